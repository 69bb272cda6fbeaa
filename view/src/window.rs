//! The window: events in, frames out. All that takes long is done on other threads; what is done
//! on this one is timed.

mod frame;
mod hands;
mod paint;
mod pane;
mod panels;
mod saves;

use crate::content::Content;
use crate::loader::{Progress, Teller};
use crate::panel::{Shows, Status};
use crate::picture::{Look, Shown};
use crate::plan::Plan;
use crate::state::State;
use crate::trace::{Took, Trace, Watch};
use crate::worker::{News, Worker, WorkerOptions};
use calibrate::Pixel;
use pane::{Opened, Pane};
use panels::Panels;
use render::path::{KeyframeFile, NerfstudioFrame};
use saves::Saves;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::ModifiersState;
use winit::window::{Window, WindowId};

/// How the window is to be.
#[derive(Debug)]
pub struct ViewOptions {
    /// What it is called.
    pub title: String,
    /// Width and height, in points.
    pub size: (u32, u32),
    /// How pictures are drawn at first.
    pub look: Look,
    /// Of the thread that draws; screenshots and the path go to its folder.
    pub worker: WorkerOptions,
    /// Keyframes to begin with.
    pub keyframes: Option<KeyframeFile>,
    /// Where paths lie that are saved for nerfstudio.
    pub nerfstudio: NerfstudioFrame,
    /// A file that gets a line of JSON for each frame.
    pub trace: Option<PathBuf>,
}

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// Nothing to open a window on.
    #[error(
        "no display to open a window on ({0}); set DISPLAY, or run this on a desktop; \
         `lumigraph render` and `lumigraph walk` draw without one"
    )]
    NoDisplay(String),
    /// Nothing that could draw in it.
    #[error(
        "no graphics driver can show anything in a window ({0}); on Debian and Ubuntu install \
         mesa-vulkan-drivers and libvulkan1, or libegl1 and libgl1-mesa-dri"
    )]
    NoDevice(String),
    /// The trace cannot be written.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Trace(PathBuf, std::io::Error),
    /// Keyframes that were in no file could not be written to one at the end.
    #[error("keyframes that were not saved are lost: {0}")]
    Keyframes(String),
}

/// What other threads tell the window.
enum Event {
    Progress(Progress),
    News(News),
    /// There is something to draw with, or there is not.
    Opened(Result<Box<Opened>, ViewError>),
    /// Panels with letters for another scale.
    Panels(Box<Panels>),
    /// Something people should know.
    Said(String),
}

/// By which other threads tell it.
type Tell = Arc<dyn Fn(Event) + Send + Sync>;

/// A frame is drawn so often at most, while things move.
const FRAME: Duration = Duration::from_millis(8);
/// How long closing waits for the picture that is just being drawn.
const PATIENCE: Duration = Duration::from_millis(150);
/// A device that is lost more often one time after the other is not opened again.
const MOST_LOSSES: u32 = 5;
/// A device that still shows frames after so long works.
const STEADY: Duration = Duration::from_secs(10);

/// Opens a window and shows in it what `load`, on a thread of its own, has to show. Returns when
/// the window is closed; threads may still be at work then. Keyframes that are in no file by then are
/// saved: what comes back says where.
///
/// # Errors
/// No display; no device that can draw in a window; a trace that cannot be written; keyframes that
/// cannot be saved at the end.
pub fn run(
    options: ViewOptions,
    load: impl FnOnce(&Teller) + Send + 'static,
) -> Result<Option<String>, ViewError> {
    let no_display = |error: winit::error::EventLoopError| {
        ViewError::NoDisplay(without_place(&error.to_string()))
    };
    let trace = match &options.trace {
        Some(path) => Some(Trace::create(path).map_err(|e| ViewError::Trace(path.clone(), e))?),
        None => None,
    };
    let event_loop = EventLoop::<Event>::with_user_event()
        .build()
        .map_err(no_display)?;
    // Proxies may be used by one thread at a time.
    let proxy = Mutex::new(event_loop.create_proxy());
    let tell: Tell = Arc::new(move |event| {
        let proxy = proxy.lock().unwrap_or_else(PoisonError::into_inner);
        // A window that is closed does not listen.
        let _ = proxy.send_event(event);
    });
    let of_loading = Arc::clone(&tell);
    let teller = Teller::new(move |progress| of_loading(Event::Progress(progress)));
    std::thread::spawn(move || load(&teller));
    let mut app = App::new(options, tell, trace);
    event_loop.run_app(&mut app).map_err(no_display)?;
    match app.error {
        Some(error) => Err(error),
        None => Ok(app.said),
    }
}

/// The first line of what winit says, without where in its code that was.
fn without_place(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let said = line
        .split_once(".rs:")
        .and_then(|(_, rest)| rest.split_once(": "));
    said.map_or(line, |(_, said)| said)
        .trim_end_matches('.')
        .to_owned()
}

struct App {
    options: ViewOptions,
    state: State,
    shows: Option<Shows>,
    status: Status,
    worker: Worker,
    tell: Tell,
    trace: Option<Trace>,
    window: Option<Arc<Window>>,
    /// What draws in it, once that is opened.
    pane: Option<Pane>,
    /// Pixels a point that are wanted.
    scale: f32,
    plan: Option<Plan>,
    shown: Option<Shown>,
    revision: u64,
    modifiers: ModifiersState,
    pointer: Option<Pixel>,
    holds_wipe: bool,
    start: Instant,
    last_frame: Instant,
    /// What all that happened since the last frame took.
    events: Took,
    frames: u64,
    losses: u32,
    /// Those since a device worked.
    losses_in_a_row: u32,
    /// When the last device was opened.
    opened: Instant,
    /// What of the path is in files.
    saves: Saves,
    /// When the panels want another frame.
    wake: Option<Instant>,
    /// What people should know when the window is closed.
    said: Option<String>,
    error: Option<ViewError>,
}

impl App {
    fn new(options: ViewOptions, tell: Tell, trace: Option<Trace>) -> Self {
        let mut state = State::new(options.look.clone());
        if let Some(file) = &options.keyframes {
            state
                .keyframes
                .load(&file.keyframes, file.interpolation, file.fps);
        }
        let saves = Saves::opened(state.keyframes.clone());
        let of_worker = Arc::clone(&tell);
        let tell_news = move |news| of_worker(Event::News(news));
        let worker = Worker::start(options.worker.clone(), tell_news);
        Self {
            options,
            state,
            shows: None,
            status: Status {
                doing: Some("opening".to_owned()),
                ..Status::default()
            },
            worker,
            tell,
            trace,
            window: None,
            pane: None,
            scale: 1.0,
            plan: None,
            shown: None,
            revision: 0,
            modifiers: ModifiersState::empty(),
            pointer: None,
            holds_wipe: false,
            start: Instant::now(),
            last_frame: Instant::now(),
            events: Took::default(),
            frames: 0,
            losses: 0,
            losses_in_a_row: 0,
            opened: Instant::now(),
            saves,
            wake: None,
            said: None,
            error: None,
        }
    }

    fn redraw(&self) {
        if let (Some(window), Some(_)) = (&self.window, &self.pane) {
            window.request_redraw();
        }
    }

    /// Begins to open what draws in the window.
    fn open(&mut self, event_loop: &ActiveEventLoop) {
        let Some(window) = self.window.clone() else {
            return;
        };
        let display = event_loop.owned_display_handle();
        let open = move || Event::Opened(Opened::of(&window, display).map(Box::new));
        if cfg!(target_os = "macos") {
            // There surfaces are made on the window's thread only.
            self.hear(event_loop, open());
        } else {
            let tell = Arc::clone(&self.tell);
            std::thread::spawn(move || tell(open()));
        }
    }

    fn opened(&mut self, opened: Opened) {
        let Some(window) = self.window.clone() else {
            return;
        };
        let pane = Pane::new(window, opened);
        let (width, height) = pane.size();
        let points = width as f32 / pane.panels.scale();
        self.shows.get_or_insert_with(|| Shows::fitting(points));
        self.pane = Some(pane);
        self.opened = Instant::now();
        if self.losses > 0 {
            self.status.said = Some("the graphics device was lost and opened anew".to_owned());
        }
        // Both may have changed meanwhile.
        self.resize(width, height);
        self.rescale(self.scale);
        self.show_picture();
    }

    /// Opens another device in place of one that was lost.
    fn reopen(&mut self, event_loop: &ActiveEventLoop) {
        self.losses += 1;
        self.losses_in_a_row += 1;
        self.pane = None;
        match self.losses_in_a_row {
            0..=MOST_LOSSES => self.open(event_loop),
            _ => {
                let text = "it was lost again and again".to_owned();
                self.fail(event_loop, ViewError::NoDevice(text));
            }
        }
    }

    /// Takes note of a frame that reached the screen.
    fn presented(&mut self, now: Instant) {
        if now.saturating_duration_since(self.opened) >= STEADY {
            self.losses_in_a_row = 0;
        }
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, mut error: ViewError) {
        if let ViewError::NoDevice(text) = &mut error
            && let Some(rescued) = self.rescue_path()
        {
            let said = rescued.unwrap_or_else(|text| ViewError::Keyframes(text).to_string());
            *text = format!("{text}; {said}");
        }
        self.error = Some(error);
        self.close(event_loop);
    }

    /// Brings the picture to the screen's textures.
    fn show_picture(&mut self) {
        if let (Some(pane), Some(shown)) = (&mut self.pane, &self.shown) {
            pane.panels.show(shown);
        }
    }

    /// Another size of the window, in pixels; none while it is minimised.
    fn resize(&mut self, width: u32, height: u32) {
        let mut size = (width, height);
        if let Some(pane) = &mut self.pane {
            pane.screen.resize(width, height);
            let most = pane.texture_side() as u32;
            size = (width.min(most), height.min(most));
        }
        self.state.resize(size.0, size.1);
    }

    /// Another scale, as of another monitor: its letters are drawn on another thread.
    fn rescale(&mut self, scale: f32) {
        self.scale = scale;
        let Some(pane) = &self.pane else {
            return;
        };
        if pane.panels.scale() != scale {
            let (size, side) = (pane.size(), pane.texture_side());
            let tell = Arc::clone(&self.tell);
            std::thread::spawn(move || {
                tell(Event::Panels(Box::new(Panels::warm(scale, size, side))));
            });
        }
    }

    fn hear(&mut self, event_loop: &ActiveEventLoop, event: Event) {
        match event {
            Event::Opened(Ok(opened)) => self.opened(*opened),
            Event::Opened(Err(error)) => self.fail(event_loop, error),
            Event::Panels(panels) => {
                // Others may be wanted by now.
                if let (Some(pane), true) = (&mut self.pane, panels.scale() == self.scale) {
                    pane.replace(*panels);
                    self.show_picture();
                }
            }
            Event::Said(text) => self.status.said = Some(text),
            Event::Progress(progress) => self.progress(progress),
            Event::News(News::Shown(shown)) => {
                self.state.shown(&shown);
                self.shown = Some(*shown);
                self.show_picture();
            }
            Event::News(News::Shot(Ok(shot))) => {
                self.status.said = Some(format!("saved {}{}", shot.file.display(), shot.note));
            }
            Event::News(News::Shot(Err(text)) | News::Trouble(text)) => {
                self.status.said = Some(text);
            }
        }
        self.redraw();
    }

    fn progress(&mut self, progress: Progress) {
        match progress {
            Progress::Doing(text) => self.status.doing = Some(text),
            Progress::Note(text) => self.status.said = Some(text),
            Progress::Done => self.status.doing = None,
            Progress::Failed(text) => {
                self.status.doing = None;
                self.status.failed = Some(text);
            }
            Progress::Show(content, space) => {
                self.revision += 1;
                self.plan = match &content {
                    Content::Interior(house) => Some(Plan::new(house)),
                    Content::Scene(_) => None,
                };
                let before = self.state.show(content.clone(), Arc::clone(&space));
                // Gigabytes of photos may go with it.
                std::thread::spawn(move || drop(before));
                self.worker.show(content, space, self.revision);
            }
        }
    }

    fn close(&mut self, event_loop: &ActiveEventLoop) {
        self.end();
        event_loop.exit();
    }

    /// All of closing but that the program goes on.
    fn end(&mut self) {
        if let Some(window) = &self.window {
            window.set_visible(false);
        }
        self.trace = None;
        self.worker.end(PATIENCE);
        match self.rescue_path() {
            Some(Ok(said)) => self.said = Some(said),
            Some(Err(text)) => self.error = self.error.take().or(Some(ViewError::Keyframes(text))),
            None => {}
        }
    }
}

impl ApplicationHandler<Event> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.window.is_some() {
            return;
        }
        let (width, height) = self.options.size;
        let attributes = Window::default_attributes()
            .with_title(self.options.title.clone())
            .with_inner_size(winit::dpi::LogicalSize::new(width, height));
        match event_loop.create_window(attributes) {
            Ok(window) => {
                self.scale = window.scale_factor() as f32;
                self.window = Some(Arc::new(window));
                self.open(event_loop);
            }
            Err(error) => self.fail(event_loop, ViewError::NoDisplay(error.to_string())),
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, event: Event) {
        let watch = Watch::start();
        self.hear(event_loop, event);
        self.events += watch.took();
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if matches!(event, WindowEvent::RedrawRequested) {
            self.draw(event_loop);
            return;
        }
        let watch = Watch::start();
        self.on_event(event_loop, event);
        self.events += watch.took();
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let next = match (self.state.is_restless(), self.wake) {
            (true, _) => self.last_frame + FRAME,
            (false, Some(wake)) => wake,
            (false, None) => return event_loop.set_control_flow(ControlFlow::Wait),
        };
        if Instant::now() >= next {
            self.wake = None;
            self.redraw();
        }
        event_loop.set_control_flow(ControlFlow::WaitUntil(next.max(Instant::now() + FRAME / 2)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::Rigid3;
    use render::DeviceChoice;
    use render::interior::WalkOptions;

    #[test]
    fn errors_say_what_to_do() {
        let text = ViewError::NoDisplay("neither is set".to_owned()).to_string();
        assert!(text.contains("DISPLAY") && text.contains("lumigraph render"));
        assert!(!text.contains('\n'));
        let text = without_place("os error at /a/b.rs:7: neither is set.");
        assert_eq!(text, "neither is set");
    }

    /// Without a window; what it saves goes to a folder.
    pub(super) fn app(output: PathBuf, keyframes: Option<KeyframeFile>) -> App {
        let options = ViewOptions {
            title: String::new(),
            size: (320, 240),
            look: Look::default(),
            worker: WorkerOptions {
                device: DeviceChoice::Cpu,
                gpu_memory: None,
                skips: render::Skips::ALL,
                walk: WalkOptions::default(),
                output,
            },
            keyframes,
            nerfstudio: NerfstudioFrame::default(),
            trace: None,
        };
        App::new(options, Arc::new(|_| {}), None)
    }

    #[test]
    fn what_comes_before_there_is_a_device_is_kept() {
        let mut app = app(PathBuf::new(), None);
        for (width, height) in [(0, 0), (1, 0), (0, 1), (u32::MAX, 1), (320, 240)] {
            app.resize(width, height);
            app.rescale(1.5);
            app.redraw();
            assert!(app.state.view().is_none() && app.state.wanted().is_none());
        }
        assert_eq!(app.scale, 1.5);
        app.progress(Progress::Failed("no such scene".to_owned()));
        assert_eq!(app.status.failed.as_deref(), Some("no such scene"));
        assert_eq!(*app.state.pose(), Rigid3::IDENTITY);
        // Devices that worked for a while are not counted with those that are lost at once.
        app.losses_in_a_row = MOST_LOSSES;
        app.presented(app.opened);
        assert_eq!(app.losses_in_a_row, MOST_LOSSES);
        app.presented(app.opened + STEADY);
        assert_eq!(app.losses_in_a_row, 0);
        assert_eq!(app.rescue_path(), None, "there is none");
        app.worker.end(Duration::from_secs(10));
    }
}
