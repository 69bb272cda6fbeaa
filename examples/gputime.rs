use calibrate::*;
use render::*;
use std::path::Path;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let folder = Path::new(&args[1]);
    let rec = calibrate::colmap::read_model(&folder.join("sparse/0")).unwrap();
    let fit = proxy::fit_plane(&rec).unwrap();
    let mut images: Vec<_> = rec.images.values().cloned().collect();
    images.sort_by(|a, b| a.name.cmp(&b.name));
    images.truncate(17);
    let sources: Vec<SourceView> = images
        .iter()
        .map(|i| {
            let c = &rec.cameras[&i.camera_id];
            SourceView {
                name: i.name.clone(),
                view: View {
                    lens: c.lens().unwrap(),
                    width: c.width,
                    height: c.height,
                    camera_from_world: i.camera_from_world,
                },
                gain: [1.0; 3],
            }
        })
        .collect();
    let paths: Vec<_> = images
        .iter()
        .map(|i| folder.join("images").join(&i.name))
        .collect();
    let photos = PhotoStore::new(paths.len(), move |i| {
        Ok(image::open(&paths[i]).unwrap().to_rgba8())
    });
    let lg = Lumigraph {
        sources,
        photos,
        proxy: proxy::Proxy::Plane(fit.plane),
    };
    let (a, b) = (&lg.sources[0].view, &lg.sources[1].view);
    let c = a.center().lerp(b.center(), 0.5);
    let q = a.camera_from_world.rotation;
    let pin = View {
        lens: Lens::pinhole(
            a.lens.focal * (960.0 / a.width as f64),
            glam::DVec2::new(480.0, 360.0),
        ),
        width: 960,
        height: 720,
        camera_from_world: Rigid3::new(q, -(q * c)),
    };
    let frame = Frame::new(&lg, pin, FieldOptions::default());
    let f = TriangulatedField::new(&frame, args.get(2).map_or(32, |s| s.parse().unwrap())).unwrap();
    let nb = f.triangles.iter().filter(|t| t.bordered).count();
    let area = |t: &render::field::FieldTriangle| {
        let [a, b, c] = t.corners.map(|i| f.vertices[i as usize]);
        (b - a).perp_dot(c - a) / 2.0
    };
    println!(
        "triangles {} bordered {} area {:.3} entries/plain {:.1} /bordered {:.1}",
        f.triangles.len(),
        nb,
        f.triangles
            .iter()
            .filter(|t| t.bordered)
            .map(area)
            .sum::<f64>()
            / (960.0 * 720.0),
        f.triangles
            .iter()
            .filter(|t| !t.bordered)
            .map(|t| t.entry_count)
            .sum::<u32>() as f64
            / (f.triangles.len() - nb) as f64,
        f.triangles
            .iter()
            .filter(|t| t.bordered)
            .map(|t| t.entry_count)
            .sum::<u32>() as f64
            / nb as f64
    );
    let mut gpu = render::gpu::Gpu::open().unwrap();
    let time = |g: &mut dyn FnMut()| {
        let mut best = 1e9f64;
        for _ in 0..12 {
            let t = cpu_time::ProcessTime::now();
            g();
            best = best.min(t.elapsed().as_secs_f64() * 1e3);
        }
        best
    };
    println!(
        "gpu tri {:.0} ms",
        time(&mut || {
            gpu.render_field(&frame, &f).unwrap();
        })
    );
    println!(
        "cpu tri {:.0} ms",
        time(&mut || {
            render::cpu::render_field(&frame, &f).unwrap();
        })
    );
    println!(
        "cpu exact {:.0} ms",
        time(&mut || {
            render::cpu::render_exact(&frame).unwrap();
        })
    );
    println!(
        "field {:.2} ms",
        time(&mut || {
            TriangulatedField::new(&frame, args.get(2).map_or(32, |s| s.parse().unwrap())).unwrap();
        })
    );
}
