//! Time and memory to carve: `cargo bench -p proxy --bench carve`; see README.md.

use cpu_time::ProcessTime;
use proxy::carve;
use std::time::Instant;

#[path = "../proxy/tests/surfaces/room/mod.rs"]
#[allow(dead_code, unreachable_pub)]
mod room;

fn main() {
    println!("points     photos  lines of sight    facets   wall s    CPU s   peak MB");
    for (points, photos) in [(10_000, 50), (1_000_000, 50)] {
        let room = room::Room::new(photos);
        let sparse = room.points(points, 0.005, &mut room::Random(7));
        let lines: usize = sparse.iter().map(|p| p.seen_by.len()).sum();
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        let surface = carve::surface(&room.views, &sparse, &carve::Options::default())
            .expect("a room can be carved");
        println!(
            "{points:<11}{photos:<8}{lines:>14}{:>10}{:>9.1}{:>9.1}{:>10}",
            surface.mesh.triangles.len(),
            wall.elapsed().as_secs_f64(),
            cpu.elapsed().as_secs_f64(),
            peak_mb().map_or("?".into(), |mb| mb.to_string()),
        );
    }
}

/// The most memory that this process has held so far, the points included.
fn peak_mb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kb: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kb / 1024)
}
