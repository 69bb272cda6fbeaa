//! Made of reference images: what is kept, and by whose rule.

use super::*;

#[test]
fn the_central_image_stays_and_the_rest_is_added() {
    let set = set(4, 2, 128, 13, 3);
    for side in &set.sides {
        let images: Vec<&Reference> = side.iter().collect();
        for center_in_front in [false, true] {
            let options = ConstructOptions {
                center_in_front,
                ..of_the_papers()
            };
            let made = construct(&images, &options).unwrap();
            let ldi = &made.ldi;
            let central = &side[6];
            let shift = ldi.camera.principal - central.camera.principal;
            let shift = [shift.x.round() as u32, shift.y.round() as u32];
            let (mut pixels, mut before_center) = (0, 0);
            for y in 0..128 {
                for x in 0..128 {
                    let i = (y * 128 + x) as usize;
                    let s = central.seen.inverse_depth[i];
                    if s == 0.0 {
                        continue;
                    }
                    pixels += 1;
                    let samples: Vec<Sample> = ldi.pixel(x + shift[0], y + shift[1]).collect();
                    let is_it = |sample: &Sample| {
                        sample.color == central.seen.color[i]
                            && (sample.inverse_depth / s - 1.0).abs() < 1e-5
                            && sample.offset.iter().all(|o| o.abs() <= 1)
                    };
                    let at = samples.iter().position(is_it).expect("it stays");
                    // Of other surfaces.
                    let nearest = s * (1.0 + options.range as f32);
                    let is_before = |sample: &&Sample| sample.inverse_depth > nearest;
                    before_center += samples.iter().filter(is_before).count();
                    if center_in_front {
                        assert_eq!(at, samples.len() - 1);
                    } else {
                        let depths = samples.iter().map(|s| s.inverse_depth);
                        assert!(depths.is_sorted());
                    }
                }
            }
            let all: usize = side
                .iter()
                .map(|r| r.seen.color.iter().filter(|c| c[3] > 0).count())
                .sum();
            assert_eq!(made.offered, all);
            assert_eq!(ldi.len() + made.merged + made.outside + made.crowded, all);
            assert!(ldi.len() > pixels && ldi.len() < all / 2);
            let table = layers(ldi);
            assert_eq!(table.total(), ldi.len());
            assert!(table.samples[0] >= pixels && table.share(1, 1) > 0.5);
            // A few pixels have something before what the centre saw of them: edges.
            assert!(before_center * 10 < ldi.len(), "{before_center}");
            assert!(before_center <= made.before_center);
        }
    }
}

/// An image of a wall across the view, at a depth.
fn wall(place: SemicircleView, size: u32, focal: f64, depth: f32, color: [u8; 4]) -> Reference {
    let view = View {
        lens: Lens::pinhole(DVec2::splat(focal), DVec2::splat(0.5 * f64::from(size))),
        width: size,
        height: size,
        camera_from_world: place.camera_from_world,
    };
    let mut seen = Target::new(size, size);
    seen.color.fill(color);
    seen.inverse_depth.fill(1.0 / depth);
    Reference {
        place,
        camera: Pinhole::new(&view).unwrap(),
        seen,
    }
}

#[test]
fn conflicts_are_resolved_by_each_papers_rule() {
    let set = set(2, 1, 8, 3, 50);
    let place = SemicircleView {
        camera_from_world: Rigid3::IDENTITY,
        ..set.sides[0][0].place.clone()
    };
    let [red, blue, green] = [[200, 0, 0, 255], [0, 0, 200, 255], [0, 200, 0, 255]];
    // The centre looks at nothing, so others decide; the third sees smaller patches, and four
    // samples fall in each pixel.
    let images = |depths: [f32; 2], colors: [[u8; 4]; 2]| {
        let mut center = wall(place.clone(), 16, 20.0, 1.0, red);
        center.seen.clear(16, 16);
        let coarse = wall(place.clone(), 16, 20.0, depths[0], colors[0]);
        let fine = wall(place.clone(), 32, 40.0, depths[1], colors[1]);
        [coarse, center, fine]
    };
    let made = |conflict, depths, colors| {
        let images = images(depths, colors);
        let images: Vec<&Reference> = images.iter().collect();
        let options = ConstructOptions {
            conflict,
            range: 0.01,
            ..of_the_papers()
        };
        construct(&images, &options).unwrap().ldi
    };
    let at = |ldi: &Layered| -> Vec<[u8; 4]> { ldi.pixel(8, 8).map(|s| s.color).collect() };
    // The smaller patch wins, and all four of its image are kept.
    let ldi = made(
        Conflict::SmallerPatch { same_color: 255 },
        [2.0, 2.01],
        [blue, green],
    );
    assert_eq!(at(&ldi), [green; 4]);
    // Farther apart than the range, all are.
    let ldi = made(
        Conflict::SmallerPatch { same_color: 255 },
        [2.0, 2.1],
        [blue, green],
    );
    assert_eq!(at(&ldi), [green, green, green, green, blue]);
    // The first stays; another colour is another surface.
    let rule = Conflict::RangeThenColor { same_color: 10 };
    assert_eq!(at(&made(rule, [2.0, 2.01], [blue, blue])), [blue]);
    assert_eq!(at(&made(rule, [2.0, 2.01], [blue, green])).len(), 2);
    assert_eq!(at(&made(rule, [2.0, 2.1], [blue, blue])).len(), 2);
    // The mean of five.
    let [only] = at(&made(Conflict::Average, [2.0, 2.0], [blue, green]))[..] else {
        panic!("one sample");
    };
    assert!(
        only[2].abs_diff(40) <= 2 && only[1].abs_diff(160) <= 2,
        "{only:?}"
    );
    // And the centre's is never displaced.
    let mut images = images([2.0, 2.01], [blue, green]);
    images[1].seen.color.fill(red);
    images[1].seen.inverse_depth.fill(0.5);
    let images: Vec<&Reference> = images.iter().collect();
    let ldi = construct(&images, &of_the_papers()).unwrap().ldi;
    assert_eq!(at(&ldi), [red]);
}

#[test]
fn images_of_nothing_make_an_empty_ldi_and_no_images_none() {
    assert!(construct(&[], &ConstructOptions::default()).is_err());
    let set = set(2, 1, 8, 3, 50);
    let mut images: Vec<Reference> = set.sides[0].clone();
    for image in &mut images {
        image.seen.clear(8, 8);
    }
    let ldi = ldi_of(&images);
    assert!(ldi.is_empty() && layers(&ldi).total() == 0 && ldi.near == 0.0);
    places::draw_all(&ldi, &view(DVec3::ZERO, DVec3::Z, [20, 10]));
    // More samples than a pixel has room for: the central one stays.
    let place = &set.sides[0][0].place;
    let many: Vec<Reference> = (0..301_u16)
        .map(|i| {
            wall(
                place.clone(),
                1,
                1.0,
                1.0 + 0.1 * f32::from(i.abs_diff(150)),
                [9, (i % 256) as u8, 0, 255],
            )
        })
        .collect();
    let images: Vec<&Reference> = many.iter().collect();
    let options = ConstructOptions {
        range: 0.0,
        ..of_the_papers()
    };
    let made = construct(&images, &options).unwrap();
    assert_eq!(made.ldi.count(0, 0), 151);
    assert_eq!(made.merged, 150);
    let many: Vec<Reference> = (0..301_u16)
        .map(|i| {
            wall(
                place.clone(),
                1,
                1.0,
                if i == 150 {
                    900.0
                } else {
                    1.0 + 0.1 * f32::from(i)
                },
                [9, 0, 0, 255],
            )
        })
        .collect();
    let images: Vec<&Reference> = many.iter().collect();
    let made = construct(&images, &options).unwrap();
    assert_eq!((made.ldi.count(0, 0), made.crowded), (255, 46));
    let is_center = |s: Sample| (s.inverse_depth - 1.0 / 900.0).abs() < 1e-9;
    assert!(made.ldi.pixel(0, 0).any(is_center));
}
