//! `lumigraph field`

use super::npz::{Weights, npz};
use super::options::{FieldArgs, HoldOutArgs, ProxyArgs, SceneArgs, resized, size};
use super::output::{make_parent, print, write_file};
use calibrate::Pixel;
use glam::{DVec2, DVec3};
use render::blend::Contributor;
use render::picture::{contributors_exact, field_picture, palette};
use render::triangulation::{Triangulation, to_svg};
use render::{Frame, Method, TriangulatedField};
use std::path::{Path, PathBuf};

/// Picture the blending field: which photo paints which pixel
///
/// One colour a photo, mixed by weight, as seen from the photo NAME. That photo itself
/// paints its own view alone; --without-view shows who would stand in for it.
///
///     lumigraph field my-capture --view a.jpg --without-view -o field.png
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// The photo from whose place to look
    #[arg(long, value_name = "NAME")]
    view: String,
    /// Leave out that photo, as if it were held out
    #[arg(long)]
    without_view: bool,
    #[command(flatten)]
    hold_out: HoldOutArgs,
    #[command(flatten)]
    proxy: ProxyArgs,
    #[command(flatten)]
    field: FieldArgs,
    /// Size of the picture in pixels [default: the photo's]
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
    let scene = args.scene.open()?;
    let mut without = args.hold_out.names(&scene)?;
    let view = resized(scene.view(&args.view)?, args.size);
    if args.without_view {
        without.insert(args.view.clone());
    }
    let proxy = args.proxy.choose(&scene, &without)?;
    let lumigraph = scene.lumigraph(&without, proxy.proxy)?;
    let frame = Frame::new(&lumigraph, view, args.field.options());

    // 1. The field, as the renderer asked for has it.
    let triangulated = || TriangulatedField::new(&frame, args.field.grid);
    let (contributors, field) = match args.field.method() {
        Method::Exact => (contributors_exact(&frame), None),
        Method::Triangulated { .. } => {
            let field = triangulated()?;
            (field.contributors(&frame), Some(field))
        }
    };

    // 2. Its pictures.
    let colors = palette(frame.sources.len());
    let mut written = vec![&args.output];
    make_parent(&args.output)?;
    capture::write_png(&args.output, &field_picture(&frame, &contributors, &colors))?;
    if let Some(file) = &args.weights {
        write_weights(file, &frame, &contributors)?;
        written.push(file);
    }
    if let Some(file) = &args.triangulation {
        let field = match field {
            Some(field) => field,
            None => triangulated()?,
        };
        write_file(file, svg(&frame, &field, &colors).as_bytes())?;
        written.push(file);
    }
    let lines: Vec<String> = written
        .iter()
        .map(|f| format!("{}\n", f.display()))
        .collect();
    print(&lines.concat())
}

fn write_weights(
    file: &Path,
    frame: &Frame<'_>,
    contributors: &[Vec<Contributor>],
) -> anyhow::Result<()> {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let world_from_camera = frame.desired.camera_from_world.inverse();
    let point = |i: usize| {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let point = frame.proxy_point(Pixel::center_of(x, y));
        let in_world = point.map(|p| world_from_camera * (p.ray / p.inverse_distance));
        // At the plane's horizon there is no point that numbers could name.
        in_world.filter(|p| p.is_finite()).unwrap_or(DVec3::NAN)
    };
    let points: Vec<DVec3> = (0..contributors.len()).map(point).collect();
    let sources = &frame.lumigraph.sources;
    let bytes = npz(&Weights {
        width,
        height,
        camera_names: sources.iter().map(|s| s.name.as_str()).collect(),
        contributors,
        points: &points,
    })?;
    write_file(file, &bytes)
}

/// The triangles, each in the mix of its photos' colours, and the epipoles.
fn svg(frame: &Frame<'_>, field: &TriangulatedField, colors: &[[u8; 3]]) -> String {
    let fill = |triangle_idx: usize| {
        let mut mix = [0.0_f32; 3];
        let mut sum = 0.0;
        for entry in field.entries_of(triangle_idx) {
            let weight: f32 = entry.weights.iter().sum();
            let color = colors[entry.source_idx as usize];
            for c in 0..3 {
                mix[c] += weight * f32::from(color[c]);
            }
            sum += weight;
        }
        mix.map(|v| (v / sum.max(f32::MIN_POSITIVE)) as u8)
    };
    let fills: Vec<[u8; 3]> = (0..field.triangles.len()).map(fill).collect();
    let epipoles: Vec<DVec2> = field.epipoles.iter().map(|(_, at)| *at).collect();
    let triangulation = Triangulation {
        vertices: field.vertices.clone(),
        triangles: field.triangles.iter().map(|t| t.corners).collect(),
        ..Triangulation::default()
    };
    let (width, height) = (frame.desired.width, frame.desired.height);
    to_svg(&triangulation, width, height, Some(&fills), &epipoles)
}
