//! The graphics device through the command line, where there is one.

use crate::run::{files, lumigraph, with_wall};

#[test]
fn the_gpu_draws_what_the_cpu_draws_and_again_the_same() {
    let folder = with_wall();
    for renderer in ["triangulated", "exact"] {
        let render = |device: &str, out: &str| {
            let line = format!(
                "render wall --proxy plane --path sweep --frames 3 --renderer {renderer} --device {device} \
                 -o {out}"
            );
            let ran = lumigraph(folder.path(), &line);
            (ran, folder.path().join(out))
        };
        let (ran, on_gpu) = render("gpu", &format!("{renderer}-gpu"));
        if ran.code == 1 && ran.stderr.contains("graphics device") {
            assert!(
                std::env::var_os("LUMIGRAPH_REQUIRE_GPU").is_none(),
                "a graphics device is required: {}",
                ran.stderr
            );
            eprintln!("SKIPPED: no graphics device: {}", ran.stderr);
            return;
        }
        ran.ok();
        let (ran, again) = render("gpu", &format!("{renderer}-again"));
        ran.ok();
        assert!(files(&on_gpu) == files(&again), "{renderer}");
        let (ran, on_cpu) = render("cpu", &format!("{renderer}-cpu"));
        ran.ok();
        let on_cpu = files(&on_cpu);
        for (name, bytes) in files(&on_gpu) {
            let open = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgba8();
            let (a, b) = (open(&bytes), open(&on_cpu[&name]));
            let far = |(p, q): &(&image::Rgba<u8>, &image::Rgba<u8>)| {
                (0..4).any(|c| p.0[c].abs_diff(q.0[c]) > 2)
            };
            let count = a.pixels().zip(b.pixels()).filter(far).count();
            assert!(
                count * 1000 <= 96 * 72,
                "{renderer} {}: {count}",
                name.display()
            );
        }
    }
}
