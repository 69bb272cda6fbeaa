//! How far the fast engines may be from the reference by rounding: a bound for each pixel of the
//! exact field, derived by running their own formulas in intervals.
//!
//! The formulas of `cpu/source.rs` are written for any `Scalar`: once for f32, once for intervals
//! that hold what they give exactly and in f32. What f32's polynomials leave is added where they
//! stand for angles and logarithms. Blends follow from what they are made of (`weights.rs`), photos
//! are sampled over all places that are possible (`sample.rs`).

mod interval;
mod sample;
mod weights;

use crate::cpu::lanes::{LANES, each};
use crate::cpu::probe;
use crate::cpu::scalar::Scalar;
use crate::cpu::source::{Sight, Source, Tile};
use crate::frame::Frame;
use crate::held::Held;
use crate::photos::PhotoError;
use crate::rays::ray_of;
use crate::reference;
use calibrate::{Distortion, Pixel};
pub(crate) use interval::Interval;
use sample::Filter;
use weights::{Candidate, blended};

/// Least and most of each channel: premultiplied, 0…255, coverage last.
pub type Bounds = [[f64; 2]; 4];

/// A pixel of the exact field. Colours are premultiplied, 0…255, coverage last.
#[derive(Clone, Debug)]
pub struct Fragment {
    /// Which pixel.
    pub pixel: (u32, u32),
    /// What the reference has there.
    pub exact: [f64; 4],
    /// What the CPU's engine has, before it is rounded to bytes.
    pub cpu: [f64; 4],
    /// Within which it must be.
    pub cpu_bounds: Bounds,
    /// Within which a graphics device must be that computes as WGSL demands, up to bytes.
    pub gpu_bounds: Bounds,
}

/// f32 rounded to the nearest, as everywhere on a CPU.
const CPU: u32 = 1;
/// WGSL lets a quotient be 2.5 units off in the last place, sums and products one, fused or not, and
/// sums be taken in any order: three times the worst of these, which the longest sum has.
const GPU: u32 = 15;
/// Vulkan demands of filters 4 bits below texels and levels, of which devices have 8; colours of 8
/// bits may be rounded to those after each of three steps.
const GPU_FILTER: Filter = Filter {
    beside: 1.0 / 256.0,
    steps: 2.0,
};
const CPU_FILTER: Filter = Filter {
    beside: 0.0,
    steps: 0.0,
};

/// Of pixels of a frame, with bounds. Ignore masks make bounds wide: they may leave anything.
///
/// # Errors
/// A photo that is needed cannot be decoded.
///
/// # Panics
/// If the frame's blend is not the consistent one.
pub fn fragments(frame: &Frame<'_>, pixels: &[(u32, u32)]) -> Result<Vec<Fragment>, PhotoError> {
    assert_eq!(frame.options.blend, crate::Blend::Consistent);
    let taking_part: Vec<usize> = frame.taking_part().collect();
    let photos = Held::new(frame, &taking_part).uncounted();
    let cpu = probe::colors(frame, pixels, &photos)?;
    let cpu_bounds = bounds::<CPU>(frame, pixels, &photos, CPU_FILTER)?;
    let gpu_bounds = bounds::<GPU>(frame, pixels, &photos, GPU_FILTER)?;
    let fragment = |i: usize| -> Result<Fragment, PhotoError> {
        let (x, y) = pixels[i];
        let point = frame.proxy_point(Pixel::center_of(x, y));
        let exact = point.map(|point| {
            let contributors = reference::blend_at(frame, &point);
            reference::color_at(frame, &photos, &point, &contributors)
        });
        Ok(Fragment {
            pixel: (x, y),
            exact: exact.transpose()?.unwrap_or_default().map(|v| 255.0 * v),
            cpu: cpu[i].to_array().map(f64::from),
            cpu_bounds: cpu_bounds[i],
            gpu_bounds: gpu_bounds[i],
        })
    };
    (0..pixels.len()).map(fragment).collect()
}

fn bounds<const N: u32>(
    frame: &Frame<'_>,
    pixels: &[(u32, u32)],
    photos: &Held<'_>,
    filter: Filter,
) -> Result<Vec<Bounds>, PhotoError> {
    let sources: Vec<(usize, Source<Interval<N>>)> = frame
        .taking_part()
        .map(|i| (i, Source::new(frame, i)))
        .collect();
    let mut all = Vec::new();
    for pixels in pixels.chunks(LANES) {
        let mut tile = Tile::nothing();
        for (k, &(x, y)) in pixels.iter().enumerate() {
            let plane = frame.surface.plane_of(x as usize, y as usize);
            if let (Some(ray), Some(plane)) = (ray::<N>(frame, x, y), plane) {
                tile.set(k, ray, plane);
            }
        }
        let mut candidates: [Vec<Candidate<N>>; LANES] = std::array::from_fn(|_| Vec::new());
        for (i, source) in &sources {
            let mut sight = Sight::nothing();
            if !source.see(&tile, &mut sight) {
                continue;
            }
            relevance(frame, *i, &mut sight, filter);
            let diff = source.difference(&tile);
            for k in (0..pixels.len()).filter(|&k| sight.a[k].hi > 0.0) {
                let size = frame.sources[*i].size;
                let [width, height] = size;
                let at = [
                    sight.u[k].within(0.0, width),
                    sight.v[k].within(0.0, height),
                ];
                let color = sample::sample(photos.get(*i)?, at, sight.level[k], filter);
                candidates[k].push(Candidate {
                    diff: diff[k],
                    a: sight.a[k],
                    color: exposed(color, frame.sources[*i].exposure),
                });
            }
        }
        all.extend(candidates[..pixels.len()].iter().map(|candidates| {
            blended(candidates, &frame.options).map(|color| [color.lo, color.hi])
        }));
    }
    Ok(all)
}

/// As the engine has it: a device computes those of a pinhole in f32.
fn ray<const N: u32>(frame: &Frame<'_>, x: u32, y: u32) -> Option<[Interval<N>; 3]> {
    let lens = &frame.desired.lens;
    let pixel = Pixel::center_of(x, y);
    if N == CPU || lens.distortion() != Distortion::None {
        return Some(ray_of(lens, pixel)?.to_array().map(Interval::rounded));
    }
    let along = |at: f64, principal: f64, focal: f64| {
        (Interval::rounded(at) - Interval::rounded(principal)) * Interval::rounded(1.0 / focal)
    };
    Some([
        along(pixel.x, lens.principal.x, lens.focal.x),
        along(pixel.y, lens.principal.y, lens.focal.y),
        Interval::of(1.0),
    ])
}

/// What masks and what is before the points take off: of a mask anything.
fn relevance<const N: u32>(
    frame: &Frame<'_>,
    source_idx: usize,
    sight: &mut Sight<Interval<N>>,
    filter: Filter,
) {
    let lumigraph = frame.lumigraph;
    if lumigraph.photos.mask(source_idx).is_some() {
        sight.a = each(|k| Interval::new(0.0, sight.a[k].hi));
    }
    if let Some(visibility) = &lumigraph.visibility {
        let map = visibility.map(source_idx);
        sight.a = each(|k| {
            let at = [sight.u[k], sight.v[k]];
            match sight.a[k].hi > 0.0 {
                true => sight.a[k] * sample::shown(map, at, sight.inverse_distance[k], filter),
                false => sight.a[k],
            }
        });
    }
}

/// [`crate::frame::exposed`] of bounds.
fn exposed<const N: u32>(color: [Interval<N>; 4], exposure: [f64; 3]) -> [Interval<N>; 4] {
    let [r, g, b, alpha] = color;
    let channel = |v: Interval<N>, factor: f64| {
        if factor == 1.0 {
            return v;
        }
        let one = Interval::of(1.0);
        let white = Interval::rounded(1.0 - crate::frame::SHOULDER) * alpha;
        let share = ((alpha - v) / white).clamp01();
        v + (Interval::rounded(factor) - one) * v * share
    };
    let [x, y, z] = exposure;
    [channel(r, x), channel(g, y), channel(b, z), alpha]
}
