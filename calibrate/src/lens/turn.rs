//! Lenses of pictures that are turned by quarters, as cameras say of what they store.

use super::{Distortion, Lens, Pixel};
use glam::DVec2;

impl Pixel {
    /// Where a pixel of a picture of this width and height is once the picture is turned by quarters, clockwise.
    #[must_use]
    pub fn turned(self, quarters: u8, (width, height): (u32, u32)) -> Self {
        let (width, height) = (f64::from(width), f64::from(height));
        match quarters % 4 {
            1 => Self::new(height - self.y, self.x),
            2 => Self::new(width - self.x, height - self.y),
            3 => Self::new(self.y, width - self.x),
            _ => self,
        }
    }
}

impl Lens {
    /// The lens of the same camera for its picture, of this width and height, turned by quarters clockwise. The
    /// camera turns with it: a point (x, y, z) of its frame becomes (−y, x, z) for each quarter.
    ///
    /// `None` for what no lens here is: a quarter of a sensor that is skewed, or tilted about both axes, and a
    /// panorama that is turned.
    #[must_use]
    pub fn turned(&self, quarters: u8, size: (u32, u32)) -> Option<Self> {
        let (half, quarter) = (quarters & 2 != 0, quarters & 1 != 0);
        let mut distortion = self.distortion;
        if half {
            distortion = turned_by_half(distortion)?;
        }
        if quarter {
            distortion = turned_by_quarter(distortion)?;
        }
        let DVec2 { x, y } = self.focal;
        let focal = if quarter {
            DVec2::new(y, x)
        } else {
            self.focal
        };
        let principal = Pixel::new(self.principal.x, self.principal.y).turned(quarters, size);
        let principal = DVec2::new(principal.x, principal.y);
        Some(Self::new(focal, principal, distortion))
    }
}

/// What vectors in the picture say turns with it: tangential and prism terms, and tilts.
fn turned_by_half(distortion: Distortion) -> Option<Distortion> {
    // Zero stays without a sign.
    fn negated<const N: usize>(terms: [f64; N]) -> [f64; N] {
        terms.map(|term| 0.0 - term)
    }
    Some(match distortion {
        Distortion::Rational { k, p } => Distortion::Rational { k, p: negated(p) },
        Distortion::Tilted { k, p, s, tau } => Distortion::Tilted {
            k,
            p: negated(p),
            s: negated(s),
            tau: negated(tau),
        },
        Distortion::ThinPrismFisheye { k, p, s } => Distortion::ThinPrismFisheye {
            k,
            p: negated(p),
            s: negated(s),
        },
        Distortion::RadTanThinPrismFisheye { k, p, s } => Distortion::RadTanThinPrismFisheye {
            k,
            p: negated(p),
            s: negated(s),
        },
        Distortion::Equirectangular => return None,
        other => other,
    })
}

/// The same by a quarter clockwise: a vector (x, y) becomes (−y, x). The tangential terms' is (p₂, p₁), or Aria's
/// (p₀, p₁).
fn turned_by_quarter(distortion: Distortion) -> Option<Distortion> {
    let prisms = |[s1, s2, s3, s4]: [f64; 4]| [0.0 - s3, 0.0 - s4, s1, s2];
    let tangential = |[p1, p2]: [f64; 2]| [p2, 0.0 - p1];
    Some(match distortion {
        Distortion::Rational { k, p } => Distortion::Rational {
            k,
            p: tangential(p),
        },
        // About both axes the sensor's own would lean.
        Distortion::Tilted { tau: [x, y], .. } if x != 0.0 && y != 0.0 => return None,
        Distortion::Tilted { k, p, s, tau } => Distortion::Tilted {
            k,
            p: tangential(p),
            s: prisms(s),
            tau: [0.0 - tau[1], tau[0]],
        },
        Distortion::ThinPrismFisheye { k, p, s } => Distortion::ThinPrismFisheye {
            k,
            p: tangential(p),
            s: [0.0 - s[1], s[0]],
        },
        Distortion::RadTanThinPrismFisheye { k, p, s } => Distortion::RadTanThinPrismFisheye {
            k,
            p: [0.0 - p[1], p[0]],
            s: prisms(s),
        },
        Distortion::SkewedFisheye { .. } | Distortion::Equirectangular => return None,
        other => other,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const SIZE: (u32, u32) = (640, 480);

    fn lens(distortion: Distortion) -> Lens {
        Lens::new(
            DVec2::new(500.0, 530.0),
            DVec2::new(310.0, 250.0),
            distortion,
        )
    }

    #[test]
    fn what_a_turned_lens_sees_is_where_the_turned_picture_has_it() {
        let p = [0.01, -0.02];
        let k = [-0.1, 0.03, 0.004, 0.02, -0.01, 0.003];
        let s = [0.002, -0.003, 0.004, 0.001];
        let tilted = |tau: [f64; 2]| Distortion::Tilted { k, p, s, tau };
        let polynomial = [0.05, -0.01, 0.002, 0.001];
        for (distortion, turns) in [
            (Distortion::None, vec![0, 1, 2, 3]),
            (Distortion::Rational { k, p }, vec![0, 1, 2, 3]),
            (tilted([0.0; 2]), vec![0, 1, 2, 3]),
            (tilted([0.1, 0.0]), vec![0, 1, 2, 3]),
            (tilted([0.0, -0.2]), vec![0, 1, 2, 3]),
            (tilted([0.1, -0.2]), vec![0, 2]),
            (Distortion::Fisheye { k: polynomial }, vec![0, 1, 2, 3]),
            (
                Distortion::SkewedFisheye {
                    k: polynomial,
                    alpha: 0.1,
                },
                vec![0, 2],
            ),
            (
                Distortion::ThinPrismFisheye {
                    k: polynomial,
                    p,
                    s: [0.003, -0.002],
                },
                vec![0, 1, 2, 3],
            ),
            (
                Distortion::RadTanThinPrismFisheye { k, p, s },
                vec![0, 1, 2, 3],
            ),
            (Distortion::Fov { omega: 0.9 }, vec![0, 1, 2, 3]),
            (Distortion::Equirectangular, vec![0]),
        ] {
            let lens = lens(distortion);
            for quarters in 0..4 {
                let Some(turned) = lens.turned(quarters, SIZE) else {
                    assert!(!turns.contains(&quarters), "{distortion:?} {quarters}");
                    continue;
                };
                assert!(turns.contains(&quarters), "{distortion:?} {quarters}");
                for (x, y) in [(0.1, 0.2), (-0.3, 0.05), (0.2, -0.25)] {
                    let mut point = DVec3::new(x, y, 1.0);
                    let expected = lens.project(point).unwrap().turned(quarters, SIZE);
                    for _ in 0..quarters {
                        point = DVec3::new(-point.y, point.x, point.z);
                    }
                    let found = turned.project(point).unwrap();
                    let off = found.distance(expected);
                    assert!(off < 1e-9, "{distortion:?} {quarters}: {off}");
                }
            }
        }
    }

    #[test]
    fn four_quarters_lead_back() {
        let corner = Pixel::new(0.5, 0.5);
        assert_eq!(corner.turned(1, SIZE), Pixel::new(479.5, 0.5));
        assert_eq!(corner.turned(3, SIZE), Pixel::new(0.5, 639.5));
        let lens = lens(Distortion::Rational {
            k: [0.1; 6],
            p: [0.01, 0.02],
        });
        let (w, h) = SIZE;
        let there = lens.turned(1, SIZE).unwrap();
        assert_eq!(there.turned(3, (h, w)), Some(lens));
        let upside_down = there.turned(1, (h, w));
        assert_eq!(upside_down, lens.turned(2, SIZE));
    }
}
