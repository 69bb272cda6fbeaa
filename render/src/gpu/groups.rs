//! A frame in parts, where it needs more photos than the device holds at once.
//!
//! Each part is drawn with its own photos by the same shaders from the same numbers, so that a
//! picture has the same bytes however many parts it is drawn in.

use crate::field::TriangulatedField;
use std::collections::BTreeSet;
use std::ops::Range;

/// What is drawn at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Group {
    pub part: Part,
    /// The source views that it may sample, in order.
    pub sources: Vec<usize>,
}

/// A part of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// Of a triangulated field's triangles.
    Triangles(Range<usize>),
    /// Of the exact field.
    Pixels(Rect),
}

/// Pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rect {
    pub origin: [u32; 2],
    pub size: [u32; 2],
}

impl Rect {
    pub(super) fn whole(width: u32, height: u32) -> Self {
        Self {
            origin: [0, 0],
            size: [width, height],
        }
    }

    /// Its halves across the longer side; `None` for a single pixel.
    pub(super) fn halves(self) -> Option<[Self; 2]> {
        let side = usize::from(self.size[1] > self.size[0]);
        if self.size[side] < 2 {
            return None;
        }
        let (mut first, mut second) = (self, self);
        first.size[side] = self.size[side] / 2;
        second.origin[side] += first.size[side];
        second.size[side] -= first.size[side];
        Some([first, second])
    }
}

/// What a group may have at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Most {
    pub sources: usize,
    pub triangles: usize,
    pub entries: usize,
}

/// A field's triangles in runs, each as long as the limits allow; at least one run. A triangle
/// that alone exceeds them is a run of its own.
pub(super) fn of_field(field: &TriangulatedField, most: Most) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut sources = BTreeSet::new();
    let (mut start, mut entries) = (0, 0);
    for (i, triangle) in field.triangles.iter().enumerate() {
        let listed = field.entries_of(i).iter().map(|e| e.source_idx as usize);
        let count = triangle.entry_count as usize;
        let fits = i - start < most.triangles && entries + count <= most.entries;
        let more = || listed.clone().filter(|s| !sources.contains(s)).count();
        if i > start && !(fits && sources.len() + more() <= most.sources) {
            groups.push(Group {
                part: Part::Triangles(start..i),
                sources: std::mem::take(&mut sources).into_iter().collect(),
            });
            (start, entries) = (i, 0);
        }
        sources.extend(listed);
        entries += count;
    }
    groups.push(Group {
        part: Part::Triangles(start..field.triangles.len()),
        sources: sources.into_iter().collect(),
    });
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{FieldEntry, FieldTriangle};
    use proptest::prelude::*;

    fn field(lists: &[Vec<u32>]) -> TriangulatedField {
        let mut field = TriangulatedField {
            vertices: Vec::new(),
            triangles: Vec::new(),
            entries: Vec::new(),
            epipoles: Vec::new(),
        };
        for list in lists {
            field.triangles.push(FieldTriangle {
                corners: [0; 3],
                first_entry: field.entries.len() as u32,
                entry_count: list.len() as u32,
                bordered: false,
            });
            field
                .entries
                .extend(list.iter().map(|&source_idx| FieldEntry {
                    source_idx,
                    values: [0.0; 3],
                }));
        }
        field
    }

    proptest! {
        #[test]
        fn groups_keep_to_the_limits_and_miss_nothing(
            lists in proptest::collection::vec(
                proptest::collection::btree_set(0_u32..20, 0..5), 0..40),
            sources in 4_usize..12, triangles in 1_usize..9, entries in 4_usize..20,
        ) {
            let lists: Vec<Vec<u32>> = lists.into_iter().map(|l| l.into_iter().collect()).collect();
            let field = field(&lists);
            let groups = of_field(&field, Most { sources, triangles, entries });
            let mut next = 0;
            for group in &groups {
                let Part::Triangles(range) = &group.part else { panic!("{group:?}") };
                prop_assert_eq!(range.start, next);
                next = range.end;
                prop_assert!(range.len() <= triangles && group.sources.len() <= sources);
                let of_group = &lists[range.clone()];
                prop_assert!(of_group.iter().map(Vec::len).sum::<usize>() <= entries);
                let listed: BTreeSet<usize> =
                    of_group.iter().flatten().map(|&s| s as usize).collect();
                prop_assert_eq!(&listed.into_iter().collect::<Vec<_>>(), &group.sources);
            }
            prop_assert_eq!(next, lists.len());
        }
    }

    #[test]
    fn without_tight_limits_there_is_one_group() {
        let most = Most {
            sources: 256,
            triangles: 1 << 20,
            entries: 1 << 20,
        };
        assert_eq!(of_field(&field(&[]), most).len(), 1);
        assert_eq!(of_field(&field(&[vec![3], vec![1, 2]]), most).len(), 1);
        // A list that is too long is alone, and its array will say so.
        let tight = Most { sources: 1, ..most };
        let groups = of_field(&field(&[vec![1], vec![1, 2], vec![2]]), tight);
        assert_eq!(groups.len(), 3);
    }

    #[test]
    fn halves_are_all_of_it() {
        let rect = Rect {
            origin: [3, 5],
            size: [7, 4],
        };
        let [first, second] = rect.halves().unwrap();
        assert_eq!((first.origin, first.size), ([3, 5], [3, 4]));
        assert_eq!((second.origin, second.size), ([6, 5], [4, 4]));
        assert_eq!(Rect::whole(1, 1).halves(), None);
        assert!(Rect::whole(1, 2).halves().is_some());
    }
}
