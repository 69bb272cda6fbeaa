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
mod tests;
