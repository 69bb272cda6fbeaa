//! `lumigraph plan`

use super::Usage;
use super::captured::{model_file, model_of};
use super::interior::open;
use super::output::{print, print_json, say};
use anyhow::Context;
use glam::{DMat4, DVec3};
use proxy::interior::{
    Cell, CellId, Content, Contents, Interior, InteriorWarning, SemicircleOptions, semicircles,
};
use proxy::mesh::Model;
use proxy::shown_name;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Where to photograph an interior from: cameras on semicircles before its portals
///
/// For every portal and each side of it, 2n + 1 cameras at eye height that aim at the portal's
/// centre and look into the cell beyond.
///
///     lumigraph plan house --json
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    /// The interior: a folder with interior.json, or that file
    interior: PathBuf,
    /// Cameras before each side of a portal: an odd number
    #[arg(long, value_name = "N", default_value_t = 13)]
    views: usize,
    /// Degrees between the outermost of them, as the portal sees them
    #[arg(long, value_name = "DEGREES", default_value_t = 120.0)]
    span: f64,
    /// Print poses as JSON: camera_from_world, 16 numbers row by row
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Pose<'a> {
    portal: &'a str,
    /// None is the outside.
    from: Option<&'a str>,
    into: &'a str,
    angle_degrees: f64,
    /// Whether it stands in the cell `from`.
    inside: bool,
    /// Whether it would not at any radius: before an upright portal, above or below that cell.
    #[serde(skip)]
    is_off: bool,
    center: [f64; 3],
    camera_from_world: [f64; 16],
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    if args.views.is_multiple_of(2) || args.views > 999 {
        let found = args.views;
        return Err(Usage(format!(
            "--views is {found}; expected an odd number up to 999"
        ))
        .into());
    }
    if !(args.span > 0.0 && args.span < 180.0) {
        let found = args.span;
        return Err(Usage(format!(
            "--span is {found}; expected more than 0 and less than 180"
        ))
        .into());
    }
    let (path, interior) = open(&args.interior)?;
    let contents = contents(&path, &interior)?;
    let options = SemicircleOptions {
        views: args.views,
        span: args.span.to_radians(),
    };
    let poses = poses(&interior, &contents, &options);
    let outside = poses.iter().filter(|pose| !pose.inside).count();
    if outside > 0 {
        say!(
            "warning: {outside} of {} cameras stand outside their cell; {} in {}",
            poses.len(),
            remedy(&interior, &poses)?,
            path.display()
        );
    }
    if args.json {
        return print_json(&poses);
    }
    let digits = digits(interior.eye_height);
    let width = digits.max(3) + 6;
    let mut text = format!(
        "{:<20} {:<20} {:<20} {:>7} {:>width$} {:>width$} {:>width$}\n",
        "portal", "from", "into", "angle", "x", "y", "z"
    );
    for pose in &poses {
        let [x, y, z] = pose.center;
        text += &format!(
            "{:<20} {:<20} {:<20} {:>6.1}° {x:>width$.digits$} {y:>width$.digits$} {z:>width$.digits$}\n",
            shown_name(pose.portal),
            shown_name(pose.from.unwrap_or("(outside)")),
            shown_name(pose.into),
            pose.angle_degrees,
        );
    }
    print(&text)
}

/// How many digits after the point tell a thousandth of the eyes' height: of metres, three.
fn digits(eye_height: f64) -> usize {
    (3.0 - eye_height.log10()).ceil().clamp(0.0, 15.0) as usize
}

/// What to do about cameras that stand outside their cell, of which there are some.
fn remedy(interior: &Interior, poses: &[Pose<'_>]) -> anyhow::Result<String> {
    // From as high a smaller semicircle would be outside, too.
    if interior.odd_eye_height().is_some() {
        return Ok("correct `eye_height`".to_owned());
    }
    // And so it would be of a portal that is turned round, on the side of its other cell.
    let odd = interior.check()?;
    let turned = odd.iter().filter_map(|warning| match warning {
        InteriorWarning::Turned(portal) => Some(portal.as_str()),
        _ => None,
    });
    let turned: BTreeSet<&str> = turned.collect();
    let outside: Vec<&Pose<'_>> = poses.iter().filter(|pose| !pose.inside).collect();
    let mut remedies = Vec::new();
    let named: BTreeSet<&str> = outside.iter().map(|pose| pose.portal).collect();
    let named = named.intersection(&turned);
    let named: Vec<String> = named
        .map(|portal| format!("`{}`", shown_name(portal)))
        .collect();
    if !named.is_empty() {
        remedies.push(format!("reverse the `polygon` of {}", named.join(", ")));
    }
    // Nor does it help where a cell is too low for eyes.
    let others = outside
        .into_iter()
        .filter(|pose| !turned.contains(pose.portal));
    let (off, beside): (Vec<&Pose<'_>>, Vec<&Pose<'_>>) = others.partition(|pose| pose.is_off);
    let off: BTreeSet<&str> = off.iter().filter_map(|pose| pose.from).collect();
    let cells = interior.cells.iter();
    let cells = cells.filter(|cell| off.contains(cell.name.as_str()));
    let cells: Vec<String> = cells
        .map(|cell| {
            let key = match cell.content {
                Content::Nodes(_) => "nodes",
                Content::Box(_) | Content::Scene { .. } => "box",
            };
            format!("the `{key}` of `{}`", shown_name(&cell.name))
        })
        .collect();
    if !cells.is_empty() {
        let cells = cells.join(", ");
        remedies.push(format!("correct {cells} (eyes are above or below)"));
    }
    if !beside.is_empty() {
        // Than those to be reversed, none of which is among them.
        let which = if named.is_empty() { "" } else { "other " };
        remedies.push(format!("give {which}portals a smaller `radius`"));
    }
    Ok(remedies.join(", and "))
}

/// Whether a place is above or below all of a cell, as far as that is known.
fn is_off(interior: &Interior, contents: &Contents, id: CellId, place: DVec3) -> bool {
    let room = contents.bounds.get(id.0 as usize).copied().flatten();
    room.is_some_and(|room| {
        let over = room.corners().map(|p| (place - p).dot(interior.up));
        over.iter().all(|h| *h > 0.0) || over.iter().all(|h| *h < 0.0)
    })
}

/// Where the cells of an interior are, whose file is `path`. Only of cells that are nodes must the model tell it; of
/// others it tells which floors are before doors on upper storeys, if it is there.
fn contents(path: &Path, interior: &Interior) -> anyhow::Result<Contents> {
    let of = |model: &Model| {
        let named = || path.display().to_string();
        let found = Contents::new(interior, model).with_context(named);
        found.map(|(contents, _)| contents)
    };
    let is_nodes = |cell: &Cell| matches!(cell.content, Content::Nodes(_));
    if interior.cells.iter().any(is_nodes) {
        return of(&model_of(path, interior)?.0);
    }
    let by_boxes = of(&Model::default())?;
    let is_there = || model_file(path, interior).is_some_and(|file| file.is_file());
    match by_boxes.has_raised(interior) && is_there() {
        true => of(&model_of(path, interior)?.0),
        false => Ok(by_boxes),
    }
}

fn poses<'a>(
    interior: &'a Interior,
    contents: &Contents,
    options: &SemicircleOptions,
) -> Vec<Pose<'a>> {
    let name = |id: CellId| interior.cell(id).name.as_str();
    let views = semicircles(interior, contents, options).into_iter();
    views
        .map(|view| {
            let pose = view.camera_from_world;
            let portal = interior.portal(view.portal);
            let is_off = |id| is_off(interior, contents, id, pose.center());
            let matrix = DMat4::from_rotation_translation(pose.rotation, pose.translation);
            Pose {
                portal: &portal.name,
                from: view.from.map(name),
                into: name(view.into),
                angle_degrees: view.angle.to_degrees(),
                inside: view.is_inside,
                is_off: !portal.lies_flat(interior.up) && view.from.is_some_and(is_off),
                center: pose.center().to_array(),
                // Row by row.
                camera_from_world: matrix.transpose().to_cols_array(),
            }
        })
        .collect()
}
