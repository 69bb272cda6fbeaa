//! One desired view, made ready: everything about the source views as seen from it.

#[cfg(test)]
pub(crate) mod every_lens;

use crate::lens_edge::{LensEdge, lens_edges};
use crate::lumigraph::{Lumigraph, SourceView};
use crate::options::{FieldOptions, Resolution, Skips};
use crate::photos::PhotoError;
use crate::planted::{Fault, is_planted};
use crate::sight::{Views, within_sight};
use crate::surface::{FacetMap, Surface};
use crate::tally::{Scored, Tally};
use crate::time::Moment;
use crate::view_tree::ViewTree;
use crate::visibility::visible;
use calibrate::{Lens, Pixel, View};
use glam::{DMat3, DVec3};
use proxy::Rays;
use std::cmp::Ordering;
use std::sync::OnceLock;

/// A point of the proxy as the desired view sees it: along `ray` from its centre, at
/// p = ray / `inverse_distance` in the desired camera's frame.
///
/// Kept as a fraction, so that a point on the plane's horizon is finite too. Every formula
/// below is the usual one multiplied through by `inverse_distance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyPoint {
    /// Any length but zero; in the desired camera's frame.
    pub ray: DVec3,
    /// Zero at infinity, else positive; in units of the ray's length.
    pub inverse_distance: f64,
    /// The plane of the proxy there: q with inverse_distance = q · ray.
    pub plane: DVec3,
}

/// Mip levels by which photos are sampled sharper than their footprint asks for. A desired
/// pixel of up to 1.19 × 1.19 source pixels is then sampled from the photo alone, at half
/// the cost; no capture's held-out score changed by more than 0.02 dB, even with 0.5.
pub const LEVEL_BIAS: f64 = 0.25;

/// Cells across the image's longer side of the grid that a frame's exposure is averaged
/// over.
const EXPOSURE_GRID: f64 = 16.0;

/// From this stored value up to 1, colours keep more and more of themselves when a photo is
/// brought to another exposure: cameras compress what is bright, and where light was clipped
/// no factor says how much there was. Chosen among 0, 0.25, 0.5, 0.7, 0.9 and 1 by the held-out
/// scores of seven photo sets, of which none loses 0.1 dB to matching with it.
pub(crate) const SHOULDER: f64 = 0.25;

/// How much a photo counts in a blend where its matte shows nothing, of what it counts where it shows
/// the object: a hole in one matte among photos that show the object is no hole in it. Of 1, 0.5, 0.25 and
/// 0.1 it is the largest with which 99 % of held-out mattes are covered (ARCHITECTURE.md).
pub(crate) const TRANSPARENT: f64 = 0.25;

/// How much a photo counts where its alpha, 0…1, is so much: one where it is opaque.
pub(crate) fn trust(alpha: f64) -> f64 {
    TRANSPARENT + (1.0 - TRANSPARENT) * alpha
}

/// A photo's colour, premultiplied, 0…1, brought to another exposure: red, green and blue
/// are multiplied by a factor each. From [`SHOULDER`] on the factor fades to one, so that
/// white stays white.
pub(crate) fn exposed([r, g, b, alpha]: [f64; 4], exposure: [f64; 3]) -> [f64; 4] {
    let channel = |v: f64, factor: f64| {
        let share = (alpha - v) / ((1.0 - SHOULDER) * alpha).max(f64::MIN_POSITIVE);
        v + (factor - 1.0) * v * share.clamp(0.0, 1.0)
    };
    let [x, y, z] = exposure;
    [channel(r, x), channel(g, y), channel(b, z), alpha]
}

/// A source view, relative to the desired one.
#[derive(Clone, Copy, Debug)]
pub struct FrameSource {
    /// Turns the desired camera's frame into the source camera's.
    pub rotation: DMat3,
    /// The desired centre in the source camera's frame.
    pub translation: DVec3,
    /// The source centre in the desired camera's frame.
    pub center: DVec3,
    /// Its lens.
    pub lens: Lens,
    /// Image size in pixels.
    pub size: [f64; 2],
    /// What the ratio of distances is multiplied by to compare pixel footprints.
    pub footprint_ratio: f64,
    /// Pixels from the border over which it fades in.
    pub feather_px: f64,
    /// Where its lens ends, if that is within its image: there it fades in, too.
    pub(crate) lens_edge: Option<LensEdge>,
    /// What red, green and blue are multiplied by to bring it to the frame's exposure; see
    /// `exposed`.
    pub exposure: [f64; 3],
    /// What its time adds to its difference; infinite where it takes no part.
    pub time_penalty: f64,
}

impl FrameSource {
    /// Not where its time is outside the window, or where it was left out.
    pub(crate) fn takes_part(&self) -> bool {
        self.time_penalty < f64::INFINITY
    }

    /// fovBlend: rises smoothly from 0 at the image's border, and from next to nothing where the
    /// lens ends within it, to 1 at the feather's width; negative outside the image.
    pub fn fov_blend(&self, pixel: Pixel) -> f64 {
        let [width, height] = self.size;
        let border = pixel
            .x
            .min(width - pixel.x)
            .min(pixel.y)
            .min(height - pixel.y);
        if border < 0.0 {
            return -1.0;
        }
        let border = match &self.lens_edge {
            None => border,
            Some(edge) => border.min(edge.distance_px(pixel)),
        };
        if border >= self.feather_px {
            return 1.0;
        }
        let s = border / self.feather_px;
        s * s * (3.0 - 2.0 * s)
    }

    /// A source view as a desired one has it, without feather and alike in footprint.
    #[cfg(test)]
    pub(crate) fn of(view: &View, desired: &View) -> Self {
        Self::at(view.center(), view, desired)
    }

    /// As `desired` sees a view, which is at `center` in the world.
    fn at(center: DVec3, view: &View, desired: &View) -> Self {
        let View {
            lens,
            width,
            height,
            camera_from_world,
        } = *view;
        let desired_rotation = desired.camera_from_world.matrix();
        // Centres are subtracted in the world before anything else: there the digits are,
        // however far away the origin is.
        let offset_in_world = center - desired.center();
        Self {
            rotation: camera_from_world.matrix() * desired_rotation.transpose(),
            translation: camera_from_world.rotation * -offset_in_world,
            center: desired.camera_from_world.rotation * offset_in_world,
            lens,
            size: [f64::from(width), f64::from(height)],
            footprint_ratio: 1.0,
            feather_px: 0.0,
            lens_edge: None,
            exposure: [1.0; 3],
            time_penalty: 0.0,
        }
    }
}

/// A centre comes of a rotation and a translation: a few roundings, relative to its size.
const ONE_PLACE: f64 = 16.0 * f64::EPSILON;

/// Whether two centres may be apart by rounding alone. Of photos taken at one place, one after the
/// other, or at the viewer's, what they differ by would be noise: it would decide which of more than
/// [`MAX_CONTRIBUTORS`](crate::MAX_CONTRIBUTORS) contribute, and by how much.
fn is_one_place(a: DVec3, b: DVec3) -> bool {
    let size = a.length().max(b.length());
    a.distance(b) <= ONE_PLACE * size
}

/// No photos in rows, grids or rings are many at one place along it.
const ASKEW: DVec3 = DVec3::new(0.618_034, 0.324_718, 0.715_999);

/// Where photos were taken; those at one place, or at the viewer's, at the same to the last digit, as
/// only then ties are ties. Which of them stands for all follows from where they are, not from their
/// order.
fn places(sources: &[SourceView], viewer: DVec3) -> Vec<DVec3> {
    let mut places: Vec<DVec3> = sources.iter().map(|s| s.view.center()).collect();
    let along = |place: DVec3| place.dot(ASKEW);
    // Worked out once, not at each comparison.
    let keys = places.iter().enumerate();
    let mut order: Vec<(f64, [f64; 3], usize)> = keys
        .map(|(i, place)| (along(*place), place.to_array(), i))
        .collect();
    order.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    // What is near is near along any direction, too.
    let mut last: Vec<DVec3> = Vec::new();
    for (_, _, i) in order {
        let place = places[i];
        last.retain(|other| {
            let size = other.length().max(place.length());
            along(place) - along(*other) <= 2.0 * ONE_PLACE * size
        });
        let known = std::iter::once(&viewer).chain(&last);
        match known.copied().find(|other| is_one_place(*other, place)) {
            Some(same) => places[i] = same,
            None => last.push(place),
        }
    }
    places
}

/// Which source views take part in a frame, where it is not all of them alike.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part<'p> {
    /// Those that do not.
    pub without: &'p [usize],
    /// Of a scene that moves: photos count by their times, too (see [`Moment::penalties`]), and those
    /// outside the window not at all.
    pub moment: Option<Moment>,
}

/// What each source view's time adds to its difference; infinite where it takes no part.
fn penalties(lumigraph: &Lumigraph, moment: Option<&Moment>, k: usize, gone: &[usize]) -> Vec<f64> {
    let sources = &lumigraph.sources;
    let mut penalties = match moment {
        None => vec![0.0; sources.len()],
        Some(moment) => {
            assert_eq!(moment.check(), Ok(()));
            let times_s: Vec<Option<f64>> = sources.iter().map(|s| s.time_s).collect();
            moment.penalties(&times_s, k)
        }
    };
    for gone in gone {
        penalties[*gone] = f64::INFINITY;
    }
    penalties
}

/// One desired view of a lumigraph, with all that does not depend on the pixel.
#[derive(Debug)]
pub struct Frame<'a> {
    /// What is rendered.
    pub lumigraph: &'a Lumigraph,
    /// From where.
    pub desired: View,
    /// How views are weighted.
    pub options: FieldOptions,
    /// The source views, by the lumigraph's index.
    pub sources: Vec<FrameSource>,
    /// The proxy from there.
    pub surface: Surface,
    /// Samples of a pixel, across and down, each of which is as much smaller than the pixel.
    across: f64,
    /// What is left out.
    pub(crate) skips: Skips,
    /// Made when first asked for.
    view_tree: OnceLock<ViewTree>,
    /// Which views were scored.
    pub(crate) tally: Tally,
}

impl<'a> Frame<'a> {
    /// Prepares a desired view.
    ///
    /// # Panics
    /// If the options fail [`FieldOptions::check`]: check them where they come in.
    pub fn new(lumigraph: &'a Lumigraph, desired: View, options: FieldOptions) -> Self {
        Self::with(lumigraph, desired, options, &Part::default())
    }

    /// The same with some of the source views. (The lumigraph's proxy and points are as they are, whoever
    /// they rest on.)
    ///
    /// # Panics
    /// If the options fail [`FieldOptions::check`], or the moment [`Moment::check`].
    pub fn with(
        lumigraph: &'a Lumigraph,
        desired: View,
        options: FieldOptions,
        part: &Part<'_>,
    ) -> Self {
        Self::of(lumigraph, desired, options, part.without, part.moment, None)
    }

    /// A desired view of facets that were found for it, in place of what it sees of the
    /// lumigraph's proxy; without some of the source views.
    pub(crate) fn over(
        lumigraph: &'a Lumigraph,
        desired: View,
        options: FieldOptions,
        gone: &[usize],
        facets: FacetMap,
    ) -> Self {
        Self::of(lumigraph, desired, options, gone, None, Some(facets))
    }

    /// For so many samples of a pixel, across and down: photos weigh as they do in this frame, and are sampled from finer
    /// mip levels, or coarser ones where it is less than one. What samples look at they bring with them.
    pub(crate) fn of_samples(&self, across: f64) -> Self {
        Self {
            lumigraph: self.lumigraph,
            desired: self.desired.clone(),
            options: self.options,
            sources: self.sources.clone(),
            surface: Surface::Nothing,
            across,
            skips: self.skips,
            view_tree: self.view_tree.clone(),
            tally: Tally::new(self.sources.len()),
        }
    }

    fn of(
        lumigraph: &'a Lumigraph,
        desired: View,
        options: FieldOptions,
        gone: &[usize],
        moment: Option<Moment>,
        facets: Option<FacetMap>,
    ) -> Self {
        assert_eq!(options.check(), Ok(()));
        let penalties = penalties(lumigraph, moment.as_ref(), options.k, gone);
        // A desired view finer than every photo undersamples all of them alike; that is no
        // reason to prefer any. So its focal length counts only up to the longest there is.
        let longest = lumigraph
            .sources
            .iter()
            .map(|s| s.view.lens.mean_focal())
            .fold(0.0, f64::max);
        let desired_focal = desired.lens.mean_focal().min(longest);

        let sources = lumigraph
            .sources
            .iter()
            .zip(places(&lumigraph.sources, desired.center()))
            .zip(penalties)
            .zip(lens_edges(&lumigraph.sources))
            .map(|(((source, center), time_penalty), lens_edge)| {
                let View { width, height, .. } = source.view;
                FrameSource {
                    time_penalty,
                    footprint_ratio: match options.resolution {
                        Resolution::Footprint => desired_focal / source.view.lens.mean_focal(),
                        Resolution::Distance | Resolution::Length => 1.0,
                    },
                    feather_px: options.feather * f64::from(width.min(height)),
                    lens_edge,
                    ..FrameSource::at(center, &source.view, &desired)
                }
            })
            .collect::<Vec<FrameSource>>();
        let surface = match facets {
            Some(facets) => {
                let rays = Rays::of(&desired.lens, (desired.width, desired.height));
                Surface::Facets(within_sight(
                    facets,
                    &desired,
                    rays.as_ref(),
                    &Views::new(&sources),
                ))
            }
            None => Surface::of(lumigraph, &desired, &sources),
        };
        let mut frame = Self {
            lumigraph,
            desired,
            options,
            sources,
            surface,
            across: 1.0,
            skips: Skips::ALL,
            view_tree: OnceLock::new(),
            tally: Tally::new(lumigraph.sources.len()),
        };
        frame.match_exposures();
        frame
    }

    /// Which source views were scored so far, by the field and by the exact picture on the CPU;
    /// the same for any number of threads. (Other engines' exact pictures score all that take
    /// part.)
    pub fn scored(&self) -> Scored {
        self.tally.scored()
    }

    /// The same view, leaving out these things alone: the same pictures, sooner or later.
    #[must_use]
    pub fn skipping(mut self, skips: Skips) -> Self {
        let asks_others = skips.views != self.skips.views;
        self.skips = skips;
        self.view_tree = OnceLock::new();
        if asks_others {
            // Who was scored for the frame's exposure, too.
            self.tally = Tally::new(self.sources.len());
            self.match_exposures();
        }
        self
    }

    /// Whether source views that cannot count are passed over.
    pub(crate) fn may_skip(&self) -> bool {
        self.skips.views
    }

    /// Loops on several threads are to ask for it before they begin: else each may make one.
    pub(crate) fn view_tree(&self) -> &ViewTree {
        if let Some(tree) = self.view_tree.get() {
            return tree;
        }
        // Not while others wait for it: a thread whose work others share takes up their work meanwhile, which may be
        // to ask for the tree.
        let tree = ViewTree::new(&self.sources, self.skips.views);
        self.view_tree.get_or_init(|| tree)
    }

    /// The source views that take part: all but those outside the time window, in order.
    pub fn taking_part(&self) -> impl Iterator<Item = usize> {
        (0..self.sources.len()).filter(|&i| self.takes_part(i))
    }

    /// Whether the ignore masks of those could be decoded, as far as they were asked for.
    ///
    /// # Errors
    /// The first of those that could not.
    pub fn check_masks(&self) -> Result<(), PhotoError> {
        self.lumigraph.photos.check_masks(self.taking_part())
    }

    fn takes_part(&self, source_idx: usize) -> bool {
        self.sources[source_idx].takes_part()
    }

    /// Whether any source view is brought to another exposure.
    pub fn exposures_differ(&self) -> bool {
        self.sources.iter().any(|s| s.exposure != [1.0; 3])
    }

    /// Brings the source views to the frame's exposure.
    fn match_exposures(&mut self) {
        let views = &self.lumigraph.sources;
        if views.iter().any(|s| s.gain != [1.0; 3]) {
            let gain = self.gain();
            for (source, of) in self.sources.iter_mut().zip(views) {
                source.exposure = std::array::from_fn(|c| gain[c] / of.gain[c]);
            }
        }
    }

    /// The exposure of the whole frame: the mean of Σ wⱼ·gainⱼ over a grid of its pixels.
    ///
    /// It is one for the frame, as for a photo taken there. With the mean of each pixel in
    /// its place nothing would change: where photos agree but for their gains,
    /// Σ wᵢ·(Σ wⱼ·gainⱼ)/gainᵢ·colourᵢ is Σ wᵢ·colourᵢ again, and all steps stay.
    fn gain(&self) -> [f64; 3] {
        let size = [self.desired.width, self.desired.height].map(f64::from);
        let longer = size[0].max(size[1]);
        // Cells as square as fit, so that their middles lie well within the image.
        let [columns, rows] = size.map(|side| (EXPOSURE_GRID * side / longer).round().max(1.0));
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for row in 0..rows as u32 {
            for column in 0..columns as u32 {
                let middle = |i: u32| f64::from(i) + 0.5;
                let pixel = Pixel::new(
                    size[0] / columns * middle(column),
                    size[1] / rows * middle(row),
                );
                let Some(point) = self.proxy_point(pixel) else {
                    continue;
                };
                for contributor in self.blend_at(&point) {
                    let gain = self.lumigraph.sources[contributor.source_idx].gain;
                    weights += contributor.weight;
                    for c in 0..3 {
                        sum[c] += contributor.weight * gain[c];
                    }
                }
            }
        }
        if weights > 0.0 {
            sum.map(|s| s / weights)
        } else {
            [1.0; 3]
        }
    }

    /// The proxy point seen at a pixel of the desired image, if there is one.
    pub fn proxy_point(&self, pixel: Pixel) -> Option<ProxyPoint> {
        let ray = self.desired.lens.unproject(pixel)?;
        let plane = self.surface.plane_at(pixel)?;
        let inverse_distance = plane.dot(ray);
        (inverse_distance >= 0.0).then_some(ProxyPoint {
            ray,
            inverse_distance,
            plane,
        })
    }

    /// Whether the middle of any pixel of the desired image shows the proxy, whether or not a photo shows it, too.
    pub fn sees_proxy(&self) -> bool {
        let (width, height) = (self.desired.width, self.desired.height);
        let mut places = (0..height).flat_map(|y| (0..width).map(move |x| Pixel::center_of(x, y)));
        places.any(|place| self.proxy_point(place).is_some())
    }

    /// angDiff + β·resDiff of a source view (Buehler 2001, §4.1, with α = 1), and what its
    /// time adds.
    pub fn difference(&self, source_idx: usize, point: &ProxyPoint) -> f64 {
        let source = &self.sources[source_idx];
        let angle = angle_difference(source.center, point) + source.time_penalty;
        if self.options.beta == 0.0 {
            return angle;
        }
        let resolution = match self.options.resolution {
            Resolution::Length => length_difference(source.center, point),
            Resolution::Footprint | Resolution::Distance => {
                footprint_difference(source.center, point, source.footprint_ratio)
            }
        };
        angle + self.options.beta * resolution
    }

    /// Where a proxy point falls in a source image, or outside it; `None` where the source
    /// camera cannot see in that direction, or takes no part.
    pub fn project(&self, source_idx: usize, point: &ProxyPoint) -> Option<Pixel> {
        if !self.takes_part(source_idx) {
            return None;
        }
        let source = &self.sources[source_idx];
        source
            .lens
            .project(source.rotation * point.ray + source.translation * point.inverse_distance)
    }

    /// [`FrameSource::fov_blend`] of a source view.
    pub fn fov_blend(&self, source_idx: usize, pixel: Pixel) -> f64 {
        self.sources[source_idx].fov_blend(pixel)
    }

    /// How much a source view counts for a proxy point that falls on a pixel of its image:
    /// 1 where nothing is before it, little where something is.
    pub fn visible(&self, source_idx: usize, point: &ProxyPoint, pixel: Pixel) -> f64 {
        let Some(visibility) = &self.lumigraph.visibility else {
            return 1.0;
        };
        let source = &self.sources[source_idx];
        let in_source = source.rotation * point.ray + source.translation * point.inverse_distance;
        let nearest = visibility.map(source_idx).inverse_distance(pixel);
        visible(point.inverse_distance / in_source.length(), nearest)
    }

    /// The mip level at which a source photo is sampled: half the binary logarithm of how
    /// many source pixels one desired pixel covers, less [`LEVEL_BIAS`].
    ///
    /// A patch of the proxy covers, in an image of focal length f whose centre lies at
    /// distance h from the patch's plane and which sees it at depth z, f²·h/z³ times its
    /// area; the ratio of two such terms is exact for pinholes and planes. A wide lens has
    /// the distance in the depth's place.
    pub fn level_of_detail(&self, source_idx: usize, point: &ProxyPoint) -> f64 {
        let source = &self.sources[source_idx];
        let scale = self.area_scale(source_idx, point.plane);
        let in_source = source.rotation * point.ray + source.translation * point.inverse_distance;
        let ratio =
            depth_for_area(&self.desired.lens, point.ray) / depth_for_area(&source.lens, in_source);
        let area = scale * ratio * ratio * ratio;
        (0.5 * area.log2() - LEVEL_BIAS).max(0.0)
    }

    /// What the cube of the ratio of depths is multiplied by to give the ratio of areas,
    /// for a facet in the plane with vector `q`.
    pub fn area_scale(&self, source_idx: usize, q: DVec3) -> f64 {
        let source = &self.sources[source_idx];
        let focal = source.lens.mean_focal() / (self.across * self.desired.lens.mean_focal());
        // q · x = 1 on the plane, so 1 − q · c is c's distance from it over the viewer's.
        focal * focal * (1.0 - q.dot(source.center)).abs()
    }
}

/// The depth, or for a wide lens the distance, that decides a patch's area in the image.
pub(crate) fn depth_for_area(lens: &Lens, point_in_camera: DVec3) -> f64 {
    if lens.is_wide() {
        point_in_camera.length()
    } else {
        point_in_camera.z
    }
}

/// The angle at p between the directions to the desired centre and to c.
///
/// p and c are relative to the desired centre, so it is the angle between p and p − c:
/// |c × p| over p·(p − c), which loses nothing however close c is to the line of sight.
fn angle_difference(center: DVec3, point: &ProxyPoint) -> f64 {
    let (ray, s) = (point.ray, point.inverse_distance);
    let across = s * center.cross(ray).length();
    let along = ray.length_squared() - s * ray.dot(center);
    across.atan2(along)
}

/// max(0, g·|p − c|/|p − d| − 1), computed as (g²|p − c|²/|p − d|² − 1) over (… + 1) so
/// that a ratio near one keeps its digits.
fn footprint_difference(center: DVec3, point: &ProxyPoint, g: f64) -> f64 {
    let (ray, s) = (point.ray, point.inverse_distance);
    let excess =
        (s * s * center.length_squared() - 2.0 * s * ray.dot(center)) / ray.length_squared();
    let squares = (g * g - 1.0) + g * g * excess;
    let difference = (squares / (g * (1.0 + excess).max(0.0).sqrt() + 1.0)).max(0.0);
    match is_planted(Fault::TurnedPenalty) {
        true => -difference,
        false => difference,
    }
}

/// max(0, |p − c| − |p − d|), by the same trick; finite at infinity too.
fn length_difference(center: DVec3, point: &ProxyPoint) -> f64 {
    let (ray, s) = (point.ray, point.inverse_distance);
    let squares = s * center.length_squared() - 2.0 * ray.dot(center);
    (squares / ((ray - s * center).length() + ray.length())).max(0.0)
}
