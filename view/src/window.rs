//! The window: events in, frames out. All that takes long is done on other threads; what is done
//! on this one is timed.

use crate::content::Content;
use crate::keys::{self, Key};
use crate::loader::{Progress, Teller};
use crate::overlay::{Overlay, clicked};
use crate::panel::{self, Command, Shows, Status};
use crate::picture::{Look, Shown};
use crate::plan::{self, Plan};
use crate::screen::{Presented, Screen};
use crate::state::{Action, Button, State};
use crate::trace::Trace;
use crate::worker::{News, Worker, WorkerOptions};
use calibrate::Pixel;
use egui::{Color32, Rect, TextureHandle, TextureOptions, TexturesDelta, pos2};
use render::path::{KeyframeFile, write_keyframes};
use serde_json::json;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{ModifiersState, PhysicalKey};
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
/// The longest side of egui's textures, in texels. With another, fonts would be read again.
const TEXTURE_SIDE: usize = 8192;
/// A device that is lost more often is not opened again.
const MOST_LOSSES: u32 = 5;
/// So near, in pixels, the wipe is taken hold of.
const WIPE_PX: f64 = 8.0;

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

/// A window with what draws in it.
struct Pane {
    window: Arc<Window>,
    screen: Screen,
    context: egui::Context,
    input: egui_winit::State,
    picture: Option<TextureHandle>,
    photo: Option<TextureHandle>,
    /// What is to be brought to the device before the next frame's.
    textures: TexturesDelta,
}

impl Drop for Pane {
    fn drop(&mut self) {
        (self.picture, self.photo) = (None, None);
        // egui insists that nothing is left to be done.
        self.context.tex_manager().write().take_delta().clear();
        self.textures.clear();
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
    /// egui wants another frame soon.
    wants_frame: bool,
    error: Option<ViewError>,
    /// Fonts being read.
    warm: Option<JoinHandle<(egui::Context, TexturesDelta)>>,
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
            wants_frame: false,
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
        let screen = Screen::open(&window, event_loop.owned_display_handle());
        let screen = screen.map_err(ViewError::NoDevice)?;
        let (context, textures) = match self.warm.take().map(JoinHandle::join) {
            Some(Ok(warm)) => warm,
            _ => warm_context(),
        };
        let input = egui_winit::State::new(
            context.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(screen.max_texture_side().min(TEXTURE_SIDE)),
        );
        let size = window.inner_size();
        resize(&mut self.state, &screen, size);
        let points = size.width as f32 / window.scale_factor() as f32;
        self.shows.get_or_insert_with(|| Shows::fitting(points));
        self.pane = Some(Pane {
            window,
            screen,
            context,
            input,
            picture: None,
            photo: None,
            textures,
        });
        self.show_picture();
        self.redraw();
        Ok(())
    }

    /// Brings the picture to the screen's textures.
    fn show_picture(&mut self) {
        let (Some(pane), Some(shown)) = (&mut self.pane, &self.shown) else {
            return;
        };
        let options = TextureOptions::LINEAR;
        let set = |handle: &mut Option<TextureHandle>,
                   name: &str,
                   image: &Arc<egui::ColorImage>| {
            match handle {
                Some(handle) => handle.set(Arc::clone(image), options),
                None => *handle = Some(pane.context.load_texture(name, Arc::clone(image), options)),
            }
        };
        set(&mut pane.picture, "picture", &shown.image);
        match &shown.photo {
            Some((_, photo)) => set(&mut pane.photo, "photo", photo),
            None => pane.photo = None,
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

    fn do_key(&mut self, key: Key, is_down: bool, is_repeated: bool) {
        if let Key::Hold(motion) = key {
            self.state.hold(motion, is_down);
            return;
        }
        if !is_down || is_repeated {
            return;
        }
        let Some(shows) = &mut self.shows else {
            return;
        };
        let look = &mut self.state.look;
        let flip = |value: &mut bool| *value = !*value;
        match key {
            Key::Hold(_) => {}
            Key::Act(action) => self.state.act(action),
            Key::Layer(layer) => {
                look.layer = if look.layer == layer {
                    Default::default()
                } else {
                    layer
                };
            }
            Key::Triangulation => flip(&mut look.triangulation),
            Key::Wireframe => flip(&mut look.wireframe),
            Key::Exact => {
                look.method = match look.method {
                    render::Method::Exact => render::Method::TRIANGULATED,
                    render::Method::Triangulated { .. } => render::Method::Exact,
                }
            }
            Key::Weights => flip(&mut self.state.tells_weights),
            Key::Wipe => {
                self.state.wipe = match self.state.wipe {
                    Some(_) => None,
                    None => Some(0.5),
                }
            }
            Key::Epipoles => flip(&mut shows.epipoles),
            Key::Frusta => flip(&mut shows.frusta),
            Key::Plan => flip(&mut shows.plan),
            Key::Panel => flip(&mut shows.panel),
            Key::Hud => flip(&mut shows.hud),
            Key::Help => flip(&mut shows.help),
            Key::Shoot => self.do_command(Command::Shoot),
            Key::SavePath => self.do_command(Command::SavePath),
            Key::LoseDevice => {
                if let (Some(pane), true) = (&self.pane, self.trace.is_some()) {
                    pane.screen.lose();
                }
            }
            Key::Close => {}
        }
    }

    fn do_command(&mut self, command: Command) {
        match command {
            Command::Act(action) => self.state.act(action),
            Command::Shoot => {
                // Of where one is now.
                if let Some(request) = self.state.wanted() {
                    self.worker.ask(request);
                }
                self.worker.shoot();
            }
            Command::SavePath => self.status.said = Some(self.save_path()),
        }
    }

    fn save_path(&self) -> String {
        let Some(view) = self.state.view() else {
            return "there is no view to save a path for".to_owned();
        };
        let keyframes = &self.state.keyframes;
        let folder = &self.options.worker.output;
        let path = folder.join("path.json");
        let file = KeyframeFile {
            fps: keyframes.fps,
            keyframes: keyframes.stored(&view),
            interpolation: keyframes.interpolation,
        };
        let written = std::fs::create_dir_all(folder)
            .map_err(|error| format!("{}: {error}", folder.display()))
            .and_then(|()| write_keyframes(&path, &file).map_err(|error| error.to_string()));
        match written {
            Ok(()) => format!("saved {}", path.display()),
            Err(error) => error,
        }
    }

    fn on_pointer(&mut self, at: Option<Pixel>) {
        self.pointer = at;
        let width = self
            .pane
            .as_ref()
            .map_or(1, |p| p.window.inner_size().width.max(1));
        match at {
            Some(at) if self.holds_wipe => {
                self.state.wipe = Some((at.x / f64::from(width)).clamp(0.0, 1.0));
            }
            _ => self.state.point(at),
        }
    }

    fn on_button(&mut self, button: MouseButton, is_down: bool) {
        let Some(at) = self.pointer else {
            return;
        };
        let width = self
            .pane
            .as_ref()
            .map_or(0, |p| p.window.inner_size().width);
        let button = match button {
            MouseButton::Left => Button::Left,
            _ => Button::Other,
        };
        if !is_down {
            self.holds_wipe = false;
            let click = self
                .state
                .release(button)
                .filter(|_| button == Button::Left);
            let has_frusta = self.shows.as_ref().is_some_and(|s| s.frusta);
            let view = self.shown.as_ref().map(|s| &s.view);
            if let (Some(at), true, Some(view), Some(space)) =
                (click, has_frusta, view, self.state.space())
                && let Some(stop) = clicked(space, view, at).filter(|_| !space.is_interior)
            {
                self.state.act(Action::Go(stop));
            }
            return;
        }
        let wipe = self.state.wipe.map(|share| share * f64::from(width));
        if wipe.is_some_and(|x| (x - at.x).abs() < WIPE_PX) && button == Button::Left {
            self.holds_wipe = true;
        } else {
            self.state.press(button, at, self.modifiers.shift_key());
        }
    }

    /// One frame.
    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        // 1. Time passes.
        let now = Instant::now();
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
        self.wants_frame = delay.is_some_and(|delay| delay < Duration::from_millis(50));
        let ui_ms = ms_since(start);
        let start = Instant::now();
        let pixels_per_point = output.pixels_per_point;
        let primitives = pane.context.tessellate(output.shapes, pixels_per_point);
        let tessellate_ms = ms_since(start);
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
            self.trace_frame(&steps, upload_ms, draw_ms);
        }
        let start = Instant::now();
        for command in commands {
            self.do_command(command);
            self.redraw();
        }
        self.event_ms = ms_since(start);
        if presented == Presented::Lost {
            self.reopen(event_loop);
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

    fn trace_frame(&self, steps: &[(&str, f64)], upload_ms: f64, draw_ms: f64) {
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
            "upload_ms": upload_ms,
            "draw_ms": draw_ms,
        }));
    }

    fn close(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(pane) = &self.pane {
            pane.window.set_visible(false);
        }
        self.worker.end(PATIENCE);
        event_loop.exit();
    }
}

/// Pictures are as large as the window, or as a texture may be.
fn resize(state: &mut State, screen: &Screen, size: winit::dpi::PhysicalSize<u32>) {
    let most = screen.max_texture_side().min(TEXTURE_SIDE) as u32;
    state.resize(size.width.min(most), size.height.min(most));
}

/// Panels that have their fonts: reading them takes longer than a frame may.
fn warm_context() -> (egui::Context, TexturesDelta) {
    let context = egui::Context::default();
    context.set_theme(egui::Theme::Dark);
    let all: String = (' '..='~').collect();
    let input = egui::RawInput {
        max_texture_side: Some(TEXTURE_SIDE),
        ..egui::RawInput::default()
    };
    let mut output = context.run_pass(input, |context| {
        egui::Area::new(egui::Id::unique("all")).show(context, |ui| {
            ui.heading(&all);
            ui.label(&all);
            ui.label(egui::RichText::new(&all).size(12.0));
        });
    });
    (context, std::mem::take(&mut output.textures_delta))
}

fn ms_since(start: Instant) -> f64 {
    1e3 * start.elapsed().as_secs_f64()
}

/// The picture, the photo beside it, and the lines over both.
fn paint(
    context: &egui::Context,
    state: &State,
    shows: &Shows,
    shown: Option<&Shown>,
    plan: Option<&Plan>,
    [picture, photo]: [Option<egui::TextureId>; 2],
) {
    let painter = context.layer_painter(egui::LayerId::background());
    let rect = context.viewport_rect();
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    let Some((shown, picture)) = shown.zip(picture) else {
        return;
    };
    painter.image(picture, rect, whole, Color32::WHITE);
    let photo = state.wipe.zip(photo);
    if let Some((share, photo)) = photo {
        let mut right = rect;
        right.set_left(rect.left() + share as f32 * rect.width());
        painter
            .with_clip_rect(right)
            .image(photo, rect, whole, Color32::WHITE);
    }
    let painter = painter.with_clip_rect(rect);
    // What photos do not support is dimmed, gently.
    if state.support < 1.0 {
        let share = (1.0 - state.support) * 70.0;
        painter.rect_filled(rect, 0.0, Color32::from_black_alpha(share as u8));
    }
    // A picture of another size is stretched until there is one of this.
    let overlay = Overlay {
        painter: &painter,
        pixels_per_point: shown.view.width as f32 / rect.width().max(1.0),
        view: &shown.view,
    };
    overlay.lines(&shown.lines, shows.epipoles);
    if let Some(space) = state.space() {
        if shows.frusta && !space.is_interior {
            overlay.frusta(space, state.nearest());
        }
        if !state.is_playing() {
            let keyframes = &state.keyframes;
            overlay.keyframes(keyframes.poses(), keyframes.chosen(), 0.05 * space.depth);
        }
        if let (Some((share, _)), Some((source, _))) = (photo, &shown.photo) {
            let name = space.stops.get(*source).map_or("", |s| s.name.as_str());
            overlay.wipe(share, name);
        }
    }
    if let (Some(Content::Interior(house)), Some(plan)) = (state.content(), plan) {
        if shows.frusta {
            overlay.portals(&house.interior, 0.05);
        }
        if shows.plan {
            plan.paint(&painter, plan::place(rect), state.pose(), state.cell());
        }
    }
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
        if !self.state.is_restless() && !self.wants_frame {
            event_loop.set_control_flow(ControlFlow::Wait);
            return;
        }
        let next = self.last_frame + FRAME;
        if Instant::now() >= next {
            self.redraw();
        }
        event_loop.set_control_flow(ControlFlow::WaitUntil(next.max(Instant::now() + FRAME / 2)));
    }
}

impl App {
    fn on_event(&mut self, event_loop: &ActiveEventLoop, event: WindowEvent) {
        let Some(pane) = &mut self.pane else {
            return;
        };
        let key = match &event {
            // With the focus come keys that were pressed elsewhere.
            WindowEvent::KeyboardInput {
                event,
                is_synthetic: true,
                ..
            } if event.state == ElementState::Pressed => None,
            WindowEvent::KeyboardInput { event, .. } => match event.physical_key {
                // What was pressed must be released, whatever else is held by then.
                PhysicalKey::Code(code) if event.state == ElementState::Released => {
                    keys::of(code, ModifiersState::empty())
                }
                PhysicalKey::Code(code) => keys::of(code, self.modifiers),
                PhysicalKey::Unidentified(_) => None,
            },
            _ => None,
        };
        // egui would move its focus by it.
        let is_ours = key == Some(Key::Panel);
        let consumed = !is_ours && pane.input.on_window_event(&pane.window, &event).consumed;
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => self.close(event_loop),
            WindowEvent::Resized(size) => {
                pane.screen.resize(size.width, size.height);
                resize(&mut self.state, &pane.screen, size);
            }
            WindowEvent::Focused(false) => self.state.let_go(),
            WindowEvent::ModifiersChanged(modifiers) => self.modifiers = modifiers.state(),
            WindowEvent::KeyboardInput { event, .. } => {
                let is_down = event.state == ElementState::Pressed;
                match key {
                    Some(Key::Close) if is_down && !consumed => self.close(event_loop),
                    Some(key) if !consumed || !is_down => {
                        self.do_key(key, is_down, event.repeat);
                    }
                    _ => {}
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                let at = Pixel::new(position.x, position.y);
                self.on_pointer((!consumed).then_some(at));
                self.pointer = Some(at);
            }
            WindowEvent::CursorLeft { .. } => self.on_pointer(None),
            WindowEvent::MouseInput { state, button, .. } => {
                let is_down = state == ElementState::Pressed;
                if !consumed || !is_down {
                    self.on_button(button, is_down);
                }
            }
            WindowEvent::MouseWheel { delta, .. } if !consumed => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, y) => f64::from(y),
                    MouseScrollDelta::PixelDelta(by) => by.y / 50.0,
                };
                if let Some(at) = self.pointer {
                    self.state.wheel(notches, at);
                }
            }
            _ => {}
        }
        self.redraw();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::vec2;

    #[test]
    fn errors_say_what_to_do() {
        let text = ViewError::NoDisplay("neither is set".to_owned()).to_string();
        assert!(text.contains("DISPLAY") && text.contains("lumigraph render"));
        assert!(!text.contains('\n'));
        let text = without_place("os error at /a/b.rs:7: neither is set.");
        assert_eq!(text, "neither is set");
        let rect = plan::place(Rect::from_min_size(pos2(0.0, 0.0), vec2(800.0, 600.0)));
        assert!(rect.width() <= 260.0 && rect.bottom() < 600.0);
    }
}
