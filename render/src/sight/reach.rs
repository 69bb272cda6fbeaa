//! How far source views reach: what a view surely does not see, it need not be asked about.
//!
//! The points at ray / s are (ray, s) in homogeneous coordinates, and what a view sees of them lies within a
//! pyramid whose apex is the view's centre; where its lens sees aside and behind, outside of one. Sides of
//! pyramids are linear in ray and s. So a view reaches along a ray from one inverse distance to another, and
//! whether it reaches into a box of rays is told by the box's corners, at the least s and at the greatest.
//!
//! All of it is on the safe side of rounding. What is computed of the point at (ray, s), in a source camera's frame
//! R·ray + t·s, is off by some ε·(|ray| + |t|·s), and so is a side's value there, as normals have unit length. By
//! [`SLACK`]·(|ray| + |t|·s), some million times as much, sides are moved: outwards where views see within, inwards
//! where they see beyond. Up to there they are linear in s, too, so that is added to what they consist of.
//! Of the sums over a box's corners, and of the quotient that says at which s a side is met, rounding is worth some
//! ε·(|ray| + |t|·s) of the side's value, too.

use crate::frame::FrameSource;
use crate::view_tree::{SLACK, widest};
use calibrate::{Distortion, Lens};
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

/// What a photo can show, by directions in its camera's frame.
#[derive(Clone, Copy, Debug)]
enum Shows {
    /// No more than what meets the rectangle between two points of the plane z = 1. (Behind the camera no
    /// direction is inside of the pyramid's four sides.)
    Within(DVec2, DVec2),
    /// Nothing that meets the square |x|, |y| ≤ this of the plane z = −1.
    Beyond(f64),
    /// That is not known.
    Anything,
}

impl Shows {
    fn of(lens: &Lens, size: [f64; 2]) -> Self {
        if lens.distortion() == Distortion::None {
            let size = DVec2::from_array(size);
            // Positions in the photo are computed as x / z · f + c, and lie within it: so they are off by some
            // ε · (size + 2 |c|) at the most.
            let wider = SLACK * (size + lens.principal.abs());
            let at = |pixel: DVec2| (pixel - lens.principal) / lens.focal;
            let (one, other) = (at(-wider), at(size + wider));
            return Self::Within(one.min(other), one.max(other));
        }
        // Farther from the axis the photo shows nothing, as the view tree has it, or the lens does not see.
        let limit = match lens.distortion() {
            Distortion::Rational { .. } | Distortion::Tilted { .. } => lens.limit().atan(),
            _ => lens.limit(),
        };
        let angle = widest(lens, size).min(limit);
        if angle <= FRAC_PI_2 {
            // A pyramid around the cone.
            let side = DVec2::splat(angle.tan());
            Self::Within(-side, side)
        } else if angle < PI {
            // A pyramid in the cone behind, whose edges lie on that.
            Self::Beyond((PI - angle).tan() / SQRT_2)
        } else {
            Self::Anything
        }
    }
}

/// The same by the inward normals of a pyramid's sides, in the camera's frame, of unit length.
enum Pyramid {
    Within([DVec3; 4]),
    Beyond([DVec3; 4]),
    Anything,
}

impl Pyramid {
    fn of(shows: Shows) -> Self {
        let normals = |least: DVec2, most: DVec2| {
            let normals = [
                DVec3::new(1.0, 0.0, -least.x),
                DVec3::new(-1.0, 0.0, most.x),
                DVec3::new(0.0, 1.0, -least.y),
                DVec3::new(0.0, -1.0, most.y),
            ];
            normals.map(DVec3::normalize)
        };
        match shows {
            Shows::Within(least, most) => Self::Within(normals(least, most)),
            Shows::Beyond(side) => Self::Beyond(normals(DVec2::splat(side), DVec2::splat(-side))),
            Shows::Anything => Self::Anything,
        }
    }
}

/// A side of a pyramid: the point at ray / s is inside where normal · ray + offset · s is positive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// In the desired camera's frame, of unit length.
    normal: DVec3,
    /// Moved by the slack that goes with s.
    offset: f64,
}

/// Where a source view may see something.
#[derive(Clone, Copy, Debug)]
pub(super) enum Reach {
    /// It takes no part.
    Nowhere,
    /// Nowhere but inside of a pyramid.
    Within([Side; 4]),
    /// Nowhere inside of a pyramid.
    Beyond([Side; 4]),
    /// Anywhere, for all that is known.
    Anywhere,
}

/// Of each source view.
pub(super) fn reaches(sources: &[FrameSource]) -> Vec<Reach> {
    let mut last: Option<(Lens, [f64; 2], Pyramid)> = None;
    let of_source = |source: &FrameSource| {
        if !source.takes_part() {
            return Reach::Nowhere;
        }
        // Most photos share their lens.
        match &last {
            Some((lens, size, pyramid)) if *lens == source.lens && *size == source.size => {
                Reach::of(source, pyramid)
            }
            _ => {
                let pyramid = Pyramid::of(Shows::of(&source.lens, source.size));
                let reach = Reach::of(source, &pyramid);
                last = Some((source.lens, source.size, pyramid));
                reach
            }
        }
    };
    sources.iter().map(of_source).collect()
}

/// Whether a source view may see something within a beam: all that do may.
pub(super) fn may_within(beam: &Beam) -> impl Fn(&Reach) -> bool {
    let slack = SLACK * beam.least.abs().max(beam.most.abs()).length();
    move |reach| reach.may_within(beam, slack)
}

impl Reach {
    fn of(source: &FrameSource, pyramid: &Pyramid) -> Self {
        let (normals, slack) = match pyramid {
            Pyramid::Within(normals) => (normals, SLACK),
            Pyramid::Beyond(normals) => (normals, -SLACK),
            Pyramid::Anything => return Self::Anywhere,
        };
        let to_desired = source.rotation.transpose();
        let slack = slack * source.translation.length();
        let sides = normals.map(|normal| Side {
            normal: to_desired * normal,
            offset: normal.dot(source.translation) + slack,
        });
        let is_known = |side: &Side| side.normal.is_finite() && side.offset.is_finite();
        match pyramid {
            _ if !sides.iter().all(is_known) => Self::Anywhere,
            Pyramid::Within(_) => Self::Within(sides),
            Pyramid::Beyond(_) | Pyramid::Anything => Self::Beyond(sides),
        }
    }

    /// Where along a ray it may see something.
    pub(super) fn along(&self, ray: DVec3) -> Stretch {
        let (sides, slack, is_outside) = match self {
            Self::Nowhere => return Stretch::NOTHING,
            Self::Anywhere => return Stretch::ALL,
            Self::Within(sides) => (sides, SLACK, false),
            Self::Beyond(sides) => (sides, -SLACK, true),
        };
        let slack = slack * ray.length();
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for side in sides {
            let at_infinity = side.normal.dot(ray) + slack;
            let met = -at_infinity / side.offset;
            if side.offset > 0.0 {
                from = from.max(met);
            } else if side.offset < 0.0 {
                to = to.min(met);
            } else if at_infinity < 0.0 {
                to = f64::NEG_INFINITY;
            }
        }
        Stretch {
            from,
            to,
            is_outside,
        }
    }

    /// Whether it may see something within a beam, where `slack` goes with the longest of its rays.
    fn may_within(&self, beam: &Beam, slack: f64) -> bool {
        // What is no number leaves a view in.
        match self {
            Self::Nowhere => false,
            Self::Anywhere => true,
            // Not if all of the beam is outside of one side.
            Self::Within(sides) => !sides.iter().any(|side| {
                let corners = (side.normal * beam.least).max(side.normal * beam.most);
                let most = corners.element_sum() + slack;
                most < 0.0 && most + side.offset * beam.nearest < 0.0
            }),
            // Not if all of it is inside of all.
            Self::Beyond(sides) => !sides.iter().all(|side| {
                let corners = (side.normal * beam.least).min(side.normal * beam.most);
                let least = corners.element_sum() - slack;
                least > 0.0 && least + side.offset * beam.nearest > 0.0
            }),
        }
    }
}

/// A part of a ray, by inverse distances of zero or more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    from: f64,
    to: f64,
    /// Whether it is what is not between those.
    is_outside: bool,
}

impl Stretch {
    const NOTHING: Self = Self {
        from: f64::INFINITY,
        to: f64::NEG_INFINITY,
        is_outside: false,
    };
    const ALL: Self = Self {
        is_outside: true,
        ..Self::NOTHING
    };

    /// Whether it has an inverse distance.
    pub(super) fn has(&self, s: f64) -> bool {
        (self.from..=self.to).contains(&s) != self.is_outside
    }

    /// Whether it has any inverse distance up to one.
    pub(super) fn has_any(&self, nearest: f64) -> bool {
        if self.is_outside {
            !(self.from <= 0.0 && nearest <= self.to)
        } else {
            self.from <= self.to && self.from <= nearest
        }
    }
}

/// The points at ray / s of all rays in a box, with s from zero to some inverse distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beam {
    least: DVec3,
    most: DVec3,
    nearest: f64,
}

impl Beam {
    /// Of no rays.
    pub(super) const NONE: Self = Self {
        least: DVec3::INFINITY,
        most: DVec3::NEG_INFINITY,
        nearest: 0.0,
    };

    /// The smallest that has the point at ray / s, too; where s is negative or no number, the ray alone.
    pub(super) fn with(self, ray: DVec3, s: f64) -> Self {
        Self {
            least: self.least.min(ray),
            most: self.most.max(ray),
            nearest: self.nearest.max(s),
        }
    }

    /// The same rays, so many times as near.
    pub(super) fn nearer(self, times: f64) -> Self {
        Self {
            nearest: self.nearest * times,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::sees;
    use super::*;
    use crate::frame::every_lens;
    use std::slice::from_ref;

    /// Evenly in 0…1.
    fn share(i: u32, of: f64) -> f64 {
        (f64::from(i + 1) * (0.618_033_988_7 + of)).fract()
    }

    #[test]
    fn what_a_view_sees_is_within_its_reach_whatever_its_lens() {
        let lumigraph = every_lens::lumigraph();
        let frame = every_lens::frame(&lumigraph);
        let reaches = reaches(&frame.sources);
        assert_eq!(reaches.len(), frame.sources.len());
        let (mut unseen, mut beyond_reach) = (0, 0);
        for (i, (source, reach)) in frame.sources.iter().zip(&reaches).enumerate() {
            // All of a photo, up to its borders; then all around, also as far as can be, and near.
            let of_photo = every_lens::points(&frame, i).into_iter().map(|(point, _)| {
                let [x, y, z, s] = point.map(f64::from);
                (DVec3::new(x, y, z), s)
            });
            let around = (0..3000).map(|k| {
                let (sin, cos) = (2.0 * PI * share(k, 0.0)).sin_cos();
                let y = 2.0 * share(k, 0.1) - 1.0;
                let level = (1.0 - y * y).sqrt();
                let s = [0.0, 1.0, 6.0, 1e9][k as usize % 4] * share(k, 0.2);
                (DVec3::new(level * sin, y, level * cos), s)
            });
            let mut before = None;
            for (ray, s) in of_photo.chain(around) {
                let sees = sees(source, ray, s);
                let (last, last_s, last_sees) = before.unwrap_or((ray, s, sees));
                before = Some((ray, s, sees));
                let may = reach.along(ray).has(s);
                assert!(may || !sees, "{i}: {reach:?}, {ray} at {s}");
                assert!(!may || reach.along(ray).has_any(s), "{i}: {ray} at {s}");
                let beam = Beam::NONE.with(ray, s).with(last, last_s);
                let is_within = may_within(&beam)(reach);
                assert!(is_within || !(sees || last_sees), "{i}: {beam:?}");
                unseen += u32::from(!sees);
                beyond_reach += u32::from(!may);
            }
        }
        assert!(2 * beyond_reach > unseen, "{beyond_reach} of {unseen}");
    }

    #[test]
    fn who_takes_no_part_reaches_nowhere() {
        let lumigraph = every_lens::lumigraph();
        let mut source = every_lens::frame(&lumigraph).sources[0];
        source.time_penalty = f64::INFINITY;
        let reach = reaches(from_ref(&source))[0];
        assert!(!reach.along(DVec3::Z).has_any(1.0));
        let beam = Beam::NONE.with(DVec3::Z, 1.0);
        assert!(!may_within(&beam)(&reach));
    }
}
