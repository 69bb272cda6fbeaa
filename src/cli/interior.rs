//! `lumigraph interior`

mod folder;
mod told;
mod warnings;

use super::Usage;
use super::options::{HoldOutArgs, triple};
use super::output::{print, say};
use super::session::spinner;
use super::targets::check_new_folder;
use anyhow::{Context, bail};
use calibrate::Distortion;
use datasets::in_new_folder;
pub(super) use folder::{
    INTERIOR, check_holds_none, check_no_interior, check_outside, check_there, is_interior,
    is_without_photos, open,
};
use folder::{PLAN_PNG, PLAN_SVG, beside_interior, is_ours};
use glam::DVec3;
use image::ImageFormat;
use lumigraph::scene::{Scene, relative};
use proxy::interior::find::{Evidence, FindOptions, FoundInterior, find_interior};
use proxy::interior::{
    Contents, EYE_HEIGHT, Interior, InteriorError, InteriorWarning, compare, fit_to_sight,
    interior_from_nodes, strays, surface_of, write_interior,
};
use proxy::mesh::{MeshFileError, Model, files_beside, model_to_glb, parse_model};
use proxy::shown_name;
use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Instant;
use told::{Told, model_name};
use warnings::put_causes_first;
pub(super) use warnings::said;

/// Make an interior of a model or a capture: cells joined by portals
///
/// Rooms and doorways are found in the surface: that of the model, or that of a capture's depth
/// maps, fused (without depth maps, a scene's own mesh). Look at floor-plan.svg, and correct
/// interior.json where it is wrong. They can be told instead: by --rooms (boxes and outlines), or
/// by the names of a model's nodes: `cell:NAME` for a room and all below it, `portal:A|B` for the
/// flat mesh of an opening between two of them. The rooms of a capture are drawn from its photos,
/// which stay where they are.
///
///     lumigraph interior house.glb -o house
///     lumigraph interior my-rgbd-walk -o office
///     lumigraph interior house.glb --rooms rooms.json -o house
///     lumigraph interior my-rgbd-walk --compare rooms.json -o office
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The model, textured: .glb; or a scene or capture with depth maps
    #[arg(value_name = "MODEL|SCENE")]
    model: PathBuf,
    /// Rooms and openings: {"version": 1, "up": [0, 1, 0], "rooms": [{"name", "min", "max"}], "openings":
    /// [{"name", "between": ["A", "B"], "polygon": [[x, y, z], …]}]}; without "up" a model's is y, and a capture's the
    /// axis next to what was up for its cameras
    #[arg(long, value_name = "FILE")]
    rooms: Option<PathBuf>,
    #[command(flatten)]
    hold_out: HoldOutArgs,
    /// Find the rooms even where nodes name them
    #[arg(long, conflicts_with = "rooms")]
    find: bool,
    /// Which way is up in the world; rooms are found then, even where nodes name them [default: as cameras had
    /// it, else the way the floor says]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true,
        conflicts_with = "rooms")]
    up: Option<DVec3>,
    /// How many world units a metre is; with --rooms, eyes are 1.6 of it over the floor where FILE has no
    /// "eye_height"
    #[arg(long, value_name = "UNITS", default_value_t = 1.0)]
    meter: f64,
    /// Print how what was found compares with rooms and openings that are known: a file as --rooms has
    /// them, or another interior's folder; portals count within 0.3 m
    #[arg(long, value_name = "FILE|DIR", conflicts_with = "rooms")]
    compare: Option<PathBuf>,
    /// Replace the interior that DIR holds, its layered depth images (`lumigraph ldis`) included
    #[arg(long)]
    force: bool,
    /// The interior's folder: interior.json, and the model beside it
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// Portals that are nearer than this to one another are the same; metres.
const SAME_PORTAL: f64 = 0.3;
/// Rooms and portals reach farther by this at most to have what is seen; metres.
const WALL: f64 = 0.35;
/// What a capture's model is called.
const MODEL: &str = "model.glb";

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if !(args.meter > 0.0 && args.meter.is_finite()) {
        let text = format!("--meter is {}; expected a positive number", args.meter);
        return Err(Usage(text).into());
    }
    if args.up.is_some_and(|up| up.try_normalize().is_none()) {
        return Err(Usage("--up: expected a direction such as 0,1,0".to_owned()).into());
    }
    let options = FindOptions {
        up: args.up,
        meter: args.meter,
        ..FindOptions::default()
    };
    check_no_interior(&args.model)?;
    // Before what may take long.
    check_free(args)?;
    let told = Told::read(args)?;
    say_unused(args, &told);
    match args.model.is_dir() {
        true => run_scene(args, &options, told),
        false => run_model(args, &options, told),
    }
}

/// Says where an option was given for nothing.
fn say_unused(args: &Args, told: &Told) {
    if let (Some(file), Some(rooms)) = (&args.rooms, &told.rooms)
        && args.meter != 1.0
        && rooms.interior.eye_height != EYE_HEIGHT * args.meter
    {
        let file = file.display();
        say!("note: --meter changes nothing: {file} says how high eyes are (\"eye_height\")");
    }
    let why = match (args.model.is_dir(), args.up) {
        (true, _) => "photos have no nodes that name rooms",
        (false, Some(_)) => "with --up rooms are found anyway",
        (false, None) => return,
    };
    if args.find {
        say!("note: --find changes nothing: {why}");
    }
}

/// Fails where an interior would be replaced that was not asked to be, as people correct them by hand, or that
/// cannot be, as other things lie beside it; and where there is no writing to the folder.
fn check_free(args: &Args) -> anyhow::Result<()> {
    if args.output.join(INTERIOR).exists() {
        let folder = args.output.display();
        if let Some(other) = beside_interior(&args.output)? {
            bail!(
                "{folder}: the folder is not empty: it holds an interior, and {other}; choose another, or move that \
                 away first"
            );
        }
        if !args.force {
            bail!(
                "{folder}: holds an interior already; replace it with --force, or choose another folder"
            );
        }
    }
    check_new_folder(&args.output, is_ours)
}

fn run_scene(args: &Args, options: &FindOptions, told: Told) -> anyhow::Result<()> {
    let named = || args.model.display().to_string();
    let photos = relative(&args.output, &args.model)?;
    let (mut scene, warnings) = Scene::open(&args.model, false)?;
    super::options::print_warnings(&warnings);
    super::options::drop_weak_of_interior(&mut scene);
    let without = args.hold_out.names(&scene)?;
    say_distorted(&scene, &without);
    // 1. The surface.
    let start = Instant::now();
    let busy = spinner("fusing depth maps");
    let surface = scene.surface(&without);
    busy.finish_and_clear();
    let surface = surface.with_context(named)?;
    for (name, reason) in &surface.left_out {
        say!("warning: photo {name} is left out: {reason}");
    }
    for (name, reason) in &surface.maps_left_out {
        say!("note: the depth map of photo {name} is left out: {reason}");
    }
    let fused_s = start.elapsed().as_secs_f64();
    // 2. Its rooms.
    let start = Instant::now();
    let mut rooms = match told.rooms {
        Some(mut given) => {
            if let Some(up) = surface.up() {
                given.ask_cameras(up).with_context(named)?;
            }
            Rooms::given(given.interior, given.warnings)
        }
        None => {
            let busy = spinner("finding rooms");
            let found = surface.rooms(MODEL, options);
            busy.finish_and_clear();
            Rooms::found(found.with_context(named)?)?
        }
    };
    let rooms_s = start.elapsed().as_secs_f64();
    // 3. The photos that show them.
    rooms.interior.show_photos(&photos);
    rooms.interior.held_out = without.into_iter().collect();
    let (bytes, model) = stored(&surface.model, MODEL).with_context(named)?;
    finish(args, MODEL, &bytes, &model, rooms, told.known)?;
    let surface = match surface.maps {
        0 => "the scene's own mesh, coloured".to_owned(),
        maps => format!("{maps} depth maps fused and coloured"),
    };
    say!("{surface} in {fused_s:.1} s, rooms in {rooms_s:.1} s");
    Ok(())
}

/// A model's file, and the model as whoever opens it has it: with coordinates that are rounded to f32, which says
/// whether what lies in the plane of a box's side is in it.
fn stored(model: &Model, file: &str) -> anyhow::Result<(Vec<u8>, Model)> {
    let bytes = model_to_glb(model)?;
    let (model, _) = parse_model(Path::new(file), &bytes)?;
    Ok((bytes, model))
}

/// Says so where pictures of the interior cannot be compared with photos that are held out.
fn say_distorted(scene: &Scene, held_out: &BTreeSet<String>) {
    let is_distorted = |name: &&String| {
        let view = scene.view(name);
        view.is_ok_and(|view| view.lens.distortion() != Distortion::None)
    };
    if let Some(name) = held_out.iter().find(is_distorted) {
        say!(
            "note: photo {name} is held out, and its lens is distorted, for which `walk --held-out` draws nothing: import \
             the photos with --undistort, and make the interior of that scene"
        );
    }
}

fn run_model(args: &Args, options: &FindOptions, told: Told) -> anyhow::Result<()> {
    if args.hold_out.hold_out.is_some() {
        let text = "--hold-out is for captures; a model has no photos";
        return Err(Usage(text.to_owned()).into());
    }
    // A .glb is one file as a rule, and can be copied as it is.
    let is_glb = args
        .model
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("glb"));
    if !is_glb {
        // Without an extension a folder was meant.
        if args.model.extension().is_none() {
            check_there(&args.model)?;
        }
        let found = args.model.display();
        let text = format!(
            "{found}: interiors are made of .glb models, or of folders of photos; export the model as .glb, \
             from Blender, say"
        );
        return Err(Usage(text).into());
    }
    check_there(&args.model)?;
    // The copy is of what was read.
    let unreadable = |e| MeshFileError::Io(args.model.clone(), e);
    let bytes = std::fs::read(&args.model).map_err(unreadable)?;
    let (model, warnings) = parse_model(&args.model, &bytes)?;
    for warning in warnings {
        say!("warning: {}: {warning}", args.model.display());
    }
    let file = model_name(args);
    let named = || args.model.display().to_string();
    let (bytes, model) = match files_beside(&args.model)?.is_empty() {
        true => (bytes, model),
        // What lies beside it is not there beside a copy.
        false => stored(&model, &file).with_context(named)?,
    };
    let given = match told.rooms {
        Some(given) => Some((given.interior, given.warnings)),
        None if args.find => None,
        None => match (interior_from_nodes(&model, &file, args.meter), args.up) {
            (Err(InteriorError::NoCellNodes), _) => None,
            (_, Some(_)) => {
                say!(
                    "note: with --up rooms are found; those that the model's nodes name are not taken"
                );
                None
            }
            (told, None) => Some(told.with_context(named)?),
        },
    };
    let rooms = match given {
        Some((interior, mut warnings)) => {
            // They are as they were given, and what they hide is said.
            let hidden = strays(&interior, &model).with_context(named)?;
            warnings.extend(hidden.warning(&interior));
            warnings.extend(hidden.cut_warning());
            Rooms::given(interior, warnings)
        }
        None => {
            let busy = spinner("finding rooms");
            // Doors that the model marks are open.
            let surface = surface_of(&model);
            let evidence = Evidence {
                mesh: &surface,
                cameras: &[],
                sights: &[],
            };
            let found = find_interior(&evidence, &file, options);
            busy.finish_and_clear();
            let mut found = found.with_context(named)?;
            // What may be wrong is said at once: where the scale is, the rest takes long.
            let mut warnings = std::mem::take(&mut found.warnings);
            put_causes_first(&mut warnings);
            for warning in said(&warnings) {
                say!("warning: {warning}");
            }
            let busy = spinner("fitting rooms to what is seen from them");
            let fitted = fitted(found, &model, options.meter);
            busy.finish_and_clear();
            Rooms::found(fitted.with_context(named)?)?
        }
    };
    finish(args, &file, &bytes, &model, rooms, told.known)
}

/// What was found with all of the model in sight that is.
fn fitted(
    mut found: FoundInterior,
    model: &Model,
    meter: f64,
) -> Result<FoundInterior, InteriorError> {
    let left = fit_to_sight(&mut found.interior, model, WALL * meter)?;
    found.warnings.extend(left.warning(&found.interior));
    found.warnings.extend(left.cut_warning());
    Ok(found)
}

/// Files beside the model.
type Pictures = Vec<(&'static str, Vec<u8>)>;

/// An interior's cells and portals, given or found.
struct Rooms {
    interior: Interior,
    warnings: Vec<InteriorWarning>,
    /// To check by what was found; none of what was given.
    pictures: Pictures,
}

impl Rooms {
    fn given(interior: Interior, warnings: Vec<InteriorWarning>) -> Self {
        Self {
            interior,
            warnings,
            pictures: Vec::new(),
        }
    }

    fn found(found: FoundInterior) -> anyhow::Result<Self> {
        let mut png = Cursor::new(Vec::new());
        found.picture().write_to(&mut png, ImageFormat::Png)?;
        let pictures = vec![
            (PLAN_SVG, found.svg().into_bytes()),
            (PLAN_PNG, png.into_inner()),
        ];
        let mut warnings = found.warnings;
        put_causes_first(&mut warnings);
        Ok(Self {
            interior: found.interior,
            warnings,
            pictures,
        })
    }
}

fn finish(
    args: &Args,
    file: &str,
    bytes: &[u8],
    model: &Model,
    rooms: Rooms,
    known: Option<Interior>,
) -> anyhow::Result<()> {
    let Rooms {
        interior,
        warnings,
        pictures,
    } = rooms;
    let named = || args.model.display().to_string();
    let compared = known.map(|known| {
        let tolerance = SAME_PORTAL * args.meter;
        compare(&known, &interior, tolerance, args.meter).to_string()
    });
    let (contents, more) = Contents::new(&interior, model).with_context(named)?;
    let warnings: Vec<InteriorWarning> = warnings.into_iter().chain(more).collect();
    for warning in said(&warnings) {
        say!("warning: {warning}");
    }
    write(args, file, bytes, &interior, &pictures)?;
    let mut table = String::new();
    for (cell, triangles) in interior.cells.iter().zip(&contents.triangles) {
        let name = shown_name(&cell.name);
        table += &format!("{:>9} triangles  {name}\n", triangles.len());
    }
    table += &compared.unwrap_or_default();
    print(&format!(
        "{table}{}: {} cells, {} portals, {} triangles\n",
        args.output.display(),
        interior.cells.len(),
        interior.portals.len(),
        model.mesh.triangles.len()
    ))?;
    if !pictures.is_empty() {
        say!(
            "note: rooms were found, not given; check them by {}",
            args.output.join(PLAN_SVG).display()
        );
    }
    Ok(())
}

/// Fills a folder that takes its name only when it is complete. An interior that is there
/// already, as with --force it may, is replaced, if it is nothing else.
fn write(
    args: &Args,
    file: &str,
    model: &[u8],
    interior: &Interior,
    pictures: &Pictures,
) -> anyhow::Result<()> {
    in_new_folder(&args.output, is_ours, |folder| {
        let put = |name: &str, bytes: &[u8]| {
            let beside = folder.join(name);
            std::fs::write(&beside, bytes)
                .with_context(|| format!("{}: cannot write", beside.display()))
        };
        put(file, model)?;
        for (name, bytes) in pictures {
            put(name, bytes)?;
        }
        Ok(write_interior(&folder.join(INTERIOR), interior)?)
    })
}
