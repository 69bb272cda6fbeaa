//! A thousand photos within a gigabyte: `cargo bench --bench many_photos`; see README.md.
//!
//! Photos of 1920 × 1440 along a way before a wall, and `lumigraph render` along it on each
//! engine, with budgets; what matters is the most memory that the process ever held.

use clap::Parser;
use image::{ImageEncoder, RgbImage, codecs::jpeg::JpegEncoder};
use serde_json::{Value, json};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

/// Renders a long path with memory budgets.
#[derive(Parser)]
struct Args {
    /// How many photos
    #[arg(long, default_value_t = 1000)]
    photos: usize,
    /// Frames along the way
    #[arg(long, default_value_t = 20)]
    frames: usize,
    /// For photos in memory, and the same again on the device
    #[arg(long, default_value = "1GiB")]
    memory: String,
    /// What draws
    #[arg(long, value_delimiter = ',', default_value = "cpu,gpu")]
    devices: Vec<String>,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

const SIZE: (u32, u32) = (1920, 1440);
const FOCAL: f64 = 1600.0;
/// From one photo to the next, and from all of them to the wall.
const STEP: f64 = 0.02;
const DISTANCE: f64 = 4.0;
/// The wall repeats itself after so many steps, so that no more photos are different files.
const DIFFERENT: usize = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let folder = tempfile::tempdir()?;
    let bytes = write_capture(folder.path(), args.photos)?;
    println!(
        "{} photos of {} × {}, {:.0} MB as files, {:.1} GB decoded with their mip levels",
        args.photos,
        SIZE.0,
        SIZE.1,
        bytes as f64 / 1e6,
        args.photos as f64 * render::photo_bytes([SIZE.0, SIZE.1], 0) as f64 / 1e9
    );
    let path = folder.path().join("path.json");
    std::fs::write(&path, path_file(&args).to_string())?;
    println!(
        "\n| device | s | CPU s | peak memory, MB | photos, MB | device, MB | a frame | loads | let go | level |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for device in &args.devices {
        let ran = Command::new(env!("CARGO_BIN_EXE_lumigraph"))
            .arg("render")
            .arg(folder.path())
            .args(["--proxy", "plane", "--no-exposure", "--json", "--path"])
            .arg(&path)
            .args(["--device", device])
            .args(["--cpu-memory", &args.memory, "--gpu-memory", &args.memory])
            .arg("-o")
            .arg(folder.path().join(device))
            .output()?;
        if !ran.status.success() {
            eprintln!("{device}: {}", String::from_utf8_lossy(&ran.stderr));
            continue;
        }
        let ran: Value = serde_json::from_slice(&ran.stdout)?;
        println!("{}", row(&ran["report"]));
    }
    Ok(())
}

fn row(report: &Value) -> String {
    let mb = |value: &Value| {
        value
            .as_f64()
            .map_or("–".to_owned(), |b| format!("{:.0}", b / 1e6))
    };
    let (cpu, gpu) = (&report["cpu_memory"], &report["gpu_memory"]);
    let more = |key: &str| cpu[key].as_u64().max(gpu[key].as_u64()).unwrap_or_default();
    format!(
        "| {} | {:.0} | {:.0} | {} | {} | {} | {} | {} | {} | {} |",
        report["device"].as_str().unwrap_or_default(),
        report["seconds"].as_f64().unwrap_or_default(),
        report["cpu_seconds"].as_f64().unwrap_or_default(),
        mb(&report["peak_memory_bytes"]),
        mb(&cpu["peak_bytes"]),
        mb(&gpu["peak_bytes"]),
        report["photos_used_per_frame"],
        cpu["loads"],
        cpu["evictions"],
        more("level_cap"),
    )
}

/// Along the photos, nearer to them and farther away, and in the end so far that no budget of a
/// gigabyte holds what the view shows in full.
fn path_file(args: &Args) -> Value {
    let frame = |i: usize| {
        let part = i as f64 / (args.frames - 1).max(1) as f64;
        let x = (0.1 + 0.8 * part) * args.photos as f64 * STEP;
        let back = match i + 1 == args.frames {
            true => 4.0,
            false => 0.5 - 0.4 * (12.0 * part).cos(),
        };
        let [width, height, focal] = [960.0, 720.0, 800.0];
        json!({
            "camera_from_world": [1, 0, 0, -x, 0, 1, 0, 0, 0, 0, 1, back, 0, 0, 0, 1],
            "width": width as u32, "height": height as u32, "model": "SIMPLE_PINHOLE",
            "params": [focal, 0.5 * width, 0.5 * height],
        })
    };
    let frames: Vec<Value> = (0..args.frames).map(frame).collect();
    json!({"version": 1, "fps": 30, "frames": frames})
}

/// Photos and a COLMAP text model; how many bytes the photos have, names of the same file counted
/// each.
fn write_capture(folder: &Path, count: usize) -> Result<u64, Box<dyn Error>> {
    let images = folder.join("images");
    let model = folder.join("sparse/0");
    std::fs::create_dir_all(&images)?;
    std::fs::create_dir_all(&model)?;
    let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
    let (cx, cy) = (0.5 * width, 0.5 * height);
    std::fs::write(
        model.join("cameras.txt"),
        format!("1 SIMPLE_PINHOLE {width} {height} {FOCAL} {cx} {cy}\n"),
    )?;
    let (mut of_images, mut points) = (String::new(), String::new());
    let mut bytes = 0;
    let name = |i: usize| images.join(format!("{i:04}.jpg"));
    for i in 0..count {
        let x = i as f64 * STEP;
        if i < DIFFERENT {
            write_photo(&name(i), x)?;
        } else {
            std::fs::hard_link(name(i % DIFFERENT), name(i))?;
        }
        bytes += std::fs::metadata(name(i))?.len();
        // A point before each photo, which the next has, too.
        let shift = STEP / DISTANCE * FOCAL;
        let mut seen = format!("{cx} {cy} {}", i + 1);
        if i > 0 {
            write!(seen, " {} {cy} {i}", cx - shift)?;
        }
        writeln!(
            of_images,
            "{} 1 0 0 0 {} 0 0 1 {i:04}.jpg\n{seen}",
            i + 1,
            -x
        )?;
        let track = match i + 1 < count {
            true => format!(" {} 1", i + 2),
            false => String::new(),
        };
        writeln!(
            points,
            "{} {x} 0 {DISTANCE} 128 128 128 0.5 {} 0{track}",
            i + 1,
            i + 1
        )?;
    }
    std::fs::write(model.join("images.txt"), of_images)?;
    std::fs::write(model.join("points3D.txt"), points)?;
    Ok(bytes)
}

/// What a camera at x sees of the wall: waves of several lengths, all of which fit the wall's
/// period.
fn write_photo(path: &Path, x: f64) -> Result<(), Box<dyn Error>> {
    let turns = std::f64::consts::TAU / (STEP * DIFFERENT as f64);
    let (width, height) = SIZE;
    let scale = DISTANCE / FOCAL;
    let columns: Vec<[f64; 3]> = (0..width)
        .map(|u| {
            let at = turns * (x + (f64::from(u) + 0.5 - 0.5 * f64::from(width)) * scale);
            [3.0, 17.0, 41.0].map(|k| (k * at).sin())
        })
        .collect();
    let mut photo = RgbImage::new(width, height);
    for (v, row) in photo.enumerate_rows_mut() {
        let at = turns * (f64::from(v) * scale);
        let of_row = [5.0, 13.0, 37.0].map(|k| (k * at).cos());
        for ((_, _, pixel), of_column) in row.zip(&columns) {
            pixel.0 = std::array::from_fn(|c| {
                let both = of_column[c] * of_row[c] + 0.5 * of_column[(c + 1) % 3];
                (128.0 + 70.0 * both) as u8
            });
        }
    }
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    JpegEncoder::new_with_quality(file, 60).write_image(
        &photo,
        width,
        height,
        image::ExtendedColorType::Rgb8,
    )?;
    Ok(())
}
