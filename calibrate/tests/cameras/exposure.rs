//! Gains against known ones.

use calibrate::exposure::{Exposure, Observation, Verdict, estimate, patches, sample};
use calibrate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Reconstruction,
    Rigid3,
};
use glam::{DQuat, DVec3};
use image::{Rgba, RgbaImage};

/// Pseudo-random numbers in 0…1, the same everywhere: SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Photos that each see a third of the points, through known gains.
struct Set {
    gains: Vec<[f64; 3]>,
    points: Vec<DVec3>,
    observations: Vec<Observation>,
}

/// `amount` 0.3 is gains of ±30 %; every twentieth value is of something else; values are
/// rounded to bytes, and what would exceed them is clipped and has none.
fn set(photos: usize, points: usize, amount: f64, noise: f64) -> Set {
    let mut random = Random(7);
    let mut gains: Vec<[f64; 3]> = (0..photos)
        .map(|_| std::array::from_fn(|_| (amount * (2.0 * random.next() - 1.0)).exp()))
        .collect();
    for c in 0..3 {
        let mean = gains.iter().map(|g| g[c].ln()).sum::<f64>() / photos as f64;
        gains.iter_mut().for_each(|g| g[c] /= mean.exp());
    }
    let mut set = Set {
        gains,
        points: Vec::new(),
        observations: Vec::new(),
    };
    for point_idx in 0..points {
        let place = DVec3::new(random.next(), random.next(), random.next());
        set.points.push(place);
        let albedo: [f64; 3] = std::array::from_fn(|_| 20.0 + 200.0 * random.next());
        for photo_idx in 0..photos {
            if random.next() > 0.33 {
                continue;
            }
            let outlier = random.next() < 0.05;
            let rgb = std::array::from_fn(|c| {
                let seen = if outlier {
                    20.0 + 200.0 * random.next()
                } else {
                    albedo[c]
                };
                let jitter = 1.0 + noise * (random.next() + random.next() - 1.0);
                let value = (seen * set.gains[photo_idx][c] * jitter).round();
                (12.0..=245.0).contains(&value).then_some(value)
            });
            set.observations.push(Observation {
                photo_idx,
                point_idx,
                rgb,
            });
        }
    }
    set
}

impl Set {
    fn estimate(&self) -> Exposure {
        estimate(self.gains.len(), &self.points, &self.observations)
    }
}

#[test]
fn known_gains_are_recovered_to_a_percent() {
    for noise in [0.0, 0.05] {
        let set = set(12, 2000, 0.3, noise);
        let found = set.estimate();
        assert!(
            matches!(found.verdict, Verdict::Matched(_)),
            "{:?}",
            found.verdict
        );
        for (found, gain) in found.gains.iter().zip(&set.gains) {
            for c in 0..3 {
                let error = (found[c] / gain[c]).ln().abs();
                assert!(error < 0.01, "{found:?}, expected {gain:?}");
            }
        }
    }
}

#[test]
fn equal_gains_are_left_alone() {
    let set = set(12, 2000, 0.0, 0.05);
    let found = set.estimate();
    assert!(
        matches!(found.verdict, Verdict::NotMeasurable(_)),
        "{:?}",
        found.verdict
    );
    assert!(found.gains.iter().all(|g| *g == [1.0; 3]));
}

#[test]
fn differences_too_small_to_see_are_left_alone() {
    let set = set(12, 4000, 0.005, 0.0);
    let Verdict::NotMeasurable(evidence) = set.estimate().verdict else {
        panic!("a third of a step of 255 is nothing to match");
    };
    assert!(evidence.significance > 4.0, "measured, but {evidence:?}");
}

#[test]
fn the_order_of_photos_and_observations_does_not_matter() {
    let mut set = set(12, 500, 0.3, 0.05);
    let before = set.estimate();
    let count = set.gains.len();
    set.observations.reverse();
    for o in &mut set.observations {
        o.photo_idx = count - 1 - o.photo_idx;
    }
    let after = set.estimate();
    for (a, b) in before.gains.iter().zip(after.gains.iter().rev()) {
        for c in 0..3 {
            assert!((a[c] / b[c] - 1.0).abs() < 1e-9, "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_photo_without_points_keeps_gain_one() {
    let mut set = set(12, 2000, 0.3, 0.0);
    set.observations.retain(|o| o.photo_idx != 5);
    let found = set.estimate();
    assert!(matches!(found.verdict, Verdict::Matched(_)));
    assert_eq!(found.gains[5], [1.0; 3]);
    // With a single observation it is hardly trusted.
    let one = set.observations.iter().find(|o| o.photo_idx == 4);
    let wrong = one.unwrap().rgb.map(|v| v.map(|v| 1.1 * v));
    let point_idx = one.unwrap().point_idx;
    set.observations.push(Observation {
        photo_idx: 5,
        point_idx,
        rgb: wrong,
    });
    let gain = set.estimate().gains[5];
    assert!(gain.iter().all(|g| (g - 1.0).abs() < 0.35), "{gain:?}");
}

/// A set whose last photo sees only so many of the points, half of them as something else.
fn with_a_weak_photo(points: usize, seed: u64) -> Set {
    let mut set = set(20, 600, 0.17, 0.04);
    let mut random = Random(seed);
    set.observations.retain(|o| o.photo_idx < 19);
    let mut unseen: Vec<usize> = (0..set.points.len()).collect();
    for _ in 0..points {
        let point_idx = unseen.swap_remove((random.next() * unseen.len() as f64) as usize);
        let of_point = |o: &&Observation| o.point_idx == point_idx;
        let other = set.observations.iter().find(of_point);
        let gain_of = |o: &Observation, c: usize| set.gains[19][c] / set.gains[o.photo_idx][c];
        let is_false = random.next() < 0.5;
        let rgb = std::array::from_fn(|c| {
            let seen = other.and_then(|o| Some(o.rgb[c]? * gain_of(o, c)));
            let value = if is_false {
                Some(20.0 + 200.0 * random.next())
            } else {
                seen
            };
            value.filter(|v| (12.0..=245.0).contains(v))
        });
        set.observations.push(Observation {
            photo_idx: 19,
            point_idx,
            rgb,
        });
    }
    set
}

#[test]
fn a_photo_with_few_points_does_not_keep_the_others_from_being_matched() {
    for (points, seed) in [2, 3, 4, 6, 10]
        .into_iter()
        .flat_map(|n| (0..8).map(move |s| (n, s)))
    {
        let set = with_a_weak_photo(points, seed);
        let found = set.estimate();
        let what = format!("{points} points, seed {seed}: {:?}", found.verdict);
        assert!(matches!(found.verdict, Verdict::Matched(_)), "{what}");
        for c in 0..3 {
            let error = |i: usize| (found.gains[i][c] / set.gains[i][c]).ln();
            let mean = (0..19).map(error).sum::<f64>() / 19.0;
            let worst = (0..19).map(|i| (error(i) - mean).abs()).fold(0.0, f64::max);
            assert!(worst < 0.01, "{what}, off by {worst}");
        }
    }
}

/// Points that each photo shows in one colour.
fn flat(colors: &[[f64; 3]]) -> Set {
    let mut random = Random(7);
    let points: Vec<DVec3> = (0..60)
        .map(|_| DVec3::new(random.next(), random.next(), random.next()))
        .collect();
    let observation = |photo_idx: usize, point_idx: usize| Observation {
        photo_idx,
        point_idx,
        rgb: colors[photo_idx].map(Some),
    };
    let observations = (0..points.len())
        .flat_map(|p| (0..colors.len()).map(move |i| observation(i, p)))
        .collect();
    Set {
        gains: vec![[1.0; 3]; colors.len()],
        points,
        observations,
    }
}

#[test]
fn photos_all_of_one_colour_have_no_gains_to_measure() {
    for value in 12..=245 {
        for photos in 2..5 {
            let set = flat(&vec![[f64::from(value); 3]; photos]);
            let Verdict::NotMeasurable(evidence) = set.estimate().verdict else {
                panic!("{photos} photos of {value} do not differ");
            };
            let sizes = [evidence.spread, evidence.error, evidence.significance];
            assert!(
                sizes.iter().all(|size| (0.0..1e-9).contains(size)),
                "{photos} photos of {value}: {evidence:?}"
            );
        }
    }
}

#[test]
fn a_channel_alike_in_all_photos_does_not_hide_what_the_others_show() {
    for blue in 12..=245 {
        let blue = f64::from(blue);
        let found = flat(&[[100.0, 100.0, blue], [143.0, 143.0, blue]]).estimate();
        let what = format!("blue {blue}: {found:?}");
        assert!(matches!(found.verdict, Verdict::Matched(_)), "{what}");
        let [a, b] = [0, 1].map(|i| found.gains[i]);
        for (c, ratio) in [1.43, 1.43, 1.0].into_iter().enumerate() {
            assert!((b[c] / a[c] - ratio).abs() < 0.01, "{what}");
        }
    }
}

#[test]
fn groups_that_share_no_point_are_matched_each_by_itself() {
    let mut set = set(12, 3000, 0.3, 0.0);
    // Points of even index are seen by the first six alone, the others by the rest.
    set.observations
        .retain(|o| (o.photo_idx < 6) == (o.point_idx % 2 == 0));
    let found = set.estimate();
    for group in [0..6, 6..12] {
        let of_group = group.len() as f64;
        for c in 0..3 {
            let mean = |gains: &[[f64; 3]]| {
                gains[group.clone()].iter().map(|g| g[c].ln()).sum::<f64>() / of_group
            };
            assert!(mean(&found.gains).abs() < 1e-9);
            let expected = mean(&set.gains);
            for i in group.clone() {
                let error = found.gains[i][c].ln() - (set.gains[i][c].ln() - expected);
                assert!(error.abs() < 0.01, "{i}: {error}");
            }
        }
    }
}

#[test]
fn nothing_to_match_by_is_said() {
    let none = estimate(3, &[], &[]);
    assert_eq!(
        (none.verdict, none.gains),
        (Verdict::NoLinks, vec![[1.0; 3]; 3])
    );
    let mut set = set(12, 200, 0.3, 0.0);
    set.observations.iter_mut().for_each(|o| o.rgb = [None; 3]);
    assert_eq!(set.estimate().verdict, Verdict::NoLinks);
}

/// A point straight ahead of two photos, the second twice as far away.
fn two_photos() -> Reconstruction {
    let mut whole = Reconstruction::default();
    let camera = Camera {
        model: ModelKind::SimplePinhole,
        width: 100,
        height: 80,
        params: vec![100.0, 50.0, 40.0],
    };
    whole.cameras.insert(CameraId(1), camera);
    for (id, name, z) in [(1, "near", 2.0), (2, "far", 4.0)] {
        let image = Image {
            name: name.to_owned(),
            camera_id: CameraId(1),
            camera_from_world: Rigid3::new(DQuat::IDENTITY, DVec3::new(0.0, 0.0, z)),
            keypoints: vec![Keypoint {
                x: 50.0,
                y: 40.0,
                point: Some(Point3DId(1)),
            }],
        };
        whole.images.insert(ImageId(id), image);
    }
    let point = Point3D {
        position: DVec3::ZERO,
        color: [0; 3],
        error_px: 0.0,
        track: vec![(ImageId(1), 0), (ImageId(2), 0)],
    };
    whole.points.insert(Point3DId(1), point);
    whole
}

#[test]
fn patches_cover_the_same_width_of_the_surface() {
    let found = patches(&two_photos(), &["near", "far"]);
    assert_eq!(found.points_in_world, [DVec3::ZERO]);
    let [near, far] = [0, 1].map(|i| found.of_photo[i][0]);
    assert_eq!((near.x, near.y), (50.0, 40.0));
    assert_eq!(near.sigma_px, 2.0 * far.sigma_px);
    // A photo that takes no part leaves the point to one alone: no patch.
    let alone = patches(&two_photos(), &["far"]);
    assert_eq!(
        (alone.points_in_world.len(), alone.of_photo[0].len()),
        (0, 0)
    );
}

#[test]
fn samples_are_weighted_means_of_what_is_in_proportion() {
    let patch = patches(&two_photos(), &["near", "far"]).of_photo[1][0];
    let look = |photo: &RgbaImage| sample(photo, 1, &[patch]).first().map(|o| o.rgb);
    // A ramp's mean is its middle.
    let ramp = RgbaImage::from_fn(100, 80, |x, y| Rgba([50 + x as u8, 200 - y as u8, 9, 255]));
    let [r, g, b] = look(&ramp).unwrap();
    assert!((r.unwrap() - 99.5).abs() < 1e-9 && (g.unwrap() - 160.5).abs() < 1e-9);
    assert_eq!(b, None, "too dark");
    let mut clipped = ramp.clone();
    clipped.get_pixel_mut(51, 40).0[0] = 255;
    assert_eq!(look(&clipped).unwrap()[0], None);
    let mut transparent = ramp.clone();
    transparent.get_pixel_mut(51, 40).0[3] = 229;
    assert_eq!(look(&transparent), None);
    // Mattes of nearly whole objects change nothing: colours are straight.
    let mut matted = ramp.clone();
    for (x, y, pixel) in matted.enumerate_pixels_mut() {
        pixel.0[3] = 230 + ((3 * x + y) % 26) as u8;
    }
    assert_eq!(look(&matted), look(&ramp));
    // What is far from the patch does not matter.
    let mut elsewhere = ramp.clone();
    elsewhere.get_pixel_mut(80, 40).0 = [255, 255, 255, 0];
    assert_eq!(look(&elsewhere), look(&ramp));
    let small = RgbaImage::new(20, 20);
    assert_eq!(look(&small), None, "the patch's middle lies outside");
}
