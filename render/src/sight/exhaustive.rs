//! Passing source views over changes nothing that asking all of them would find, and asks far less.

use super::*;
use calibrate::{Distortion, Lens, Rigid3};

const SIZE: (u32, u32) = (32, 24);

/// What is to be moved, by asking every view about every pixel at every inverse distance; and how often that is.
fn exhaustive(
    map: &FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    sources: &[FrameSource],
) -> (Vec<Vec<Moved>>, u64) {
    let [width, height] = map.size.map(|side| side as usize);
    let mut asked = 0;
    let mut all = Vec::new();
    for y in 0..height {
        let mut moved = Vec::new();
        for x in 0..width {
            let ray = match rays {
                Some(rays) => rays.at(x, y).map(|at| at.extend(1.0)),
                None => desired.lens.unproject(Pixel::center_of(x as u32, y as u32)),
            };
            let plane = map.planes.get(map.facet_of[y * width + x] as usize);
            let (Some(ray), Some(plane)) = (ray, plane) else {
                continue;
            };
            let s = plane.dot(ray);
            let mut first = |s: f64, sees: &dyn Fn(&FrameSource, DVec3, f64) -> bool| {
                sources.iter().position(|source| {
                    asked += 1;
                    sees(source, ray, s)
                })
            };
            if !(s >= 0.0) || first(s, &sees).is_some() {
                continue;
            }
            let nearest = nearest_seen(s, &mut |s: f64| first(s, &sees_well).is_some());
            if let Some(to) = nearest {
                let source_idx = first(to, &sees_well).unwrap();
                moved.push(Moved {
                    x,
                    plane: ray * (to / ray.length_squared()),
                    source_idx: source_idx as u32,
                    shift_px: shift_px(&sources[source_idx], desired, ray, s, to),
                });
            }
        }
        all.push(moved);
    }
    (all, asked)
}

fn view(center: DVec3, towards: DVec3, lens: Lens) -> View {
    View {
        lens,
        width: SIZE.0,
        height: SIZE.1,
        camera_from_world: Rigid3::looking_at(center, center + towards, DVec3::Y),
    }
}

/// Its focal length in pixels, across and down.
fn lens(focal: [f64; 2], distortion: Distortion) -> Lens {
    let middle = 0.5 * DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
    Lens::new(DVec2::from_array(focal), middle, distortion)
}

/// The lenses of photos: narrow, bent, wide, so wide that they see behind themselves, and all around.
fn lenses() -> [Lens; 6] {
    let radial = Distortion::Rational {
        k: [-0.2, 0.02, 0.0, 0.0, 0.0, 0.0],
        p: [0.01, -0.005],
    };
    let fisheye = Distortion::Fisheye { k: [0.0; 4] };
    let round = std::f64::consts::TAU / f64::from(SIZE.0);
    [
        lens([30.0; 2], Distortion::None),
        lens([25.0, 30.0], radial),
        lens([20.0; 2], fisheye),
        lens([9.0; 2], fisheye),
        lens([14.0; 2], Distortion::Division { k: -0.3 }),
        lens([round.recip(); 2], Distortion::Equirectangular),
    ]
}

/// Photos beside one another that look ahead, each a little elsewhere; one of them takes no part.
fn photos(lens: Lens, count: u32, desired: &View) -> Vec<FrameSource> {
    let photo = |i: u32| {
        let aside = f64::from(i) - 0.5 * f64::from(count - 1);
        let up = f64::from(i * 5 % 7) / 7.0;
        let towards = DVec3::new(0.1 * aside, 0.3 * up - 0.15, 1.0);
        let photo = view(DVec3::new(0.4 * aside, 0.2 * up, 0.0), towards, lens);
        let mut source = FrameSource::of(&photo, desired);
        if i == 3 {
            source.time_penalty = f64::INFINITY;
        }
        source
    };
    (0..count).map(photo).collect()
}

/// From among the photos, from one's own place, from before, behind, beside and far away: ahead, aside, up and back.
fn desired_views() -> Vec<View> {
    let straight = lens([16.0; 2], Distortion::None);
    let mut views: Vec<View> = [
        ([0.0, 0.1, 0.0], [0.0, 0.0, 1.0]),
        ([0.0, 0.1, 0.0], [1.0, 0.0, 0.2]),
        ([0.0, 0.1, 0.0], [0.0, -1.0, 0.15]),
        ([0.0, 0.1, 0.0], [0.2, 0.1, -1.0]),
        // Of the first of an even number.
        ([-1.4, 0.0, 0.0], [-0.8, 0.0, 0.6]),
        ([0.3, 0.0, 6.0], [0.0, 0.0, -1.0]),
        ([0.3, 0.0, -6.0], [0.2, 0.0, 1.0]),
        ([-5.0, 0.0, 1.0], [1.0, 0.0, 0.3]),
        ([2000.0, 100.0, -900.0], [-0.9, 0.0, 0.4]),
    ]
    .map(|(center, towards)| {
        let [center, towards] = [center, towards].map(DVec3::from_array);
        view(center, towards, straight)
    })
    .to_vec();
    // Of rays that bend, and of some that look back.
    let fisheye = Distortion::Fisheye { k: [0.0; 4] };
    for i in [0, 1, 3] {
        for focal in [[16.0; 2], [9.0, 16.0]] {
            let lens = lens(focal, fisheye);
            views.push(View {
                lens,
                ..views[i].clone()
            });
        }
    }
    views
}

/// So many facets in pieces of so many pixels, near and far.
fn surface(desired: &View, pieces: u32, pixels: u32) -> FacetMap {
    let plane = |i: u32| {
        let share = |of: f64| (f64::from(i + 1) * (0.618_033_988_7 + of)).fract();
        let tilt = DVec3::new(share(0.1), share(0.2), 0.0) - DVec3::new(0.5, 0.5, 0.0);
        (DVec3::Z + 0.4 * tilt) * 0.02 * 100.0_f64.powf(share(0.0))
    };
    let across = SIZE.0.div_ceil(pixels);
    let piece = |i: u32| i % SIZE.0 / pixels + i / SIZE.0 / pixels * across;
    let facet_of: Vec<u32> = (0..SIZE.0 * SIZE.1).map(piece).collect();
    assert_eq!(facet_of.iter().max(), Some(&(pieces - 1)));
    FacetMap::of_pixels((0..pieces).map(plane).collect(), facet_of, desired)
}

/// How often views were asked, and how often all of them would have been.
#[derive(Default)]
struct Asked {
    few: u64,
    all: u64,
}

#[test]
fn all_is_moved_as_if_every_view_had_been_asked() {
    let lenses = lenses();
    let bits = |map: &FacetMap| -> Vec<u64> {
        let planes = map.planes.iter();
        planes
            .flat_map(|q| q.to_array().map(f64::to_bits))
            .collect()
    };
    let (mut of_pinholes, mut of_others, mut moved) = (Asked::default(), Asked::default(), 0);
    for desired in desired_views() {
        let rays = Rays::of(&desired.lens, SIZE);
        // Facets that are asked about by themselves, and smaller ones.
        let surfaces = [(12, 8), (48, 4)].map(|(pieces, pixels)| surface(&desired, pieces, pixels));
        let several = lenses.map(|lens| photos(lens, 8, &desired));
        let one = photos(lenses[0], 1, &desired);
        // Without those that see all around: they would leave nothing to move.
        let two_each = several[..5].iter().flat_map(|of_lens| &of_lens[..2]);
        let mixed: Vec<FrameSource> = two_each.copied().collect();
        for (i, sources) in several.iter().chain([&one, &mixed]).enumerate() {
            let asked = if i == 0 {
                &mut of_pinholes
            } else {
                &mut of_others
            };
            for map in &surfaces {
                let (expected, of_all) = exhaustive(map, &desired, rays.as_ref(), sources);
                moved += expected.iter().map(Vec::len).sum::<usize>();
                let expected = with_moved(map.clone(), expected);
                let views = Views::new(sources);
                let found = to_move(map, &desired, rays.as_ref(), &views);
                let found = with_moved(map.clone(), found);
                assert_eq!(found, expected, "{i}: {desired:?}");
                assert_eq!(bits(&found), bits(&expected), "{i}: {desired:?}");
                asked.few += views.asked.into_inner();
                asked.all += of_all;
            }
        }
    }
    assert!(moved > 10_000, "{moved}");
    // What a pinhole has along a ray is known to the last bit but a few; around bent lenses a cone is.
    let Asked { few, all } = of_pinholes;
    assert!(40 * few < all, "{few} of {all}");
    let Asked { few, all } = of_others;
    assert!(5 * few < all, "{few} of {all}");
}

#[test]
fn who_cannot_see_what_is_looked_at_is_not_asked() {
    // From behind all photos, away from them.
    let straight = lens([16.0; 2], Distortion::None);
    let desired = view(DVec3::NEG_Z, DVec3::NEG_Z, straight);
    let rays = Rays::of(&desired.lens, SIZE);
    for lens in &lenses()[..3] {
        let sources = photos(*lens, 8, &desired);
        // Of large facets only the view that saw the last pixel is asked about the next.
        let pixels = u64::from(SIZE.0 * SIZE.1);
        for (pieces, across, most) in [(12, 8, pixels), (48, 4, 0)] {
            let map = surface(&desired, pieces, across);
            let views = Views::new(&sources);
            let moved = to_move(&map, &desired, rays.as_ref(), &views);
            assert!(moved.iter().all(Vec::is_empty));
            let asked = views.asked.into_inner();
            assert!(asked <= most, "{asked} of {pieces}");
        }
    }
}
