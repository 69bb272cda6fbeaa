//! The thread that draws. It takes the newest request; older ones that it did not come to are
//! dropped.

use crate::content::{Content, House, Space};
use crate::draw_house::draw_house;
use crate::draw_scene::{Drawn, FINISH, SceneDrawer};
use crate::picture::{Request, Shown};
use crate::shot::{self, Shot, Subject};
use image::RgbaImage;
use render::interior::{CAPTURED_REFERENCE_SIZE, Painter, Walk, WalkOptions};
use render::{DeviceChoice, Engine, Lumigraph};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What the thread that draws has to say.
#[derive(Debug)]
pub enum News {
    /// A picture.
    Shown(Box<Shown>),
    /// A screenshot was written, or why not.
    Shot(Result<Shot, String>),
    /// What went wrong, for people.
    Trouble(String),
}

/// How it draws.
#[derive(Clone, Debug)]
pub struct WorkerOptions {
    /// What draws.
    pub device: DeviceChoice,
    /// For photos on the device, in bytes; none for no limit.
    pub gpu_memory: Option<u64>,
    /// Asks every photo about every ray: the same pictures, later.
    pub skips: render::Skips,
    /// Of walks.
    pub walk: WalkOptions,
    /// The folder for screenshots.
    pub output: PathBuf,
}

/// A coarser picture will do while one moves, if a frame would take longer, in ms.
const SLOW_MS: f64 = 50.0;
/// A finer one is tried again where a frame took less.
const FAST_MS: f64 = 18.0;
/// So long a screenshot that was asked for is waited for at the end.
const SHOT_PATIENCE: Duration = Duration::from_secs(60);
/// Times that a picture is drawn smaller at most, each way.
const MOST_REDUCED: u32 = 4;

/// A content, what is known of the space in it, and its number.
type Given = (Content, Arc<Space>, u64);

#[derive(Default)]
struct Inbox {
    content: Option<Given>,
    request: Option<Request>,
    shots: usize,
    /// Whether one of the screenshots that were asked for is being made.
    is_shooting: bool,
    is_over: bool,
}

struct Shared {
    inbox: Mutex<Inbox>,
    is_there_more: Condvar,
}

impl Shared {
    fn inbox(&self) -> MutexGuard<'_, Inbox> {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A handle to the thread that draws.
pub struct Worker {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread; `tell` is called from it.
    pub fn start(options: WorkerOptions, tell: impl Fn(News) + Send + 'static) -> Self {
        let shared = Arc::new(Shared {
            inbox: Mutex::default(),
            is_there_more: Condvar::new(),
        });
        let of_thread = Arc::clone(&shared);
        let thread = std::thread::spawn(move || run(&of_thread, &options, &tell));
        Self {
            shared,
            thread: Some(thread),
        }
    }

    /// What is to be drawn from now on; `revision` comes back with each picture.
    pub fn show(&self, content: Content, space: Arc<Space>, revision: u64) {
        self.tell(|inbox| inbox.content = Some((content, space, revision)));
    }

    /// Asks for a picture, in place of the one asked for before if that was not begun.
    pub fn ask(&self, request: Request) {
        self.tell(|inbox| inbox.request = Some(request));
    }

    /// Asks for a screenshot of the last request.
    pub fn shoot(&self) {
        self.tell(|inbox| inbox.shots += 1);
    }

    fn tell(&self, change: impl FnOnce(&mut Inbox)) {
        change(&mut self.shared.inbox());
        self.shared.is_there_more.notify_all();
    }

    /// Asks the thread to end, and waits for it, but not for long: one frame may take seconds.
    /// Screenshots that were asked for are waited for longer.
    pub fn end(&mut self, patience: Duration) {
        self.tell(|inbox| inbox.is_over = true);
        let Some(thread) = self.thread.take() else {
            return;
        };
        let start = Instant::now();
        let patience = || {
            let inbox = self.shared.inbox();
            match inbox.shots > 0 || inbox.is_shooting {
                true => patience.max(SHOT_PATIENCE),
                false => patience,
            }
        };
        while !thread.is_finished() && start.elapsed() < patience() {
            std::thread::sleep(Duration::from_millis(2));
        }
        if thread.is_finished() {
            // A panic there was said on stderr.
            let _ = thread.join();
        }
    }
}

/// What there is to do next.
enum Job {
    Show(Given),
    Draw(Box<Request>),
    Shoot,
    End,
}

fn next_job(shared: &Shared) -> Job {
    let mut inbox = shared.inbox();
    inbox.is_shooting = false;
    loop {
        // What was asked for before the end is still made, and what it takes.
        if inbox.is_over && inbox.shots == 0 {
            return Job::End;
        }
        if let Some(given) = inbox.content.take() {
            return Job::Show(given);
        }
        if let Some(request) = inbox.request.take() {
            return Job::Draw(Box::new(request));
        }
        if inbox.shots > 0 {
            inbox.shots -= 1;
            inbox.is_shooting = true;
            return Job::Shoot;
        }
        inbox = shared
            .is_there_more
            .wait(inbox)
            .unwrap_or_else(PoisonError::into_inner);
    }
}

fn run(shared: &Shared, options: &WorkerOptions, tell: &dyn Fn(News)) {
    let mut engine: Option<Engine> = None;
    let mut last: Option<Request> = None;
    let mut showing: Option<Given> = None;
    loop {
        let next = match showing.take() {
            None => match next_job(shared) {
                Job::End => return,
                Job::Show(given) => Some(given),
                Job::Draw(request) => {
                    last = Some(*request);
                    None
                }
                Job::Shoot => None,
            },
            Some((Content::Scene(lumigraph), space, revision)) => {
                let engine = engine.get_or_insert_with(|| open(options, tell));
                let mut desk = Desk::new(shared, options, tell, revision, &mut last);
                desk.serve_scene(&lumigraph, &space, engine)
            }
            Some((Content::Interior(house), _, revision)) => {
                let mut desk = Desk::new(shared, options, tell, revision, &mut last);
                desk.serve_house(&house)
            }
        };
        if next.is_none() && shared.inbox().is_over {
            return;
        }
        showing = next;
    }
}

fn open(options: &WorkerOptions, tell: &dyn Fn(News)) -> Engine {
    let mut engine = Engine::open(options.device).unwrap_or_else(|error| {
        tell(News::Trouble(format!("{error}; the CPU draws")));
        Engine::open(DeviceChoice::Cpu).expect("the CPU always answers")
    });
    if let Some(gpu) = engine.gpu_mut() {
        gpu.set_budget(options.gpu_memory);
    }
    engine
}

/// Draws one content until there is another.
struct Desk<'s> {
    shared: &'s Shared,
    options: &'s WorkerOptions,
    tell: &'s dyn Fn(News),
    revision: u64,
    subject: Subject,
    /// What was asked for last, by whichever content it was drawn.
    last: &'s mut Option<Request>,
    reduction: u32,
}

impl<'s> Desk<'s> {
    fn new(
        shared: &'s Shared,
        options: &'s WorkerOptions,
        tell: &'s dyn Fn(News),
        revision: u64,
        last: &'s mut Option<Request>,
    ) -> Self {
        Self {
            shared,
            options,
            tell,
            revision,
            subject: Subject::Scene {
                meanwhile: String::new(),
            },
            last,
            reduction: 1,
        }
    }

    fn serve_scene(
        &mut self,
        lumigraph: &Lumigraph,
        space: &Space,
        engine: &mut Engine,
    ) -> Option<Given> {
        self.subject = Subject::Scene {
            meanwhile: space.meanwhile.clone(),
        };
        let mut drawer = SceneDrawer::new(lumigraph, space, self.options.skips);
        let mut notes = engine.notes().len();
        let mut gone = 0;
        // Of what comes later there is a picture on the screen already.
        let mut is_first = self.revision <= 1;
        self.serve(|tell, request, reduction| {
            if let (true, Some(preview)) = (is_first, drawer.preview(request)) {
                tell(News::Shown(Box::new(preview)));
            }
            is_first = false;
            let drawn = drawer.draw(engine, request, reduction);
            for note in engine.notes().iter().skip(notes) {
                tell(News::Trouble((*note).to_owned()));
            }
            notes = engine.notes().len();
            for idx in &drawer.gone()[gone..] {
                let name = &lumigraph.sources[*idx].name;
                tell(News::Trouble(format!(
                    "{name} cannot be decoded and is left out"
                )));
            }
            gone = drawer.gone().len();
            drawn.map_err(|error| error.to_string())
        })
    }

    fn serve_house(&mut self, house: &House) -> Option<Given> {
        let mut options = self.options.walk;
        let painter = match house.take_photos() {
            Some(photos) => {
                options.library.size = CAPTURED_REFERENCE_SIZE;
                photos
            }
            None => Painter::open(self.options.device, &house.model),
        };
        let ldi_views = options.library.with_photos(painter.captured()).ldi_views;
        self.subject = Subject::Interior { ldi_views };
        let (interior, contents, model) = (&house.interior, &house.contents, &house.model);
        std::thread::scope(|scope| {
            let mut walk = Walk::with(painter, interior, contents, model, options);
            if let Err(error) = walk.make_ahead(scope) {
                (self.tell)(News::Trouble(format!("{error}; nothing is made ahead")));
            }
            if let Some(folder) = house.ldis() {
                walk.use_ldi_files(folder);
            }
            let mut said = BTreeSet::new();
            self.serve(|tell, request, reduction| {
                let drawn = draw_house(house, &mut walk, request, reduction);
                say_new(&walk.painter().notes(), &mut said, tell);
                drawn.map_err(|error| error.to_string())
            })
        })
    }

    /// Draws until there is another content, which is returned, or an end.
    fn serve(
        &mut self,
        mut draw: impl FnMut(&dyn Fn(News), &Request, u32) -> Result<Drawn, String>,
    ) -> Option<Given> {
        // What was asked for of the content before is wanted of this one, too.
        let mut again = self.last.take();
        // As files have it, at full size.
        let mut kept: Option<(Request, RgbaImage)> = None;
        loop {
            let job = match again.take() {
                Some(request) => Job::Draw(Box::new(request)),
                None => next_job(self.shared),
            };
            match job {
                Job::End => return None,
                Job::Show(given) => return Some(given),
                Job::Draw(request) => {
                    *self.last = Some((*request).clone());
                    let start = Instant::now();
                    let reduction = if request.is_moving { self.reduction } else { 1 };
                    match draw(self.tell, &request, reduction) {
                        Ok((picture, mut shown)) => {
                            shown.revision = self.revision;
                            let finish = shown.stages.iter().find(|(stage, _)| *stage == FINISH);
                            let finish_ms = finish.map_or(0.0, |(_, ms)| *ms);
                            (self.tell)(News::Shown(Box::new(shown)));
                            self.adapt(&request, 1e3 * start.elapsed().as_secs_f64() - finish_ms);
                            if reduction == 1 && !request.is_moving {
                                kept = Some((*request, picture));
                            }
                        }
                        Err(error) => (self.tell)(News::Trouble(error)),
                    }
                }
                Job::Shoot => {
                    let Some(mut request) = self.last.clone() else {
                        continue;
                    };
                    request.is_moving = false;
                    if !kept.as_ref().is_some_and(|(of, _)| is_alike(of, &request)) {
                        match draw(self.tell, &request, 1) {
                            Ok((picture, _)) => kept = Some((request.clone(), picture)),
                            Err(error) => {
                                (self.tell)(News::Trouble(error));
                                continue;
                            }
                        }
                    }
                    if let Some((_, picture)) = &kept {
                        let folder = &self.options.output;
                        let written = shot::write(folder, &request, picture, &self.subject);
                        (self.tell)(News::Shot(written));
                    }
                }
            }
        }
    }

    /// How large the next picture will be that is drawn while one moves, where one took so long to draw, without what
    /// is only drawn where nothing moves.
    fn adapt(&mut self, request: &Request, ms: f64) {
        let drawn = if request.is_moving { self.reduction } else { 1 };
        if ms > SLOW_MS {
            // As if time went by pixels.
            let needed = f64::from(drawn) * (ms / SLOW_MS).sqrt();
            self.reduction = self.reduction.max(needed.ceil() as u32).min(MOST_REDUCED);
        } else if ms < FAST_MS && request.is_moving {
            self.reduction = (self.reduction - 1).max(1);
        }
    }
}

/// Says those notes that were not said yet, wherever among the others they stand: those of photos that are
/// left out stand before the engine's.
fn say_new(notes: &[&str], said: &mut BTreeSet<String>, tell: &dyn Fn(News)) {
    for note in notes {
        if said.insert((*note).to_owned()) {
            tell(News::Trouble((*note).to_owned()));
        }
    }
}

/// Whether two requests are for the same picture as files have it.
fn is_alike(a: &Request, b: &Request) -> bool {
    a.view == b.view
        && a.look.layer == b.look.layer
        && a.look.options == b.look.options
        && a.look.method == b.look.method
        && a.look.portals == b.look.portals
        && a.look.moment == b.look.moment
}

#[cfg(test)]
mod tests;
