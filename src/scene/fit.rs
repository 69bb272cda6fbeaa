//! Fitting a scene's proxy.

use super::auto::Trial;
use super::carved_points::CarvedPoints;
use super::damaged::of_each;
use super::{Photo, Scene, SceneError};
use calibrate::View;
use capture::DepthMap;
use glam::DVec3;
use proxy::dense::{DenseOptions, Matching};
use proxy::depth;
use proxy::hull;
use proxy::{
    FitBasis, FitError, Form, ILL_CONDITIONED, Mesh, MeshKind, PlaneFit, Proxy, Solid, SparsePoint,
    Tunnel,
};
use proxy::{carve, shown_number, tunnel};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

/// Fewer sparse points tell nothing of where things are.
pub(super) const FEWEST_POINTS: usize = 3;

/// Without sparse points, how near and how far things are taken to be, in shares of how far that is which photos
/// look at; where they look every way, of how far apart they were taken.
const NEAREST: f64 = 1.0 / 3.0;
const NEAREST_AROUND: f64 = 1.0 / 8.0;
const FARTHEST: f64 = 20.0;

/// Proxies that can be fitted to a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Parallel to the image planes.
    Plane,
    /// The plane that most sparse points lie on.
    DominantPlane,
    /// A plane for every view.
    ViewPlane,
    /// A box around a hallway.
    Tunnel,
    /// What the silhouettes leave of space.
    Hull,
    /// The sparse points that views like the desired one observe.
    Points,
    /// A closed mesh of the sparse points.
    Carved,
    /// Depth maps, fused.
    Depth,
    /// The sparse points, and those that photos agree on between them, as far as they lie on
    /// [`Self::CarvedDense`].
    Dense,
    /// A closed mesh of these points.
    CarvedDense,
}

impl Kind {
    /// All of them, what is fitted fastest first.
    pub const ALL: [Self; 10] = [
        Self::Plane,
        Self::DominantPlane,
        Self::ViewPlane,
        Self::Points,
        Self::Tunnel,
        Self::Carved,
        Self::Hull,
        Self::Depth,
        Self::Dense,
        Self::CarvedDense,
    ];

    /// As the command line spells it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::DominantPlane => "dominant-plane",
            Self::ViewPlane => "view-plane",
            Self::Tunnel => "tunnel",
            Self::Hull => "hull",
            Self::Points => "points",
            Self::Carved => "carved",
            Self::Depth => "depth",
            Self::Dense => "dense",
            Self::CarvedDense => "carved-dense",
        }
    }

    /// What there is of it without a desired view.
    pub fn form(self) -> Form {
        match self {
            Self::Plane | Self::DominantPlane => Form::Plane,
            Self::ViewPlane | Self::Points | Self::Dense => Form::PerView,
            Self::Tunnel | Self::Hull | Self::Carved | Self::Depth | Self::CarvedDense => {
                Form::Mesh
            }
        }
    }

    /// The kind of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// A fitted proxy, and what to say of it.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The surface.
    pub proxy: Proxy,
    /// How it came about, for people.
    pub how: String,
    /// What people should know of it, if anything.
    pub note: Option<String>,
    /// Where the kind was chosen by trial: what became of each.
    pub trials: Vec<Trial>,
    /// Photos that were found damaged and had no part in it, by name, with what is wrong with each.
    pub left_out: BTreeMap<String, String>,
}

impl Scene {
    /// Fits a proxy when the photos of the given names were never taken, nor those that it takes and
    /// that cannot be decoded, as long as two others remain; see [`Fitted::left_out`].
    ///
    /// # Errors
    /// The scene does not have what it takes; the message says what that is.
    pub fn fit(&self, kind: Kind, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        self.fit_without_damaged(without, |fewer| self.fit_to_all(kind, fewer))
    }

    /// The same, all other photos being taken.
    ///
    /// # Errors
    /// As [`Self::fit`]; [`SceneError::Damaged`] of photos that cannot be decoded.
    pub(super) fn fit_to_all(
        &self,
        kind: Kind,
        without: &BTreeSet<String>,
    ) -> Result<Fitted, SceneError> {
        match kind {
            Kind::Plane => {
                let fit = self.fit_plane(without)?;
                let how = format!(
                    "fitted at distance {} to {}",
                    shown_number(fit.distance),
                    fit.basis
                );
                let mut fitted = Fitted::new(Proxy::Plane(fit.plane), how);
                if !matches!(fit.basis, FitBasis::Points { .. }) {
                    let basis = fit.basis;
                    fitted.note = Some(format!("the proxy is a plane fitted to {basis}"));
                }
                Ok(fitted.with_condition(fit.condition))
            }
            Kind::DominantPlane => {
                let (_, points) = self.sparse(without)?;
                let positions: Vec<DVec3> = points.iter().map(|p| p.position).collect();
                let found = proxy::dominant_plane(&positions).map_err(unfit)?;
                let how = format!("{} of {} points lie on it", found.inliers, found.points);
                let fitted = Fitted::new(Proxy::Plane(found.plane), how);
                Ok(fitted.with_condition(found.condition))
            }
            Kind::ViewPlane => {
                self.needs_observed(kind)?;
                Ok(Fitted::new(Proxy::ViewPlane, "made for every view"))
            }
            Kind::Points => {
                self.needs_observed(kind)?;
                Ok(Fitted::points(self.bound(without)?))
            }
            Kind::Tunnel => Ok(Fitted::tunnel(&self.tunnel(without)?)),
            Kind::Carved if self.suits_any_distance() => self.fit_dome(without),
            Kind::Carved => {
                self.needs_observed(kind)?;
                let (views, points) = self.observed(without)?;
                let surface = carve::surface(&views, &points, &carve::Options::default());
                let how = format!("carved out of {} points", points.len());
                let mesh = surface.map_err(unfit)?.mesh;
                let within = self.bound(without)?;
                Ok(Fitted::mesh_within(MeshKind::Carved, mesh, within, how))
            }
            Kind::Hull => self.fit_hull(without),
            Kind::Depth => self.fit_depth(without),
            Kind::Dense => self.fit_dense(without),
            Kind::CarvedDense => {
                let surface = self.dense_surface(without)?;
                surface.surface(self.bound(without)?)
            }
        }
    }

    /// The tunnel, where the photos but those of the given names were taken along a hallway.
    pub(super) fn fit_hallway(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        let tunnel = self.tunnel(without)?;
        if tunnel.is_hallway() {
            Ok(Fitted::tunnel(&tunnel))
        } else {
            Err(unfit("the scene is no hallway"))
        }
    }

    fn tunnel(&self, without: &BTreeSet<String>) -> Result<Tunnel, SceneError> {
        let (views, points) = self.sparse(without)?;
        let positions: Vec<DVec3> = points.iter().map(|p| p.position).collect();
        tunnel::fit(&views, &positions).map_err(unfit)
    }

    /// The views but those of the given names, and the sparse points: each with those that see it, if any do.
    pub(super) fn sparse(
        &self,
        without: &BTreeSet<String>,
    ) -> Result<(Vec<View>, Vec<SparsePoint>), SceneError> {
        let sources = self.sources(without)?;
        let names: Vec<String> = sources.iter().map(|(p, _)| p.name.clone()).collect();
        let views = sources.into_iter().map(|(_, view)| view).collect();
        Ok((views, self.sparse_points(without, &names)))
    }

    /// The hull of the photos' silhouettes.
    fn fit_hull(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        let sources = self.sources(without)?;
        let views: Vec<View> = sources.iter().map(|(_, view)| view.clone()).collect();
        let silhouettes = of_each(&sources, Photo::decode_silhouette)?;
        let hull = hull::carve(&views, &silhouettes, &hull::Options::default()).map_err(unfit)?;
        let mut how = format!(
            "covers {:.2} % of the silhouettes, {:.2} of intersection over union",
            100.0 * hull.measures.coverage,
            hull.measures.iou
        );
        if hull.misses > 0 || hull.tolerance_px > hull::Options::default().tolerance_px {
            how += &format!(
                "; they contradict one another: {} may miss, by {} px all",
                hull.misses, hull.tolerance_px
            );
        }
        let mut fitted = Fitted::mesh(MeshKind::Hull, hull.mesh, how);
        if let Some(first) = hull.left_out.first() {
            fitted.note = Some(format!(
                "{} of {} masks are all object or all background and say nothing (that of {}, \
                 for one)",
                hull.left_out.len(),
                sources.len(),
                sources[*first].0.name
            ));
        }
        Ok(fitted)
    }

    /// The surface of the photos' depth maps, with a shell behind it.
    fn fit_depth(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        let sources = self.sources(without)?;
        let maps = sources
            .iter()
            .filter(|(p, _)| p.depth_map.is_some())
            .count();
        let decode =
            |photo: &Photo, size: (u32, u32)| photo.decode_depth(size).map_err(SceneError::from);
        let fusion = fuse_depth(&sources, MOST_TRIANGLES, decode)?;
        let how = format!(
            "{maps} depth maps fused in voxels of {}",
            shown_number(fusion.voxel_size)
        );
        let (views, points) = self.sparse(without)?;
        let mut mesh = fusion.mesh;
        mesh.append(&proxy::shell(&views, &points));
        Ok(Fitted::mesh(MeshKind::Depth, mesh, how))
    }

    /// The plane that fits the sparse points when the photos of the given names were never
    /// taken; where no photo observes any, that through what the cameras look at. Of a scene whose photos were all
    /// taken from one place, which a view does not leave, one at any distance.
    ///
    /// # Errors
    /// Nothing to fit to; photos of one place that look all around.
    pub fn fit_plane(&self, without: &BTreeSet<String>) -> Result<PlaneFit, SceneError> {
        let rest = self.reconstruction.without_images(without);
        let fitted = match proxy::fit_plane(&rest) {
            Err(FitError::NoPoints) => proxy::plane_across_axes(&rest, &self.depth_bounds()),
            fit => fit,
        };
        match fitted {
            Err(FitError::NoPoints) if proxy::is_one_place(&self.reconstruction) => {
                Ok(proxy::plane_of_one_place(&rest)?)
            }
            Err(FitError::NoPoints) => Err(self.lack_of_plane(&rest)),
            fit => Ok(fit?),
        }
    }

    /// Whether nothing tells how far away things are, nor has to: no photo observes sparse points, and all were taken
    /// from one place, where any distance shows the same.
    pub(super) fn suits_any_distance(&self) -> bool {
        self.observed_count() == 0 && proxy::is_one_place(&self.reconstruction)
    }

    /// What is left of a carved mesh where there is [any distance](Self::suits_any_distance): the dome.
    fn fit_dome(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        let (views, _) = self.sparse(without)?;
        // What the others are apart by is rounding, which would say how far they reach.
        let dome = proxy::shell(&views[..views.len().min(1)], &[]);
        let how = format!(
            "a dome around {} photos of one place, where any distance serves",
            views.len()
        );
        let note = format!("the proxy is {how}, as they observe no sparse points");
        let mut fitted = Fitted::mesh(MeshKind::Carved, dome, how);
        fitted.note = Some(note);
        Ok(fitted)
    }

    /// The nearest and the farthest depth of photos, where the calibration says so, by name.
    fn depth_bounds(&self) -> BTreeMap<String, [f64; 2]> {
        let photos = self.photos.iter();
        let bounds = photos.filter_map(|photo| Some((photo.name.clone(), photo.depth_bounds?)));
        bounds.collect()
    }

    /// Where no photo observes sparse points, the inverse depths (1/z) between which to compare each photo but
    /// those of the given names: as the calibration has them, else around how far that lies which all look at;
    /// where they look every way, around how far they are from one another.
    fn supposed_ranges(&self, without: &BTreeSet<String>) -> Result<Vec<[f64; 2]>, SceneError> {
        let sources = self.sources(without)?;
        let bounds = self.depth_bounds();
        let rest = self.reconstruction.without_images(without);
        let (distance, nearest) = match proxy::plane_across_axes(&rest, &bounds) {
            Ok(fit) => (fit.distance, NEAREST),
            // That much is rounding.
            Err(_) if proxy::is_one_place(&rest) => (0.0, NEAREST_AROUND),
            Err(_) => (
                spread(sources.iter().map(|(_, view)| view.center())),
                NEAREST_AROUND,
            ),
        };
        if !(distance > 0.0 && distance.is_finite()) {
            return Err(unfit(
                "no photo observes sparse points, and all were taken from one place, which tells no \
                 depths; try plane, or carved where they look all around",
            ));
        }
        let range = |photo: &Photo| match bounds.get(&photo.name) {
            Some([near, far]) => [1.0 / far, 1.0 / near],
            None => [1.0 / (FARTHEST * distance), 1.0 / (nearest * distance)],
        };
        Ok(sources.iter().map(|(photo, _)| range(photo)).collect())
    }

    fn fit_dense(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        let surface = self.dense_surface(without)?;
        let sources = self.sources(without)?;
        let names = sources.iter().map(|(p, _)| p.name.clone()).collect();
        Ok(surface.dense(names, self.bound(without)?))
    }

    /// The hull that bounds what is made of points, where photos are cut out.
    fn bound(&self, without: &BTreeSet<String>) -> Result<Option<Arc<Solid>>, SceneError> {
        Ok(self.cutout(without, None)?.map(|cutout| cutout.hull))
    }

    fn dense_surface(&self, without: &BTreeSet<String>) -> Result<CarvedPoints, SceneError> {
        let (views, sparse) = self.observed(without)?;
        let (matching, note) = self.matching(without)?;
        let points = matching.points(&sparse, &[]);
        Ok(CarvedPoints::of_all(&views, points, sparse.len())?.with_note(note))
    }

    /// The photos but those of the given names, ready to be compared, with what sensors measured of
    /// them; and what is to be said of depth maps that cannot be used.
    ///
    /// # Errors
    /// Nothing tells between which depths to compare them; [`SceneError::Damaged`] of all photos that
    /// cannot be decoded, before any are compared.
    pub(super) fn matching(
        &self,
        without: &BTreeSet<String>,
    ) -> Result<(Matching, Option<String>), SceneError> {
        let sources = self.sources(without)?;
        let (views, sparse) = self.observed(without)?;
        let ranges = match sparse.len() < FEWEST_POINTS {
            true => Some(self.supposed_ranges(without)?),
            false => None,
        };
        // 1. Photos and depth maps, each decoded once.
        let damaged: Mutex<BTreeMap<String, String>> = Mutex::default();
        let photo = |i: usize| {
            let (photo, size) = (sources[i].0, (views[i].width, views[i].height));
            match photo.decode_usable(size) {
                Ok(pixels) => Some(pixels),
                Err(error) => {
                    if let Ok(mut all) = damaged.lock() {
                        all.insert(photo.name.clone(), error.to_string());
                    }
                    None
                }
            }
        };
        let maps = self.depth_maps(without)?;
        let noise = maps.noise(|i| views[i].clone());
        let unusable = Mutex::new(BTreeMap::new());
        let depth = |i: usize| {
            if !maps.has(i) {
                return None;
            }
            let believed = noise.clone().and_then(|n| maps.believed(i, &views[i], n));
            let note = |error| unusable.lock().map(|mut all| all.insert(i, error));
            believed.map_err(note).ok()
        };
        let known: &[SparsePoint] = match &ranges {
            Some(_) => &[],
            None => &sparse,
        };
        let mut matching = Matching::new(&views, known, photo, depth, &DenseOptions::default());
        let damaged = damaged.into_inner().unwrap_or_default();
        if !damaged.is_empty() {
            return Err(SceneError::Damaged(damaged));
        }
        // 2. Where no points tell which of them go together, comparing them does.
        if let Some(ranges) = ranges {
            matching.suppose(&views, &ranges);
        }
        let unusable = unusable.into_inner().unwrap_or_default();
        let note = unusable
            .first_key_value()
            .map(|(_, first)| match unusable.len() {
                1 => format!("a depth map is left out: {first}"),
                count => format!("{count} depth maps are left out, the first as: {first}"),
            });
        Ok((matching, note))
    }
}

/// How far apart places are: how far half of them are from their middle, wherever a few may be.
fn spread(places: impl Iterator<Item = DVec3> + Clone) -> f64 {
    let middle_of = |values: &mut dyn Iterator<Item = f64>| {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let middle = |axis: usize| middle_of(&mut places.clone().map(|place| place[axis]));
    let middle = DVec3::new(middle(0), middle(1), middle(2));
    middle_of(&mut places.map(|place| place.distance(middle)))
}

impl Fitted {
    pub(super) fn new(proxy: Proxy, how: impl Into<String>) -> Self {
        Self {
            proxy,
            how: how.into(),
            note: None,
            trials: Vec::new(),
            left_out: BTreeMap::new(),
        }
    }

    /// The sparse points, within a hull if there is one.
    pub(super) fn points(within: Option<Arc<Solid>>) -> Self {
        Self::new(Proxy::Points { within }, "made for every view")
    }

    fn tunnel(tunnel: &Tunnel) -> Self {
        let how = format!(
            "{} wide, {} high, {} long, {:.0} % of the points on its walls",
            shown_number(tunnel.width()),
            shown_number(tunnel.height()),
            shown_number(tunnel.length()),
            100.0 * tunnel.share_on_walls
        );
        Self::mesh(MeshKind::Tunnel, tunnel.mesh(), how).with_condition(tunnel.condition)
    }

    /// Says so where the fit is ill-posed.
    fn with_condition(mut self, condition: f64) -> Self {
        if condition > ILL_CONDITIONED {
            let said = format!(
                "the surface hardly follows from what it is fitted to (condition number \
                 {condition:.0}, {ILL_CONDITIONED:.0} is much): look whether it lies where it \
                 should, or try points"
            );
            self.note = Some(match self.note {
                Some(note) => format!("{note}; {said}"),
                None => said,
            });
        }
        self
    }

    pub(super) fn mesh(kind: MeshKind, mesh: Mesh, how: String) -> Self {
        Self::mesh_within(kind, mesh, None, how)
    }

    /// A mesh, within a hull if there is one.
    pub(super) fn mesh_within(
        kind: MeshKind,
        mesh: Mesh,
        within: Option<Arc<Solid>>,
        how: String,
    ) -> Self {
        let mut solid = Solid::new(kind, mesh);
        solid.keep_within(within);
        Self::new(Proxy::Mesh(Arc::new(solid)), how)
    }
}

/// Fused depth maps are simplified to about so many triangles: finer ones show no difference,
/// and rays through them take longer.
const MOST_TRIANGLES: usize = 200_000;

/// The surface of the depth maps that some photos have, of about so many triangles at most. `decode` gives a
/// photo's map, of a size in pixels; it is asked several times.
pub(super) fn fuse_depth(
    sources: &[(&Photo, View)],
    most_triangles: usize,
    mut decode: impl FnMut(&Photo, (u32, u32)) -> Result<Option<DepthMap>, SceneError>,
) -> Result<depth::Fusion, SceneError> {
    let with_maps: Vec<&(&Photo, View)> = sources
        .iter()
        .filter(|(photo, _)| photo.depth_map.is_some())
        .collect();
    let frame = |i: usize| -> Result<(View, DepthMap), SceneError> {
        let (photo, view) = with_maps[i];
        let map = decode(photo, (view.width, view.height))?;
        let map = map.ok_or_else(|| unfit(format!("{}: no depth map", photo.name)))?;
        Ok((view.clone(), map))
    };
    let options = depth::Options {
        max_triangles: Some(most_triangles),
        ..depth::Options::default()
    };
    depth::fuse(with_maps.len(), frame, &options).map_err(unfit)
}

/// Why a kind of proxy does not suit a scene.
pub(super) fn unfit(reason: impl ToString) -> SceneError {
    SceneError::Unfit(reason.to_string())
}
