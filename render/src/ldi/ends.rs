//! Where a sample's surface ends.
//!
//! A pixel at an outline tells that its surface goes on for less than a pixel more. Patches that are
//! made larger so that no gaps are left between neighbours, of several images, make what is in front
//! swell by more than half a pixel on all sides; they need not where there is no neighbour.

use glam::DMat3;

/// The sides of a sample's pixel beyond which its image saw something farther: 1 right, 2 below, 4
/// left, 8 above.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ends(pub u8);

/// What is behind a surface by more, in shares of its inverse depth, is another one.
const STEP: f64 = 0.05;
/// So many standard deviations are no chance.
const SURE: f64 = 3.0;

impl Ends {
    /// Of a pixel of an image by its inverse depths; beside pixels that show nothing, nothing is known.
    ///
    /// Inverse depth is linear on a plane, so what goes on as it comes from the other side is the same
    /// surface however fast it recedes. `noise` is the inverse depths' standard deviation.
    pub(super) fn of(
        inverse_depth: &[f32],
        [width, height]: [usize; 2],
        i: usize,
        noise: f64,
    ) -> Self {
        let (x, y) = (i % width, i / width);
        let at = |has: bool, j: usize| match has {
            true => f64::from(inverse_depth[j]),
            false => 0.0,
        };
        let s = f64::from(inverse_depth[i]);
        // Three inverse depths are compared, one of them twice.
        let step = (STEP * s).max(SURE * 6.0_f64.sqrt() * noise);
        let [right, below, left, above] = [
            at(x + 1 < width, i + 1),
            at(y + 1 < height, i + width),
            at(x > 0, i.wrapping_sub(1)),
            at(y > 0, i.wrapping_sub(width)),
        ];
        let ends = |next: f64, other: f64| {
            let expected = s.min(2.0 * s - other);
            next > 0.0 && other > 0.0 && next < expected - step
        };
        let sides = [
            ends(right, left),
            ends(below, above),
            ends(left, right),
            ends(above, below),
        ];
        let bits = (0..).zip(sides).map(|(k, ends)| u8::from(ends) << k);
        Self(bits.sum())
    }

    /// In an image in which its own is turned by so many quarters, from right to below.
    #[inline(always)]
    pub(super) fn turned(self, quarters: u32) -> Self {
        let turn = quarters % 4;
        Self((self.0 << turn | self.0 >> (4 - turn)) & 15)
    }

    /// What of half a side is covered to the right, below, to the left and above.
    pub(super) fn covered(self, end: f32) -> [f32; 4] {
        [1, 2, 4, 8].map(|side| if self.0 & side == 0 { 1.0 } else { end })
    }
}

/// By how many quarters an image is turned in another, from its right to below, given the rotation from
/// its camera's frame to the other's.
pub(super) fn quarter_turns(rotation: DMat3) -> u32 {
    let (x, y) = (rotation.x_axis, rotation.y_axis);
    let angle = (x.y - y.x).atan2(x.x + y.y);
    (angle / std::f64::consts::FRAC_PI_2)
        .round()
        .rem_euclid(4.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn surfaces_end_where_something_farther_is_beside_them() {
        // Depths by pixel: something near before a wall, and nothing in a corner.
        let near = [0.0, 0.5, 0.5, 0.5, 1.0, 0.99, 0.5, 0.97, 0.5];
        let of = |i| Ends::of(&near, [3, 3], i, 0.0).0;
        // Beside the near one there is the wall, and a pixel that is as near below and to its right.
        assert_eq!(of(4), 4 | 8);
        assert_eq!((of(5), of(7)), (8 | 2, 1 | 4));
        // What is behind does not, nor what is beside nothing or the border.
        for i in [1, 2, 3, 6, 8] {
            assert_eq!(of(i), 0, "{i}");
        }
        // A plane ends nowhere, however steep; a step behind it is one.
        let plane = [1.0, 0.8, 0.6, 0.4, 0.2, 0.1];
        for i in 0..5 {
            assert_eq!(Ends::of(&plane, [6, 1], i, 0.0).0, 0, "{i}");
        }
        let step = [1.0, 0.8, 0.6, 0.3, 0.2];
        assert_eq!(Ends::of(&step, [5, 1], 2, 0.0).0, 1);
        // But not if such a step comes about by chance.
        assert_eq!(Ends::of(&step, [5, 1], 2, 0.02).0, 0);
    }

    #[test]
    fn sides_turn_with_the_image() {
        let right = Ends(1);
        let turned = [0, 1, 2, 3, 4].map(|quarters| right.turned(quarters).0);
        assert_eq!(turned, [1, 2, 4, 8, 1]);
        assert_eq!(Ends(5).turned(1), Ends(10));
        assert_eq!(Ends(5).covered(0.2), [0.2, 1.0, 0.2, 1.0]);
        for (degrees, quarters) in [(0.0, 0), (40.0, 0), (90.0, 1), (-90.0, 3), (180.0, 2)] {
            let roll = DMat3::from_rotation_z(f64::to_radians(degrees));
            // Whatever else it does, short of looking back.
            let yaw = DMat3::from_quat(DQuat::from_rotation_y(1.2));
            assert_eq!(quarter_turns(roll), quarters, "{degrees}");
            assert_eq!(quarter_turns(yaw * roll), quarters, "{degrees}");
        }
    }
}
