//! Photos that are to be shown turned, as cameras that were held upright or upside down write beside them: their
//! pixels are used as stored, of which calibrations speak.

use super::{Photo, Warning};
use capture::Exif;

/// Says which photos are stored turned or mirrored, for people; `None` where none is known to be.
pub(super) fn text(photos: &[Photo]) -> Option<String> {
    let of = |photo: &Photo| Some((photo.name.clone(), photo.orientation?));
    let mut turned = photos.iter().filter_map(of);
    let (name, orientation) = turned.next()?;
    let count = 1 + turned.count();
    Some(format!(
        "{count} of {} photos are stored turned or mirrored (EXIF orientation; {orientation} in {name}, for one)",
        photos.len()
    ))
}

/// The same, with what comes of it.
pub(super) fn note(photos: &[Photo]) -> Option<Warning> {
    let text = text(photos)?;
    Some(Warning::Note(format!(
        "{text}: their pixels are used as stored, of which calibrations speak; paths derived from them and the \
         window stand upright as they do when they are shown turned"
    )))
}

/// Lets photos know how they are stored, as cameras wrote into them.
pub(super) fn set(photos: &mut [Photo], taken: &[Exif]) {
    for (photo, exif) in photos.iter_mut().zip(taken) {
        photo.orientation = exif.orientation.filter(|orientation| *orientation != 1);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Scene;
    use super::super::tests::wall;
    use super::*;

    #[test]
    fn photos_that_are_stored_turned_are_counted_and_one_is_named() {
        let (_folder, capture) = wall(3, 1);
        let (scene, _) = Scene::open(&capture, false).unwrap();
        let said = |orientations: &[Option<u8>]| {
            let of = |orientation: &Option<u8>| Exif {
                orientation: *orientation,
                ..Exif::default()
            };
            let taken: Vec<Exif> = orientations.iter().map(of).collect();
            let mut photos = scene.photos.clone();
            set(&mut photos, &taken);
            text(&photos)
        };
        assert_eq!(said(&[]), None);
        assert_eq!(said(&[None, Some(1), None]), None);
        assert_eq!(
            said(&[Some(1), Some(8), Some(6)]).unwrap(),
            "2 of 3 photos are stored turned or mirrored (EXIF orientation; 8 in 0001.png, for one)"
        );
    }
}
