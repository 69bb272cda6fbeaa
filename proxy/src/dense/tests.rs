use super::*;
use crate::{Mesh, MeshKind, Solid};
use calibrate::{Distortion, Lens, Pixel, Rigid3};
use glam::{DVec2, DVec3};
use image::Rgba;

/// A wall at z = 6 with a slanted board before it.
fn scene() -> Solid {
    let quad = |corners: [[f64; 3]; 4]| Mesh {
        positions: corners.map(DVec3::from_array).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let mut mesh = quad([
        [-20.0, -20.0, 6.0],
        [20.0, -20.0, 6.0],
        [20.0, 20.0, 6.0],
        [-20.0, 20.0, 6.0],
    ]);
    mesh.append(&quad([
        [-0.8, -0.6, 4.0],
        [0.6, -0.6, 4.6],
        [0.6, 0.7, 4.6],
        [-0.8, 0.7, 4.0],
    ]));
    Solid::new(MeshKind::Mesh, mesh)
}

fn view(i: usize) -> View {
    let center = DVec3::new(0.4 * (i % 3) as f64 - 0.4, 0.4 * (i / 3) as f64 - 0.4, 0.0);
    View {
        lens: Lens::pinhole(DVec2::splat(170.0), DVec2::new(96.0, 72.0)),
        width: 192,
        height: 144,
        camera_from_world: Rigid3::looking_at(center, DVec3::new(0.0, 0.0, 5.0), DVec3::Y),
    }
}

/// Blotches that differ everywhere.
fn gray(p: DVec3) -> f64 {
    let wave = |a: f64, b: f64, c: f64| (a * p.x + b * p.y + c).sin();
    let fine = wave(17.0, 5.0, p.z) * wave(-4.0, 19.0, 1.0) + wave(31.0, -23.0, 2.0);
    128.0 + 30.0 * fine + 25.0 * wave(3.0, 7.0, 0.3) * wave(6.0, -2.0, 1.3)
}

fn photo(solid: &Solid, view: &View) -> RgbaImage {
    photo_of(solid, view, gray)
}

/// Of surfaces of other grays.
fn photo_of(solid: &Solid, view: &View, gray: impl Fn(DVec3) -> f64) -> RgbaImage {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    RgbaImage::from_fn(view.width, view.height, |x, y| {
        let mut sum = 0.0;
        for k in 0..4_u32 {
            let at = |i: u32, k: u32| f64::from(i) + 0.25 + 0.5 * f64::from(k);
            let ray = view.lens.unproject(Pixel::new(at(x, k % 2), at(y, k / 2)));
            let ray = world_from_camera * ray.unwrap();
            let hit = solid.first_hit(view.center(), ray).unwrap();
            sum += gray(view.center() + ray * hit.along);
        }
        let gray = (sum / 4.0) as u8;
        Rgba([gray, gray, gray, 255])
    })
}

/// One over the depths of all pixels.
fn depth(solid: &Solid, view: &View) -> Vec<f32> {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let inverse = |i: u32| {
        let at = Pixel::center_of(i % view.width, i / view.width);
        let ray = view.lens.unproject(at).unwrap();
        let ray = world_from_camera * (ray / ray.z);
        (1.0 / solid.first_hit(view.center(), ray).unwrap().along) as f32
    };
    (0..view.width * view.height).map(inverse).collect()
}

/// A few points on the surfaces, seen by all.
fn sparse(solid: &Solid) -> Vec<SparsePoint> {
    let point = |x: i32, y: i32| {
        let ray = DVec3::new(0.09 * f64::from(x), 0.09 * f64::from(y), 1.0);
        let hit = solid.first_hit(DVec3::ZERO, ray)?;
        Some(SparsePoint {
            position: ray * hit.along,
            seen_by: (0..9).collect(),
        })
    };
    let places = (-4..5).flat_map(|x| (-4..5).map(move |y| (x, y)));
    places.filter_map(|(x, y)| point(x, y)).collect()
}

/// What most tests are about: the scene, its views, and the points that all see.
fn seen_by_nine() -> (Solid, Vec<View>, Vec<SparsePoint>) {
    let solid = scene();
    let sparse = sparse(&solid);
    (solid, (0..9).map(view).collect(), sparse)
}

/// Few pixels, which take little time.
const SMALL: DenseOptions = DenseOptions {
    long_side: 96,
    spacing: 4,
};

fn found(options: &DenseOptions) -> (Solid, Vec<SparsePoint>, usize) {
    let (solid, views, sparse) = seen_by_nine();
    let points = densify(
        &views,
        &sparse,
        |i| Some(photo(&solid, &views[i])),
        |_| None,
        options,
    );
    (solid, points, sparse.len())
}

#[test]
fn points_lie_on_the_surfaces_and_fill_the_views() {
    let options = DenseOptions {
        long_side: 192,
        spacing: 4,
    };
    let (solid, points, sparse) = found(&options);
    let new = &points[sparse..];
    let mut errors: Vec<f64> = new
        .iter()
        .map(|p| {
            let along = solid.first_hit(DVec3::ZERO, p.position).unwrap().along;
            (along - 1.0).abs()
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let share = |s: f64| errors[(s * errors.len() as f64) as usize];
    let (median, most) = (share(0.5), share(0.95));
    println!(
        "{} points, depth off by {median:.4} (median), {most:.4} (95 %)",
        new.len()
    );
    // A pixel of the reduced photos is worth 3.7 % of depth over the widest baseline.
    assert!(median < 0.0055 && most < 0.03, "{median} {most}");
    // The first view has 48 × 36 cells; it shares what it sees with the others.
    assert!(new.len() > 1200, "{}", new.len());
    for point in new {
        assert!(point.seen_by.len() >= 3);
        assert!(point.seen_by.is_sorted());
    }
}

#[test]
fn the_same_photos_give_the_same_points_on_any_number_of_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| found(&SMALL).1)
    };
    assert!(on(1) == on(3));
}

#[test]
fn photos_tell_where_things_are_without_sparse_points() {
    let (solid, views, sparse) = seen_by_nine();
    let options = DenseOptions {
        long_side: 192,
        spacing: 4,
    };
    let photo = |i: usize| Some(photo(&solid, &views[i]));
    // What they look at is about 5 away: from a third of that to far beyond.
    let ranges = [[0.01, 0.6]; 9];
    let points = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let mut matching = Matching::new(&views, &[], photo, |_| None, &options);
            matching.suppose(&views, &ranges);
            matching.compare(&[]);
            matching.points(&[], &[])
        })
    };
    let found = points(2);
    let with = densify(&views, &sparse, photo, |_| None, &options);
    // As many as between sparse points, about, and as near.
    let between = &with[sparse.len()..];
    assert!(
        found.len() > between.len() * 9 / 10,
        "{} of {}",
        found.len(),
        between.len()
    );
    let median = |points: &[SparsePoint]| {
        let mut errors = errors(&solid, points);
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let (without, with) = (median(&found), median(between));
    println!(
        "{} points, off by {without:.4} (median; {with:.4} with sparse points)",
        found.len()
    );
    assert!(without < 0.0055 && without < 1.2 * with, "{without} {with}");
    assert!(points(1) == found);
}

/// A view of one of two places far apart, around which photos are taken in circles of 40.
fn around_two_places(i: usize) -> View {
    let place = DVec3::new(1e4 * (i / 40) as f64, 0.0, 5.0);
    let (sin, cos) = (std::f64::consts::TAU * i as f64 / 40.0).sin_cos();
    View {
        camera_from_world: Rigid3::looking_at(
            place + DVec3::new(2.0 * cos, 2.0 * sin, -5.0),
            place,
            DVec3::Y,
        ),
        ..view(i)
    }
}

fn supposed_of(views: &[View]) -> Vec<SparsePoint> {
    let blank = RgbaImage::from_pixel(192, 144, Rgba([90, 90, 90, 255]));
    let photos: Vec<Option<SmallPhoto>> = views
        .iter()
        .map(|view| SmallPhoto::new(view, &blank, 16))
        .collect();
    supposed::points(&photos, &vec![[0.01, 0.6]; views.len()])
}

#[test]
fn many_photos_suppose_no_more_places_than_some_that_lie_among_all() {
    let places = 144;
    let views: Vec<View> = (0..80).map(around_two_places).collect();
    assert_eq!(supposed_of(&views[..60]).len(), 60 * places);
    let points = supposed_of(&views);
    assert_eq!(points.len(), 60 * places);
    // Every photo goes together with others all the same.
    let together = Affinity::new(&views, &points).neighbours(|_| true);
    for (i, neighbours) in together.iter().enumerate() {
        assert!(!neighbours.is_empty(), "{i}");
        assert!(neighbours.iter().all(|j| j / 40 == i / 40), "{i}");
    }
}

#[test]
fn where_photos_show_nothing_in_common_there_are_no_points() {
    let (solid, views, _) = seen_by_nine();
    let clear = |_: usize| Some(RgbaImage::new(192, 144));
    let mut matching = Matching::new(&views, &[], clear, |_| None, &SMALL);
    matching.suppose(&views, &[[0.01, 0.6]; 9]);
    matching.compare(&[]);
    assert_eq!(matching.points(&[], &[]), []);
    // One alone has nobody to compare with.
    let one = |i: usize| (i == 4).then(|| photo(&solid, &views[i]));
    let mut matching = Matching::new(&views, &[], one, |_| None, &SMALL);
    matching.suppose(&views, &[[0.01, 0.6]; 9]);
    matching.compare(&[]);
    assert_eq!(matching.points(&[], &[]), []);
}

#[test]
fn of_a_photo_what_is_used_is_compared_and_lies_where_it_did() {
    let (solid, views, sparse) = seen_by_nine();
    let whole: Vec<RgbaImage> = views.iter().map(|v| photo(&solid, v)).collect();
    // The right half without its corner, as a matte of an object would have it.
    let is_used = |x: u32, y: u32| x >= 96 && y >= 24 && (x < 150 || y < 100);
    let part = |i: usize| {
        let mut part = whole[i].clone();
        for (x, y, pixel) in part.enumerate_pixels_mut() {
            pixel.0[3] = if is_used(x, y) { 255 } else { 0 };
        }
        part
    };
    let [all, some] =
        [whole[4].clone(), part(4)].map(|photo| SmallPhoto::new(&views[4], &photo, 192).unwrap());
    assert_eq!([all.width, all.height], [192, 144]);
    assert_eq!([some.width, some.height], [192 - 96 + 3, 144 - 24 + 3]);
    assert_eq!(some.used.iter().filter(|u| **u).count(), 96 * 120 - 42 * 44);
    for (x, y) in [(0, 0), (50, 70), (98, 122)] {
        let (at, there) = (y * some.width + x, (y + 21) * all.width + x + 93);
        assert_eq!(some.grays[at], all.grays[there]);
        let point = some.point(x, y, 0.2);
        assert!((point - all.point(x + 93, y + 21, 0.2)).length() < 1e-12);
        assert_eq!(
            some.project(point).and_then(|(p, _)| some.index(p)),
            Some(at)
        );
    }
    // What is used has the depths that it has in whole photos, which differ where others are transparent.
    let depths = |photo: &dyn Fn(usize) -> RgbaImage| {
        let photos: Vec<RgbaImage> = (0..9).map(photo).collect();
        let photo = |i: usize| Some(photos[i].clone());
        let mut matching = Matching::new(&views, &sparse, photo, |_| None, &SMALL);
        matching.compare(&[]);
        matching.maps[4][0].map.clone().unwrap()
    };
    let only_four = |i: usize| if i == 4 { part(4) } else { whole[i].clone() };
    let (of_all, of_some) = (depths(&|i| whole[i].clone()), depths(&only_four));
    let scale = SmallPhoto::new(&views[4], &whole[4], SMALL.long_side).unwrap();
    let cut = SmallPhoto::new(&views[4], &part(4), SMALL.long_side).unwrap();
    let shift = [0, 1].map(|k| (scale.principal[k] - cut.principal[k]).round() as usize);
    let (mut alike, mut used) = (0, 0);
    for i in (0..cut.used.len()).filter(|i| cut.used[*i]) {
        let (x, y) = (i % cut.width + shift[0], i / cut.width + shift[1]);
        let [a, b] = [
            of_some.inverse_depths[i],
            of_all.inverse_depths[y * scale.width + x],
        ];
        used += 1;
        alike += u32::from((a - b).abs() <= 0.01 * b);
    }
    assert!(alike > 97 * used / 100, "{alike} of {used}");
    // Of nothing there is no photo.
    let nothing = RgbaImage::new(192, 144);
    assert!(SmallPhoto::new(&views[4], &nothing, 192).is_none());
}

#[test]
fn leaving_photos_out_is_as_if_they_had_never_been_taken() {
    let (options, (solid, views, sparse)) = (SMALL, seen_by_nine());
    let photos: Vec<RgbaImage> = views.iter().map(|v| photo(&solid, v)).collect();
    // Two that go were measured, and one that stays.
    let measured = |i: usize| [0, 3, 4].contains(&i).then(|| depth(&solid, &views[i]));
    let mut matching = Matching::new(
        &views,
        &sparse,
        |i| Some(photos[i].clone()),
        measured,
        &options,
    );
    assert!(matching.points(&sparse, &[]).len() > sparse.len() + 100);
    let sets = [vec![0], vec![4], vec![8], vec![2, 6], vec![7, 0, 4]];
    let one_by_one = sets.clone().map(|gone| matching.points(&sparse, &gone));
    matching.compare(&sets);
    assert!(one_by_one == sets.clone().map(|gone| matching.points(&sparse, &gone)));
    for gone in sets {
        let left: Vec<usize> = (0..9).filter(|i| !gone.contains(i)).collect();
        let seen_by_rest = |number: &dyn Fn(usize, usize) -> usize| -> Vec<SparsePoint> {
            let rest = |p: &SparsePoint| SparsePoint {
                position: p.position,
                seen_by: (left.iter().enumerate())
                    .filter(|(_, i)| p.seen_by.contains(&(**i as u32)))
                    .map(|(k, &i)| number(k, i) as u32)
                    .collect(),
            };
            sparse.iter().map(rest).collect()
        };
        let fewer: Vec<View> = left.iter().map(|&i| views[i].clone()).collect();
        let photo = |i: usize| Some(photos[left[i]].clone());
        let depth = |i: usize| measured(left[i]);
        let mut never = densify(&fewer, &seen_by_rest(&|k, _| k), photo, depth, &options);
        for i in never.iter_mut().flat_map(|p| &mut p.seen_by) {
            *i = left[*i as usize] as u32;
        }
        let without = matching.points(&seen_by_rest(&|_, i| i), &gone);
        assert!(without == never, "{gone:?}");
    }
}

/// How far points are from the surfaces, in parts of their depth.
fn errors(solid: &Solid, points: &[SparsePoint]) -> Vec<f64> {
    let error = |p: &SparsePoint| {
        let i = p.seen_by[0] as usize;
        let center = view(i).center();
        let hit = solid.first_hit(center, p.position - center).unwrap();
        (hit.along - 1.0).abs()
    };
    points.iter().map(error).collect()
}

/// Where there is little contrast a window that is beside the right one has more.
#[test]
fn soft_texture_has_the_depths_that_it_has() {
    let (solid, views, sparse) = seen_by_nine();
    let soft = |p: DVec3| {
        let wave = |a: f64, b: f64, c: f64| (a * p.x + b * p.y + c).sin();
        128.0 + 12.0 * (wave(2.4, 0.9, p.z) + wave(-1.1, 2.3, 1.0) + wave(1.9, -2.0, 2.0))
    };
    let photo = |i: usize| Some(photo_of(&solid, &views[i], soft));
    let options = DenseOptions::default();
    let points = densify(&views, &sparse, photo, |_| None, &options);
    let mut errors = errors(&solid, &points[sparse.len()..]);
    assert!(errors.len() > 500, "{}", errors.len());
    errors.sort_by(f64::total_cmp);
    let [half, most] = [0.5, 0.9].map(|share| errors[(share * errors.len() as f64) as usize]);
    // A pixel of parallax is 9 % of the depth. As windows of more contrast fitted better, half were 29 % off.
    assert!(half < 0.04 && most < 0.12, "{half} {most}");
}

#[test]
fn what_was_measured_counts_where_photos_agree_on_nothing() {
    let (options, (solid, views, sparse)) = (SMALL, seen_by_nine());
    let count = sparse.len();
    let blank = RgbaImage::from_pixel(192, 144, Rgba([90, 90, 90, 255]));
    let of_blank = |i: usize| (i == 4).then(|| depth(&solid, &views[i]));
    // 1. A photo that nobody can be compared with: all that it sees is known.
    let alone = |i: usize| (i == 4).then(|| blank.clone());
    let points = densify(&views, &sparse, alone, of_blank, &options);
    let of_it = &points[count..];
    assert_eq!(of_it.len(), 24 * 18);
    assert!(of_it.iter().all(|p| p.seen_by == [4]));
    // What lies on the board's rim by the nearest pixel is not all on it by its centre.
    let off = errors(&solid, of_it).into_iter().filter(|e| *e > 0.01);
    let off = off.count();
    assert!(off < 12, "{off}");
    // 2. Photos that show what they see agree, and what was measured adds what they don't; one that is a
    // third off adds nothing, as the others see through it.
    let photos: Vec<RgbaImage> = views.iter().map(|v| photo(&solid, v)).collect();
    let with = |depth: &(dyn Fn(usize) -> Option<Vec<f32>> + Sync)| {
        densify(
            &views,
            &sparse,
            |i| Some(photos[i].clone()),
            depth,
            &options,
        )
    };
    let (without, right) = (with(&|_| None), with(&|i| Some(depth(&solid, &views[i]))));
    assert!(
        right.len() > without.len(),
        "{} {}",
        right.len(),
        without.len()
    );
    let wrong = |i: usize| {
        let nearer = depth(&solid, &views[i]).into_iter().map(|d| 1.5 * d);
        (i == 4).then(|| nearer.collect())
    };
    let by_all = |points: &[SparsePoint]| {
        let far = errors(&solid, points).into_iter().filter(|e| *e > 0.2);
        far.count()
    };
    let (none, some) = (by_all(&without), by_all(&with(&wrong)));
    assert!(some <= none + 2, "{none} {some}");
}

#[test]
#[should_panic(expected = "a depth for each pixel")]
fn a_depth_map_of_another_size_is_no_depth_map() {
    let blank = RgbaImage::from_pixel(192, 144, Rgba([90, 90, 90, 255]));
    let depth = |_| Some(vec![0.25; 96 * 72]);
    let options = DenseOptions::default();
    densify(&[view(0)], &[], |_| Some(blank.clone()), depth, &options);
}

#[test]
fn photos_that_tell_nothing_add_nothing() {
    let views: Vec<View> = (0..4).map(view).collect();
    let points = vec![SparsePoint {
        position: DVec3::new(0.0, 0.0, 5.0),
        seen_by: vec![0, 1, 2, 3],
    }];
    let options = DenseOptions {
        long_side: 64,
        spacing: 4,
    };
    let blank = RgbaImage::from_pixel(192, 144, Rgba([90, 90, 90, 255]));
    let clear = RgbaImage::new(192, 144);
    // None to be had, transparent ones, one view alone, no points.
    assert_eq!(
        densify(&views, &points, |_| None, |_| None, &options),
        points
    );
    assert_eq!(
        densify(&views, &points, |_| Some(clear.clone()), |_| None, &options),
        points
    );
    assert_eq!(
        densify(
            &views[..1],
            &[],
            |_| Some(blank.clone()),
            |_| None,
            &options
        ),
        []
    );
    assert_eq!(
        densify(&views, &[], |_| Some(blank.clone()), |_| None, &options),
        []
    );
    assert_eq!(densify(&[], &[], |_| None, |_| None, &options), []);
    // Points at no place, or where the cameras are.
    let odd = [DVec3::NAN, DVec3::INFINITY, views[0].center(), DVec3::NEG_Z];
    let odd = odd.map(|position| SparsePoint {
        position,
        seen_by: vec![0, 1, 2, 3],
    });
    let points = densify(&views, &odd, |_| Some(blank.clone()), |_| None, &options);
    assert!(points[4..].iter().all(|p| p.position.is_finite()));
}

#[test]
fn points_beside_what_straight_photos_show_of_wide_ones_say_nothing() {
    let (_, mut views, sparse) = seen_by_nine();
    let fisheye = Distortion::Fisheye { k: [0.0; 4] };
    for view in &mut views {
        view.lens = Lens::new(DVec2::splat(60.0), DVec2::new(96.0, 72.0), fisheye);
    }
    // The last looks the other way: it has in common with the others what is beside all.
    let back = Rigid3::looking_at(DVec3::ZERO, -DVec3::Z, DVec3::Y);
    views[8].camera_from_world = back;
    let photo = RgbaImage::from_pixel(192, 144, Rgba([100, 100, 100, 255]));
    let matching = |points: &[SparsePoint]| {
        Matching::new(&views, points, |_| Some(photo.clone()), |_| None, &SMALL)
    };
    let beside = |i: i32| SparsePoint {
        position: DVec3::new(3.0, 0.04 * f64::from(i), 0.01 * f64::from(i % 7 - 3)),
        seen_by: (0..9).collect(),
    };
    let mut all = sparse.clone();
    all.iter_mut().for_each(|point| point.seen_by.truncate(8));
    let before = matching(&all);
    all.extend((-20..20).map(beside));
    let after = matching(&all);
    assert_eq!(after.ranges, before.ranges);
    assert_eq!(after.neighbours, before.neighbours);
    assert!(after.neighbours[8].is_empty() && after.neighbours[0].len() == 5);
    // They are points as before, for others to use.
    assert_eq!(after.points(&all, &[])[..all.len()], all[..]);
}
