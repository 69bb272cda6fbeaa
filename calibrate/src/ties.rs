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
        // 1. Groups, each by one of its images.
        let group_of = self.groups(trusted);
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

        // 2. What each of the others shares with everyone else.
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

    /// The first image of what each image hangs together with, by ties of `trusted` shared points
    /// or more.
    ///
    /// From an image on to all that it is tied to. What is in a group is taken off the tracks, as nothing
    /// more is to be found out about it: of a long track of images that are tied little is left after
    /// a few points. Two images whose ties are too weak share fewer points than `trusted`, so however
    /// long tracks are, no pair is counted more often.
    fn groups(&self, trusted: usize) -> BTreeMap<ImageId, ImageId> {
        // 1. Who sees each point, and which points each image sees.
        let ids: Vec<ImageId> = self.images.keys().copied().collect();
        let index_of = |(id, _): &(ImageId, u32)| ids.binary_search(id).ok();
        let mut points_of: Vec<Vec<usize>> = vec![Vec::new(); ids.len()];
        let mut seen_by: Vec<Vec<usize>> = Vec::with_capacity(self.points.len());
        for point in self.points.values() {
            let mut images: Vec<usize> = point.track.iter().filter_map(index_of).collect();
            images.sort_unstable();
            images.dedup();
            for &image in &images {
                points_of[image].push(seen_by.len());
            }
            seen_by.push(images);
        }

        // 2. Each image that is in no group yet begins one.
        let mut group_of: Vec<Option<ImageId>> = vec![None; ids.len()];
        // With the image whose ties are looked for.
        let mut shared = vec![0_usize; ids.len()];
        let mut sharing: Vec<usize> = Vec::new();
        let mut open: Vec<usize> = Vec::new();
        for (first, id) in ids.iter().enumerate() {
            if group_of[first].is_some() {
                continue;
            }
            group_of[first] = Some(*id);
            open.push(first);
            while let Some(image) = open.pop() {
                for &point in &points_of[image] {
                    seen_by[point].retain(|&other| {
                        if group_of[other].is_some() {
                            return false;
                        }
                        if shared[other] == 0 {
                            sharing.push(other);
                        }
                        shared[other] += 1;
                        let is_tied = shared[other] >= trusted;
                        if is_tied {
                            group_of[other] = Some(*id);
                            open.push(other);
                        }
                        !is_tied
                    });
                }
                sharing.drain(..).for_each(|other| shared[other] = 0);
            }
        }
        let group = |(image, group): (ImageId, Option<ImageId>)| Some((image, group?));
        ids.into_iter().zip(group_of).filter_map(group).collect()
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
    use proptest::collection;
    use proptest::prelude::*;

    /// Images a, b, c, …; for each list, that many points seen by exactly those images.
    fn reconstruction(images: u32, points: &[(&[u32], usize)]) -> Reconstruction {
        let mut r = Reconstruction::default();
        for i in 0..images {
            let name = char::from_u32(u32::from('a') + i).unwrap().to_string();
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

    /// Of 4,000 images eight million pairs share each point.
    #[test]
    fn tracks_may_be_long() {
        let all: Vec<u32> = (0..4_000).collect();
        let (most, last) = all.split_at(3_999);
        let (across, elsewhere) = (&all[3_998..], last);
        let weak = reconstruction(4_000, &[(most, 30), (across, 5), (elsewhere, 20)]);
        let weak = weak.weakly_tied(TRUSTED_TIE);
        assert_eq!(weak.len(), 1);
        assert_eq!((weak[0].names.len(), weak[0].shared_points), (1, 5));
    }

    /// The same from the definition: all pairs of all tracks are counted, and those with enough join what
    /// they are in.
    fn groups_by_pairs(
        reconstruction: &Reconstruction,
        trusted: usize,
    ) -> BTreeMap<ImageId, ImageId> {
        let mut shared: BTreeMap<(ImageId, ImageId), usize> = BTreeMap::new();
        for point in reconstruction.points.values() {
            let seen_by: BTreeSet<ImageId> = point.track.iter().map(|(id, _)| *id).collect();
            for a in &seen_by {
                for b in seen_by.range(..*a) {
                    *shared.entry((*a, *b)).or_default() += 1;
                }
            }
        }
        let ids = reconstruction.images.keys();
        let mut group_of: BTreeMap<ImageId, ImageId> = ids.map(|id| (*id, *id)).collect();
        for ((a, b), count) in shared {
            let groups = (group_of.get(&a).copied(), group_of.get(&b).copied());
            if let (true, (Some(a), Some(b))) = (count >= trusted, groups) {
                let members = group_of.values_mut().filter(|g| **g == a || **g == b);
                members.for_each(|g| *g = a.min(b));
            }
        }
        group_of
    }

    proptest! {
        /// Whatever the tracks: with repeats, and images that there are none of.
        #[test]
        fn groups_are_those_that_all_pairs_make(
            tracks in collection::vec((collection::vec(0..16_u32, 0..7), 1..4_usize), 0..24),
            images in 0..14_u32,
            trusted in 0..6_usize,
        ) {
            let tracks: Vec<(&[u32], usize)> = tracks
                .iter()
                .map(|(track, count)| (track.as_slice(), *count))
                .collect();
            let reconstruction = reconstruction(images, &tracks);
            let groups = reconstruction.groups(trusted);
            prop_assert_eq!(groups, groups_by_pairs(&reconstruction, trusted));
        }
    }
}
