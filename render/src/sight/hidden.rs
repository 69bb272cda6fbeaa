//! What every photo has something before, moved to where one looks past that.

use super::views::Views;
use super::{
    HALVINGS, Moved, STEPS, beam_of_tile, factor, from_source, look, nearest_tried, sees_well,
    shift_px,
};
use crate::options::MAX_CONTRIBUTORS;
use crate::photos::PhotoStore;
use crate::surface::FacetMap;
use crate::tiles::TILE;
use crate::visibility::{TOLERANCE, Visibility, visible};
use calibrate::{Pixel, View};
use glam::DVec3;
use proxy::Rays;
use rayon::prelude::*;
use std::sync::OnceLock;

/// A photo shows a point from which half of it is left, or more, of what it counts with nothing before the point.
const SHOWN: f64 = 0.5;

/// So much of a photo's weight is left within its border that those from which a point is hidden are nothing beside it.
const COUNTS: f64 = 0.02;

/// What is so many times as near is another thing, and not the same surface farther on. A texel beside it, where a photo
/// has at least its blur, nothing else is seen.
const NEARER: f64 = 1.5;

/// But nothing is moved to where so large a part of a photo's longer side beside it there is something that is so many
/// times as near: surfaces are not as exact along their rims, and what is there may still be the thing itself.
const ASIDE: f64 = 1.0 / 160.0;
const NEARER_ASIDE: f64 = 1.1;

/// One pixel is asked of so many across and down. What the others see of the same facet, or as far, is seen if that is,
/// unless it is otherwise with the block to the right, below, or at the corner between.
const BLOCK: usize = 2;

/// So many across and down, of what is as far, move alike if they can, or not much farther; where one is shown nowhere
/// the next are not looked for.
const ALIKE: usize = 4;

/// The source views, and their distance maps.
struct Asked<'a> {
    views: &'a Views<'a>,
    visibility: &'a Visibility,
    photos: &'a PhotoStore,
    /// The source views, the nearest camera first.
    nearest: Vec<u32>,
}

impl<'a> Asked<'a> {
    fn new(views: &'a Views<'a>, visibility: &'a Visibility, photos: &'a PhotoStore) -> Self {
        // Worked out once, not at each comparison.
        let distances = views.sources.iter().map(|s| s.center.length_squared());
        let mut nearest: Vec<(f64, u32)> = distances.zip(0..).collect();
        nearest.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Self {
            views,
            visibility,
            photos,
            nearest: nearest.into_iter().map(|(_, view)| view).collect(),
        }
    }

    /// Where a source view has the point at ray / s in its image, if its mask does not ignore it there, and how much is
    /// left of it: nothing where it has something `nearer` times as near within so many pixels.
    fn visible(
        &self,
        view: usize,
        ray: DVec3,
        s: f64,
        (within_px, nearer): (f64, f64),
    ) -> Option<(Pixel, f64)> {
        let source = &self.views.sources[view];
        let point = from_source(source, ray, s);
        let [width, height] = source.size;
        let is_inside = |p: &Pixel| p.x >= 0.0 && p.y >= 0.0 && p.x <= width && p.y <= height;
        let pixel = source.lens.project(point).filter(is_inside)?;
        if self.photos.mask(view).is_some_and(|mask| !mask.uses(pixel)) {
            return None;
        }
        let (map, s) = (self.visibility.map(view), s / point.length());
        let left = visible(s, map.inverse_distance(pixel));
        let around = [-within_px, within_px].map(|by| [pixel.x + by, pixel.y + by]);
        let is_beside = left >= SHOWN && map.largest_within(around[0], around[1]) > nearer * s;
        Some((pixel, if is_beside { 0.0 } else { left }))
    }

    /// By how many pixels of a desired view the point at ray / s is a guess that is shown elsewhere: so far apart who shows
    /// it has both. Or who is nearest to the viewer, from whom it may be hidden: by as much more as that counts less,
    /// since it counts the more the nearer it is, and at its own place alone.
    fn shift_px(&self, desired: &View, ray: DVec3, s: f64, shown: &Shown) -> f32 {
        let sources = self.views.sources;
        let shift = |view: usize| shift_px(&sources[view], desired, ray, s, s * shown.times);
        let mut nearest = self
            .nearest
            .iter()
            .map(|view| *view as usize)
            .filter(|view| {
                let source = &sources[*view];
                source.takes_part() && source.time_penalty == 0.0
            });
        let by_nearest = nearest.find_map(|view| {
            let (_, left) = self.visible(view, ray, s, (0.0, f64::INFINITY))?;
            Some(shift(view) / left as f32)
        });
        by_nearest.unwrap_or(f32::INFINITY).min(shift(shown.view))
    }

    /// What one says of the point at ray / s.
    fn says(&self, view: usize, ray: DVec3, s: f64) -> Says {
        let counts = |pixel| self.views.sources[view].fov_blend(pixel) >= COUNTS;
        // A pixel around it has its texel and those beside that.
        match self.visible(view, ray, s, (1.0, NEARER)) {
            Some((_, left)) if left < SHOWN => Says::Hidden,
            Some((pixel, _)) if counts(pixel) => Says::Seen,
            _ => Says::Nothing,
        }
    }

    /// Whether one has the point at ray / s in its image, with nothing before it, beyond doubt of rounding, and so far
    /// within its border that half of it counts.
    fn shows(&self, view: usize, ray: DVec3, s: f64) -> bool {
        let source = &self.views.sources[view];
        let counts = |(pixel, left): (Pixel, f64)| left * source.fov_blend(pixel) >= SHOWN;
        let aside = (ASIDE * source.size[0].max(source.size[1])).max(1.0);
        let visible = self.visible(view, ray, s, (aside, NEARER_ASIDE));
        visible.is_some_and(counts) && sees_well(source, ray, s)
    }

    /// The nearest place before the point at ray / s that one of some shows, from a step on.
    fn nearest_shown(&self, near: &[u32], ray: DVec3, s: f64, first: i32) -> Option<Shown> {
        let mut along = Vec::new();
        self.views.along(near, ray, s * nearest_tried(), &mut along);
        let shown = |step: i32| {
            let s = s * factor(step);
            let mut all = along.iter().filter(|(_, stretch)| stretch.has(s));
            let found = all.find(|(view, _)| self.shows(*view as usize, ray, s));
            found.map(|(view, _)| *view as usize)
        };
        let (step, view) = (first..=STEPS).find_map(|step| Some((step, shown(step)?)))?;
        // Where between it and the one before who shows it begins to, so that neighbouring pixels move alike.
        let (mut times, mut beyond) = (factor(step), factor(step - 1));
        for _ in 0..HALVINGS {
            let middle = (times * beyond).sqrt();
            match self.shows(view, ray, s * middle) {
                true => times = middle,
                false => beyond = middle,
            }
        }
        Some(Shown { times, step, view })
    }
}

/// What a source view says of a point: that it has it in its image, with nothing before it and not just within the
/// border, where it hardly counts; that something is before it; or nothing.
#[derive(PartialEq)]
enum Says {
    Seen,
    Hidden,
    Nothing,
}

/// Where something that is hidden is shown.
#[derive(Clone, Copy)]
struct Shown {
    /// How many times as near, which lies between this step and the one before.
    times: f64,
    step: i32,
    /// Who shows it.
    view: usize,
}

impl Shown {
    /// The plane across the ray there, of the point at ray / s.
    fn plane(&self, ray: DVec3, s: f64) -> DVec3 {
        ray * (s * self.times / ray.length_squared())
    }
}

/// Whether inverse distances may be of the same surface.
fn are_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= TOLERANCE * a.max(b)
}

/// What is to be moved, row by row: what every photo that has it in its image has something before, to the
/// nearest place before it along its ray that a photo shows.
///
/// Nobody knows what is there, nor, but that it is no nearer, where: it may be a dome. What photos have
/// in its direction is what is before it, and painting that shows an object a second time, beside itself.
/// Where a photo looks past the object there is what lies beside it.
pub(super) fn hidden(
    map: &FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    views: &Views<'_>,
    visibility: &Visibility,
    photos: &PhotoStore,
) -> Vec<Vec<Moved>> {
    let looks = Looks::new(map, desired, rays, views, visibility, photos);
    let [width, height] = map.size.map(|side| side as usize);
    // 1. One pixel of each block.
    let of_row = |top: usize| -> Vec<bool> {
        let mut last = None;
        let lefts = (0..width).step_by(BLOCK);
        lefts
            .map(|left| looks.is_seen(left, top, &mut last))
            .collect()
    };
    let tops: Vec<usize> = (0..height).step_by(BLOCK).collect();
    let firsts: Vec<Vec<bool>> = tops.into_par_iter().map(of_row).collect();
    // 2. The others.
    let tile_rows = (0..map.tiles.down()).into_par_iter();
    tile_rows
        .flat_map_iter(|tile_row| looks.moved_of_tiles(tile_row, &firsts))
        .collect()
}

/// What the pixels of a picture look at, and who may see it.
struct Looks<'a> {
    map: &'a FacetMap,
    desired: &'a View,
    rays: Option<&'a Rays>,
    asked: Asked<'a>,
    /// By tile, row by row; see [`Self::near`].
    near: Vec<OnceLock<Vec<u32>>>,
}

/// The same of what is looked at between the pixels of a picture.
pub(crate) struct Between<'a>(Looks<'a>);

impl<'a> Between<'a> {
    pub(crate) fn new(
        map: &'a FacetMap,
        desired: &'a View,
        views: &'a Views<'a>,
        visibility: &'a Visibility,
        photos: &'a PhotoStore,
    ) -> Self {
        Self(Looks::new(map, desired, None, views, visibility, photos))
    }

    /// Who sees the point at ray / s, of a ray through a pixel.
    pub(crate) fn who_sees(&self, (x, y): (usize, usize), ray: DVec3, s: f64) -> Seen {
        self.0.who_sees((x, y), ray, s, &mut None)
    }

    /// The plane across the ray at the nearest place before that point which one shows.
    pub(crate) fn shown_before(&self, (x, y): (usize, usize), ray: DVec3, s: f64) -> Option<DVec3> {
        let shown = self.0.asked.nearest_shown(self.0.near(x, y), ray, s, 1)?;
        Some(shown.plane(ray, s))
    }
}

/// Who sees a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Seen {
    ByOne,
    /// Every photo that has it in its image has something before it.
    ByNone,
    /// No photo has it in its image.
    Beside,
}

impl<'a> Looks<'a> {
    fn new(
        map: &'a FacetMap,
        desired: &'a View,
        rays: Option<&'a Rays>,
        views: &'a Views<'a>,
        visibility: &'a Visibility,
        photos: &'a PhotoStore,
    ) -> Self {
        Self {
            map,
            desired,
            rays,
            asked: Asked::new(views, visibility, photos),
            near: vec![OnceLock::new(); map.tiles.count()],
        }
    }
}

impl Looks<'_> {
    fn at(&self, x: usize, y: usize) -> Option<(DVec3, f64)> {
        look(self.map, self.desired, self.rays, x, y)
    }

    /// Who is asked about the pixels of a tile, found when first asked for: as many as contribute to a pixel at most,
    /// those whose cameras are nearest. Others would need distance maps that nothing else in the picture does.
    fn near(&self, x: usize, y: usize) -> &[u32] {
        self.near[self.map.tiles.number(x, y)].get_or_init(|| {
            let beam = beam_of_tile(self.map, &|x, y| self.at(x, y), x, y);
            let Asked { views, nearest, .. } = &self.asked;
            views.first_within(nearest, &beam, MAX_CONTRIBUTORS)
        })
    }

    /// Whether anyone sees what a pixel looks at, or nobody has something before it. Who saw the `last` mostly does.
    fn is_seen(&self, x: usize, y: usize, last: &mut Option<usize>) -> bool {
        let Some((ray, s)) = self.at(x, y).filter(|(_, s)| *s > 0.0) else {
            return true;
        };
        self.who_sees((x, y), ray, s, last) != Seen::ByNone
    }

    /// Who sees the point at ray / s, of a ray through a pixel. Who saw the `last` is asked first.
    fn who_sees(
        &self,
        (x, y): (usize, usize),
        ray: DVec3,
        s: f64,
        last: &mut Option<usize>,
    ) -> Seen {
        if last.is_some_and(|view| self.asked.says(view, ray, s) == Says::Seen) {
            return Seen::ByOne;
        }
        let mut is_hidden = false;
        let mut near = self.near(x, y).iter().map(|view| *view as usize);
        *last = near.find(|view| {
            let says = self.asked.says(*view, ray, s);
            is_hidden |= says == Says::Hidden;
            says == Says::Seen
        });
        match (*last, is_hidden) {
            (Some(_), _) => Seen::ByOne,
            (None, true) => Seen::ByNone,
            (None, false) => Seen::Beside,
        }
    }

    /// What is moved of a row of tiles, by row. Of each block it is known whether its first pixel is seen.
    fn moved_of_tiles(&self, tile_row: usize, firsts: &[Vec<bool>]) -> Vec<Vec<Moved>> {
        let [width, height] = self.map.size.map(|side| side as usize);
        let rows = tile_row * TILE..((tile_row + 1) * TILE).min(height);
        let mut moved: Vec<Vec<Moved>> = rows.clone().map(|_| Vec::new()).collect();
        // Where what was looked for last nearby is shown, if it is, and from what inverse distance.
        let mut alike: Vec<Option<(f64, Option<Shown>)>> = vec![None; width.div_ceil(ALIKE)];
        for top in rows.clone().step_by(BLOCK) {
            if top % ALIKE == 0 {
                alike.fill(None);
            }
            let mut last = None;
            for left in (0..width).step_by(BLOCK) {
                let alike = &mut alike[left / ALIKE];
                // Where blocks beside it are otherwise, seeing ends within it.
                let (column, row) = (left / BLOCK, top / BLOCK);
                let first = firsts[row][column];
                let beside = firsts[row..].iter().take(2);
                let mut beside = beside.flat_map(|row| row[column..].iter().take(2));
                let are_alike = beside.all(|is_seen| *is_seen == first);
                let facet_at = |x: usize, y: usize| self.map.facet_of[y * width + x];
                let (facet, mut looks) = (facet_at(left, top), None);
                for y in top..(top + BLOCK).min(rows.end) {
                    for x in left..(left + BLOCK).min(width) {
                        let mut is_of_first = || {
                            let first = *looks.get_or_insert_with(|| self.at(left, top));
                            let both = first.zip(self.at(x, y));
                            both.is_some_and(|((_, a), (_, b))| are_near(a, b))
                        };
                        // A facet is one surface; where they are small most pixels see one of their own.
                        let mut is_alike = || facet_at(x, y) == facet || is_of_first();
                        let is_seen = match (x, y) == (left, top) || (are_alike && is_alike()) {
                            true => first,
                            false => self.is_seen(x, y, &mut last),
                        };
                        if !is_seen {
                            let shown = self.moves(x, y, alike);
                            moved[y - rows.start].extend(shown);
                        }
                    }
                }
            }
        }
        moved
    }

    /// Where a pixel moves, if it does; as the last did nearby, from what inverse distance, if it can.
    fn moves(&self, x: usize, y: usize, alike: &mut Option<(f64, Option<Shown>)>) -> Option<Moved> {
        let ((ray, s), asked) = (self.at(x, y)?, &self.asked);
        let before = alike.filter(|(other, _)| are_near(s, *other));
        let shown = match before {
            Some((_, None)) => None,
            _ => {
                let before = before.and_then(|(_, shown)| shown);
                let is_shown = |shown: &Shown| asked.shows(shown.view, ray, s * shown.times);
                let from = before.map_or(1, |shown| (shown.step - 1).max(1));
                let shown = before.filter(is_shown);
                shown.or_else(|| asked.nearest_shown(self.near(x, y), ray, s, from))
            }
        };
        *alike = Some((s, shown));
        let shown = shown?;
        Some(Moved {
            x,
            plane: shown.plane(ray, s),
            source_idx: shown.view as u32,
            shift_px: asked.shift_px(self.desired, ray, s, &shown),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Frame, FrameSource};
    use crate::lumigraph::{Lumigraph, SourceView};
    use crate::options::FieldOptions;
    use crate::surface::Surface;
    use calibrate::{Lens, Rigid3};
    use glam::DVec2;
    use image::{GrayImage, RgbaImage};
    use proxy::{Mesh, MeshKind, Proxy, Solid};
    use std::sync::Arc;

    const SIZE: (u32, u32) = (80, 60);
    /// How far the board is, and from where to where it reaches.
    const BOARD: f64 = 2.0;
    const LEFT: f64 = 0.2;
    const RIGHT: f64 = 0.8;

    /// Looks along z from a place on the x axis, 45° to either side.
    fn view(x: f64) -> View {
        let center = DVec3::X * x;
        View {
            lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(40.0, 30.0)),
            width: SIZE.0,
            height: SIZE.1,
            camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y),
        }
    }

    /// A board before a far wall, which photos from these places see.
    fn board(places: &[f64]) -> Lumigraph {
        let board = |left: f64, right: f64, high: f64, z: f64| Mesh {
            positions: [(left, -high), (right, -high), (right, high), (left, high)]
                .map(|(x, y)| DVec3::new(x, y, z))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let mut mesh = board(-200.0, 200.0, 200.0, 40.0);
        mesh.append(&board(LEFT, RIGHT, 9.0, BOARD));
        let proxy = Proxy::Mesh(Arc::new(Solid::new(MeshKind::Mesh, mesh)));
        let source = |x: &f64| SourceView {
            name: format!("{x}.png"),
            view: view(*x),
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        };
        let sources: Vec<SourceView> = places.iter().map(source).collect();
        let photo = RgbaImage::new(SIZE.0, SIZE.1);
        Lumigraph {
            visibility: Visibility::of(&proxy, &sources),
            photos: PhotoStore::from_images(vec![photo; places.len()]),
            sources,
            proxy,
            points: Vec::new(),
        }
    }

    /// Of each pixel of the middle row, from the place 0: the tangent of its ray, and the depth it sees.
    fn seen(lumigraph: &Lumigraph) -> Vec<(f64, f64)> {
        let frame = Frame::new(lumigraph, view(0.0), FieldOptions::default());
        let Surface::Facets(map) = &frame.surface else {
            panic!("facets")
        };
        let row = (0..SIZE.0 as usize).map(|x| (x, SIZE.1 as usize / 2));
        let of_pixel = |(x, y)| {
            let (ray, s) = look(map, &frame.desired, None, x, y).unwrap();
            let in_world = frame.desired.camera_from_world.rotation.conjugate() * ray;
            (in_world.x / in_world.z, in_world.z / s)
        };
        row.map(of_pixel).collect()
    }

    #[test]
    fn what_all_photos_have_something_before_moves_to_where_one_looks_past() {
        // The photo's own ray to the point of the wall at tangent t passes the board's plane at 1 + 2 (t − 1/40).
        let behind = |place: f64, t: f64, z: f64| place + BOARD * (t - place / z);
        let hides = |x: f64| (LEFT..=RIGHT).contains(&x);
        let mut moved = 0;
        for (t, z) in seen(&board(&[1.0])) {
            let on_board = hides(BOARD * t);
            if on_board {
                assert_eq!(z, BOARD, "{t}");
                continue;
            }
            // Texels are two pixels, or 0.1 on the board. One may be half on it, one beside it is its rim in the
            // map, and one beside that is here.
            let by = 0.36;
            let at_wall = behind(1.0, t, 40.0);
            if t < -0.97 {
                // The photo does not have it in its image.
                continue;
            }
            if !(LEFT - by..RIGHT + by).contains(&at_wall) {
                assert!((z - 40.0).abs() < 1e-9, "{t}: {z}");
            } else if hides(at_wall) {
                moved += 1;
                // It looks past, and by no more than it must.
                let x = behind(1.0, t, z);
                assert!(z < 40.0 && (x - LEFT).abs() < by, "{t}: {z}, {x}");
            }
        }
        assert!(moved > 8, "{moved}");
    }

    #[test]
    fn what_another_photo_shows_stays() {
        let far = |places: &[f64]| {
            let seen = seen(&board(places));
            seen.iter().filter(|(_, z)| *z > 39.0).count()
        };
        let (one, both) = (far(&[1.0]), far(&[1.0, -1.0]));
        // The board takes twelve of the 80, and hides as many from either photo.
        assert!(one < 58 && both == 68, "{one}, {both}");
    }

    #[test]
    fn nothing_is_shown_right_beside_what_is_before_it() {
        // Four pixels of the photo are 1/160 of it.
        let mut lumigraph = board(&[1.0]);
        lumigraph.sources[0].view = view(1.0).resized(640, 480);
        let visibility = Visibility::of(&lumigraph.proxy, &lumigraph.sources).unwrap();
        let desired = view(0.0);
        let sources = [FrameSource::of(&lumigraph.sources[0].view, &desired)];
        let views = Views::new(&sources);
        let asked = Asked::new(&views, &visibility, &lumigraph.photos);
        // Past the board's left edge by so many pixels, at some depth.
        let at = |past_px: f64, z: f64| {
            let tangent = (LEFT - 1.0) / BOARD - past_px / 320.0;
            let point = DVec3::new(1.0 + tangent * z, 0.0, z);
            desired.camera_from_world.rotation * point
        };
        let shows = |past_px: f64, z: f64| asked.shows(0, at(past_px, z), 1.0);
        let seen = |past_px: f64, z: f64| asked.says(0, at(past_px, z), 1.0) == Says::Seen;
        assert!(!shows(3.0, 2.4) && shows(12.0, 2.4));
        // There it is seen, but nothing moves there. What is hardly farther than the board may be a part of it.
        assert!(seen(3.0, 2.4) && shows(3.0, 2.1));
    }

    #[test]
    fn what_a_mask_ignores_shows_nothing() {
        let mut lumigraph = board(&[1.0, -1.0]);
        let far = |lumigraph: &Lumigraph| {
            let seen = seen(lumigraph);
            seen.iter().filter(|(_, z)| *z > 39.0).count()
        };
        let one = far(&board(&[1.0]));
        let nothing = GrayImage::new(SIZE.0, SIZE.1);
        let photos = std::mem::replace(&mut lumigraph.photos, PhotoStore::from_images(Vec::new()));
        lumigraph.photos = photos.with_masks(&[false, true], move |_| Ok(nothing.clone()));
        // As if there were the first photo alone, but for what only the other has in its image.
        let masked = far(&lumigraph);
        assert!(masked >= one && masked < one + 4, "{masked}, {one}");
    }

    #[test]
    fn all_moves_that_nobody_sees_and_that_is_shown_before() {
        let lumigraph = board(&[1.0, 0.8, 300.0, -300.0]);
        let visibility = lumigraph.visibility.as_ref().unwrap();
        let desired = view(0.0);
        let places = lumigraph
            .sources
            .iter()
            .map(|s| FrameSource::of(&s.view, &desired));
        let sources: Vec<FrameSource> = places.collect();
        let Proxy::Mesh(solid) = &lumigraph.proxy else {
            panic!("a mesh")
        };
        let rays = Rays::of(&desired.lens, SIZE);
        let map = FacetMap::of_mesh(solid, &desired, rays.as_ref());
        let photos = &lumigraph.photos;
        let views = Views::new(&sources);
        let asked = Asked::new(&views, visibility, photos);
        let moved = hidden(&map, &desired, rays.as_ref(), &views, visibility, photos);
        let is_seen = |x: usize, y: usize| {
            let (ray, s) = look(&map, &desired, rays.as_ref(), x, y).unwrap();
            let all = || (0..sources.len()).map(|view| asked.says(view, ray, s));
            let is_seen = all().any(|says| says == Says::Seen);
            (is_seen || !all().any(|says| says == Says::Hidden), s)
        };
        let (mut count, mut nearest, mut stays) = (0, 0, 0);
        for (y, row) in moved.iter().enumerate() {
            for x in 0..SIZE.0 as usize {
                let (ray, s) = look(&map, &desired, rays.as_ref(), x, y).unwrap();
                let corner = [x, y].map(|at| at / BLOCK * BLOCK);
                let (first, first_s) = is_seen(corner[0], corner[1]);
                let beside = [[0, 0], [BLOCK, 0], [0, BLOCK], [BLOCK, BLOCK]];
                let beside = beside.map(|[right, below]| [corner[0] + right, corner[1] + below]);
                let mut beside = beside
                    .iter()
                    .filter(|[x, y]| *x < SIZE.0 as usize && *y < SIZE.1 as usize);
                let are_alike = beside.all(|[x, y]| is_seen(*x, *y).0 == first);
                let is_seen = match are_alike && are_near(s, first_s) {
                    true => first,
                    false => is_seen(x, y).0,
                };
                let shown = |s: f64| (0..sources.len()).find(|view| asked.shows(*view, ray, s));
                let first = (1..=STEPS).find(|k| shown(s * factor(*k)).is_some());
                let found = row.iter().find(|moved| moved.x == x);
                let moves = !is_seen && first.is_some();
                assert!(moves || found.is_none(), "{x} {y}");
                // It may stay as one beside it does.
                stays += usize::from(moves && found.is_none());
                if let Some((moved, k)) = found.zip(first) {
                    // It may move as others beside it do.
                    let at = moved.plane.dot(ray);
                    assert!(at > s * factor(k - 1), "{x} {y}");
                    nearest += usize::from(at < s * factor(k + 3));
                    let view = moved.source_idx as usize;
                    assert!(
                        asked.shows(view, ray, 1.001 * at) || asked.shows(view, ray, 0.999 * at)
                    );
                    count += 1;
                }
            }
        }
        assert!(count > 100 && nearest > count * 3 / 4, "{count}, {nearest}");
        assert!(stays < count / 50, "{count}, {stays}");
    }
}
