//! `lumigraph info`

use super::import::check_photos;
use super::info_of_file;
use super::interior::check_no_interior;
use super::options::{Doubtful, KeyArgs, SceneArgs, beside_counts, beside_text, print_warnings};
use super::output::{print, print_json, say};
use super::report::megabytes;
use super::surface::{proxy_json, proxy_text};
use calibrate::{Reprojection, colmap};
use capture::find_photos_folder;
use glam::DVec3;
use lumigraph::bench::median;
use lumigraph::scene::{Photo, Scene, SceneError, other_models};
use proxy::shown_number;
use render::{Mask, Pyramid};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Photos and their times, cameras, points, reprojection error per camera, proxy, memory
///
/// Of a calibration alone, a file of any format or a COLMAP model: its cameras and poses.
///
///     lumigraph info my-capture
///     lumigraph info out_camera_data.yml
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    keys: KeyArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    check_no_interior(&args.scene.scene)?;
    if args.scene.scene.is_file() {
        return info_of_file::run(&args.scene.scene, &args.keys.keys(), args.json);
    }
    if let Some(model) = bare_model(&args.scene.scene) {
        if model != args.scene.scene
            && let Some(note) = other_models(&model, "`lumigraph info PATH` shows")
        {
            say!("note: {note}");
        }
        return info_of_file::of_model(&model, &args.keys.keys(), args.json);
    }
    let scene = open(args)?;
    if args.scene.strict {
        check_photos(&scene)?;
    }
    if let Err(error) = scene.check_own_proxy() {
        say!("note: {error}");
    }
    let doubtful = Doubtful::of(&scene);
    let info = gather(&scene, &doubtful)?;
    if args.json {
        return print_json(&info);
    }
    print(&text(&scene, &info))?;
    doubtful.say(scene.reconstruction.points.len(), "");
    Ok(())
}

/// The COLMAP model that a folder itself is, or one of those in its numbered folders, if it holds
/// neither photos nor a scene.
fn bare_model(folder: &Path) -> Option<PathBuf> {
    let model = colmap::find_model(folder).ok()?;
    let has_photos = find_photos_folder(folder).is_some() || Scene::is_scene(folder);
    let is_within = model.parent() == Some(folder) && !colmap::side_by_side(&model).is_empty();
    let is_it = model == folder || is_within;
    (is_it && !has_photos).then_some(model)
}

/// Opens the scene, or the capture with those matrices of its calibration that were asked for.
fn open(args: &Args) -> anyhow::Result<Scene> {
    let folder = &args.scene.scene;
    if Scene::is_scene(folder) {
        let own = format!("the COLMAP model of the scene {}", folder.display());
        info_of_file::say_unused_keys(&args.keys.keys(), &own);
        return args.scene.open_whole();
    }
    let keys = args.keys.keys();
    let (scene, warnings) = Scene::open_capture(folder, args.scene.strict, Some(&keys))?;
    print_warnings(&warnings);
    Ok(scene)
}

fn gather(scene: &Scene, doubtful: &Doubtful) -> anyhow::Result<Value> {
    let reconstruction = &scene.reconstruction;
    let mut cameras = Vec::new();
    let mut photo_bytes = 0_u64;
    for (id, camera) in &reconstruction.cameras {
        let names: BTreeSet<&str> = reconstruction
            .images
            .values()
            .filter(|i| i.camera_id == *id)
            .map(|i| i.name.as_str())
            .collect();
        let photos = names.len();
        if photos == 0 {
            continue;
        }
        let is_masked = |p: &&Photo| p.ignore_mask.is_some() && names.contains(p.name.as_str());
        let masks = scene.photos.iter().filter(is_masked).count();
        let (width, height) = (camera.width, camera.height);
        for (count, bytes) in [
            (photos, Pyramid::bytes_of(width, height)),
            (masks, Mask::bytes_of(width, height)),
        ] {
            photo_bytes = photo_bytes.saturating_add(bytes.saturating_mul(count as u64));
        }
        let reprojections = reconstruction.reprojections(*id);
        let reprojections = reprojections.map_err(|source| SceneError::Camera {
            name: format!("id {}", id.0),
            source,
        })?;
        cameras.push(json!({
            "id": id.0,
            "model": camera.model.name(),
            "width": camera.width,
            "height": camera.height,
            "params": camera.params,
            "photos": photos,
            "reprojection_px": reprojection(&reprojections),
        }));
    }
    let positions: Vec<DVec3> = reconstruction.points.values().map(|p| p.position).collect();
    let cloud = proxy::statistics(&positions);
    let own = scene.proxy.as_ref().map(|own| {
        let mut value = match own.surface() {
            Ok(proxy) => proxy_json(proxy),
            Err(lost) => json!({"error": lost.to_string()}),
        };
        value["file"] = json!(own.file);
        value["fitted_without"] = json!(own.fitted_without);
        value
    });
    let [ignore_masks, object_mattes, silhouettes, depth_maps] =
        beside_counts(scene).map(|(_, n)| n);
    Ok(json!({
        "photos": scene.photos.len(),
        "ignore_masks": ignore_masks,
        "object_mattes": object_mattes,
        "silhouettes": silhouettes,
        "depth_maps": depth_maps,
        "times": times(scene).map(|(photos, first, last)| json!({
            "photos": photos,
            "range_s": [first, last],
        })),
        "left_out": scene.left_out,
        "weakly_tied": doubtful.weak.iter().map(|group| json!({
            "photos": group.names,
            "shared_points": group.shared_points,
        })).collect::<Vec<_>>(),
        "misplaced": doubtful.misplaced,
        "cameras": cameras,
        "points": positions.len(),
        "spacing": cloud.map(|c| c.spacing),
        "isolated": cloud.map(|c| c.isolated),
        "proxy": own,
        "memory_bytes": photo_bytes,
        "contradicted_points": doubtful.contradicted,
    }))
}

/// How many photos have times, the earliest of them and the latest; `None` where none has.
fn times(scene: &Scene) -> Option<(usize, f64, f64)> {
    let mut times: Vec<f64> = scene.photos.iter().filter_map(|p| p.time_s).collect();
    times.sort_by(f64::total_cmp);
    Some((times.len(), *times.first()?, *times.last()?))
}

/// Mean, median and 95th percentile of the finite errors; how many there are, and how many points lie
/// behind the camera that is said to see them, or beyond what its lens maps one to one.
fn reprojection(all: &[Reprojection]) -> Value {
    let count = |what: Reprojection| all.iter().filter(|r| **r == what).count();
    let mut finite: Vec<f64> = all.iter().map(|r| r.px()).collect();
    finite.retain(|px| px.is_finite());
    finite.sort_by(f64::total_cmp);
    let mean = finite.iter().sum::<f64>() / finite.len() as f64;
    json!({
        "mean": (!finite.is_empty()).then_some(mean),
        "median": median(&finite),
        "p95": finite.get(finite.len() * 95 / 100),
        "observations": finite.len(),
        "behind": count(Reprojection::Behind),
        "beyond_lens": count(Reprojection::BeyondLens),
    })
}

fn text(scene: &Scene, info: &Value) -> String {
    let mut text = format!("photos   {}\n", info["photos"]);
    for camera in info["cameras"].as_array().into_iter().flatten() {
        let params: Vec<String> = camera["params"]
            .as_array()
            .into_iter()
            .flatten()
            .map(ToString::to_string)
            .collect();
        let error = error_text(&camera["reprojection_px"]);
        text += &format!(
            "camera   {}: {} {}×{} [{}], {} photos, {error}\n",
            camera["id"],
            camera["model"].as_str().unwrap_or_default(),
            camera["width"],
            camera["height"],
            params.join(", "),
            camera["photos"],
        );
    }
    if let Some(beside) = beside_text(scene).strip_prefix(", ") {
        text += &format!("with     {beside}\n");
    }
    if let Some((photos, first, last)) = times(scene) {
        text += &format!("times    of {photos} photos, {first:.3} to {last:.3} s\n");
    }
    text += &format!("points   {}", info["points"]);
    if let (Some(spacing), Some(isolated)) = (info["spacing"].as_f64(), info["isolated"].as_u64()) {
        let spacing = shown_number(spacing);
        text += &format!(", median spacing {spacing} world units, {isolated} isolated");
    }
    text += &match &scene.proxy {
        Some(own) => match own.surface() {
            Ok(proxy) => format!("\nproxy    {}\n", proxy_text(proxy)),
            Err(_) => format!("\nproxy    {}, which cannot be read\n", own.file),
        },
        None => "\nproxy    none of its own; one is chosen when needed\n".to_owned(),
    };
    let bytes = info["memory_bytes"].as_u64().unwrap_or_default();
    text += &format!(
        "memory   {} at most, if a frame needs every photo\n",
        megabytes(bytes)
    );
    text
}

/// What [`reprojection`] found, with the observations that no error is known of.
fn error_text(error: &Value) -> String {
    let counts = [
        ("behind", "of points behind the camera"),
        (
            "beyond_lens",
            "of points beyond what its lens maps one to one",
        ),
    ];
    let counted = counts.map(|(key, what)| (error[key].as_u64().unwrap_or_default(), what));
    let nowhere = counted.iter().filter(|(count, _)| *count > 0);
    let nowhere: Vec<String> = nowhere.map(|(n, what)| format!("{n} {what}")).collect();
    let nowhere = nowhere.join(", ");
    match (error["mean"].as_f64(), error["median"].as_f64()) {
        (Some(mean), Some(median)) => {
            let more = if nowhere.is_empty() { "" } else { "; besides " };
            format!(
                "reprojection error {mean:.3} px mean, {median:.3} px median over {} observations{more}{nowhere}",
                error["observations"]
            )
        }
        _ if nowhere.is_empty() => "no observations of points".to_owned(),
        _ => format!("no observations of points that its lens sees; {nowhere}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_two_errors_is_between_them() {
        let [three, one] = [3.0, 1.0].map(Reprojection::Off);
        let told = reprojection(&[three, Reprojection::Behind, one]);
        assert_eq!(told["median"], 2.0);
        assert_eq!(
            (&told["observations"], &told["behind"]),
            (&json!(2), &json!(1))
        );
        assert_eq!(told["beyond_lens"], 0);
        let told = reprojection(&[one, Reprojection::BeyondLens, Reprojection::BeyondLens]);
        assert_eq!(
            (&told["behind"], &told["beyond_lens"]),
            (&json!(0), &json!(2))
        );
        assert!(reprojection(&[])["median"].is_null());
    }

    #[test]
    fn observations_of_points_that_project_nowhere_are_told() {
        let text = |all: &[Reprojection]| error_text(&reprojection(all));
        let (off, behind) = (Reprojection::Off(0.5), Reprojection::Behind);
        let beyond = Reprojection::BeyondLens;
        assert_eq!(text(&[]), "no observations of points");
        assert_eq!(
            text(&[off, off]),
            "reprojection error 0.500 px mean, 0.500 px median over 2 observations"
        );
        assert_eq!(
            text(&[off, beyond, behind, beyond]),
            "reprojection error 0.500 px mean, 0.500 px median over 1 observations; besides 1 of points behind the \
             camera, 2 of points beyond what its lens maps one to one"
        );
        assert_eq!(
            text(&[behind, behind]),
            "no observations of points that its lens sees; 2 of points behind the camera"
        );
    }
}
