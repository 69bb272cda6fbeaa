use super::*;
use crate::period::scramble;

/// Pseudo-random numbers in 0…1, by the index of the next.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 += 1;
        (scramble(self.0) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() * count as f64) as usize
    }
}

/// What photos of gains within ±30 % show of points that they see in these tracks, with a noise of ±5 %.
fn channel(photo_count: usize, tracks: &[Vec<usize>]) -> Channel {
    let mut random = Random(7);
    let gains: Vec<f64> = (0..photo_count)
        .map(|_| 0.7 + 0.6 * random.next())
        .collect();
    let mut observations = Vec::new();
    for (point_idx, track) in tracks.iter().enumerate() {
        let albedo = 20.0 + 150.0 * random.next();
        for &photo_idx in track {
            let value = albedo * gains[photo_idx] * (0.95 + 0.1 * random.next());
            observations.push(Observation {
                photo_idx,
                point_idx,
                rgb: [Some(value); 3],
            });
        }
    }
    let by_point: Vec<&Observation> = observations.iter().collect();
    Channel::new(photo_count, &by_point, 0, |_| true)
}

/// Photos one after the other, at each of which 20 points begin that it and the next one to five see.
fn strip(photo_count: usize) -> Vec<Vec<usize>> {
    let mut random = Random(11);
    let of_photo = (0..photo_count - 1).flat_map(|first| [first; 20]);
    of_photo
        .map(|first| (first..(first + 2 + random.below(5)).min(photo_count)).collect())
        .collect()
}

/// Photos all around something whose points few of them see, or nearly all.
fn ring(photo_count: usize) -> Vec<Vec<usize>> {
    let mut random = Random(13);
    let track = |_| {
        let (first, count) = (random.below(photo_count), 2 + random.below(photo_count - 2));
        let mut track: Vec<usize> = (first..first + count).map(|i| i % photo_count).collect();
        track.sort_unstable();
        track
    };
    (0..400).map(track).collect()
}

fn ties(channel: &Channel) -> Ties {
    Ties::new(channel.photo_count, &channel.photo, &channel.start)
}

/// No ties at all: every point is gone through by itself.
fn point_by_point(channel: &Channel) -> Ties {
    Ties::of_points(channel.photo_count, &channel.photo, &channel.start, 0).unwrap()
}

#[test]
fn ties_give_the_gains_that_points_one_by_one_do() {
    let with_one_of_all = [strip(200), vec![(0..200).collect()]].concat();
    let apart = [
        strip(60),
        vec![vec![80], vec![3, 3, 5]],
        strip(20)
            .iter()
            .map(|t| t.iter().map(|i| i + 60).collect())
            .collect(),
    ]
    .concat();
    for (what, photo_count, tracks) in [
        ("a strip", 200, strip(200)),
        ("a strip and a point that all see", 200, with_one_of_all),
        ("a ring", 70, ring(70)),
        (
            "two strips, a photo of its own, and one twice at a point",
            81,
            apart,
        ),
    ] {
        let channel = channel(photo_count, &tracks);
        assert!(ties(&channel).len() > photo_count / 2, "{what}");
        assert_eq!(point_by_point(&channel).len(), 0);
        for precision in [1.0, 400.0] {
            let shares: Vec<f64> = (0..photo_count).map(|i| [1.0, 0.5][i % 2]).collect();
            let found = channel.fit(precision, &shares);
            let expected = channel.fit_by(point_by_point(&channel), precision, &shares);
            assert!(expected.iter().any(|gain| gain.abs() > 0.1), "{what}");
            for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
                assert!(
                    (a - b).abs() < 1e-9,
                    "{what}, {precision}, photo {i}: {a} for {b}"
                );
            }
        }
    }
}

#[test]
fn what_a_step_goes_through_grows_with_the_photos_that_have_points_in_common() {
    let channel = channel(3000, &strip(3000));
    assert!(channel.photo.len() > 200_000);
    assert!(ties(&channel).rest().is_empty());
    assert!(ties(&channel).len() < 5 * 3000);
}

#[test]
fn there_are_never_more_ties_than_observations() {
    // One point that all photos see would be 12.5 million pairs.
    let tracks = [vec![(0..5000).collect()], strip(5000)].concat();
    let channel_of_all = channel(5000, &tracks);
    assert_eq!(ties(&channel_of_all).rest(), [0]);
    assert!(ties(&channel_of_all).len() < 5 * 5000);
    // Points whose photos have nothing else in common.
    let mut random = Random(17);
    let anywhere = |count: usize| -> Vec<usize> {
        let mut track: Vec<usize> = (0..count).map(|_| random.below(2000)).collect();
        track.sort_unstable();
        track
    };
    let counts = (0..3000).map(|i| [2, 3, 10, 40][i % 4]);
    let tracks: Vec<Vec<usize>> = counts.map(anywhere).collect();
    let scattered = channel(2000, &tracks);
    let found = ties(&scattered);
    assert!(found.len() <= scattered.photo.len());
    assert!(found.rest().iter().all(|i| tracks[*i].len() == 40));
    assert_eq!(found.rest().len(), 750);
    assert!(found.len() > 750 * 40);
}
