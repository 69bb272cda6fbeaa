//! How far lenses see: folds, poles, sensors from behind and pixels without a ray.

use calibrate::{Distortion, Lens, Pixel};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

#[test]
fn nothing_is_seen_behind_or_beyond_the_fold() {
    let barrel = Distortion::Rational {
        k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        p: [0.0; 2],
    };
    let lens = Lens::new(DVec2::splat(1000.0), DVec2::ZERO, barrel);
    // r(1 − 0.3r²) turns back at r = 1/√0.9.
    let fold = 1.0 / 0.9_f64.sqrt();
    assert!((lens.limit() - fold).abs() < 1e-6);
    assert!(lens.project(DVec3::new(fold - 1e-6, 0.0, 1.0)).is_some());
    assert!(lens.project(DVec3::new(fold + 1e-6, 0.0, 1.0)).is_none());
    let farthest = 1000.0 * fold * 2.0 / 3.0;
    assert!(lens.unproject(Pixel::new(farthest - 1e-6, 0.0)).is_some());
    assert!(lens.unproject(Pixel::new(farthest + 1e-6, 0.0)).is_none());

    for distortion in [Distortion::None, barrel] {
        let lens = Lens::new(DVec2::splat(1000.0), DVec2::ZERO, distortion);
        for point in [DVec3::ZERO, DVec3::X, DVec3::NEG_Z, DVec3::NAN] {
            assert_eq!(lens.project(point), None, "{distortion:?}, {point}");
        }
        assert_eq!(lens.unproject(Pixel::new(f64::NAN, 0.0)), None);
        assert_eq!(lens.unproject(Pixel::new(f64::INFINITY, 0.0)), None);
    }
    // A fisheye sees sideways and somewhat back.
    let fisheye = Lens::new(
        DVec2::splat(300.0),
        DVec2::ZERO,
        Distortion::Fisheye { k: [0.0; 4] },
    );
    let pixel = fisheye.project(DVec3::new(2.0, 0.0, -2.0)).unwrap();
    assert!((pixel.x - 300.0 * 0.75 * std::f64::consts::PI).abs() < 1e-9);
    for point in [DVec3::ZERO, DVec3::NEG_Z, DVec3::NAN] {
        assert_eq!(fisheye.project(point), None, "{point}");
    }
}

/// Such a fold lies where next to nothing is seen, but what is beyond it would come back into the
/// image's middle.
#[test]
fn nothing_is_seen_beyond_a_fold_close_to_90_degrees() {
    let lens = |k1: f64, p1: f64| {
        let distortion = Distortion::Rational {
            k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0],
            p: [p1, 0.0],
        };
        Lens::new(DVec2::splat(1000.0), DVec2::ZERO, distortion)
    };
    // r(1 − k·r²) turns back at r = 1/√(3k); at 1/√k it is back at 0.
    for k in [1e-4_f64, 1e-6, 1e-12] {
        let barrel = lens(-k, 0.0);
        let fold = 1.0 / (3.0 * k).sqrt();
        assert!((barrel.limit() / fold - 1.0).abs() < 1e-9, "{k}");
        assert!(barrel.project(DVec3::new(0.99 * fold, 0.0, 1.0)).is_some());
        assert_eq!(barrel.project(DVec3::new(1.01 * fold, 0.0, 1.0)), None);
        let middle = DVec3::new(1.0 / k.sqrt(), 0.0, 1.0);
        assert_eq!(barrel.project(middle), None, "{k}");
    }
    // 6·p·r = 1.
    let tangential = lens(0.0, 1e-6).limit();
    assert!((tangential * 6e-6 - 1.0).abs() < 1e-9, "{tangential}");
    // Nothing folds where the radius grows throughout.
    assert!(lens(1e-4, 0.0).limit().is_infinite());
    assert!(lens(1e-4, 1e-6).limit().is_infinite());
}

/// Newton's method crept away from the pole that ends this lens' range in steps too small
/// to notice, and its starting point was taken for the answer.
#[test]
fn a_pole_at_the_end_of_the_range_is_not_an_answer() {
    let distortion = Distortion::Rational {
        k: [0.182, 0.041, 0.0, 0.0454, 0.0175, -0.0172],
        p: [0.0; 2],
    };
    let lens = Lens::new(DVec2::splat(500.0), DVec2::ZERO, distortion);
    assert!(lens.limit() < 2.2);
    let pixel = lens.project(DVec3::new(1.5, 0.0, 1.0)).unwrap();
    let ray = lens.unproject(pixel).unwrap();
    assert!((ray / ray.z - DVec3::new(1.5, 0.0, 1.0)).length() < 1e-9);
}

/// Its radial terms hardly grow at a radius of 1.3, where the tangential ones fold it.
#[test]
fn tangential_terms_end_the_range_too() {
    let k = [-0.1951, -0.045, 0.01945, 0.0, 0.0, 0.0];
    let limit = |p| Lens::new(DVec2::ONE, DVec2::ZERO, Distortion::Rational { k, p }).limit();
    assert!(limit([0.0; 2]).is_infinite());
    assert!(limit([0.002, 0.0]) < 1.4);
}

/// Formulas go on beyond what a camera sees; numbers do not.
#[test]
fn new_models_see_as_far_as_their_formula_is_one_to_one() {
    let lens = |distortion| Lens::new(DVec2::splat(300.0), DVec2::ZERO, distortion);
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        DVec3::new(sin, 0.0, cos)
    };
    for (distortion, sees, does_not, too_far) in [
        // π/2ω
        (Distortion::Fov { omega: 0.9 }, 89.999, 90.001, 1.7454),
        // tan θ = 1/(2√k), at 1/√k
        (Distortion::Division { k: 0.25 }, 44.999, 45.001, 2.0001),
        // tan θ = 2/3 at 1/√(−3k)
        (
            Distortion::InverseRadial { k: -1.0 / 3.0 },
            33.69,
            33.691,
            1.0001,
        ),
        // At 1/√(2α − 1), tan θ = −√(2α − 1)/(1 − α)
        (
            Distortion::Eucm {
                alpha: 0.75,
                beta: 1.0,
            },
            109.47,
            109.48,
            1.41422,
        ),
        (
            Distortion::Eucm {
                alpha: 1.0,
                beta: 1.0,
            },
            89.99,
            90.01,
            1.0001,
        ),
    ] {
        let lens = lens(distortion);
        assert!(lens.project(at(sees)).is_some(), "{distortion:?}");
        assert_eq!(lens.project(at(does_not)), None, "{distortion:?}");
        assert_eq!(
            lens.unproject(Pixel::new(300.0 * too_far, 0.0)),
            None,
            "{distortion:?}"
        );
        let last = Pixel::new(300.0 * 0.999 * too_far, 0.0);
        assert!(lens.unproject(last).is_some(), "{distortion:?}");
    }
    for distortion in [
        Distortion::Division { k: -0.2 },
        Distortion::Eucm {
            alpha: 0.5,
            beta: 1.0,
        },
        Distortion::Equirectangular,
    ] {
        let lens = lens(distortion);
        let pixel = lens.project(at(179.0)).unwrap();
        assert!((lens.unproject(pixel).unwrap() - at(179.0)).length() < 1e-9);
        assert_eq!(lens.project(DVec3::ZERO), None);
        assert_eq!(lens.project(DVec3::NAN), None);
        assert_eq!(lens.unproject(Pixel::new(f64::NAN, 0.0)), None);
    }
    // The sphere ends where its image does: the same rays again would lie beyond.
    let sphere = lens(Distortion::Equirectangular);
    assert!(
        sphere
            .unproject(Pixel::new(300.0 * PI, -150.0 * PI))
            .is_some()
    );
    assert_eq!(sphere.unproject(Pixel::new(300.1 * PI, 0.0)), None);
    assert_eq!(sphere.unproject(Pixel::new(0.0, 150.1 * PI)), None);
}

/// Within its edge a lens has a ray for every pixel; beyond, none where the image is round.
#[test]
fn an_image_reaches_to_its_lenses_edge_and_no_farther() {
    let barrel = [-0.2, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (p, tau) = ([0.004, -0.003], [0.05, -0.06]);
    let fisheye = [-0.09, 0.0, 0.0, 0.0];
    let [round, uneven, endless] = [
        vec![
            Distortion::Rational {
                k: barrel,
                p: [0.0; 2],
            },
            Distortion::Fisheye { k: fisheye },
            Distortion::Fov { omega: -0.9 },
            Distortion::Division { k: 0.25 },
            Distortion::InverseRadial { k: -0.2 },
            Distortion::Eucm {
                alpha: 0.62,
                beta: 1.1,
            },
        ],
        vec![
            Distortion::Rational { k: barrel, p },
            Distortion::Tilted {
                k: barrel,
                p,
                s: [0.002, 0.0, -0.001, 0.0],
                tau,
            },
            Distortion::SkewedFisheye {
                k: fisheye,
                alpha: 0.03,
            },
            Distortion::ThinPrismFisheye {
                k: fisheye,
                p,
                s: [0.002, -0.001],
            },
            Distortion::RadTanThinPrismFisheye {
                k: [-0.09, 0.0, 0.0, 0.0, 0.0, 0.0],
                p,
                s: [0.002, 0.0, -0.001, 0.0],
            },
        ],
        vec![
            Distortion::None,
            Distortion::Rational {
                k: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0],
                p: [0.0; 2],
            },
            Distortion::Division { k: -0.25 },
            Distortion::InverseRadial { k: 0.2 },
            Distortion::Eucm {
                alpha: 0.4,
                beta: 1.1,
            },
            Distortion::Equirectangular,
        ],
    ]
    .map(|all| {
        all.into_iter()
            .map(|distortion| (distortion, lens_of(distortion)))
    });

    let seen = |lens: &Lens, share: f64| {
        let at = |i: u32| {
            let radius = share * lens.edge();
            let at = lens.principal + lens.focal * radius * DVec2::from_angle(f64::from(i));
            lens.unproject(Pixel::new(at.x, at.y)).is_some()
        };
        (0..100).filter(|i| at(*i)).count()
    };
    for (distortion, lens) in round {
        assert_eq!(seen(&lens, 0.9999), 100, "{distortion:?}");
        assert_eq!(seen(&lens, 1.0001), 0, "{distortion:?}");
    }
    for (distortion, lens) in uneven {
        assert_eq!(seen(&lens, 0.998), 100, "{distortion:?}");
        // It touches the image's end somewhere.
        assert!(seen(&lens, 1.005) < 100, "{distortion:?}");
    }
    for (distortion, lens) in endless {
        assert_eq!(lens.edge(), f64::INFINITY, "{distortion:?}");
    }
    // It goes with the image's size.
    let lens = lens_of(Distortion::Fisheye { k: fisheye });
    assert_eq!(lens.scaled(2.0, 3.0).edge(), lens.edge());
}

fn lens_of(distortion: Distortion) -> Lens {
    Lens::new(
        DVec2::new(300.0, 310.0),
        DVec2::new(400.0, 300.0),
        distortion,
    )
}

/// A tilted sensor is a plane that rays meet from in front; the formula goes on behind it.
#[test]
fn a_tilted_sensor_is_not_seen_from_behind() {
    let tilted = Distortion::Tilted {
        k: [0.0; 6],
        p: [0.0; 2],
        s: [0.0; 4],
        tau: [0.0, 0.5_f64.atan()],
    };
    let lens = Lens::new(DVec2::splat(300.0), DVec2::ZERO, tilted);
    // 1 + x·tan τy vanishes at x = −2.
    assert!(lens.project(DVec3::new(-1.999, 0.3, 1.0)).is_some());
    assert_eq!(lens.project(DVec3::new(-2.001, 0.3, 1.0)), None);
    assert_eq!(
        lens.project_with_gradients(DVec3::new(-2.001, 0.3, 1.0)),
        None
    );
    // The sensor's own horizon: rays at right angles to the axis.
    let farthest = lens.project(DVec3::new(1e12, 0.0, 1.0)).unwrap().x;
    assert!(
        lens.unproject(Pixel::new(farthest * (1.0 - 1e-6), 0.0))
            .is_some()
    );
    assert_eq!(
        lens.unproject(Pixel::new(farthest * (1.0 + 1e-6), 0.0)),
        None
    );
}

/// Found by fuzzing: the square of such a pixel's distance is no number.
#[test]
fn pixels_too_far_out_have_no_ray() {
    let models = [
        Distortion::None,
        Distortion::Fov { omega: 0.5 },
        Distortion::Division { k: -0.1 },
        Distortion::Eucm {
            alpha: 0.3,
            beta: 1.0,
        },
    ];
    for distortion in models {
        let lens = Lens::new(DVec2::splat(1e-134), DVec2::splat(1e20), distortion);
        assert_eq!(
            lens.unproject(Pixel::new(0.25, 0.25)),
            None,
            "{distortion:?}"
        );
    }
}
