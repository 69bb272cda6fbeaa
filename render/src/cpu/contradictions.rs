//! How unlike photos are where they meet.

use super::asked::Asked;
use super::lanes::{LANES, vectorised};
use super::{Engine, Seen, shade};
use crate::frame::ProxyPoint;
use crate::held::Held;
use crate::photos::PhotoError;
use glam::Vec4;

impl Engine<'_> {
    /// The variance of photos' colours, by their weights, at some proxy points that are near one another; `None` where no
    /// photo has one. See [`crate::contradictions::Contradictions::of`].
    pub(super) fn variances(
        &self,
        photos: &Held<'_>,
        scratch: &mut (Asked, Seen),
        points: &[ProxyPoint],
    ) -> Result<Vec<Option<f32>>, PhotoError> {
        let mut variances = vec![None; points.len().next_multiple_of(LANES)];
        self.weigh_points(points, scratch, |i, seen| {
            let mut sums = [Vec4::ZERO; LANES];
            let mut squares = [0.0_f32; LANES];
            let mut weights = [0.0_f32; LANES];
            for (source_idx, sight, term) in seen.iter() {
                if term.weight.iter().all(|w| *w == 0.0) {
                    continue;
                }
                let photo = photos.get(source_idx)?;
                let exposure = self.source(source_idx).exposure;
                let mut color = [Vec4::ZERO; LANES];
                let mut weight = [0.0_f32; LANES];
                vectorised(
                    #[inline(always)]
                    || {
                        shade::add(
                            photo,
                            exposure,
                            sight,
                            &term.weight,
                            &mut color,
                            &mut weight,
                        )
                    },
                );
                for k in (0..LANES).filter(|k| weight[*k] > 0.0) {
                    sums[k] += color[k];
                    squares[k] += color[k].truncate().length_squared() / weight[k];
                    weights[k] += weight[k];
                }
            }
            for (k, variance) in variances[i * LANES..][..LANES].iter_mut().enumerate() {
                if weights[k] > 0.0 {
                    let mean = sums[k].truncate() / weights[k];
                    let all = squares[k] / weights[k] - mean.length_squared();
                    *variance = Some(all.max(0.0) / (3.0 * 255.0 * 255.0));
                }
            }
            Ok(())
        })?;
        variances.truncate(points.len());
        Ok(variances)
    }
}
