//! `lumigraph proxy`

use super::Usage;
use super::options::{HoldOutArgs, SceneArgs, triple};
use super::output::{make_parent, print};
use super::surface::{fit, proxy_text};
use ::proxy::{Plane, Proxy};
use clap::ValueEnum;
use glam::DVec3;
use std::path::PathBuf;

/// Fit the surface that carries rays to the photos, or give it by hand
///
/// Without -o it becomes the scene's own. A .json file holds it exactly; a .glb can be
/// looked at elsewhere, and read back.
///
///     lumigraph proxy my-scene plane
///     lumigraph proxy my-scene plane --point 0,0,4 --normal 0,-0.1,1 -o plane.glb
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// What kind of surface
    #[arg(value_enum)]
    kind: Kind,
    /// A point on the plane, in the world
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, requires = "normal",
        allow_hyphen_values = true)]
    point: Option<DVec3>,
    /// The plane's normal, of any length
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, requires = "point",
        allow_hyphen_values = true)]
    normal: Option<DVec3>,
    #[command(flatten)]
    hold_out: HoldOutArgs,
    /// A file to write it to, .json or .glb
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Kind {
    /// Parallel to the image planes, at the points' mean inverse depth
    Plane,
    /// The sparse points that views like the desired one observe, triangulated anew for
    /// every view
    Points,
    /// These points, and those that photos agree on between them
    Dense,
    /// The one of them that shows best what photos left out for it show
    Auto,
}

impl Kind {
    /// `None` for the best.
    fn fitted(self) -> Option<lumigraph::scene::Kind> {
        use lumigraph::scene::Kind as Of;
        match self {
            Self::Auto => None,
            Self::Plane => Some(Of::Plane),
            Self::Points => Some(Of::Points),
            Self::Dense => Some(Of::Dense),
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let by_hand = match (args.point, args.normal) {
        (Some(_), Some(_)) if args.kind != Kind::Plane => {
            let message = "--point and --normal describe a plane; write `plane`";
            return Err(Usage(message.to_owned()).into());
        }
        (Some(point), Some(normal)) => {
            Some(Plane::new(point, normal).map_err(|e| Usage(e.to_string()))?)
        }
        _ => None,
    };
    let mut scene = args.scene.open()?;
    if args.output.is_none() && scene.folder.is_none() {
        return Err(Usage(format!(
            "{} is a capture, not a scene that could keep the proxy; give a file with -o, or \
             `import` the capture first",
            args.scene.scene.display()
        ))
        .into());
    }
    let without = args.hold_out.names(&scene)?;

    let (proxy, how, fitted_without) = match by_hand {
        Some(plane) => (Proxy::Plane(plane), "given by hand".to_owned(), None),
        None => {
            let fitted = fit(&scene, args.kind.fitted(), &without)?;
            (fitted.proxy, fitted.how, Some(&without))
        }
    };
    let file = match &args.output {
        Some(file) => {
            let shown: Vec<DVec3> = scene
                .reconstruction
                .points
                .values()
                .map(|p| p.position)
                .collect();
            make_parent(file)?;
            ::proxy::write(file, &proxy, &shown)?;
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
