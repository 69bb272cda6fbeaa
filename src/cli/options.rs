//! Options that several subcommands share.

use super::interior::check_no_interior;
use super::output::say;
pub(super) use super::shape::{compared, cut};
use calibrate::opencv::Keys;
use calibrate::{TRUSTED_TIE, View, WeakGroup};
use clap::{Args, ValueEnum};
use glam::DVec3;
use lumigraph::scene::{DOUBTFUL_PX, Photo, Scene, Warning};
use render::{
    Blend, DeviceChoice, EDGE_SAMPLES, FieldOptions, MAX_BETA, MAX_CONTRIBUTORS, Method,
    Resolution, Skips,
};

use std::collections::BTreeSet;
use std::path::PathBuf;

/// Which photo set.
#[derive(Args, Clone)]
pub(super) struct SceneArgs {
    /// A scene written by `import`, or a capture: photos with a calibration
    pub(super) scene: PathBuf,
    /// Fail on a missing or corrupt photo instead of leaving it out
    #[arg(long)]
    pub(super) strict: bool,
    /// Use photos, too, that share too few points with the rest to be placed surely, or see most of theirs far off, and
    /// points that all their photos see far off
    #[arg(long)]
    pub(super) keep_weak: bool,
}

impl SceneArgs {
    /// Opens it, and says which photos are not used, and how many points.
    pub(super) fn open(&self) -> anyhow::Result<Scene> {
        let mut scene = self.open_whole()?;
        if !self.keep_weak {
            drop_weak(&mut scene);
        }
        Ok(scene)
    }

    /// As [`Self::open`], with photos whose places are unsure, and all points.
    pub(super) fn open_whole(&self) -> anyhow::Result<Scene> {
        check_no_interior(&self.scene)?;
        let (scene, warnings) = Scene::open(&self.scene, self.strict)?;
        print_warnings(&warnings);
        Ok(scene)
    }
}

/// How many photos have an ignore mask, an object matte, a silhouette and a depth map.
pub(super) fn beside_counts(scene: &Scene) -> [(&'static str, usize); 4] {
    let count = |has: fn(&Photo) -> bool| scene.photos.iter().filter(|p| has(p)).count();
    [
        ("ignore masks", count(|p| p.ignore_mask.is_some())),
        ("object mattes", count(|p| p.object_matte.is_some())),
        ("silhouettes", count(|p| p.silhouette.is_some())),
        ("depth maps", count(|p| p.depth_map.is_some())),
    ]
}

/// `, 12 ignore masks`, and so on for what there is.
pub(super) fn beside_text(scene: &Scene) -> String {
    let counts = beside_counts(scene).into_iter().filter(|(_, n)| *n > 0);
    counts.map(|(what, n)| format!(", {n} {what}")).collect()
}

/// Leaves out photos whose places are unsure, and then points that all theirs contradict, and says which, and
/// what uses them.
pub(super) fn drop_weak(scene: &mut Scene) {
    drop_weak_saying(scene, "; --keep-weak uses them");
}

/// The same for interiors, whatever anyone asks for: one of their photos that is misplaced has walls where
/// none are.
pub(super) fn drop_weak_of_interior(scene: &mut Scene) {
    drop_weak_saying(scene, "");
}

fn drop_weak_saying(scene: &mut Scene, remedy: &str) {
    for group in scene.drop_weak() {
        let tie = tie_text(&group);
        say!("note: left out, as they may be misplaced: {tie}{remedy}");
    }
    if let Some(misplaced) = misplaced_text(&scene.drop_misplaced()) {
        say!("note: left out, as misplaced: {misplaced}{remedy}");
    }
    let points = scene.reconstruction.points.len();
    if let Some(contradicted) = contradicted_text(scene.drop_contradicted(), points) {
        say!("note: left out, as wrong: {contradicted}{remedy}");
    }
}

/// What a scene has that what draws leaves out.
pub(super) struct Doubtful {
    /// Photos that too few points tie to the rest.
    pub(super) weak: Vec<WeakGroup>,
    /// The names of photos that are misplaced.
    pub(super) misplaced: Vec<String>,
    /// How many sparse points are contradicted.
    pub(super) contradicted: usize,
}

impl Doubtful {
    /// Of a scene that was opened whole.
    pub(super) fn of(scene: &Scene) -> Self {
        Self {
            weak: scene.reconstruction.weakly_tied(TRUSTED_TIE),
            misplaced: scene.misplaced(),
            contradicted: scene.contradicted_points().len(),
        }
    }

    /// Says so, and of what becomes of them here; `points` is how many sparse points there are.
    pub(super) fn say(&self, points: usize, here: &str) {
        let ties = self.weak.iter().map(tie_text);
        let misplaced = misplaced_text(&self.misplaced);
        let contradicted = contradicted_text(self.contradicted, points);
        for what in ties.chain(misplaced).chain(contradicted) {
            say!("note: {what}; {here}what draws leaves them out, unless --keep-weak");
        }
    }
}

/// What tells that so many of all sparse points are wrong; `None` of none.
fn contradicted_text(count: usize, points: usize) -> Option<String> {
    (count > 0).then(|| {
        format!(
            "{count} of {points} sparse points, which all photos that observe them see behind them, beyond their \
             lenses, or more than {DOUBTFUL_PX} pixels from where the calibration has them"
        )
    })
}

/// What tells that these photos are misplaced; `None` of none.
fn misplaced_text(names: &[String]) -> Option<String> {
    match names {
        [] => None,
        [name] => Some(format!(
            "photo {name} sees most of its sparse points behind it, beyond its lens, or more than {DOUBTFUL_PX} pixels \
             from where the calibration has them"
        )),
        _ => Some(format!(
            "{} photos see most of their sparse points behind them, beyond their lenses, or more than {DOUBTFUL_PX} \
             pixels from where the calibration has them: {}",
            names.len(),
            names.join(", ")
        )),
    }
}

/// How little ties a group of photos to the rest.
fn tie_text(group: &WeakGroup) -> String {
    let (names, points) = (group.names.join(", "), group.shared_points);
    match group.names.len() {
        1 => format!("photo {names} shares only {points} points with the others"),
        n => format!("{n} photos share only {points} points with the others: {names}"),
    }
}

/// Which of an OpenCV calibration's matrices to use.
#[derive(Args, Clone)]
pub(super) struct KeyArgs {
    /// What an OpenCV calibration calls the camera matrix [default: a name known here]
    #[arg(long, value_name = "KEY")]
    camera_matrix: Option<String>,
    /// What it calls the distortion coefficients, or none [default: a name known here]
    #[arg(long, value_name = "KEY")]
    distortion: Option<String>,
    /// Its 4 distortion coefficients are those of cv::fisheye
    #[arg(long)]
    fisheye: bool,
}

impl KeyArgs {
    pub(super) fn keys(&self) -> Keys {
        Keys {
            camera_matrix: self.camera_matrix.clone(),
            distortion: self.distortion.clone(),
            fisheye: self.fisheye,
        }
    }
}

/// Warnings printed one by one; more than these are only counted.
pub(super) const WARNINGS_SHOWN: usize = 10;

pub(super) fn print_warnings(warnings: &[Warning]) {
    for warning in warnings.iter().take(WARNINGS_SHOWN) {
        match warning {
            Warning::LeftOut { .. } => say!("warning: {warning}"),
            Warning::Uncalibrated { .. } | Warning::Note(_) => say!("note: {warning}"),
        }
    }
    if let Some(more) = warnings.len().checked_sub(WARNINGS_SHOWN + 1) {
        say!("warning: and {} more photos are left out", more + 1);
    }
}

/// Which photos to leave out of everything.
#[derive(Args, Clone)]
pub(super) struct HoldOutArgs {
    /// Leave out the photos named in this file: {"test": ["a.jpg", …]}
    #[arg(long, value_name = "SPLIT.json")]
    pub(super) hold_out: Option<PathBuf>,
}

impl HoldOutArgs {
    /// Their names; none without the option.
    pub(super) fn names(&self, scene: &Scene) -> anyhow::Result<BTreeSet<String>> {
        match &self.hold_out {
            Some(split) => Ok(scene.held_out(split)?),
            None => Ok(BTreeSet::new()),
        }
    }
}

/// How source views are weighted.
#[derive(Args)]
pub(super) struct FieldArgs {
    /// The blending field at every pixel, or at vertices and interpolated
    #[arg(long, value_enum, default_value = "triangulated")]
    renderer: Renderer,
    /// Cells of the triangulation's grid across the image's width; down it, as many as make them square
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = cells_across)]
    pub(super) grid: u32,
    /// The formula for the weights
    #[arg(long, value_enum, default_value = "consistent")]
    blend: BlendName,
    /// What a photo's lack of resolution is measured by
    #[arg(long, value_enum, default_value = "footprint")]
    resolution: ResolutionName,
    /// How many photos share a ray, roughly: Buehler's k
    #[arg(long, default_value_t = 5, value_parser = contributors)]
    k: usize,
    /// Radians of angular difference that half the resolution is worth: Buehler's β/α, up to 1e6
    #[arg(long, default_value_t = 0.1, value_parser = beta)]
    beta: f64,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum Renderer {
    /// At vertices, and interpolated: fast
    Triangulated,
    /// At every pixel
    Exact,
}

#[derive(Clone, Copy, ValueEnum)]
enum BlendName {
    /// Exact at source views, continuous where views come and go
    Consistent,
    /// Buehler et al. 2001, literally
    Paper,
}

#[derive(Clone, Copy, ValueEnum)]
enum ResolutionName {
    /// The ratio of pixel footprints
    Footprint,
    /// The ratio of distances
    Distance,
    /// The difference of distances, in world units: Buehler et al. 2001, literally
    Length,
}

impl FieldArgs {
    pub(super) fn options(&self) -> FieldOptions {
        FieldOptions {
            k: self.k,
            beta: self.beta,
            blend: match self.blend {
                BlendName::Consistent => Blend::Consistent,
                BlendName::Paper => Blend::Paper,
            },
            resolution: match self.resolution {
                ResolutionName::Footprint => Resolution::Footprint,
                ResolutionName::Distance => Resolution::Distance,
                ResolutionName::Length => Resolution::Length,
            },
            ..FieldOptions::default()
        }
    }

    pub(super) fn method(&self) -> Method {
        match self.renderer {
            Renderer::Exact => Method::Exact,
            Renderer::Triangulated => Method::Triangulated {
                cells_across: self.grid,
            },
        }
    }
}

/// What is done to a picture once it is drawn.
#[derive(Args)]
pub(super) struct FinishArgs {
    /// Samples of a pixel, across and down, where a mesh jumps between it and one beside it that looks otherwise:
    /// outlines without stairs; 1 draws them as all else
    #[arg(long = "edges", value_name = "N", default_value_t = EDGE_SAMPLES,
        value_parser = clap::value_parser!(u32).range(1..=8))]
    pub(super) edge_samples: u32,
    /// Draw as sharply as it comes what no photo shows, which is guessed from what is beside it, and what photos contradict
    /// each other of; else the one is the softer the farther it is from what is seen, the other the less they agree
    #[arg(long)]
    pub(super) sharp: bool,
}

/// Where and how large.
#[derive(Args)]
pub(super) struct DrawArgs {
    /// What draws; without a graphics processor, auto is cpu
    #[arg(long, value_enum, default_value = "auto")]
    device: DeviceName,
    /// Size of the pictures in pixels [default: each view's own]. Of another shape they show the middle of
    /// the view, cut and not stretched; those that are compared with photos keep the photos' shape
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(super) size: Option<(u32, u32)>,
    /// Leave nothing out, or nothing of what is named, though no picture needs it: decode every photo,
    /// ask each view about every ray, see through every lens as if it bent. The same bytes, later
    #[arg(long, value_enum, value_name = "WHAT", num_args = 0.., require_equals = true,
        value_delimiter = ',', default_missing_value = "all")]
    no_skip: Vec<NoSkip>,
    /// What decoded photos may take in memory, as in 512MiB or 1.5GB: those used last stay.
    /// Too little for one frame draws it from coarser mip levels [default: half of the machine's memory]
    #[arg(long, value_name = "SIZE", value_parser = bytes, allow_hyphen_values = true)]
    pub(super) cpu_memory: Option<u64>,
    /// The same for photos on the graphics processor [default: no limit]
    #[arg(long, value_name = "SIZE", value_parser = bytes, allow_hyphen_values = true)]
    pub(super) gpu_memory: Option<u64>,
}

/// What is not to be left out.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum NoSkip {
    All,
    Photos,
    Views,
    Lenses,
}

impl DrawArgs {
    /// Whether photos are decoded that no picture needs.
    pub(super) fn decodes_all(&self) -> bool {
        self.keeps(NoSkip::Photos)
    }

    /// What frames leave out.
    pub(super) fn skips(&self) -> Skips {
        Skips {
            views: !self.keeps(NoSkip::Views),
            lenses: !self.keeps(NoSkip::Lenses),
        }
    }

    fn keeps(&self, what: NoSkip) -> bool {
        let named = |name| self.no_skip.contains(name);
        named(&NoSkip::All) || named(&what)
    }
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum DeviceName {
    Auto,
    Gpu,
    Cpu,
    /// Plain f64: slow, the specification
    Reference,
}

impl DeviceName {
    pub(super) fn choice(self) -> DeviceChoice {
        match self {
            Self::Auto => DeviceChoice::Auto,
            Self::Gpu => DeviceChoice::Gpu,
            Self::Cpu => DeviceChoice::Cpu,
            Self::Reference => DeviceChoice::Reference,
        }
    }

    /// As the command line spells it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Gpu => "gpu",
            Self::Cpu => "cpu",
            Self::Reference => "reference",
        }
    }
}

impl DrawArgs {
    pub(super) fn device(&self) -> DeviceChoice {
        self.device.choice()
    }

    /// A frame's view at the size asked for; `named` is what is said of the frame.
    ///
    /// # Errors
    /// It has more pixels on a side than are drawn.
    pub(super) fn resized(&self, named: &str, view: View) -> anyhow::Result<View> {
        let view = cut(view, self.size);
        let (width, height) = (view.width, view.height);
        if width.max(height) > MAX_SIDE {
            anyhow::bail!(
                "{named} has {width} x {height} pixels; at most {MAX_SIDE} are drawn each way: give \
                 --size"
            );
        }
        Ok(view)
    }
}

/// Pictures larger than this on a side are refused: the triangulation's lattice ends here.
const MAX_SIDE: u32 = 16384;

/// `640x480`.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let parse = || {
        let (width, height) = text.split_once(['x', 'X', '×'])?;
        Some((width.trim().parse().ok()?, height.trim().parse().ok()?))
    };
    let (width, height) = parse().ok_or("expected two numbers, as in 640x480")?;
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(format!("each side must lie in 1..={MAX_SIDE}"));
    }
    Ok((width, height))
}

/// `512MiB`: at least one byte.
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, u64); 10] = [
        ("", 1),
        ("b", 1),
        ("kb", 1000),
        ("mb", 1000_u64.pow(2)),
        ("gb", 1000_u64.pow(3)),
        ("tb", 1000_u64.pow(4)),
        ("kib", 1 << 10),
        ("mib", 1 << 20),
        ("gib", 1 << 30),
        ("tib", 1 << 40),
    ];
    let parse = || {
        let end = text.find(|c: char| !c.is_ascii_digit() && c != '.');
        let (number, unit) = text.split_at(end.unwrap_or(text.len()));
        let unit = unit.trim().to_ascii_lowercase();
        let (_, factor) = UNITS.iter().find(|(name, _)| *name == unit)?;
        let bytes = number.parse::<f64>().ok()? * *factor as f64;
        (bytes >= 1.0 && bytes < u64::MAX as f64).then_some(bytes as u64)
    };
    parse().ok_or_else(|| {
        "expected a size above zero, with or without one of kB, MB, GB, TB, KiB, MiB, GiB and \
         TiB, as in 512MiB"
            .to_owned()
    })
}

/// `1.5,-2,0`.
pub(super) fn triple(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if DVec3::new(x, y, z).is_finite() => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three numbers, as in 0,-1.5,2".to_owned()),
    }
}

/// How many cells of a grid.
fn cells_across(text: &str) -> Result<u32, String> {
    let count = text.parse::<u32>().ok().filter(|&count| count > 0);
    count.ok_or_else(|| "expected a whole number above zero, as in 32".to_owned())
}

/// How many photos share a ray.
fn contributors(text: &str) -> Result<usize, String> {
    let count = text.parse::<usize>().ok();
    let count = count.filter(|count| (1..=MAX_CONTRIBUTORS).contains(count));
    count.ok_or_else(|| format!("expected a whole number in 1..={MAX_CONTRIBUTORS}"))
}

/// Buehler's β/α.
fn beta(text: &str) -> Result<f64, String> {
    let beta = zero_or_more(text).ok().filter(|&beta| beta <= MAX_BETA);
    beta.ok_or_else(|| format!("expected a number, zero or more, up to {MAX_BETA:e}"))
}

/// A number above zero.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    zero_or_more(text)
        .ok()
        .filter(|&value| value > 0.0)
        .ok_or_else(|| "expected a number above zero".to_owned())
}

/// Steps of 255, zero or more; `inf` for no bound.
pub(super) fn max_error(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value >= 0.0 => Ok(value),
        _ => Err("expected steps of 255, zero or more, or inf, as in 0.5".to_owned()),
    }
}

fn zero_or_more(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value >= 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("expected a number, zero or more".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_triples() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert!(size("0x480").is_err() && size("640").is_err() && size("-3x4").is_err());
        assert_eq!(triple("1, -2,3e-1"), Ok(DVec3::new(1.0, -2.0, 0.3)));
        assert!(triple("1,2").is_err() && triple("1,2,NaN").is_err());
        assert_eq!(bytes("512MiB"), Ok(512 << 20));
        assert_eq!((bytes("1.5 gb"), bytes("77")), (Ok(1_500_000_000), Ok(77)));
        for bad in [
            "",
            "0",
            "0.2",
            "-1GB",
            "GB",
            "1XB",
            "1.2.3MB",
            "NaN",
            "inf",
            "1e99",
            "9999999TiB99",
        ] {
            assert!(bytes(bad).is_err(), "{bad}");
        }
        assert!(bytes("99999999999TiB").is_err());
        assert!(positive("0").is_err() && positive("x").is_err());
        assert_eq!(positive("1e-3"), Ok(1e-3));
        assert_eq!(
            (max_error("0"), max_error("inf")),
            (Ok(0.0), Ok(f64::INFINITY))
        );
        assert!(
            ["-1", "NaN", "50dB", ""]
                .iter()
                .all(|bad| max_error(bad).is_err())
        );
        assert!(zero_or_more("-0.1").is_err() && zero_or_more("inf").is_err());
        assert_eq!((beta("0"), beta("1e6")), (Ok(0.0), Ok(1e6)));
        assert!(
            ["-0.1", "1e39", "inf", "nan"]
                .iter()
                .all(|bad| beta(bad).is_err())
        );
        assert_eq!((cells_across("1"), contributors("16")), (Ok(1), Ok(16)));
        assert!(
            ["0", "-1", "x", ""]
                .iter()
                .all(|bad| cells_across(bad).is_err())
        );
        assert!(
            ["0", "17", "nan", "1.5"]
                .iter()
                .all(|bad| contributors(bad).is_err())
        );
    }
}
