//! Rooms of a walk of which photos do not show what is seen.

use super::report::Walked;
use image::RgbaImage;
use proxy::interior::{CellId, Contents, Interior};
use proxy::shown_name;
use render::interior::Captured;
use std::collections::BTreeMap;

/// A room whose frames show less than this share of their pixels, in the mean, is told. On tours of house-walk they show
/// all, 93 %, and 48 % in the room that is seen from its doorway alone; on those of office-walk 90 % and more.
const ENOUGH: f64 = 0.7;

/// The share of a picture's pixels that are covered.
pub(super) fn shown(picture: &RgbaImage) -> f64 {
    let alphas = picture.pixels().map(|pixel| u64::from(pixel.0[3]));
    let most = 255 * u64::from(picture.width()) * u64::from(picture.height());
    alphas.sum::<u64>() as f64 / most.max(1) as f64
}

/// What to say of a capture's rooms whose frames show little, if there are any.
pub(super) fn note(
    interior: &Interior,
    contents: &Contents,
    captured: &Captured,
    walks: &[Walked],
) -> Option<String> {
    let frames = walks.iter().flat_map(|walk| &walk.frames);
    let of_rooms = frames.filter_map(|frame| Some((frame.cost.cell?, frame.shown)));
    let of_photos = of_rooms.filter(|(id, _)| interior.cell(*id).content.scene().is_some());
    let rooms = scant(of_photos);
    if rooms.is_empty() {
        return None;
    }
    let sources = &captured.lumigraph().sources;
    let cell_of = |center| contents.locate(interior, center);
    let taken = sources.iter().map(|source| cell_of(source.view.center()));
    let taken: Vec<Option<CellId>> = taken.collect();
    let room = |(id, share, frames): (CellId, f64, usize)| {
        let name = shown_name(&interior.cell(id).name);
        let (percent, all) = (100.0 * share, taken.len());
        let there = taken.iter().filter(|at| **at == Some(id)).count();
        let frames = match frames {
            1 => "one frame".to_owned(),
            count => format!("{count} frames"),
        };
        format!(
            "{name} ({percent:.0} % of the pixels of {frames}; photos taken there: {there} of {all})"
        )
    };
    let rooms: Vec<String> = rooms.into_iter().map(room).collect();
    Some(format!(
        "frames show little in {}: take more photos of what one sees from there, or give a --path that stays out or looks \
         another way",
        rooms.join(", ")
    ))
}

/// The rooms of frames, each with the share that it shows, which show little in the mean; how much, and how many they are.
fn scant(frames: impl Iterator<Item = (CellId, f64)>) -> Vec<(CellId, f64, usize)> {
    let mut sums: BTreeMap<CellId, (f64, usize)> = BTreeMap::new();
    for (id, shown) in frames {
        let (sum, count) = sums.entry(id).or_default();
        *sum += shown;
        *count += 1;
    }
    let means = sums
        .into_iter()
        .map(|(id, (sum, count))| (id, sum / count as f64, count));
    means.filter(|(_, mean, _)| *mean < ENOUGH).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn rooms_count_by_what_their_frames_show_in_the_mean() {
        let [first, second, third] = [0, 1, 2].map(CellId);
        let frames = [
            (second, 0.4),
            (first, 0.2),
            (first, 1.0),
            (first, 1.0),
            (third, 0.0),
            (second, 0.5),
        ];
        let found = scant(frames.into_iter());
        assert_eq!(found, [(second, 0.45, 2), (third, 0.0, 1)]);
        assert!(scant(std::iter::empty()).is_empty());
    }

    #[test]
    fn what_is_covered_in_part_counts_so() {
        let mut picture = RgbaImage::new(2, 2);
        assert_eq!(shown(&picture), 0.0);
        picture.put_pixel(0, 1, Rgba([9, 9, 9, 255]));
        picture.put_pixel(1, 1, Rgba([9, 9, 9, 51]));
        assert!((shown(&picture) - 0.3).abs() < 1e-12);
        assert_eq!(shown(&RgbaImage::new(0, 0)), 0.0);
    }
}
