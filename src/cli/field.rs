//! `lumigraph field`

use super::Usage;
use super::damaged::leave_out;
use super::exposure::ExposureArgs;
use super::film::{frame_count, write_picture};
use super::frames::{Asked, FRAMES, NamedView};
use super::inputs::files_behind_scene;
use super::npz::{Row, Weights, write_npz};
use super::options::{FieldArgs, HoldOutArgs, SceneArgs, cut, size};
use super::output::{fill_file, make_parent, print, say, write_file};
use super::session::{points, spinner};
use super::surface::ProxyArgs;
use super::targets::{check_file, check_file_in_no_part, check_inputs};
use super::time::{AtArgs, Clock, TimeArgs};
use anyhow::anyhow;
use calibrate::{Pixel, View};
use glam::{DVec2, DVec3};
use image::RgbaImage;
use render::field::FieldTriangle;
use render::path::{NerfstudioFrame, default_name};
use render::picture::{field_picture_and, palette};
use render::triangulation::{Triangulation, to_svg};
use render::{Contributions, FieldRows, Frame, Method, Part, TriangulatedField};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Picture the blending field: which photo paints which pixel
///
/// One colour a photo, mixed by weight, as seen from the photo NAME, or from the frame NAME
/// of a path. A photo paints its own view alone; --without-view shows who would stand in
/// for it.
///
///     lumigraph field my-capture --view a.jpg --without-view -o field.png
///     lumigraph field my-capture --path dolly --view frame_0008 -o field.png
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// The photo from whose place to look, or the frame of --path
    #[arg(long, value_name = "NAME")]
    view: String,
    /// Leave out that photo, as if it were held out
    #[arg(long, conflicts_with = "path")]
    without_view: bool,
    /// A path derived from where the photos were taken (orbit, dolly or sweep, as for `render`), or a path
    /// file
    #[arg(long, value_name = "KIND|FILE")]
    path: Option<String>,
    /// Frames of a derived path [default: 30]
    #[arg(long, value_name = "N", requires = "path", conflicts_with = "without_view",
        value_parser = frame_count)]
    frames: Option<u32>,
    #[command(flatten)]
    hold_out: HoldOutArgs,
    #[command(flatten)]
    proxy: ProxyArgs,
    // As by the commands that draw; weights do not depend on it, but what `auto` chooses.
    #[command(flatten)]
    exposure: ExposureArgs,
    #[command(flatten)]
    field: FieldArgs,
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    at: AtArgs,
    /// Size of the picture in pixels [default: the photo's]; of another shape it shows the middle of the view
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Also write the weights, for numpy: camera_names, ids, weights, points
    #[arg(long, value_name = "FILE.npz")]
    weights: Option<PathBuf>,
    /// Also draw the triangulation
    #[arg(long, value_name = "FILE.svg")]
    triangulation: Option<PathBuf>,
    /// The picture
    #[arg(short, long, value_name = "FILE.png")]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    check_extensions(args)?;
    let outputs = [
        (Some(&args.output), "-o"),
        (args.weights.as_ref(), "--weights"),
        (args.triangulation.as_ref(), "--triangulation"),
    ];
    let mut files: Vec<(&Path, &str)> = Vec::new();
    for (file, option) in outputs {
        let Some(file) = file else {
            continue;
        };
        check_file(file, option)?;
        files.push((file.as_path(), option));
    }
    let mut scene = args.scene.open()?;
    let inputs = files_behind_scene(&args.scene.scene, &scene);
    check_inputs(files.iter().map(|(file, _)| *file), &inputs)?;
    for (file, option) in files {
        check_file_in_no_part(file, option)?;
    }
    let mut without = args.hold_out.names(&scene)?;
    let photo = scene.name_here(&args.view);
    if args.without_view {
        without.insert(photo.clone());
    }
    let path = args.path.as_deref();
    let asked = path.map(|path| Asked::path(path, &NerfstudioFrame::default()));
    let count = args.frames.unwrap_or(FRAMES);
    let check_time = |name: String, own: Option<f64>, remedy: &str| {
        let remedy = format!("{remedy}, or give --time");
        args.time
            .check(args.at.time, &scene, [(name, own)], &remedy)
    };
    // What need not be derived is found first: fitting a proxy may take long.
    let known = match asked.transpose()? {
        None => {
            let (view, time_s) = (scene.view(&photo)?, scene.time_s(&photo));
            let remedy = "`import --times FILE.csv` gives it one";
            check_time(format!("photo {photo}"), time_s, remedy)?;
            Ok((view, time_s))
        }
        Some(Asked::Read { views, untimed, .. }) => {
            check_no_count(args)?;
            let frame = frame_of(views, &args.view)?;
            let named = format!("{}: {}", path.unwrap_or_default(), args.view);
            check_time(named, frame.1, untimed)?;
            let unused = args.time.note_of_unused(args.at.time, &scene);
            if let (Some(note), Some(_)) = (unused, frame.1) {
                say!("note: {}: {note}", path.unwrap_or_default());
            }
            Ok(frame)
        }
        Some(derived) => {
            let names: Vec<String> = (0..count as usize).map(default_name).collect();
            frame_called(&args.view, &names)?;
            Err(derived)
        }
    };
    if args.proxy.is_searched(&scene, &without) {
        // Kinds are compared by what is drawn, which is exposed alike.
        let exposure = args.exposure.choose(&mut scene, &without);
        leave_out(&scene, &exposure.left_out, &mut without, args.scene.strict)?;
    }
    let proxy = args.proxy.choose(&scene, &without, args.scene.strict)?;
    without.extend(proxy.left_out.keys().cloned());
    let lumigraph = scene.lumigraph(&without, proxy.proxy.clone())?;
    let (view, time_s) = match known {
        Ok(known) => known,
        Err(derived) => {
            let points = || points(&scene, &without);
            let (views, _) = derived.frames(count, &lumigraph, points)?;
            frame_of(views, &args.view)?
        }
    };
    let view = cut(view, args.size);
    let clock = Clock::of(&args.time, args.at.time, &lumigraph)?;
    let moment = clock.map(|clock| clock.moment(&args.view, time_s));
    let part = Part {
        moment: moment.transpose()?,
        ..Part::default()
    };
    let frame = Frame::with(&lumigraph, view, args.field.options(), &part);

    // 1. The field, as the renderer asked for has it, and its picture. Who paints each pixel is kept for a file
    //    alone: it takes many times what the picture does.
    let triangulated = || TriangulatedField::new(&frame, args.field.grid);
    let bar = spinner("weighting photos");
    let field = match args.field.method() {
        Method::Exact => None,
        Method::Triangulated { .. } => Some(triangulated()?),
    };
    let colors = palette(frame.sources.len());
    let is_kept = args.weights.is_some();
    let keep = |row: &Contributions| is_kept.then(|| Row::of(row));
    let (picture, kept) = field_picture_and(&FieldRows::new(&frame, field.as_ref()), &colors, keep);
    frame.check_masks()?;
    bar.finish_and_clear();

    // 2. Files.
    let mut written = vec![&args.output];
    make_parent(&args.output)?;
    write_picture(&args.output, &picture)?;
    if let Some(file) = &args.weights {
        let rows: Vec<Row> = kept.into_iter().flatten().collect();
        write_weights(file, &frame, &rows)?;
        written.push(file);
    }
    if let Some(file) = &args.triangulation {
        let field = match field {
            Some(field) => field,
            None => triangulated()?,
        };
        write_file(file, svg(&field, &picture).as_bytes())?;
        written.push(file);
    }
    let lines: Vec<String> = written
        .iter()
        .map(|f| format!("{}\n", f.display()))
        .collect();
    print(&lines.concat())
}

/// Fails where a file's name is not that of what would be written to it.
fn check_extensions(args: &Args) -> Result<(), Usage> {
    let files = [
        ("--output", "png", Some(&args.output)),
        ("--weights", "npz", args.weights.as_ref()),
        ("--triangulation", "svg", args.triangulation.as_ref()),
    ];
    for (option, expected, file) in files {
        let Some(file) = file else { continue };
        let found = file.extension();
        if found.is_none_or(|found| !found.eq_ignore_ascii_case(expected)) {
            let file = file.display();
            let text = format!("{option} {file}: expected a file name that ends in .{expected}");
            return Err(Usage(text));
        }
    }
    Ok(())
}

/// Fails where so many frames are asked for of a path that has its own.
fn check_no_count(args: &Args) -> Result<(), Usage> {
    let Some(count) = args.frames else {
        return Ok(());
    };
    let text = format!("--frames {count}: the path has its own frames; leave it out");
    Err(Usage(text))
}

/// The view of one frame of a path, and its time.
fn frame_of(mut frames: Vec<NamedView>, name: &str) -> anyhow::Result<(View, Option<f64>)> {
    let names: Vec<String> = frames.iter().map(|f| f.name.clone()).collect();
    let found = frames.swap_remove(frame_called(name, &names)?);
    Ok((found.view, found.time_s))
}

/// Which of a path's frames is called so.
fn frame_called(name: &str, names: &[String]) -> anyhow::Result<usize> {
    names.iter().position(|n| n == name).ok_or_else(|| {
        let (count, first) = (names.len(), names[..names.len().min(2)].join(", "));
        anyhow!("--view {name}: the path has {count} frames of other names: {first}, …")
    })
}

fn write_weights(file: &Path, frame: &Frame<'_>, rows: &[Row]) -> anyhow::Result<()> {
    let world_from_camera = frame.desired.camera_from_world.inverse();
    let point = |x: u32, y: u32| {
        let point = frame.proxy_point(Pixel::center_of(x, y));
        let in_world = point.map(|p| world_from_camera * (p.ray / p.inverse_distance));
        // At the plane's horizon there is no point that numbers could name.
        in_world.filter(|p| p.is_finite()).unwrap_or(DVec3::NAN)
    };
    let sources = &frame.lumigraph.sources;
    let weights = Weights {
        width: frame.desired.width,
        camera_names: sources.iter().map(|s| s.name.as_str()).collect(),
        rows,
    };
    fill_file(file, |temporary| {
        write_npz(&File::create(temporary)?, &weights, point)
    })
}

/// The triangles, each in the colour of the field at its centre, and the epipoles.
fn svg(field: &TriangulatedField, picture: &RgbaImage) -> String {
    let (width, height) = picture.dimensions();
    let fill = |triangle: &FieldTriangle| {
        let corners = triangle.corners.map(|i| field.vertices[i as usize]);
        let center = corners.iter().sum::<DVec2>() / 3.0;
        let (x, y) = (center.x as u32, center.y as u32);
        let [r, g, b, _] = picture.get_pixel(x.min(width - 1), y.min(height - 1)).0;
        [r, g, b]
    };
    let fills: Vec<[u8; 3]> = field.triangles.iter().map(fill).collect();
    let epipoles: Vec<DVec2> = field.epipoles.iter().map(|(_, at)| *at).collect();
    let triangulation = Triangulation {
        vertices: field.vertices.clone(),
        triangles: field.triangles.iter().map(|t| t.corners).collect(),
        ..Triangulation::default()
    };
    to_svg(&triangulation, width, height, Some(&fills), &epipoles)
}
