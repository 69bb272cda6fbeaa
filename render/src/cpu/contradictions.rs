//! What photos show where they meet.

use super::asked::Asked;
use super::lanes::{LANES, vectorised};
use super::{Engine, Seen, shade};
use crate::contradictions::Shown;
use crate::frame::ProxyPoint;
use crate::held::Held;
use crate::photos::PhotoError;
use glam::Vec4;

impl Engine<'_> {
    /// What photos show of some proxy points that are near one another; see [`crate::contradictions::Contradictions::of`].
    pub(super) fn shown(
        &self,
        photos: &Held<'_>,
        scratch: &mut (Asked, Seen),
        points: &[ProxyPoint],
    ) -> Result<Vec<Vec<Shown>>, PhotoError> {
        let mut shown = vec![Vec::new(); points.len().next_multiple_of(LANES)];
        self.weigh_points(points, scratch, |i, seen| {
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
                    shown[i * LANES + k].push(Shown {
                        source_idx,
                        weight: weight[k],
                        color: color[k].truncate() / (255.0 * weight[k]),
                    });
                }
            }
            Ok(())
        })?;
        shown.truncate(points.len());
        Ok(shown)
    }
}
