//! The window: events in, frames out. All that takes long is done on other threads; what is done
//! on this one is timed.

mod hands;
mod paint;
mod pane;

use crate::content::Content;
use crate::loader::{Progress, Teller};
use crate::panel::{self, Shows, Status};
use crate::picture::{Look, Shown};
use crate::plan::Plan;
use crate::screen::Presented;
use crate::state::State;
use crate::trace::Trace;
use crate::worker::{News, Worker, WorkerOptions};
use calibrate::Pixel;
use cpu_time::ThreadTime;
use egui::TextureHandle;
use paint::paint;
use pane::{Pane, Warm, warm_context};
use render::path::KeyframeFile;
use serde_json::json;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
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
}

/// What other threads tell the window.
enum Event {
    Progress(Progress),
    News(News),
}

/// A frame is drawn so often at most, while things move.
const FRAME: Duration = Duration::from_millis(8);
/// How long closing waits for the picture that is just being drawn.
const PATIENCE: Duration = Duration::from_millis(150);
/// A device that is lost more often is not opened again.
const MOST_LOSSES: u32 = 5;
/// Opens a window and shows in it what `load`, on a thread of its own, has to show. Returns when
/// the window is closed; threads may still be at work then.
///
/// # Errors
/// No display; no device that can draw in a window; a trace that cannot be written.
pub fn run(
    options: ViewOptions,
    load: impl FnOnce(&Teller) + Send + 'static,
) -> Result<(), ViewError> {
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
    let proxy = event_loop.create_proxy();
    let teller = Teller::new(teller_of(proxy.clone(), Event::Progress));
    let tell_news = teller_of(proxy, Event::News);
    let worker = Worker::start(options.worker.clone(), tell_news);
    std::thread::spawn(move || load(&teller));
    let mut app = App::new(options, worker, trace);
    event_loop.run_app(&mut app).map_err(no_display)?;
    match app.error {
        Some(error) => Err(error),
        None => Ok(()),
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

/// Proxies may be used by one thread at a time.
fn teller_of<T: 'static>(
    proxy: EventLoopProxy<Event>,
    wrap: fn(T) -> Event,
) -> impl Fn(T) + Send + Sync + 'static {
    let proxy = Mutex::new(proxy);
    move |said| {
        let proxy = proxy.lock().unwrap_or_else(PoisonError::into_inner);
        // A window that is closed does not listen.
        let _ = proxy.send_event(wrap(said));
    }
}

struct App {
    options: ViewOptions,
    state: State,
    shows: Option<Shows>,
    status: Status,
    worker: Worker,
    trace: Option<Trace>,
    pane: Option<Pane>,
    plan: Option<Plan>,
    shown: Option<Shown>,
    revision: u64,
    modifiers: ModifiersState,
    pointer: Option<Pixel>,
    holds_wipe: bool,
    start: Instant,
    last_frame: Instant,
    /// The longest that an event took since the last frame.
    event_ms: f64,
    frames: u64,
    losses: u32,
    /// When the panels want another frame.
    wake: Option<Instant>,
    error: Option<ViewError>,
    /// Fonts being read.
    warm: Option<JoinHandle<Warm>>,
}

impl App {
    fn new(options: ViewOptions, worker: Worker, trace: Option<Trace>) -> Self {
        let mut state = State::new(options.look.clone());
        if let Some(file) = &options.keyframes {
            state
                .keyframes
                .load(&file.keyframes, file.interpolation, file.fps);
        }
        Self {
            options,
            state,
            shows: None,
            status: Status {
                doing: Some("opening".to_owned()),
                ..Status::default()
            },
            worker,
            trace,
            pane: None,
            plan: None,
            shown: None,
            revision: 0,
            modifiers: ModifiersState::empty(),
            pointer: None,
            holds_wipe: false,
            start: Instant::now(),
            last_frame: Instant::now(),
            event_ms: 0.0,
            frames: 0,
            losses: 0,
            wake: None,
            error: None,
            warm: Some(std::thread::spawn(warm_context)),
        }
    }

    fn redraw(&self) {
        if let Some(pane) = &self.pane {
            pane.window.request_redraw();
        }
    }

    fn open_pane(
        &mut self,
        event_loop: &ActiveEventLoop,
        window: Arc<Window>,
    ) -> Result<(), ViewError> {
        let pane = Pane::open(event_loop, window, self.warm.take())?;
        let (width, height) = pane.size();
        self.state.resize(width, height);
        let points = width as f32 / pane.window.scale_factor() as f32;
        self.shows.get_or_insert_with(|| Shows::fitting(points));
        self.pane = Some(pane);
        self.show_picture();
        self.redraw();
        Ok(())
    }

    /// Brings the picture to the screen's textures.
    fn show_picture(&mut self) {
        if let (Some(pane), Some(shown)) = (&mut self.pane, &self.shown) {
            pane.show(shown);
        }
    }

    fn hear(&mut self, event: Event) {
        match event {
            Event::Progress(Progress::Doing(text)) => self.status.doing = Some(text),
            Event::Progress(Progress::Note(text)) => self.status.said = Some(text),
            Event::Progress(Progress::Done) => self.status.doing = None,
            Event::Progress(Progress::Failed(text)) => {
                self.status.doing = None;
                self.status.failed = Some(text);
            }
            Event::Progress(Progress::Show(content, space)) => {
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
            Event::News(News::Shown(shown)) => {
                self.state.shown(&shown);
                self.shown = Some(*shown);
                self.show_picture();
            }
            Event::News(News::Shot(Ok(path))) => {
                self.status.said = Some(format!("saved {}", path.display()));
            }
            Event::News(News::Shot(Err(text)) | News::Trouble(text)) => {
                self.status.said = Some(text);
            }
        }
        self.redraw();
    }

    /// One frame.
    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        // 1. Time passes.
        let (now, cpu) = (Instant::now(), ThreadTime::now());
        let seconds = (now - self.last_frame).as_secs_f64();
        self.last_frame = now;
        self.state.step(seconds);
        if let Some(request) = self.state.wanted() {
            self.worker.ask(request);
        }
        let step_ms = ms_since(now);
        // 2. What is to be painted.
        let start = Instant::now();
        let (Some(pane), Some(shows)) = (&mut self.pane, &mut self.shows) else {
            return;
        };
        let input = pane.input.take_egui_input(&pane.window);
        let mut commands = Vec::new();
        let textures = [&pane.picture, &pane.photo].map(|t| t.as_ref().map(TextureHandle::id));
        let (state, status, shown) = (&mut self.state, &self.status, self.shown.as_ref());
        let plan = self.plan.as_ref();
        let mut output = pane.context.run_pass(input, |context| {
            paint(context, state, shows, shown, plan, textures);
            panel::texts(context, state, shows, status, shown);
            if shows.panel {
                commands.extend(panel::panel(context, state, shows, shown));
            }
            panel::help(context, shows);
        });
        pane.input
            .handle_platform_output(&pane.window, output.platform_output);
        let delay = output
            .viewport_output
            .get(&egui::ViewportId::ROOT)
            .map(|v| v.repaint_delay);
        // Far away is never.
        let delay = delay.filter(|delay| *delay < Duration::from_secs(60));
        self.wake = delay.map(|delay| now + delay.max(FRAME));
        let ui_ms = ms_since(start);
        let start = Instant::now();
        let pixels_per_point = output.pixels_per_point;
        let primitives = pane.context.tessellate(output.shapes, pixels_per_point);
        let tessellate_ms = ms_since(start);
        // Without what other threads had of this core meanwhile.
        let cpu_ms = 1e3 * cpu.elapsed().as_secs_f64();
        // 3. It is painted.
        let start = Instant::now();
        let mut textures = std::mem::take(&mut pane.textures);
        textures.append(std::mem::take(&mut output.textures_delta));
        pane.screen.upload(&textures);
        let upload_ms = ms_since(start);
        let start = Instant::now();
        let presented = pane.screen.present(&primitives, pixels_per_point);
        pane.screen.free(&textures);
        textures.clear();
        let draw_ms = ms_since(start);
        self.frames += 1;
        let steps = [
            ("events", self.event_ms),
            ("step", step_ms),
            ("panels", ui_ms),
            ("tessellate", tessellate_ms),
        ];
        self.event_ms = 0.0;
        self.status.step_ms = steps.iter().map(|s| s.1).fold(0.0, f64::max);
        self.status.draw_ms = upload_ms + draw_ms;
        if presented == Presented::Yes {
            self.trace_frame(&steps, cpu_ms, [upload_ms, draw_ms]);
        }
        let start = Instant::now();
        for command in commands {
            self.do_command(command);
            self.redraw();
        }
        self.event_ms = ms_since(start);
        match presented {
            Presented::Yes | Presented::NotNow => {}
            Presented::Again => self.redraw(),
            Presented::Lost => self.reopen(event_loop),
        }
    }

    /// Opens another device in place of one that was lost.
    fn reopen(&mut self, event_loop: &ActiveEventLoop) {
        self.losses += 1;
        let Some(pane) = self.pane.take() else {
            return;
        };
        let window = Arc::clone(&pane.window);
        drop(pane);
        let opened = match self.losses {
            0..=MOST_LOSSES => self.open_pane(event_loop, window),
            _ => Err(ViewError::NoDevice(
                "it was lost again and again".to_owned(),
            )),
        };
        match opened {
            Ok(()) => {
                self.status.said = Some("the graphics device was lost and opened anew".to_owned());
            }
            Err(error) => {
                self.error = Some(error);
                self.close(event_loop);
            }
        }
    }

    fn trace_frame(&self, steps: &[(&str, f64)], cpu_ms: f64, [upload_ms, draw_ms]: [f64; 2]) {
        let Some(trace) = &self.trace else {
            return;
        };
        let state = &self.state;
        let pose = state.pose();
        let forward = pose.rotation.conjugate() * glam::DVec3::Z;
        let size = self.pane.as_ref().map(|p| p.window.inner_size());
        let steps: serde_json::Map<_, _> = steps
            .iter()
            .map(|(name, ms)| ((*name).to_owned(), json!(ms)))
            .collect();
        let picture = self.shown.as_ref().map(|s| {
            json!({
                "id": s.id,
                "revision": s.revision,
                "reduction": s.reduction,
                "ms": s.time_ms(),
                "center": s.view.center().to_array(),
                "layer": state.look.layer.name(),
                "is_settled": state.is_settled(s),
                "photo": s.photo.as_ref().map(|p| p.0),
            })
        });
        let cell = match (state.content(), state.cell()) {
            (Some(Content::Interior(house)), Some(id)) => Some(&house.interior.cell(id).name),
            _ => None,
        };
        trace.add(json!({
            "frame": self.frames,
            "t_ms": ms_since(self.start),
            "center": pose.center().to_array(),
            "forward": forward.to_array(),
            "mode": state.mode.name(),
            "cell": cell,
            "stop": state.stop(),
            "support": state.support,
            "size": size.map(|s| [s.width, s.height]),
            "picture": picture,
            "wipe": state.wipe,
            "keyframes": state.keyframes.len(),
            "is_playing": state.is_playing(),
            "doing": self.status.doing,
            "said": self.status.said,
            "losses": self.losses,
            "steps_ms": steps,
            "cpu_ms": cpu_ms,
            "upload_ms": upload_ms,
            "draw_ms": draw_ms,
        }));
    }

    fn close(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(pane) = &self.pane {
            pane.window.set_visible(false);
        }
        self.trace = None;
        self.worker.end(PATIENCE);
        event_loop.exit();
    }
}

fn ms_since(start: Instant) -> f64 {
    1e3 * start.elapsed().as_secs_f64()
}

impl ApplicationHandler<Event> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.pane.is_some() {
            return;
        }
        let (width, height) = self.options.size;
        let attributes = Window::default_attributes()
            .with_title(self.options.title.clone())
            .with_inner_size(winit::dpi::LogicalSize::new(width, height));
        let opened = match event_loop.create_window(attributes) {
            Ok(window) => self.open_pane(event_loop, Arc::new(window)),
            Err(error) => Err(ViewError::NoDisplay(error.to_string())),
        };
        if let Err(error) = opened {
            self.error = Some(error);
            self.close(event_loop);
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, event: Event) {
        let start = Instant::now();
        self.hear(event);
        self.event_ms = self.event_ms.max(ms_since(start));
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if matches!(event, WindowEvent::RedrawRequested) {
            self.draw(event_loop);
            return;
        }
        let start = Instant::now();
        self.on_event(event_loop, event);
        self.event_ms = self.event_ms.max(ms_since(start));
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

    #[test]
    fn errors_say_what_to_do() {
        let text = ViewError::NoDisplay("neither is set".to_owned()).to_string();
        assert!(text.contains("DISPLAY") && text.contains("lumigraph render"));
        assert!(!text.contains('\n'));
        let text = without_place("os error at /a/b.rs:7: neither is set.");
        assert_eq!(text, "neither is set");
    }
}
