//! How far the triangulated field is from the exact one: `cargo bench --bench field_error
//! [-- CAPTURE…]`; see README.md.

mod common;

use calibrate::Pixel;
use clap::Parser;
use common::{generate, on_the_way};
use image::{Rgba, RgbaImage};
use lumigraph::scene::{Kind, Scene};
use render::blend::Contributor;
use render::cpu::Cpu;
use render::reference::blend_at;
use render::score::score;
use render::{FieldOptions, Frame, Method, Surface, TriangulatedField};
use serde::Serialize;
use std::collections::BTreeSet;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

/// Compares the triangulated picture with the exact one, and their weights.
#[derive(Parser)]
struct Args {
    /// Captures, or scenes written by `lumigraph import` [default: synthetic scenes]
    captures: Vec<PathBuf>,
    /// Kinds of proxy
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "plane,tunnel,points,carved"
    )]
    kinds: Vec<String>,
    /// Pairs of consecutive photos, spread over the capture
    #[arg(long, default_value_t = 3)]
    pairs: usize,
    /// Pixels along the longer side of the pictures
    #[arg(long, default_value_t = 960)]
    long_side: u32,
    /// Write all figures, a frame at a time
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write both pictures of each frame and their difference, eight times as strong
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

/// Drawn where no capture is given.
const SYNTHETIC: [&str; 3] = ["shelf", "hallway", "wall"];
/// Of the synthetic photos.
const SIZE: (u32, u32) = (1000, 750);
/// Weights are compared at every eighth pixel, across and down.
const STEP: usize = 8;
/// Parts of the way from a pair's first photo to its second.
const SHARES: [(&str, f64); 2] = [("midway", 0.5), ("1 %", 0.01)];
/// Pixels around what was moved to where a photo has it that `unmoved_db` leaves out.
const AROUND: u32 = 8;

/// One desired view.
#[derive(Clone, Debug, Serialize)]
struct FrameError {
    scene: String,
    kind: String,
    /// The pair's first photo.
    photo: String,
    at: &'static str,
    /// Of the triangulated picture against the exact one, colours on black.
    psnr_db: f64,
    /// The same without what lies near anything moved into a photo's sight.
    unmoved_db: f64,
    /// The mean over pixels of half the sum of the weights' absolute differences.
    weights: f64,
    /// The share of pixels whose alpha differs by more than 2/255.
    coverage: f64,
    /// The share of pixels that look at something moved into a photo's sight.
    moved: f64,
    /// Triangles of the field, and those that some border crosses.
    triangles: usize,
    bordered: usize,
}

fn main() -> ExitCode {
    let args = Args::parse();
    match run(&args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all captures could be measured.
fn run(args: &Args) -> Result<bool, Box<dyn Error>> {
    let kinds: Vec<Kind> = args
        .kinds
        .iter()
        .map(|name| Kind::from_name(name).ok_or(format!("no kind of proxy: {name}")))
        .collect::<Result<_, _>>()?;
    if let Some(folder) = &args.pictures {
        std::fs::create_dir_all(folder)?;
    }
    let mut errors = Vec::new();
    let mut complete = true;
    println!("| scene | proxy | midway, dB | 1 %, dB | unmoved, dB | weights, % | coverage, % |");
    println!("|---|---|---|---|---|---|---|");
    let synthetic = tempfile::tempdir()?;
    let folders = if args.captures.is_empty() {
        SYNTHETIC
            .iter()
            .map(|name| generate(name, SIZE, None, synthetic.path()))
            .collect::<Result<_, _>>()?
    } else {
        args.captures.clone()
    };
    for folder in &folders {
        let name = folder.file_name().unwrap_or(folder.as_os_str());
        let name = name.to_string_lossy();
        let scene = match Scene::open(folder, false) {
            Ok((scene, _)) => scene,
            Err(error) => {
                eprintln!("{name}: {error}");
                complete = false;
                continue;
            }
        };
        for &kind in &kinds {
            match measure(&name, &scene, kind, args) {
                Ok(frames) => {
                    println!("{}", row(&frames));
                    errors.extend(frames);
                }
                // A tunnel does not fit everywhere.
                Err(error) => eprintln!("{name}, {}: {error}", kind.name()),
            }
        }
    }
    if let Some(file) = &args.json {
        std::fs::write(file, serde_json::to_string_pretty(&errors)?)?;
    }
    Ok(complete)
}

/// A scene and kind in a line: the worst dB of its frames, the mean of everything else.
fn row(frames: &[FrameError]) -> String {
    let worst = |which: &str, of: fn(&FrameError) -> f64| {
        let those = frames.iter().filter(|f| f.at == which || which.is_empty());
        those.map(of).fold(f64::INFINITY, f64::min)
    };
    let mean = |of: fn(&FrameError) -> f64| {
        100.0 * frames.iter().map(of).sum::<f64>() / frames.len() as f64
    };
    format!(
        "| {} | {} | {:.1} | {:.1} | {:.1} | {:.2} | {:.2} |",
        frames[0].scene,
        frames[0].kind,
        worst(SHARES[0].0, |f| f.psnr_db),
        worst(SHARES[1].0, |f| f.psnr_db),
        worst("", |f| f.unmoved_db),
        mean(|f| f.weights),
        mean(|f| f.coverage),
    )
}

fn measure(
    name: &str,
    scene: &Scene,
    kind: Kind,
    args: &Args,
) -> Result<Vec<FrameError>, Box<dyn Error>> {
    let all = BTreeSet::new();
    let lumigraph = scene.lumigraph(&all, scene.fit(kind, &all)?.proxy)?;
    let steps = lumigraph.sources.len().saturating_sub(1);
    if steps == 0 || args.pairs == 0 {
        return Err("no pair of photos".into());
    }
    let pairs: BTreeSet<usize> = (0..args.pairs)
        .map(|i| (2 * i + 1) * steps / (2 * args.pairs))
        .collect();
    let mut cpu = Cpu::default();
    let mut errors = Vec::new();
    for &pair in &pairs {
        for (at, share) in SHARES {
            let desired = on_the_way(&lumigraph, pair, share, args.long_side);
            let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
            let exact = cpu.render(&frame, Method::Exact)?;
            let triangulated = cpu.render(&frame, Method::TRIANGULATED)?;
            if let Some(folder) = &args.pictures {
                let stem = format!("{name}-{}-{pair}-{share}", kind.name());
                let save = |picture: &RgbaImage, what: &str| {
                    picture.save(folder.join(format!("{stem}-{what}.png")))
                };
                save(&exact, "exact")?;
                save(&triangulated, "triangulated")?;
                save(&difference(&exact, &triangulated), "difference")?;
            }
            let field = field_of(&frame)?;
            let (unmoved, moved) = unmoved(&frame, &exact, &triangulated);
            errors.push(FrameError {
                scene: name.to_owned(),
                kind: kind.name().to_owned(),
                photo: lumigraph.sources[pair].name.clone(),
                at,
                psnr_db: score(&triangulated, &exact)?.psnr.min(99.0),
                unmoved_db: score(&unmoved, &exact)?.psnr.min(99.0),
                weights: weight_error(&frame, &field),
                coverage: coverage_error(&exact, &triangulated),
                moved,
                triangles: field.triangles.len(),
                bordered: field.triangles.iter().filter(|t| t.bordered).count(),
            });
        }
    }
    Ok(errors)
}

fn field_of(frame: &Frame<'_>) -> Result<TriangulatedField, Box<dyn Error>> {
    let Method::Triangulated { cells_across } = Method::TRIANGULATED else {
        return Err("not triangulated".into());
    };
    Ok(TriangulatedField::new(frame, cells_across)?)
}

/// The mean over pixels that any photo paints in either field of how much of the weight went
/// elsewhere.
fn weight_error(frame: &Frame<'_>, field: &TriangulatedField) -> f64 {
    let width = frame.desired.width as usize;
    let contributors = field.contributors(frame);
    let (mut sum, mut count) = (0.0, 0_u32);
    for (i, interpolated) in contributors.iter().enumerate() {
        let (x, y) = (i % width, i / width);
        if x % STEP != STEP / 2 || y % STEP != STEP / 2 {
            continue;
        }
        let point = frame.proxy_point(Pixel::center_of(x as u32, y as u32));
        let exact = point.map_or_else(Vec::new, |point| blend_at(frame, &point));
        if exact.is_empty() && interpolated.is_empty() {
            continue;
        }
        let mut difference = vec![0.0; frame.sources.len()];
        let mut add = |of: &[Contributor], sign: f64| {
            of.iter()
                .for_each(|c| difference[c.source_idx] += sign * c.weight);
        };
        add(&exact, 1.0);
        add(interpolated, -1.0);
        sum += 0.5 * difference.iter().map(|d| d.abs()).sum::<f64>();
        count += 1;
    }
    sum / f64::from(count.max(1))
}

/// The share of pixels that one picture covers otherwise than the other.
fn coverage_error(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let differing = a
        .pixels()
        .zip(b.pixels())
        .filter(|(p, q)| p.0[3].abs_diff(q.0[3]) > 2)
        .count();
    differing as f64 / f64::from(a.width() * a.height())
}

/// The triangulated picture with the exact one's pixels near what was moved into a photo's
/// sight, where the surface jumps; and the share of pixels moved.
fn unmoved(frame: &Frame<'_>, exact: &RgbaImage, triangulated: &RgbaImage) -> (RgbaImage, f64) {
    let mut picture = triangulated.clone();
    let (width, height) = picture.dimensions();
    let mut count = 0_u32;
    if let Surface::Facets(map) = &frame.surface {
        for (i, _) in map.moved().enumerate().filter(|(_, moved)| *moved) {
            count += 1;
            let (x, y) = (i as u32 % width, i as u32 / width);
            for y in y.saturating_sub(AROUND)..(y + AROUND + 1).min(height) {
                for x in x.saturating_sub(AROUND)..(x + AROUND + 1).min(width) {
                    picture.put_pixel(x, y, *exact.get_pixel(x, y));
                }
            }
        }
    }
    (picture, f64::from(count) / f64::from(width * height))
}

/// Eight times the absolute difference of colours; white where coverage differs.
fn difference(a: &RgbaImage, b: &RgbaImage) -> RgbaImage {
    RgbaImage::from_fn(a.width(), a.height(), |x, y| {
        let (p, q) = (a.get_pixel(x, y).0, b.get_pixel(x, y).0);
        if p[3].abs_diff(q[3]) > 2 {
            return Rgba([255; 4]);
        }
        let of = |c: usize| p[c].abs_diff(q[c]).saturating_mul(8);
        Rgba([of(0), of(1), of(2), 255])
    })
}
