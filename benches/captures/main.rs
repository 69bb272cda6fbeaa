//! Held-out scores, capture by capture: `cargo bench --bench captures -- CAPTURE…`; see
//! README.md.

mod distances;
mod score;
mod table;

use clap::Parser;
use distances::Distances;
use lumigraph::scene::{ImportOptions, Kind, Scene, SceneError};
use score::Scored;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use table::{Figure, table};

/// Fits proxies to captures without their held-out photos, renders these and scores them.
#[derive(Parser)]
struct Args {
    /// Captures, or scenes written by `lumigraph import`
    #[arg(required = true)]
    captures: Vec<PathBuf>,
    /// Pixels along the longer side of the pictures; photos that have fewer keep theirs
    #[arg(long, default_value_t = 400)]
    long_side: u32,
    /// Kinds of proxy, and auto
    #[arg(long, value_delimiter = ',', value_parser = column, default_values_t = every_column())]
    kinds: Vec<Column>,
    /// Cut photos out along the mattes in this folder of a capture, where it has one
    #[arg(long, value_name = "NAME")]
    mattes: Option<PathBuf>,
    /// Also compare the proxies with the held-out photos' depth maps
    #[arg(long)]
    geometry: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

/// A kind of proxy, or the choice among them.
#[derive(Clone, Copy, PartialEq)]
struct Column(Option<Kind>);

impl std::fmt::Display for Column {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.map_or("auto", Kind::name))
    }
}

fn column(name: &str) -> Result<Column, String> {
    let known = every_column().into_iter().find(|c| c.to_string() == name);
    let names = || every_column().map(|c| c.to_string()).join(", ");
    known.ok_or_else(|| format!("no kind of proxy; there are: {}", names()))
}

fn every_column() -> [Column; 11] {
    let mut all = [Column(None); 11];
    for (column, kind) in all.iter_mut().zip(Kind::ALL) {
        column.0 = Some(kind);
    }
    all
}

/// What became of a capture.
struct Row {
    name: String,
    photos: usize,
    held_out: BTreeSet<String>,
    /// By column: the scores, or why there are none.
    scored: Vec<Result<Scored, String>>,
    distances: Vec<Option<Distances>>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let mut rows = Vec::new();
    for capture in &args.captures {
        match measure(capture, &args) {
            Ok(row) => rows.push(row),
            Err(error) => eprintln!("{}: {error}", capture.display()),
        }
    }
    if args.json {
        println!("{:#}", json(&args, &rows));
    } else {
        print(&args, &rows);
    }
    if rows.len() < args.captures.len() {
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// The tables, and what `auto` chose.
fn print(args: &Args, rows: &[Row]) {
    let columns: Vec<String> = args.kinds.iter().map(Column::to_string).collect();
    let figures = if args.geometry {
        [&Figure::SCORES[..], &Figure::DISTANCES].concat()
    } else {
        Figure::SCORES.to_vec()
    };
    for figure in figures {
        let cells: Vec<(&str, Vec<Option<f64>>)> = rows
            .iter()
            .map(|row| {
                let value = |i: usize| {
                    let scored = row.scored[i].as_ref().ok();
                    figure.of(scored, row.distances[i].as_ref())
                };
                (row.name.as_str(), (0..columns.len()).map(value).collect())
            })
            .collect();
        if let Some(text) = table(figure, &columns, &cells) {
            println!("{text}");
        }
    }
    for row in rows {
        let chosen = row.scored.iter().flatten().find_map(|s| s.chosen.as_ref());
        if let Some(chosen) = chosen {
            println!("{}: auto is {chosen}", row.name);
        }
    }
}

/// One capture, all columns.
fn measure(capture: &Path, args: &Args) -> Result<Row, SceneError> {
    let mut scene = open(capture, args.mattes.as_deref())?;
    // As the command line does.
    scene.drop_weak();
    scene.drop_misplaced();
    scene.drop_contradicted();
    let held_out = scene.held_out_by_default()?;
    // As `evaluate` does.
    if scene.folder.is_none() || !scene.exposure_is_without(&held_out) {
        scene.match_exposure(&held_out);
    }
    let truths = score::truths(&scene, &held_out, args.long_side)?;
    let depths = if args.geometry {
        distances::truths(&scene, &held_out)?
    } else {
        Vec::new()
    };
    let name = capture.file_name().unwrap_or(capture.as_os_str());
    let name = name.to_string_lossy().into_owned();
    let mut row = Row {
        photos: scene.photos.len(),
        scored: Vec::new(),
        distances: Vec::new(),
        held_out,
        name,
    };
    for column in &args.kinds {
        eprintln!("{}: {column}", row.name);
        let fitted = score::fit(&scene, column.0, &row.held_out);
        let scored = fitted.and_then(|fit| {
            let lumigraph = scene.lumigraph(&row.held_out, fit.fitted.proxy.clone())?;
            let distances = Distances::of(&lumigraph, &depths);
            Ok((score::score(&lumigraph, &fit, &truths)?, distances))
        });
        match scored {
            Ok((scored, distances)) => {
                row.scored.push(Ok(scored));
                row.distances.push(distances);
            }
            Err(error) => {
                row.scored.push(Err(error.to_string()));
                row.distances.push(None);
            }
        }
    }
    Ok(row)
}

fn open(capture: &Path, mattes: Option<&Path>) -> Result<Scene, SceneError> {
    let mattes = mattes.filter(|name| capture.join(name).is_dir());
    let (scene, warnings) = match mattes {
        Some(mattes) if !Scene::is_scene(capture) => {
            let options = ImportOptions {
                mattes: Some(mattes.to_owned()),
                ..ImportOptions::default()
            };
            Scene::import(capture, &options)?
        }
        _ => Scene::open(capture, false)?,
    };
    for warning in warnings {
        eprintln!("{}: {warning}", capture.display());
    }
    Ok(scene)
}

fn json(args: &Args, rows: &[Row]) -> Value {
    let kinds = |row: &Row| -> Value {
        let cells = row.scored.iter().zip(&row.distances);
        let cell = |(scored, distances): (&Result<Scored, String>, &Option<Distances>)| {
            let mut value = match scored {
                Ok(scored) => json!(scored),
                Err(reason) => json!({"not": reason}),
            };
            if let Some(distances) = distances {
                value["distances"] = json!(distances);
            }
            value
        };
        let names = args.kinds.iter().map(Column::to_string);
        names.zip(cells.map(cell)).collect()
    };
    let row = |row: &Row| {
        json!({
            "name": row.name,
            "photos": row.photos,
            "held_out": row.held_out,
            "kinds": kinds(row),
        })
    };
    json!({
        "long_side": args.long_side,
        "captures": rows.iter().map(row).collect::<Vec<_>>(),
    })
}
