//! An interior measured: what portals show, against the model drawn whole, of a capture from its
//! photos.

use super::measured::{Effort, Measured, Pictures, Skip, Subject};
use super::skips::skip;
use super::times::{Times, in_turn, timed};
use anyhow::Context;
use calibrate::{Lens, View};
use glam::DVec2;
use image::{Rgba, RgbaImage};
use indicatif::ProgressBar;
use lumigraph::bench::before_doorways;
use proxy::interior::{Contents, Interior, SemicircleOptions};
use proxy::mesh::Model;
use render::interior::{
    CAPTURED_REFERENCE_SIZE, FrameCost, Painter, PortalFill, Splat, Walk, WalkOptions,
};
use render::score::{PSNR_CAP_DB, score};
use std::collections::BTreeMap;

/// What pictures are made with.
#[derive(Clone, Debug)]
struct Setting {
    knob: &'static str,
    value: String,
    fill: PortalFill,
    options: WalkOptions,
}

impl Setting {
    fn name(&self) -> String {
        format!("{} {}", self.knob, self.value)
            .trim_end()
            .to_owned()
    }
}

/// The default, and one thing changed at a time. Images are what is changed, so they are those that
/// layered depth images are made of.
fn settings(thorough: bool, options: WalkOptions) -> Vec<Setting> {
    let base = Setting {
        knob: "default",
        value: String::new(),
        fill: PortalFill::Geometry,
        options,
    };
    let mut all = vec![base.clone()];
    let mut add = |knob, value: String, fill, change: &dyn Fn(&mut WalkOptions)| {
        let mut setting = Setting {
            knob,
            value,
            fill,
            ..base.clone()
        };
        change(&mut setting.options);
        all.push(setting);
    };
    for fill in PortalFill::ALL
        .into_iter()
        .filter(|f| *f != PortalFill::Geometry)
    {
        add("portals", fill.name().to_owned(), fill, &|_| {});
    }
    let ldi = PortalFill::Ldi;
    let views: &[usize] = if thorough { &[3, 5, 9, 25] } else { &[5] };
    for &count in views {
        add("ldi of views", count.to_string(), ldi, &|o| {
            o.library.semicircles.views = count
        });
    }
    let sides: &[u32] = if thorough { &[128, 384, 512] } else { &[128] };
    for &side in sides {
        add("ldi of pixels", side.to_string(), ldi, &|o| {
            o.library.size = [side, side]
        });
    }
    for splat in [1, 3] {
        let fill = PortalFill::Warp2;
        add("warp2 splat", splat.to_string(), fill, &|o| {
            o.splat = Splat::Fixed(splat)
        });
    }
    all
}

/// Views through portals, from a little beyond their semicircles, as many on each angle off their
/// axis.
fn views(interior: &Interior, contents: &Contents, effort: Effort) -> Vec<View> {
    let options = SemicircleOptions {
        views: 5,
        span: 90_f64.to_radians(),
    };
    let width = effort.long_side;
    let size = DVec2::new(f64::from(width), f64::from(width * 4 / 5));
    let all: Vec<View> = before_doorways(interior, contents, 1.25, &options)
        .into_iter()
        .map(|place| View {
            lens: Lens::pinhole(DVec2::splat(0.7 * size.x), 0.5 * size),
            width,
            height: width * 4 / 5,
            camera_from_world: place.camera_from_world,
        })
        .collect();
    let count = (2 * effort.views).min(all.len());
    (0..count)
        .map(|i| all[(2 * i + 1) * all.len() / (2 * count)].clone())
        .collect()
}

/// Measures an interior. One painter draws all settings in turn, as it holds the model, or the photos.
pub(super) fn measure(
    interior: &Interior,
    contents: &Contents,
    model: &Model,
    mut painter: Painter,
    name: &str,
    effort: Effort,
    bar: &ProgressBar,
) -> anyhow::Result<(Subject, Pictures)> {
    let views = views(interior, contents, effort);
    let first_view = views.first();
    let first_view =
        first_view.context("no portal can be looked through from where one can stand")?;
    let mut base = WalkOptions::default();
    if painter.captured().is_some() {
        base.library.size = CAPTURED_REFERENCE_SIZE;
    }
    let settings = settings(effort.thorough, base);
    bar.set_length(settings.len() as u64 * (1 + effort.repeats as u64));
    bar.set_message(format!("{name}: measuring"));
    let drawn_by = painter.description();

    // 1. The truth, then each setting's first picture, with making its images, and its error.
    let whole = WalkOptions {
        whole_cells: true,
        ..WalkOptions::default()
    };
    let mut whole = Walk::with(painter, interior, contents, model, whole);
    let mut truths = Vec::new();
    for view in &views {
        whole.draw(view, PortalFill::Geometry)?;
        truths.push(whole.picture().picture());
    }
    painter = std::mem::take(whole.painter_mut());
    let mut walks = Vec::new();
    let mut measured = Vec::new();
    let mut pictures = None;
    for setting in &settings {
        let mut walk = Walk::with(painter, interior, contents, model, setting.options);
        let (drawn, first) = timed(|| walk.draw(first_view, setting.fill).map(drop));
        drawn?;
        let (image_bytes, images_made) = {
            let residency = walk.library().residency();
            (residency.held, residency.loads as usize)
        };
        let (mut psnr, mut ssim, mut coverage) = (0.0, 0.0, 0.0);
        let (mut squared, mut holes) = (0.0, 0);
        for (i, (view, truth)) in views.iter().zip(&truths).enumerate() {
            walk.draw(view, setting.fill)?;
            let picture = walk.picture().picture();
            let scored = score(&picture, truth)?;
            psnr += scored.psnr.min(PSNR_CAP_DB);
            ssim += scored.ssim;
            coverage += scored.coverage;
            squared += 255.0_f64.powi(2) * 10.0_f64.powf(-0.1 * scored.psnr);
            let pairs = picture.pixels().zip(truth.pixels());
            holes += pairs
                .filter(|(ours, theirs)| ours.0[3] == 0 && theirs.0[3] > 0)
                .count();
            if i == 0 && setting.fill == PortalFill::Ldi && pictures.is_none() {
                pictures = Some(Pictures {
                    truth: truth.clone(),
                    setting: setting.name(),
                    drawn: picture,
                    exact: None,
                });
            }
        }
        let count = views.len() as f64;
        let steps = (squared / count).sqrt();
        let pixels = count * f64::from(first_view.width) * f64::from(first_view.height);
        measured.push(Measured {
            name: setting.name(),
            knob: setting.knob.to_owned(),
            value: setting.value.clone(),
            frame: Times::default(),
            cpu_ms_range: [0.0; 2],
            first,
            image_bytes,
            images_made,
            psnr: psnr / count,
            ssim: ssim / count,
            coverage: coverage / count,
            holes: Some(holes as f64 / pixels),
            steps_from_exact: steps,
            psnr_to_exact: (20.0 * (255.0 / steps).log10()).min(PSNR_CAP_DB),
        });
        painter = std::mem::take(walk.painter_mut());
        walks.push(walk);
        bar.inc(1);
    }

    // 2. Times, in turn.
    let repeats = in_turn(
        settings.len(),
        effort.repeats,
        views.len(),
        bar,
        |i, view| draw_by(&mut painter, &mut walks[i], &views[view], settings[i].fill).map(drop),
    )?;
    for (measured, repeats) in measured.iter_mut().zip(&repeats) {
        measured.set_times(repeats);
    }
    let walk = |painter, options| Walk::with(painter, interior, contents, model, options);
    let skips = skips(&walk, base, &mut painter, first_view)?;
    let about = format!(
        "{} cells, {} portals, {} triangles; {} views through portals, up to 45° off their axis, \
         {} × {}; geometry drawn by {}",
        interior.cells.len(),
        interior.portals.len(),
        model.mesh.triangles.len(),
        views.len(),
        first_view.width,
        first_view.height,
        drawn_by,
    );
    let result = Subject {
        name: name.to_owned(),
        is_interior: true,
        about,
        views: (0..views.len()).map(|i| i.to_string()).collect(),
        size: [first_view.width, first_view.height],
        start_up: None,
        skips,
        settings: measured,
        failed: BTreeMap::new(),
    };
    let none = RgbaImage::from_pixel(1, 1, Rgba([0; 4]));
    let pictures = pictures.unwrap_or_else(|| Pictures {
        truth: none.clone(),
        setting: settings[0].name(),
        drawn: none,
        exact: None,
    });
    Ok((result, pictures))
}

/// Draws a view by a painter that other walks use, too.
fn draw_by(
    painter: &mut Painter,
    walk: &mut Walk<'_>,
    view: &View,
    fill: PortalFill,
) -> anyhow::Result<FrameCost> {
    std::mem::swap(walk.painter_mut(), painter);
    let drawn = walk.draw(view, fill);
    std::mem::swap(walk.painter_mut(), painter);
    Ok(drawn?)
}

/// Each on its own, of the first view. `walk` makes a walk by a painter, which says what the walk is
/// of: a model, or photos. It is given `painter`, which draws all of them.
fn skips<'a>(
    walk: &dyn Fn(Painter, WalkOptions) -> Walk<'a>,
    base: WalkOptions,
    painter: &mut Painter,
    view: &View,
) -> anyhow::Result<Vec<Skip>> {
    let whole_cells = WalkOptions {
        whole_cells: true,
        ..base
    };
    let whole_ldis = WalkOptions {
        whole_ldis: true,
        ..base
    };
    let mut all = Vec::new();
    for (name, fill, changed) in [
        ("cells", PortalFill::Geometry, whole_cells),
        ("columns", PortalFill::Ldi, whole_ldis),
    ] {
        let [mut with, mut without] = [base, changed].map(|options| {
            let mut made = walk(std::mem::take(painter), options);
            *painter = std::mem::take(made.painter_mut());
            made
        });
        let cost = draw_by(painter, &mut with, view, fill)?;
        let fired = match name {
            "cells" => (cost.triangles_in_cells - cost.triangles_tried, "triangles"),
            _ => (cost.samples_clipped, "samples"),
        };
        let fired = (fired.0 > 0).then(|| format!("{} {}", fired.0, fired.1));
        all.push(skip(name, fired, |skips| {
            let walk = if skips { &mut with } else { &mut without };
            let (drawn, times) = timed(|| draw_by(painter, walk, view, fill).map(drop));
            drawn?;
            Ok((walk.picture().picture(), times))
        })?);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::captured::Opened;
    use crate::cli::exposure::ExposureArgs;
    use lumigraph::scene::Scene;
    use proxy::interior::{parse_rooms, write_interior};
    use proxy::mesh::model_to_glb;
    use render::DeviceChoice;
    use std::collections::BTreeSet;
    use std::path::Path;

    /// The two halves of the hallway.
    const HALVES: &str = r#"{"version": 1, "rooms": [
        {"name": "front", "min": [-9, -0.1, -99], "max": [9, 9, -2]},
        {"name": "back", "min": [-9, -0.1, -2], "max": [9, 9, 99]}],
        "openings": [{"name": "across", "between": ["front", "back"], "radius": 0.5,
            "polygon": [[-1, 0, -2], [1, 0, -2], [1, 2.4, -2], [-1, 2.4, -2]]}]}"#;

    #[test]
    fn what_is_left_out_of_a_captured_interior_is_its_surface() {
        // 1. An interior of photos.
        let folder = tempfile::tempdir().unwrap();
        let at = |path: &str| folder.path().join(path);
        let options = datasets::Options {
            size: Some((96, 72)),
            ..datasets::Options::default()
        };
        let hallway = datasets::by_name("hallway", &options).unwrap();
        datasets::write(&hallway, &at("hall")).unwrap();
        let (scene, _) = Scene::open(&at("hall"), false).unwrap();
        let surface = scene.surface(&BTreeSet::new()).unwrap();
        let rooms = Path::new("rooms.json");
        let rooms = parse_rooms(rooms, HALVES.as_bytes(), "model.glb");
        let mut interior = rooms.unwrap().0;
        interior.show_photos("../hall");
        std::fs::create_dir(at("two")).unwrap();
        let model = model_to_glb(&surface.model).unwrap();
        std::fs::write(at("two/model.glb"), model).unwrap();
        write_interior(&at("two/interior.json"), &interior).unwrap();
        // 2. What draws it.
        let exposure = ExposureArgs::default();
        let mut opened = Opened::new(&at("two"), Some(&exposure), |_| {}).unwrap();
        let mut painter = opened.painter(DeviceChoice::Cpu, None).unwrap();
        let (interior, contents, model) = (&opened.interior, &opened.contents, &opened.model);
        let walk = |painter, options| Walk::with(painter, interior, contents, model, options);
        let mut base = WalkOptions::default();
        base.library.size = [64, 64];
        let places = SemicircleOptions {
            views: 1,
            span: 1.0,
        };
        let places = before_doorways(interior, contents, 1.25, &places);
        let view = View {
            lens: Lens::pinhole(DVec2::splat(45.0), DVec2::new(32.0, 24.0)),
            width: 64,
            height: 48,
            camera_from_world: places[0].camera_from_world,
        };
        // 3. As a walk of it has it.
        let mut whole = walk(std::mem::take(&mut painter), base);
        let cost = whole.draw(&view, PortalFill::Geometry).unwrap();
        painter = std::mem::take(whole.painter_mut());
        assert_eq!(cost.triangles_in_cells, model.mesh.triangles.len());
        let passed_over = cost.triangles_in_cells - cost.triangles_tried;
        let skips = skips(&walk, base, &mut painter, &view).unwrap();
        let fired = format!("{passed_over} triangles");
        assert_eq!(skips[0].fired.as_deref(), Some(&fired[..]));
        assert!(skips.iter().all(|skip| skip.same_bytes));
        assert!(painter.captured().is_some());
    }
}
