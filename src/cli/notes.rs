//! What walks tell people as they go.

use super::output::say;
use render::interior::Painter;

/// What was said, in order and each once.
#[derive(Default)]
pub(super) struct Notes(Vec<String>);

impl Notes {
    pub(super) fn say(&mut self, note: String) {
        if !self.0.contains(&note) {
            say!("note: {note}");
            self.0.push(note);
        }
    }

    /// Keeps what was said before.
    pub(super) fn keep(&mut self, said: impl Iterator<Item = String>) {
        self.0.extend(said);
    }

    /// Says what a painter has to say and was not said before.
    pub(super) fn say_new(&mut self, painter: &Painter) {
        for note in painter.notes() {
            self.say(note.to_owned());
        }
    }

    /// All of it.
    pub(super) fn into_all(self) -> Vec<String> {
        self.0
    }
}
