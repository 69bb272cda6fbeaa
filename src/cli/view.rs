//! `lumigraph view`

use super::Usage;
use super::captured::Photos;
use super::exposure::ExposureArgs;
use super::interior::open;
use super::options::{DrawArgs, FieldArgs, SceneArgs};
use super::surface::{ProxyArgs, proxy_text};
use super::walk::model_of;
use anyhow::Context;
use lumigraph::scene::{Kind, Scene};
use proxy::interior::Contents;
use render::interior::{PortalFill, WalkOptions};
use render::path::read_keyframes;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use view::{Content, House, Look, Progress, Teller, ViewOptions, WorkerOptions};

/// Look around in a window
///
/// A scene or a capture opens at its first photo's pose; what is fitted to it goes on behind. An
/// interior is walked through. F1 shows which key does what.
///
///     lumigraph view scene
///     lumigraph view house -o film
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    proxy: ProxyArgs,
    #[command(flatten)]
    exposure: ExposureArgs,
    #[command(flatten)]
    field: FieldArgs,
    #[command(flatten)]
    draw: DrawArgs,
    /// What the portals of an interior show: geometry, texture, warp1, warp2 or ldi
    #[arg(long, value_name = "KIND", default_value = "geometry")]
    portals: String,
    /// Begin with the keyframes of a path that was saved before
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// The folder for screenshots (shot_0001.png, …) and the path (path.json)
    #[arg(short, long, value_name = "DIR", default_value = "lumigraph-view")]
    output: PathBuf,
    /// Write a line of JSON for each frame on the screen: where one is, and what took how long
    #[arg(long, value_name = "FILE", hide = true)]
    trace: Option<PathBuf>,
}

/// Of the window, in points.
const SIZE: (u32, u32) = (1280, 800);

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let Some(portals) = PortalFill::from_name(&args.portals) else {
        let known = PortalFill::ALL.map(PortalFill::name).join(", ");
        let text = format!("--portals: unknown {:?}; expected {known}", args.portals);
        return Err(Usage(text).into());
    };
    let keyframes = match &args.path {
        Some(path) => {
            let file = read_keyframes(path)?;
            let none = || format!("{}: it has frames, not keyframes", path.display());
            Some(file.with_context(none)?)
        }
        None => None,
    };
    let mut walk = WalkOptions::default();
    walk.library.budget = args.draw.cpu_memory;
    let given = &args.scene.scene;
    let options = ViewOptions {
        title: format!("{} – lumigraph", given.display()),
        size: args.draw.size.unwrap_or(SIZE),
        look: Look {
            options: args.field.options(),
            method: args.field.method(),
            portals,
            ..Look::default()
        },
        worker: WorkerOptions {
            device: args.draw.device(),
            gpu_memory: args.draw.gpu_memory,
            no_skip: args.draw.no_skip,
            walk,
            output: args.output.clone(),
        },
        keyframes,
        trace: args.trace.clone(),
    };
    // What cannot be opened is said where it was asked for, not in a window.
    let load = loader(args)?;
    // Threads of its own: pictures must not wait until a piece of the fitting is done.
    let threads = rayon::current_num_threads();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    view::run(options, move |teller| {
        teller.say(match pool.install(|| load(teller)) {
            Ok(()) => Progress::Done,
            Err(error) => Progress::Failed(super::one_line(&error)),
        });
    })?;
    Ok(())
}

type Load = Box<dyn FnOnce(&Teller) -> anyhow::Result<()> + Send>;

fn loader(args: &Args) -> anyhow::Result<Load> {
    let given = args.scene.scene.clone();
    let is_interior = given.join("interior.json").is_file()
        || given
            .file_name()
            .is_some_and(|name| name == "interior.json");
    if is_interior {
        let (path, interior) = open(&given)?;
        let (device, budget) = (args.draw.device(), args.draw.cpu_memory);
        let exposure = args.exposure.clone();
        return Ok(Box::new(move |teller| {
            teller.doing("reading the model");
            let model = model_of(&path, &interior)?;
            let named = || given.display().to_string();
            let (contents, warnings) = Contents::new(&interior, &model).with_context(named)?;
            if let Some(warning) = warnings.first() {
                teller.say(Progress::Note(warning.to_string()));
            }
            let photos = Photos::open(&path, &interior, &exposure)?;
            let mut house = House::new(interior, contents, model);
            if let Some(photos) = photos {
                teller.doing("measuring what photos see");
                house = house.with_photos(|interior, contents, model| {
                    let backdrop = photos.add_backdrop(model, contents)?;
                    photos.painter(device, budget, interior, contents, model, backdrop)
                })?;
            }
            teller.show(Content::Interior(Arc::new(house)));
            Ok(())
        }));
    }
    let scene = args.scene.open()?;
    let (proxy, exposure) = (args.proxy.clone(), args.exposure.clone());
    let budget = args.draw.cpu_memory;
    Ok(Box::new(move |teller| {
        load_scene(scene, &proxy, &exposure, budget, teller)
    }))
}

/// Shows a scene as soon as may be with a proxy that is quickly had, and then as `render` would
/// draw it.
fn load_scene(
    mut scene: Scene,
    proxy: &ProxyArgs,
    exposure: &ExposureArgs,
    budget: Option<u64>,
    teller: &Teller,
) -> anyhow::Result<()> {
    let without = BTreeSet::new();
    let show = |scene: &Scene, proxy: proxy::Proxy| -> anyhow::Result<()> {
        let mut lumigraph = scene.lumigraph(&without, proxy)?;
        lumigraph.photos.set_budget(budget);
        teller.show(Content::Scene(Arc::new(lumigraph)));
        Ok(())
    };
    // 1. At once.
    let is_ready = proxy.is_default() && scene.proxy.is_some();
    let quick = match &scene.proxy {
        Some(own) if is_ready => Some(own.proxy.clone()),
        _ => {
            let quick = scene.fit(Kind::Points, &without);
            let quick = quick.or_else(|_| scene.fit(Kind::Plane, &without));
            quick.ok().map(|fitted| fitted.proxy)
        }
    };
    if let Some(quick) = quick {
        show(&scene, quick)?;
    }
    // 2. Behind.
    teller.doing("matching exposures");
    exposure.choose(&mut scene, &without);
    let has_gains = scene.photos.iter().any(|photo| photo.gain.is_some());
    if !is_ready {
        teller.doing("choosing the proxy that shows best what photos show: this may take a while");
        let chosen = proxy.choose(&scene, &without)?;
        let text = proxy_text(&chosen.proxy);
        show(&scene, chosen.proxy)?;
        teller.say(Progress::Note(format!("proxy: {text}")));
    } else if let (true, Some(own)) = (has_gains, &scene.proxy) {
        show(&scene, own.proxy.clone())?;
    }
    Ok(())
}
