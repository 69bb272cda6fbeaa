//! Which photos hang on to the rest by too little to be trusted.
//!
//! Structure from motion joins a photo to a model by points that it shares with others.
//! A handful of false matches (a repeated window, say) can tie a whole group of photos to
//! the wrong place; the group is consistent in itself, so no reprojection error shows it.

use crate::{ImageId, Reconstruction};
use std::collections::{BTreeMap, BTreeSet};

/// Photos that are tied to each other, but hardly to the rest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeakGroup {
    /// The photos' names, sorted.
    pub names: Vec<String>,
    /// Sparse points that this group and the rest both see.
    pub shared_points: usize,
}

/// Fewer shared points than these make no trustworthy tie between two photos.
pub const TRUSTED_TIE: usize = 12;

impl Reconstruction {
    /// The groups of photos whose ties to the largest group are all weaker than
    /// `trusted` shared points (see [`TRUSTED_TIE`]), by name.
    ///
    /// Two photos are tied when they share that many points; groups are what hangs
    /// together by such ties. A group that shares no point at all was not placed by points
    /// (its poses were given), and is none. Nor is there one where the largest group is not
    /// the majority: nothing says which part would be the wrong one.
    pub fn weakly_tied(&self, trusted: usize) -> Vec<WeakGroup> {
        // 1. Points shared by each pair of images.
        let mut shared: BTreeMap<(ImageId, ImageId), usize> = BTreeMap::new();
        for point in self.points.values() {
            let seen_by: BTreeSet<ImageId> = point.track.iter().map(|(id, _)| *id).collect();
            for (i, a) in seen_by.iter().enumerate() {
                for b in seen_by.iter().skip(i + 1) {
                    *shared.entry((*a, *b)).or_default() += 1;
                }
            }
        }

        // 2. Groups: each image starts alone; a trusted tie joins two groups.
        let mut group_of: BTreeMap<ImageId, ImageId> =
            self.images.keys().map(|i| (*i, *i)).collect();
        for (a, b) in shared
            .iter()
            .filter(|(_, n)| **n >= trusted)
            .map(|(pair, _)| *pair)
        {
            let (Some(&keep), Some(&gone)) = (group_of.get(&a), group_of.get(&b)) else {
                continue;
            };
            if keep != gone {
                group_of
                    .values_mut()
                    .filter(|g| **g == gone)
                    .for_each(|g| *g = keep);
            }
        }
        let mut groups: BTreeMap<ImageId, BTreeSet<ImageId>> = BTreeMap::new();
        for (image, group) in &group_of {
            groups.entry(*group).or_default().insert(*image);
        }
        let Some(largest) = groups.values().max_by_key(|g| g.len()).cloned() else {
            return Vec::new();
        };
        if 2 * largest.len() <= self.images.len() {
            return Vec::new();
        }

        // 3. What each of the others shares with everyone else.
        let across = self.points_across(&group_of);
        let others = groups.into_iter().filter(|(_, group)| *group != largest);
        let weak = others.filter_map(|(id, group)| {
            let names = group.iter().map(|image| self.images[image].name.clone());
            let mut names: Vec<String> = names.collect();
            names.sort();
            Some(WeakGroup {
                names,
                shared_points: *across.get(&id)?,
            })
        });
        let mut weak: Vec<WeakGroup> = weak.collect();
        weak.sort_by(|a, b| a.names.cmp(&b.names));
        weak
    }

    /// How many points images of each group see that others see, too; groups without any are
    /// left out. `group_of` has the group of each image.
    fn points_across(&self, group_of: &BTreeMap<ImageId, ImageId>) -> BTreeMap<ImageId, usize> {
        let mut across = BTreeMap::new();
        for point in self.points.values() {
            let seen_by = point.track.iter().map(|(image, _)| group_of.get(image));
            let seen_by: BTreeSet<Option<&ImageId>> = seen_by.collect();
            if seen_by.len() > 1 {
                for group in seen_by.into_iter().flatten() {
                    *across.entry(*group).or_default() += 1;
                }
            }
        }
        across
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraId, Image, Point3D, Point3DId, Rigid3};
    use glam::DVec3;

    /// Images a, b, c, …; for each list, that many points seen by exactly those images.
    fn reconstruction(images: u32, points: &[(&[u32], usize)]) -> Reconstruction {
        let mut r = Reconstruction::default();
        for i in 0..images {
            let name = char::from(b'a' + i as u8).to_string();
            let image = Image {
                name,
                camera_id: CameraId(0),
                camera_from_world: Rigid3::IDENTITY,
                keypoints: Vec::new(),
            };
            r.images.insert(ImageId(i), image);
        }
        for (seen_by, count) in points {
            for _ in 0..*count {
                let track = seen_by.iter().map(|i| (ImageId(*i), 0)).collect();
                let (position, color) = (DVec3::ZERO, [0; 3]);
                let id = Point3DId(r.points.len() as u64);
                r.points.insert(
                    id,
                    Point3D {
                        position,
                        color,
                        error_px: 0.0,
                        track,
                    },
                );
            }
        }
        r
    }

    #[test]
    fn a_group_that_hangs_by_a_few_points_is_found() {
        let strong: &[(&[u32], usize)] =
            &[(&[0, 1, 2], 40), (&[2, 3], 30), (&[4, 5], 50), (&[3, 4], 5)];
        let weak = reconstruction(6, strong).weakly_tied(TRUSTED_TIE);
        let names = vec!["e".to_owned(), "f".to_owned()];
        assert_eq!(
            weak,
            [WeakGroup {
                names,
                shared_points: 5
            }]
        );
    }

    /// A point counts once for each group that it ties to others, however many of the group see it.
    #[test]
    fn each_of_several_groups_has_its_own_points() {
        let points: &[(&[u32], usize)] = &[
            (&[0, 1, 2, 3, 4], 40),
            (&[5, 6], 20),
            (&[5, 6, 0, 1], 3),
            (&[5, 7], 2),
            (&[7, 4, 7], 4),
            (&[7], 30),
            (&[8], 30),
        ];
        let weak = reconstruction(9, points).weakly_tied(TRUSTED_TIE);
        let found: Vec<(String, usize)> = weak
            .iter()
            .map(|group| (group.names.join(" "), group.shared_points))
            .collect();
        assert_eq!(found, [("f g".to_owned(), 5), ("h".to_owned(), 6)]);
    }

    #[test]
    fn a_chain_of_trusted_ties_is_one_group() {
        let chain: &[(&[u32], usize)] = &[(&[0, 1], 12), (&[1, 2], 12), (&[2, 3], 12)];
        assert_eq!(reconstruction(4, chain).weakly_tied(12), []);
    }

    #[test]
    fn without_a_majority_nothing_is_called_wrong() {
        assert_eq!(
            reconstruction(4, &[(&[0, 1], 20), (&[2, 3], 20)]).weakly_tied(12),
            []
        );
        let apart: &[(&[u32], usize)] = &[(&[0, 1, 2], 20), (&[3, 4], 20)];
        assert_eq!(reconstruction(5, apart).weakly_tied(12), [], "poses given");
        assert_eq!(
            reconstruction(5, &[]).weakly_tied(12),
            [],
            "poses given, no points"
        );
    }
}
