use super::predicates::volume6;
use super::*;
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Everything that a Delaunay triangulation is.
fn check(delaunay: &Delaunay) {
    let Delaunay {
        sites,
        tetrahedra,
        across,
        finite,
    } = delaunay;
    let site = |v: u32| sites[v as usize];
    // 1. Adjacency is symmetric, and both sides name the same three corners.
    for (t, corners) in tetrahedra.iter().enumerate() {
        assert_eq!(corners.contains(&INFINITE), t >= *finite);
        for k in 0..4 {
            let code = across[t][k] as usize;
            assert_eq!(across[code >> 2][code & 3] as usize, 4 * t + k);
            let facet = |t: usize, k: usize| {
                let all = tetrahedra[t].iter().enumerate();
                all.filter(|(i, _)| *i != k)
                    .map(|(_, v)| *v)
                    .collect::<BTreeSet<_>>()
            };
            assert_eq!(facet(t, k), facet(code >> 2, code & 3));
        }
    }
    // 2. All volumes are positive and sum to the hull's; the hull is convex.
    let mut volume = 0;
    for corners in &tetrahedra[..*finite] {
        let six = volume6(corners.map(site));
        assert!(six > 0, "flat or inverted");
        volume += six;
    }
    let mut hull = 0;
    for corners in &tetrahedra[*finite..] {
        // With the origin in place of infinity the sign is the other.
        hull -= volume6(corners.map(|v| if v == INFINITE { [0; 3] } else { site(v) }));
    }
    assert_eq!(volume, hull);
    // 3. Each facet is locally Delaunay, which makes all of it Delaunay, the hull included.
    for t in 0..*finite {
        for k in 0..4 {
            let code = across[t][k] as usize;
            let opposite = tetrahedra[code >> 2][code & 3];
            if opposite == INFINITE {
                for v in sites.iter() {
                    let mut four = tetrahedra[t].map(site);
                    four[k] = *v;
                    if sites.len() < 200 {
                        assert_ne!(orientation(four), Ordering::Less, "outside the hull");
                    }
                }
            } else {
                let inside = in_sphere(tetrahedra[t].map(site), site(opposite));
                assert_ne!(inside, Ordering::Greater);
            }
        }
    }
    // 4. Every site is a corner.
    assert!(delaunay.tetrahedron_of_vertex().iter().all(|t| *t != NONE));
}

fn distinct(sites: Vec<Site>) -> Vec<Site> {
    sites
        .into_iter()
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect()
}

#[test]
fn a_cube_and_its_middle() {
    let corner = |i: i32| [0, 1, 2].map(|k| (i >> k & 1) * 10);
    let mut sites: Vec<Site> = (0..8).map(corner).collect();
    check(&Delaunay::new(sites.clone()).unwrap());
    sites.push([5, 5, 5]);
    let delaunay = Delaunay::new(sites).unwrap();
    check(&delaunay);
    assert_eq!(delaunay.finite, 12, "two for each of six sides");
}

#[test]
fn a_lattice_full_of_cospherical_points() {
    let mut sites = Vec::new();
    for x in 0..9 {
        for y in 0..8 {
            for z in 0..7 {
                sites.push([x * 1000, y * 1000, z * 1000]);
            }
        }
    }
    check(&Delaunay::new(sites).unwrap());
}

#[test]
fn a_plane_with_one_point_off_it() {
    let mut sites: Vec<Site> = (0..400).map(|i| [i % 20, i / 20, 7]).collect();
    assert_eq!(Delaunay::new(sites.clone()).unwrap_err(), Flat);
    sites.push([3, 3, 8]);
    check(&Delaunay::new(sites).unwrap());
}

#[test]
fn what_spans_no_space_is_flat() {
    let line: Vec<Site> = (0..50).map(|i| [i, 2 * i, 3 * i]).collect();
    for sites in [vec![], vec![[1, 2, 3]], line[..3].to_vec(), line] {
        assert_eq!(Delaunay::new(sites).unwrap_err(), Flat);
    }
}

#[test]
fn locating_finds_the_tetrahedron_around() {
    let sites: Vec<Site> = (0..500i32)
        .map(|i| [i * 7919 % 1009, i * 104_729 % 997, i * 1_299_709 % 991])
        .collect();
    let delaunay = Delaunay::new(distinct(sites)).unwrap();
    check(&delaunay);
    for i in 0..200 {
        let place = [i * 31 % 1000, i * 57 % 1000, i * 91 % 1000];
        let found = delaunay.locate(place, 0);
        if !delaunay.is_ghost(found) {
            for k in 0..4 {
                let mut four = delaunay.corners(found);
                four[k] = place;
                assert_ne!(orientation(four), Ordering::Less);
            }
        }
    }
    assert!(delaunay.is_ghost(delaunay.locate([5000, 0, 0], 3)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_sites_make_a_delaunay_triangulation(
        sites in prop_oneof![
            prop::collection::vec(prop::array::uniform3(0..4i32), 0..60),
            prop::collection::vec(prop::array::uniform3(0..60i32), 0..150),
            prop::collection::vec(prop::array::uniform3(0..1 << 24), 0..150),
            prop::collection::vec((0..1 << 24, 0..1 << 24, 0..2i32).prop_map(|(x, y, z)| [x, y, z]), 0..150),
        ],
    ) {
        if let Ok(delaunay) = Delaunay::new(distinct(sites)) {
            check(&delaunay);
        }
    }
}
