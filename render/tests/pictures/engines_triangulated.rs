//! Pictures of the triangulated field against exact ones, by every engine.

use crate::common::{Shot, by_all, psnr};
use crate::engines::{desired_views, mixed, options};

use calibrate::{View, colmap};
use proxy::Proxy;
use render::{
    Blend, FieldOptions, Frame, Lumigraph, Method, PhotoStore, Resolution, SourceView, cpu,
    reference,
};
use std::path::Path;

/// That the triangulated field's picture is at least 50 dB from the exact one, by every
/// engine.
fn check_triangulated(lumigraph: &Lumigraph, desired: View, options: FieldOptions, what: &str) {
    let frame = Frame::new(lumigraph, desired, options);
    let exact = reference::render_exact(&frame).unwrap();
    for (engine, picture) in by_all(&frame, Method::TRIANGULATED) {
        let db = psnr(&picture.unwrap(), &exact);
        println!("{what}, {engine}: {db:.1} dB");
        assert!(db >= 50.0, "{what}, {engine}: {db} dB");
    }
}

#[test]
fn triangulated_pictures_are_close_to_exact_ones() {
    let shot = Shot::of("shelf", 9, None);
    let lumigraph = shot.lumigraph();
    let views = &shot.views;
    let mut desired = desired_views(&shot);
    desired.push(("midway", views[1].between(&views[2], 0.5)));
    desired.push(("1 % off", views[4].between(&views[5], 0.01)));
    for (name, view) in desired {
        for blend in [Blend::Consistent, Blend::Paper] {
            let what = format!("{name}, {blend:?}");
            let options = options(blend, Resolution::Footprint);
            check_triangulated(&lumigraph, view.clone(), options, &what);
        }
    }
}

#[test]
fn triangulated_pictures_are_close_with_other_lenses_gains_and_alpha() {
    let shot = mixed();
    for (name, desired) in [
        ("midway", shot.views[3].between(&shot.views[6], 0.5)),
        ("1 % off", shot.views[4].between(&shot.views[0], 0.01)),
    ] {
        let options = FieldOptions::default();
        check_triangulated(&shot.lumigraph, desired, options, name);
    }
}

/// A capture folder of the project's shared ones, `None` where it is not there.
fn capture(name: &str) -> Option<Lumigraph> {
    let root = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/captures"
    ));
    let folder = root.join(name);
    if !folder.is_dir() {
        eprintln!("SKIPPED: no capture {name} beside this repository");
        return None;
    }
    let model = colmap::read_model(&colmap::find_model(&folder).unwrap()).unwrap();
    let plane = proxy::fit_plane(&model).unwrap().plane;
    let mut images: Vec<_> = model.images.values().collect();
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let sources = images.iter().map(|image| {
        let camera = &model.cameras[&image.camera_id];
        SourceView {
            name: image.name.clone(),
            view: View {
                lens: camera.lens().unwrap(),
                width: camera.width,
                height: camera.height,
                camera_from_world: image.camera_from_world,
            },
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        }
    });
    let sources: Vec<SourceView> = sources.collect();
    let photos = capture::find_photos_folder(&folder).unwrap();
    let files: Vec<_> = sources.iter().map(|s| photos.join(&s.name)).collect();
    let load = move |i: usize| capture::decode(&files[i], None).map_err(|e| e.to_string());
    Some(Lumigraph {
        points: Vec::new(),
        photos: PhotoStore::new(sources.len(), load),
        sources,
        proxy: Proxy::Plane(plane),
        visibility: None,
    })
}

#[test]
fn triangulated_pictures_are_close_on_real_captures() {
    for name in ["desk-sweep", "sceaux-castle", "fern"] {
        let Some(lumigraph) = capture(name) else {
            continue;
        };
        // From a photo in the middle to the one nearest to it.
        let first = &lumigraph.sources[lumigraph.sources.len() / 2].view;
        let distance = |s: &&SourceView| s.view.center().distance(first.center());
        let others = lumigraph.sources.iter().filter(|s| distance(s) > 0.0);
        let nearest = others.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        for share in [0.5, 0.01] {
            let desired = first.between(&nearest.unwrap().view, share);
            let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
            let exact = cpu::render(&frame, Method::Exact).unwrap();
            let triangulated = cpu::render(&frame, Method::TRIANGULATED).unwrap();
            let db = psnr(&triangulated, &exact);
            println!("{name}, {share} of the way: {db:.1} dB");
            assert!(db >= 50.0, "{name}, {share} of the way: {db} dB");
        }
    }
}
