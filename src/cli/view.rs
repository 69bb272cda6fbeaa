//! `lumigraph view`

use super::Usage;
use super::budget;
use super::captured::{Opened, Photos};
use super::damaged::{leave_out, left_out_text};
use super::exposure::ExposureArgs;
use super::film::{Background, background};
use super::interior::{check_holds_none, is_interior};
use super::made::{self, Made};
use super::options::{DrawArgs, FieldArgs, HoldOutArgs, SceneArgs};
use super::output::say;
use super::path::NerfstudioArgs;
use super::surface::{ProxyArgs, proxy_text, say_lack};
use super::targets::{check_folder, note_of_unasked_folder};
use super::time::{AtArgs, Clock, TimeArgs};
use super::unused::note_of_ldi_views;
use anyhow::Context;
use capture::as_argument;
use lumigraph::scene::{Kind, Scene};
use proxy::Proxy;
use render::DeviceChoice;
use render::interior::{CAPTURED_REFERENCE_SIZE, LibraryOptions, Painter, PortalFill, WalkOptions};
use render::path::read_keyframes;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use view::{Content, House, Look, Progress, Teller, ViewOptions, WorkerOptions};

/// Look around in a window
///
/// A scene or a capture opens at its first photo's pose; what is fitted to it goes on behind. An
/// interior is walked through; options that are for scenes change nothing there. F1 shows which key does what.
///
///     lumigraph view scene
///     lumigraph view house -o film
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    mut_arg("scene", |arg| arg.help(SCENE_HELP)),
    mut_arg("size", |arg| arg.help(SIZE_HELP))
)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    hold_out: HoldOutArgs,
    #[command(flatten)]
    proxy: ProxyArgs,
    #[command(flatten)]
    exposure: ExposureArgs,
    #[command(flatten)]
    field: FieldArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    at: AtArgs,
    /// What the portals of an interior show: geometry, texture, warp1, warp2 or ldi
    #[arg(long, value_name = "KIND", default_value = "geometry")]
    portals: String,
    /// Make an interior's LDIs of views of the N views nearest to where one is, and the middle one, ahead of need,
    /// by a thread of low priority [default: all views make one]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=999))]
    ldi_views: Option<u16>,
    /// What is behind where nothing is shown: #RRGGBB, or transparent, shown as squares
    #[arg(long, value_name = "COLOR", default_value = "#1c1c20", value_parser = background)]
    background: Background,
    /// Begin with the keyframes of a path that was saved before, by nerfstudio's viewer too, or with where a
    /// screenshot was taken; they keep their lenses and times
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    #[command(flatten)]
    nerfstudio: NerfstudioArgs,
    /// The folder for screenshots (shot_0001.png, …) and the path (path.json; for nerfstudio
    /// camera_path.json; path_2.json and so on beside those of an earlier session) [default: lumigraph-view]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write a line of JSON for each frame on the screen: where one is, and what took how long
    #[arg(long, value_name = "FILE", hide = true)]
    trace: Option<PathBuf>,
}

// What options that other commands have, too, are here.
const SCENE_HELP: &str =
    "A scene written by `import`, a capture (photos with a calibration), or an interior";
const SIZE_HELP: &str = "Size of the window [default: 1280x800]";

/// The folder for what is saved, where nobody names one.
const OUTPUT: &str = "lumigraph-view";

/// Of the window, in points, as the help has it.
const SIZE: (u32, u32) = (1280, 800);

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let Some(portals) = PortalFill::from_name(&args.portals) else {
        let known = PortalFill::ALL.map(PortalFill::name).join(", ");
        let text = format!("--portals: unknown {:?}; expected {known}", args.portals);
        return Err(Usage(text).into());
    };
    let output = match &args.output {
        Some(output) => {
            check_holds_none(output)?;
            check_folder(output)?;
            output.clone()
        }
        None => {
            let output = PathBuf::from(OUTPUT);
            check_holds_none(&output)?;
            // Who looks around may want to save nothing.
            if let Some(note) = note_of_unasked_folder(&output)? {
                say!("note: {note}");
            }
            output
        }
    };
    let given = &args.scene.scene;
    if args.hold_out.hold_out.is_some() && is_interior(given) {
        let text = "--hold-out: photos are held out of an interior when it is made; `lumigraph interior CAPTURE \
                    --hold-out SPLIT.json` makes one without them";
        return Err(Usage(text.to_owned()).into());
    }
    let nerfstudio = args.nerfstudio.frame()?;
    let keyframes = match &args.path {
        Some(path) => {
            let file = read_keyframes(path, &nerfstudio)?;
            let none = || {
                let command = match is_interior(given) {
                    true => "walk",
                    false => "render",
                };
                let transforms = args.nerfstudio.file();
                let transforms = transforms
                    .map(|file| format!(" --dataparser-transforms {}", as_argument(file)));
                format!(
                    "{}: it has frames, not keyframes, which alone can be moved here; `lumigraph {command} {} --path {}{} \
                     -o FRAMES` draws it",
                    path.display(),
                    as_argument(given),
                    as_argument(path),
                    transforms.unwrap_or_default()
                )
            };
            Some(file.with_context(none)?)
        }
        None => None,
    };
    let mut walk = WalkOptions::default();
    walk.library.budget = args.draw.cpu_memory;
    walk.library.ldi_views = args.ldi_views.map(usize::from);
    let options = ViewOptions {
        title: format!("{} – lumigraph", given.display()),
        size: args.draw.size.unwrap_or(SIZE),
        look: Look {
            options: args.field.options(),
            method: args.field.method(),
            portals,
            background: args.background.0,
            ..Look::default()
        },
        worker: WorkerOptions {
            device: args.draw.device(),
            gpu_memory: args.draw.gpu_memory,
            skips: args.draw.skips(),
            walk,
            output,
        },
        keyframes,
        nerfstudio,
        trace: args.trace.clone(),
    };
    // A slip of the pen is said where it was made; what else is wrong is said in the window, too.
    if !given.exists() {
        args.scene.open()?;
    }
    let load = Load::of(args, walk.library);
    // Threads of its own: pictures must not wait until a piece of the fitting is done.
    let threads = rayon::current_num_threads();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    let failed = Arc::new(Mutex::new(None));
    let of_loading = Arc::clone(&failed);
    let said = view::run(options, move |teller| {
        teller.say(match pool.install(|| load.run(teller)) {
            Ok(()) => Progress::Done,
            Err(error) => {
                let text = super::one_line(&error);
                *of_loading.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                Progress::Failed(text)
            }
        });
    })?;
    if let Some(said) = said {
        say!("note: keyframes were in no file: {said}");
    }
    let failed = failed.lock().unwrap_or_else(PoisonError::into_inner).take();
    failed.map_or(Ok(()), Err)
}

/// What is loaded behind the window.
struct Load {
    scene: SceneArgs,
    hold_out: HoldOutArgs,
    proxy: ProxyArgs,
    exposure: ExposureArgs,
    time: TimeArgs,
    at: AtArgs,
    device: DeviceChoice,
    budget: Option<u64>,
    library: LibraryOptions,
}

impl Load {
    fn of(args: &Args, library: LibraryOptions) -> Self {
        Self {
            scene: args.scene.clone(),
            hold_out: args.hold_out.clone(),
            proxy: args.proxy.clone(),
            exposure: args.exposure.clone(),
            time: args.time.clone(),
            at: args.at.clone(),
            device: args.draw.device(),
            budget: args.draw.cpu_memory,
            library,
        }
    }

    fn run(&self, teller: &Teller) -> anyhow::Result<()> {
        match is_interior(&self.scene.scene) {
            true => self.load_house(teller),
            false => self.load_scene(teller),
        }
    }

    fn load_house(&self, teller: &Teller) -> anyhow::Result<()> {
        let given = &self.scene.scene;
        teller.doing("reading the model");
        let warn = |text| teller.say(Progress::Note(text));
        let opened = Opened::new(given, Some(&self.exposure), warn)?;
        let (file, files) = (opened.file.clone(), opened.files());
        // The folder of LDIs that were made as they would be here.
        let ldis = |painter: &Painter, photos: Option<&Photos>| {
            let mut options = self.library;
            if photos.is_some() {
                options.size = CAPTURED_REFERENCE_SIZE;
            }
            let made = || Made::new(&file, &files, &options, painter, photos);
            made::usable(&file, made, |text| teller.say(Progress::Note(text)))
        };
        let mut house = House::new(opened.interior, opened.contents, opened.model);
        let mut folder = None;
        match &opened.photos {
            Some(photos) => {
                teller.doing("measuring what photos see");
                let (device, budget) = (self.device, self.budget);
                house = house.with_photos(|interior, contents, model| {
                    let painter = photos.painter(device, budget, interior, contents, model)?;
                    if let Some(note) = note_of_ldi_views(&self.library, &painter) {
                        teller.say(Progress::Note(note.to_owned()));
                    }
                    folder = ldis(&painter, Some(photos))?;
                    anyhow::Ok(painter)
                })?;
            }
            // Images of a model are the CPU's.
            None => folder = ldis(&Painter::cpu(), None)?,
        }
        if let Some(folder) = folder {
            house = house.with_ldis(folder);
        }
        teller.show(Content::Interior(Arc::new(house)));
        Ok(())
    }

    /// Shows a scene as soon as may be with a proxy that is quickly had, and then as `render` would
    /// draw it.
    fn load_scene(&self, teller: &Teller) -> anyhow::Result<()> {
        let (proxy, exposure) = (&self.proxy, &self.exposure);
        let mut scene = self.scene.open()?;
        let without = self.hold_out.names(&scene)?;
        let mut clock = None;
        let mut show = |scene: &Scene, without: &BTreeSet<String>, proxy: Proxy, until: &str| {
            let mut lumigraph = scene.lumigraph(without, proxy)?;
            lumigraph.photos.set_budget(budget::of_photos(self.budget));
            // Looking for a period takes a while.
            let clock = match &clock {
                Some(clock) => *clock,
                None => *clock.insert(Clock::of(&self.time, self.at.time, &lumigraph)?),
            };
            let first_s = lumigraph.sources.iter().filter_map(|s| s.time_s);
            let first_s = first_s.min_by(f64::total_cmp);
            let moment = clock.map(|clock| clock.moment("the scene", first_s));
            let content = Content::Scene(Arc::new(lumigraph));
            teller.show_at(content, moment.transpose()?, until);
            anyhow::Ok(())
        };
        // 1. At once.
        exposure.forget(&mut scene);
        let is_ready = proxy.takes_own(&scene, &without)?;
        // What of it is to be another, as options draw it.
        let mut meanwhile = Vec::new();
        let quick = match &scene.proxy {
            Some(own) if is_ready => {
                say_lack(&scene, own.surface()?, &without)?;
                Some(own.surface()?.clone())
            }
            _ => {
                let mut kinds = [Kind::Points, Kind::Plane].into_iter();
                let quick = kinds.find_map(|kind| Some((kind, scene.fit(kind, &without).ok()?)));
                quick.map(|(kind, fitted)| {
                    meanwhile.push(format!("--proxy {}", kind.name()));
                    fitted.proxy
                })
            }
        };
        let is_awaited = exposure.is_awaited(&scene, &without);
        if is_awaited {
            meanwhile.push("--no-exposure".to_owned());
        }
        if let Some(quick) = quick {
            show(&scene, &without, quick, &meanwhile.join(" "))?;
        }
        // 2. Behind.
        teller.doing("matching exposures");
        let damaged = exposure.choose(&mut scene, &without).left_out;
        let mut fewer = without.clone();
        leave_out(&scene, &damaged, &mut fewer, self.scene.strict)?;
        for photo in &damaged {
            teller.say(Progress::Note(left_out_text(photo)));
        }
        let has_gains = scene.photos.iter().any(|photo| photo.gain.is_some());
        let is_other = has_gains || is_awaited || !damaged.is_empty();
        if !is_ready {
            let text = "choosing the proxy that shows best what photos show: this may take a while";
            teller.doing(text);
            let chosen = proxy.choose(&scene, &fewer, self.scene.strict)?;
            fewer.extend(chosen.left_out.into_keys());
            let text = proxy_text(&chosen.proxy);
            show(&scene, &fewer, chosen.proxy, "")?;
            teller.say(Progress::Note(format!("proxy: {text}")));
        } else if let (true, Some(own)) = (is_other, &scene.proxy) {
            show(&scene, &fewer, own.surface()?.clone(), "")?;
        }
        Ok(())
    }
}
