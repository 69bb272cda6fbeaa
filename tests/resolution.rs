//! Buehler et al. 2001, Figure 10: a hallway with and without regard to resolution.

use calibrate::{Rigid3, View};
use datasets::{Dataset, Options};
use glam::DVec3;
use image::RgbaImage;
use proxy::{MeshKind, Proxy, Solid, tunnel};
use render::score::score;
use render::{FieldOptions, Frame, Lumigraph, Method, PhotoStore, SourceView, cpu};
use std::sync::Arc;

/// The synthetic hallway's photos on the tunnel that fits its sparse points.
fn lumigraph(dataset: &Dataset) -> Lumigraph {
    let picture = |p: &datasets::Photo| {
        datasets::render_view(&dataset.scene, &p.view, dataset.samples_per_side)
    };
    let photos: Vec<RgbaImage> = dataset.photos.iter().map(picture).collect();
    let source = |p: &datasets::Photo| SourceView {
        name: p.name.clone(),
        view: p.view.clone(),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let views: Vec<View> = dataset.photos.iter().map(|p| p.view.clone()).collect();
    let points = dataset.reconstruction.points.values();
    let points: Vec<DVec3> = points.map(|p| p.position).collect();
    let mesh = tunnel::fit(&views, &points).unwrap().mesh();
    Lumigraph {
        points: Vec::new(),
        sources: dataset.photos.iter().map(source).collect(),
        photos: PhotoStore::from_images(photos),
        proxy: Proxy::Mesh(Arc::new(Solid::new(MeshKind::Tunnel, mesh))),
        visibility: None,
    }
}

/// The part of a picture that shows the wall nearby: its right third.
fn near_wall(picture: &RgbaImage) -> RgbaImage {
    let (width, height) = picture.dimensions();
    image::imageops::crop_imm(picture, width - width / 3, 0, width / 3, height).to_image()
}

/// Looking ahead along the right wall. To the wall's points the angles are least from cameras
/// far behind, in the middle of the way, which show it coarsely.
#[test]
fn the_resolution_penalty_sharpens_the_wall_nearby() {
    let options = Options {
        size: Some((240, 180)),
        samples_per_side: Some(2),
        ..Options::default()
    };
    let dataset = datasets::by_name("hallway", &options).unwrap();
    let lumigraph = lumigraph(&dataset);
    let center = DVec3::new(0.6, 1.5, -1.5);
    let desired = View {
        camera_from_world: Rigid3::looking_at(center, center - DVec3::Z, DVec3::Y),
        ..dataset.photos[0].view.clone()
    };
    let truth = datasets::render_view(&dataset.scene, &desired, dataset.samples_per_side);
    let scores = |beta: f64| {
        let options = FieldOptions {
            beta,
            ..FieldOptions::default()
        };
        let frame = Frame::new(&lumigraph, desired.clone(), options);
        let picture = cpu::render(&frame, Method::Exact).unwrap();
        let all = score(&picture, &truth).unwrap();
        let wall = score(&near_wall(&picture), &near_wall(&truth)).unwrap();
        println!(
            "beta {beta}: {:.2} dB, SSIM {:.3}; the wall nearby {:.2} dB, SSIM {:.3}",
            all.psnr, all.ssim, wall.psnr, wall.ssim
        );
        (all, wall)
    };
    let (ignored, wall_ignored) = scores(0.0);
    let (regarded, wall_regarded) = scores(FieldOptions::default().beta);
    assert!(regarded.psnr > ignored.psnr + 0.6);
    assert!(wall_regarded.psnr > wall_ignored.psnr + 0.7);
    assert!(wall_regarded.ssim > wall_ignored.ssim + 0.01);
}
