use calibrate::*;
use render::*;
use std::path::Path;
use std::time::Instant;
fn psnr(a: &image::RgbaImage, b: &image::RgbaImage) -> f64 {
    let mut s = 0.0;
    let mut n = 0.0;
    for (p, q) in a.pixels().zip(b.pixels()) {
        for c in 0..3 {
            let va = p.0[c] as f64 * p.0[3] as f64 / 255.0;
            let vb = q.0[c] as f64 * q.0[3] as f64 / 255.0;
            s += (va - vb) * (va - vb);
            n += 1.0;
        }
    }
    if s == 0.0 {
        99.0
    } else {
        10.0 * (255.0f64 * 255.0 / (s / n)).log10()
    }
}
fn within2(a: &image::RgbaImage, b: &image::RgbaImage) -> f64 {
    let mut ok = 0;
    let mut n = 0;
    for (p, q) in a.pixels().zip(b.pixels()) {
        n += 1;
        if (0..4).all(|c| (p.0[c] as i32 - q.0[c] as i32).abs() <= 2) {
            ok += 1;
        }
    }
    ok as f64 / n as f64
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let folder = Path::new(&args[1]);
    let rec = calibrate::colmap::read_model(&folder.join("sparse/0")).unwrap();
    let fit = proxy::fit_plane(&rec).unwrap();
    println!("{:?}", fit);
    let mut images: Vec<_> = rec.images.values().cloned().collect();
    images.sort_by(|a, b| a.name.cmp(&b.name));
    images.truncate(args.get(2).map_or(17, |s| s.parse().unwrap()));
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
    // desired views
    let mid = |a: &View, b: &View, t: f64| {
        let q = a
            .camera_from_world
            .rotation
            .slerp(b.camera_from_world.rotation, t);
        let c = a.center().lerp(b.center(), t);
        View {
            camera_from_world: Rigid3::new(q, -(q * c)),
            ..a.clone()
        }
    };
    let n = lg.sources.len();
    let mut desired = vec![
        ("source".to_string(), lg.sources[n / 2].view.clone()),
        ("mid".into(), mid(a, b, 0.5)),
        ("1%".into(), mid(a, b, 0.01)),
        (
            "mid2".into(),
            mid(&lg.sources[n / 2].view, &lg.sources[n / 2 + 1].view, 0.5),
        ),
        (
            "1%2".into(),
            mid(&lg.sources[n / 2].view, &lg.sources[n / 2 + 1].view, 0.01),
        ),
    ];
    let pin = View {
        lens: Lens::pinhole(
            a.lens.focal * (960.0 / a.width as f64),
            glam::DVec2::new(480.0, 360.0),
        ),
        width: 960,
        height: 720,
        camera_from_world: desired[1].1.camera_from_world,
    };
    desired.push(("pinhole 960x720".into(), pin));
    let mut gpu = render::gpu::Gpu::open().unwrap();
    println!("{} software {}", gpu.description(), gpu.is_software());
    let full = args.get(3).is_some();
    for (name, view) in &desired {
        let frame = Frame::new(&lg, view.clone(), FieldOptions::default());
        let cpu = |f: &mut dyn FnMut() -> image::RgbaImage| {
            let w = Instant::now();
            let t = cpu_time::ProcessTime::now();
            let im = f();
            (
                im,
                t.elapsed().as_secs_f64() * 1e3,
                w.elapsed().as_secs_f64() * 1e3,
            )
        };
        render::cpu::render(&frame, Method::Exact).unwrap();
        let (exact, te, we) = cpu(&mut || render::cpu::render(&frame, Method::Exact).unwrap());
        let (tri, tt, wt) = cpu(&mut || render::cpu::render(&frame, Method::TRIANGULATED).unwrap());
        let (_, tf, wf) = cpu(&mut || {
            for _ in 0..10 {
                TriangulatedField::new(&frame, 32).unwrap();
            }
            image::RgbaImage::new(1, 1)
        });
        gpu.render(&frame, Method::TRIANGULATED).unwrap();
        let (gt, tg, wg) = cpu(&mut || gpu.render(&frame, Method::TRIANGULATED).unwrap());
        let (ge, tge, wge) = cpu(&mut || gpu.render(&frame, Method::Exact).unwrap());
        println!(
            "{name}: cpu exact {te:.0}/{we:.0} ms, tri {tt:.0}/{wt:.0}, field {:.1}/{:.1}, gpu tri {tg:.0}/{wg:.0} exact {tge:.0}/{wge:.0}; tri~exact {:.1} dB, gpu tri~tri {:.1}, gpu exact~exact {:.1} dB in2 {:.5}",
            tf / 10.0,
            wf / 10.0,
            psnr(&exact, &tri),
            psnr(&gt, &tri),
            psnr(&ge, &exact),
            within2(&ge, &exact)
        );
        if full {
            let (r, tr, wr) = cpu(&mut || render::reference::render_exact(&frame).unwrap());
            let f = TriangulatedField::new(&frame, 32).unwrap();
            let rt = render::field::render_reference(&frame, &f).unwrap();
            println!(
                "   reference {tr:.0}/{wr:.0}: cpu~ref {:.1} in2 {:.5}; gpu~ref in2 {:.5}; tri cpu~ref {:.1} in2 {:.5}",
                psnr(&exact, &r),
                within2(&exact, &r),
                within2(&ge, &r),
                psnr(&tri, &rt),
                within2(&tri, &rt)
            );
        }
        if name == "source" {
            let p = &lg.photos.get(n / 2).unwrap().levels[0];
            println!(
                "   photo: exact {:.1} tri {:.1} gpu {:.1} {:.1}",
                psnr(p, &exact),
                psnr(p, &tri),
                psnr(p, &gt),
                psnr(p, &ge)
            );
        }
        if let Some(out) = args.get(4) {
            exact
                .save(format!("{out}/{name}-exact.png").replace('%', ""))
                .unwrap();
            tri.save(format!("{out}/{name}-tri.png").replace('%', ""))
                .unwrap();
            ge.save(format!("{out}/{name}-gpue.png").replace('%', ""))
                .unwrap();
        }
    }
    println!("decoded {} of {}", lg.photos.decoded(), lg.photos.len());
}
