//! How visible it is in a frame where one photo's part ends and another's begins.

use crate::blend::Contributor;
use crate::frame::{Frame, ProxyPoint, exposed};
use crate::held::Held;
use crate::photos::PhotoError;
use crate::reference::sample;
use calibrate::Pixel;
use rayon::prelude::*;

/// Every how many pixels, across and down, the frame is looked at.
const STEP: u32 = 8;
/// Photos are sampled this many mip levels coarser than for the picture: what a coarse
/// proxy puts in the wrong place is mostly finer than that, a step of exposure is not.
const COARSER: f64 = 3.0;

/// The root mean square, in steps of 255, of how far the contributors to a pixel are from
/// their blend: Σ wᵢ·(cᵢ − Σ wⱼ·cⱼ)², colours at the frame's exposure, averaged over red,
/// green and blue and over every eighth pixel across and down. `None` where no photo sees
/// anything.
///
/// # Errors
/// A photo that is needed cannot be decoded.
pub fn seams(frame: &Frame<'_>) -> Result<Option<f64>, PhotoError> {
    // 1. Who paints, so that memory is found for their photos and no others.
    frame.view_tree();
    let rows: Vec<u32> = (STEP / 2..frame.desired.height)
        .step_by(STEP as usize)
        .collect();
    let of_row = |y: u32| -> Vec<(ProxyPoint, Vec<Contributor>)> {
        let columns = (STEP / 2..frame.desired.width).step_by(STEP as usize);
        let points = columns.filter_map(|x| frame.proxy_point(Pixel::center_of(x, y)));
        points
            .map(|point| (point, frame.blend_at(&point)))
            .collect()
    };
    let painted: Vec<Vec<(ProxyPoint, Vec<Contributor>)>> =
        rows.into_par_iter().map(of_row).collect();
    let contributors = painted.iter().flatten().flat_map(|(_, c)| c);
    let mut used: Vec<usize> = contributors.map(|c| c.source_idx).collect();
    used.sort_unstable();
    used.dedup();
    let photos = Held::new(frame, &used);
    // 2. Their colours.
    let of_row = |row: &Vec<(ProxyPoint, Vec<Contributor>)>| -> Result<(f64, u32), PhotoError> {
        let (mut sum, mut count) = (0.0, 0);
        for (point, contributors) in row {
            if let Some(variance) = variance(frame, &photos, point, contributors)? {
                sum += variance;
                count += 1;
            }
        }
        Ok((sum, count))
    };
    let by_row: Vec<Result<(f64, u32), _>> = painted.par_iter().map(of_row).collect();
    let by_row: Vec<(f64, u32)> = by_row.into_iter().collect::<Result<_, _>>()?;
    let count: u32 = by_row.iter().map(|(_, count)| count).sum();
    let sum: f64 = by_row.iter().map(|(sum, _)| sum).sum();
    Ok((count > 0).then(|| 255.0 * (sum / f64::from(count)).sqrt()))
}

/// The weighted variance of the contributors' colours, 0…1, averaged over the channels.
fn variance(
    frame: &Frame<'_>,
    photos: &Held<'_>,
    point: &ProxyPoint,
    contributors: &[Contributor],
) -> Result<Option<f64>, PhotoError> {
    let (mut first, mut second) = ([0.0; 3], [0.0; 3]);
    for contributor in contributors {
        let (i, weight) = (contributor.source_idx, contributor.weight);
        let Some(at) = frame.project(i, point) else {
            continue;
        };
        let level = frame.level_of_detail(i, point) + COARSER;
        let color = sample(photos.get(i)?, at, level);
        let color = exposed(color, frame.sources[i].exposure);
        for c in 0..3 {
            first[c] += weight * color[c];
            second[c] += weight * color[c] * color[c];
        }
    }
    let of_channel = |c: usize| (second[c] - first[c] * first[c]).max(0.0);
    Ok((!contributors.is_empty()).then(|| (0..3).map(of_channel).sum::<f64>() / 3.0))
}
