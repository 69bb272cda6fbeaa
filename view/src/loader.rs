//! Loading goes on behind the window, and tells it how far it is.

use crate::content::{Content, Space, Times};
use render::Moment;
use std::sync::Arc;

/// What loading has to say.
#[derive(Clone, Debug)]
pub enum Progress {
    /// What is being done.
    Doing(String),
    /// Something to show, in place of what was there before.
    Show(Content, Arc<Space>),
    /// Something people should know.
    Note(String),
    /// All is there.
    Done,
    /// There will be nothing (more), and why.
    Failed(String),
}

/// By which loading speaks to the window.
#[derive(Clone)]
pub struct Teller {
    tell: Arc<dyn Fn(Progress) + Send + Sync>,
}

impl Teller {
    /// Speaks by a function.
    pub fn new(tell: impl Fn(Progress) + Send + Sync + 'static) -> Self {
        Self {
            tell: Arc::new(tell),
        }
    }

    /// Says what is being done.
    pub fn doing(&self, text: impl Into<String>) {
        self.say(Progress::Doing(text.into()));
    }

    /// Shows something, in place of what was there before. What moving about in it needs to know is
    /// found here, not on the window's thread.
    pub fn show(&self, content: Content) {
        self.show_at(content, None, "");
    }

    /// As [`Self::show`], a scene that moves at a moment; `meanwhile` are the options that stand for what is still to be
    /// chosen, as `--proxy points`, or nothing.
    pub fn show_at(&self, content: Content, moment: Option<Moment>, meanwhile: &str) {
        let mut space = Space::of(&content);
        if let (Content::Scene(lumigraph), Some(moment)) = (&content, moment) {
            space.times = Times::of(lumigraph, moment);
        }
        meanwhile.clone_into(&mut space.meanwhile);
        self.say(Progress::Show(content, Arc::new(space)));
    }

    /// Says something else.
    pub fn say(&self, progress: Progress) {
        (self.tell)(progress);
    }
}
