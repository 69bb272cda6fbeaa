//! `lumigraph proxy`

use super::Usage;
use super::damaged::leave_out;
use super::exposure::ExposureArgs;
use super::inputs::files_behind_scene;
use super::options::{HoldOutArgs, SceneArgs, triple};
use super::output::{make_parent, print, say};
use super::surface::{fit, proxy_text};
use super::targets::{check_apart, check_file, check_file_in_no_part, check_scene_folder};
use ::proxy::mesh::Coarse;
use ::proxy::{FileError, Form, MeshKind, Plane, Proxy, Solid, mesh, plane_focused_on};
use anyhow::{Context, bail};
use calibrate::{Pixel, View};
use clap::ValueEnum;
use clap::builder::PossibleValue;
use glam::{DMat4, DVec3};
use lumigraph::scene::{Kind as Fit, Scene, SceneError};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Fit the surface that carries rays to the photos, or give it by hand
///
/// Without -o it becomes the scene's own. A .json file (.ply for meshes) holds it exactly; a
/// .glb can be looked at elsewhere, with the cameras, and read back. What `auto` chooses goes
/// beside FILE where such a file cannot hold it.
///
///     lumigraph proxy my-scene auto
///     lumigraph proxy my-scene carved -o carved.glb
///     lumigraph proxy my-scene plane --point 0,0,4 --normal 0,-0.1,1
///     lumigraph proxy my-scene plane --through 0,0,4 --through 1,0,4 --through 0,1,5
///     lumigraph proxy my-scene plane --focus a.jpg:320,240
///     lumigraph proxy my-scene mesh house.obj
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// What kind of surface
    #[arg(value_enum)]
    kind: Kind,
    /// For `mesh`: the file, .glb, .gltf, .ply or .obj
    mesh: Option<PathBuf>,
    /// For `mesh`: what takes its coordinates to the scene's, 16 numbers row by row
    #[arg(long, value_name = "M11,M12,…", value_parser = matrix, allow_hyphen_values = true)]
    transform: Option<DMat4>,
    /// A point on the plane, in the world
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, requires = "normal",
        allow_hyphen_values = true)]
    point: Option<DVec3>,
    /// The plane's normal, of any length
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, requires = "point",
        conflicts_with_all = ["through", "focus"], allow_hyphen_values = true)]
    normal: Option<DVec3>,
    /// One of three points on the plane, in the world
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true,
        conflicts_with = "point")]
    through: Vec<DVec3>,
    /// A photo and a pixel of it: the plane parallel to the photo through what shows there
    #[arg(long, value_name = "PHOTO:X,Y", conflicts_with_all = ["point", "through"])]
    focus: Option<String>,
    #[command(flatten)]
    hold_out: HoldOutArgs,
    /// A file to write it to, .json, .ply or .glb
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// What the command line calls kinds: those that are fitted, a choice of them, and a file.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Auto,
    Fitted(Fit),
    Mesh,
}

impl ValueEnum for Kind {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [Kind; Fit::ALL.len() + 2] = {
            let mut all = [Kind::Auto; Fit::ALL.len() + 2];
            let mut i = 0;
            while i < Fit::ALL.len() {
                all[i + 1] = Kind::Fitted(Fit::ALL[i]);
                i += 1;
            }
            all[i + 1] = Kind::Mesh;
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, help) = match self {
            Self::Auto => (
                "auto",
                "The one of those below that shows best what photos left out for it show",
            ),
            Self::Mesh => ("mesh", "A mesh from elsewhere"),
            Self::Fitted(fit) => (fit.name(), about(*fit)),
        };
        Some(PossibleValue::new(name).help(help))
    }
}

fn about(fit: Fit) -> &'static str {
    match fit {
        Fit::Plane => "Parallel to the image planes, at the points' mean inverse depth",
        Fit::DominantPlane => "The plane that most sparse points lie on",
        Fit::ViewPlane => {
            "A plane through what each view sees of the points, fitted anew for each; equal rays \
             no longer meet equal points"
        }
        Fit::Tunnel => "A box around the way through a hallway",
        Fit::Hull => "What the photos' silhouettes leave of space",
        Fit::Points => {
            "The sparse points that views like the desired one observe, triangulated anew for \
             every view"
        }
        Fit::Carved => "A closed mesh of the sparse points, free space carved away",
        Fit::CarvedDense => "The same of the points that photos agree on between them, too",
        Fit::Depth => "The photos' depth maps, fused",
        Fit::Dense => "The sparse points, and those that photos agree on between them",
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    check(args)?;
    let mut scene = args.scene.open()?;
    if args.output.is_none() && scene.folder.is_none() {
        return Err(Usage(format!(
            "{} is a capture, not a scene that could keep the proxy; give a file with -o, or \
             `import` the capture first",
            args.scene.scene.display()
        ))
        .into());
    }
    if let Some(file) = &args.output {
        check_written(args.kind, file)?;
        check_file(file, "-o")?;
        let mut inputs = files_behind_scene(&args.scene.scene, &scene);
        let named = [&args.mesh, &args.hold_out.hold_out].into_iter();
        inputs.extend(named.flatten().cloned());
        check_apart("the proxy is", "-o", [file.as_path()], &inputs)?;
        check_file_in_no_part(file, "-o")?;
    } else if let Some(folder) = &scene.folder {
        check_scene_folder(folder)?;
    }
    let without = args.hold_out.names(&scene)?;
    let (proxy, how, fitted_without) = match by_hand(args, &scene, &without)? {
        Some((proxy, how)) => (proxy, how, None),
        None => {
            let kind = match args.kind {
                Kind::Fitted(kind) => Some(kind),
                Kind::Auto | Kind::Mesh => None,
            };
            if matches!(kind, Some(Fit::Points | Fit::ViewPlane)) && !without.is_empty() {
                say!(
                    "note: --hold-out changes nothing: such a surface is made anew for each view, of the photos that it is drawn of"
                );
            }
            let mut fewer = without.clone();
            if kind.is_none() {
                // Kinds are compared by what is drawn, which is exposed alike.
                let exposure = ExposureArgs::default().choose(&mut scene, &without);
                leave_out(&scene, &exposure.left_out, &mut fewer, args.scene.strict)?;
            }
            let fitted = fit(&scene, kind, &fewer, args.scene.strict)?;
            (fitted.proxy, fitted.how, Some(&without))
        }
    };
    let file = match &args.output {
        Some(file) => {
            let file = &match args.kind {
                Kind::Auto => file_for(file, &proxy),
                Kind::Fitted(_) | Kind::Mesh => file.clone(),
            };
            let points = scene.reconstruction.points.values();
            let shown: Vec<DVec3> = points.map(|p| p.position).collect();
            make_parent(file)?;
            // Other files hold none.
            let cameras = match is_to_be_looked_at(file) {
                true => cameras(&scene)?,
                false => Vec::new(),
            };
            ::proxy::write(file, &proxy, &shown, &cameras)?;
            file.clone()
        }
        None => scene.set_proxy(proxy.clone(), fitted_without)?,
    };
    print(&format!(
        "{}: {}, {how}\n",
        file.display(),
        proxy_text(&proxy)
    ))
}

/// Whether a kind can be written to a file of that name, before it takes minutes to fit.
fn check_written(kind: Kind, file: &Path) -> Result<(), FileError> {
    match kind {
        Kind::Fitted(fit) => fit.form().check(file, fit.name()),
        Kind::Mesh => Form::Mesh.check(file, "mesh"),
        // Of those that may be chosen some can.
        Kind::Auto => match Form::Plane.check(file, "plane") {
            Err(error @ FileError::Extension(_)) => Err(error),
            _ => Ok(()),
        },
    }
}

/// Where what was chosen among all kinds is written: to the file that was asked for, or beside it where such files
/// cannot hold it, so that the choice is not lost. Nothing that is there is written over unasked: of `p.ply`, `p_2.ply`
/// and so on the first that is free is taken.
fn file_for(file: &Path, proxy: &Proxy) -> PathBuf {
    let form = Form::of(proxy);
    let Err(error) = form.check(file, proxy.kind()) else {
        return file.to_owned();
    };
    let named = |i: u32| {
        let mut name = file.file_stem().unwrap_or_default().to_owned();
        if i > 1 {
            name.push(format!("_{i}"));
        }
        name.push(format!(".{}", form.exact_extension()));
        file.with_file_name(name)
    };
    let free = (1..).map(named).find(|beside| !beside.exists());
    let beside = free.unwrap_or_else(|| named(1));
    say!("note: {error}; it goes to {}", beside.display());
    beside
}

/// Options that belong to other kinds of surface.
fn check(args: &Args) -> Result<(), Usage> {
    let plane = args.point.is_some() || !args.through.is_empty() || args.focus.is_some();
    let message = if plane && args.kind != Kind::Fitted(Fit::Plane) {
        "--point, --normal, --through and --focus describe a plane; write `plane`"
    } else if args.kind == Kind::Mesh && args.mesh.is_none() {
        "give the mesh's file: `lumigraph proxy SCENE mesh FILE`"
    } else if args.kind != Kind::Mesh && (args.mesh.is_some() || args.transform.is_some()) {
        "a file and --transform belong to the kind `mesh`"
    } else if !args.through.is_empty() && args.through.len() != 3 {
        "--through takes three points: write it three times"
    } else {
        return Ok(());
    };
    Err(Usage(message.to_owned()))
}

/// What is given rather than fitted, and how.
fn by_hand(
    args: &Args,
    scene: &Scene,
    without: &BTreeSet<String>,
) -> anyhow::Result<Option<(Proxy, String)>> {
    let given = |plane| Some((Proxy::Plane(plane), "given by hand".to_owned()));
    if let (Some(point), Some(normal)) = (args.point, args.normal) {
        return Ok(given(
            Plane::new(point, normal).map_err(|e| Usage(e.to_string()))?,
        ));
    }
    if let [a, b, c] = args.through[..] {
        return Ok(given(
            Plane::through([a, b, c]).map_err(|e| Usage(e.to_string()))?,
        ));
    }
    if let Some(focus) = &args.focus {
        let (name, pixel) = focused(focus)?;
        let name = scene.name_here(name);
        let view = scene.view(&name)?;
        // Which leaves it no points.
        if let Some(split) = &args.hold_out.hold_out
            && without.contains(&name)
        {
            bail!(
                "cannot focus on {focus}: {name} is held out by {}; focus on another photo",
                split.display()
            );
        }
        let rest = scene.reconstruction.without_images(without);
        let id = rest.images.iter().find(|(_, image)| image.name == name);
        let seen = rest.points.values().filter(|p| {
            let mut track = p.track.iter();
            id.is_some_and(|(id, _)| track.any(|(image, _)| image == id))
        });
        let seen: Vec<DVec3> = seen.map(|p| p.position).collect();
        let plane = plane_focused_on(&view, pixel, &seen)
            .with_context(|| format!("cannot focus on {focus}"))?;
        return Ok(Some((Proxy::Plane(plane), format!("focused on {focus}"))));
    }
    if let Some(file) = &args.mesh {
        let mut mesh = mesh::read(file)?;
        let coarse = Coarse::of(&mesh);
        if let Some(coarse) = &coarse {
            say!(
                "warning: {}: {coarse}, and give --transform",
                file.display()
            );
        }
        if let Some(transform) = &args.transform {
            mesh.transform(transform);
        }
        let views = scene.views(&scene.names())?;
        let solid = Solid::new(MeshKind::Mesh, mesh);
        let share = mesh::lies_where_cameras_look(&solid, &views);
        if share < LEAST_SEEN && coarse.is_none() {
            say!(
                "warning: only {:.1} % of what the photos look at meets the mesh; give \
                 --transform if its axes or units are not the scene's",
                100.0 * share
            );
        }
        let how = format!(
            "from {}; {:.1} % of what the photos look at meets it",
            file.display(),
            100.0 * share
        );
        return Ok(Some((Proxy::Mesh(Arc::new(solid)), how)));
    }
    Ok(None)
}

/// A mesh that fewer rays than this share meet probably lies elsewhere.
const LEAST_SEEN: f64 = 0.2;

/// Whether a proxy's file is one that shows the cameras, too.
fn is_to_be_looked_at(file: &Path) -> bool {
    let extension = file.extension();
    extension.is_some_and(|extension| extension.eq_ignore_ascii_case("glb"))
}

/// The photos' cameras, by name.
fn cameras(scene: &Scene) -> Result<Vec<(String, View)>, SceneError> {
    let names = scene.names();
    let views = scene.views(&names)?;
    Ok(names.into_iter().zip(views).collect())
}

/// A photo's name and a pixel of it.
fn focused(text: &str) -> Result<(&str, Pixel), Usage> {
    let parsed = || {
        let (name, at) = text.rsplit_once(':')?;
        let (x, y) = at.split_once(',')?;
        Some((
            name,
            Pixel::new(x.trim().parse().ok()?, y.trim().parse().ok()?),
        ))
    };
    parsed().ok_or_else(|| {
        Usage(format!(
            "--focus {text}: expected PHOTO:X,Y, as a.jpg:320,240"
        ))
    })
}

fn matrix(text: &str) -> Result<DMat4, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    let numbers = numbers.map_err(|e| format!("{e}; expected 16 numbers, row by row"))?;
    let rows: [f64; 16] = numbers
        .try_into()
        .map_err(|n: Vec<f64>| format!("{} numbers; expected 16, row by row", n.len()))?;
    let matrix = DMat4::from_cols_array(&rows).transpose();
    if !matrix.is_finite() || matrix.determinant() == 0.0 {
        return Err("it flattens space; expected an invertible matrix".to_owned());
    }
    let (column, last) = ([rows[3], rows[7], rows[11]], &rows[12..]);
    if last != [0.0, 0.0, 0.0, 1.0] {
        let is_transposed = column == [0.0; 3] && last[3] == 1.0;
        let remedy = match is_transposed {
            true => "it seems to be column by column: transpose it",
            false => "expected 16 numbers, row by row, that move, turn, scale or shear",
        };
        return Err(format!(
            "its last row is {last:?}, not 0, 0, 0, 1; {remedy}"
        ));
    }
    Ok(matrix)
}
