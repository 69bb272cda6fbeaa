//! LDIs kept as files: that walks draw the same with them, and what files they refuse.

use crate::house;

use calibrate::View;
use house::{own_house, small_house, view, viewpoint};
use proxy::interior::Interior;
use render::RenderError;
use render::interior::{FrameCost, Library, PortalFill, Target, Walk, WalkError, WalkOptions};
use render::ldi::write;
use std::collections::BTreeSet;
use std::path::Path;
use std::thread::scope;

/// Beside the default: LDIs of so many views, of few pixels.
fn options(views: Option<usize>) -> WalkOptions {
    let mut options = WalkOptions::default();
    options.library.size = [32; 2];
    options.library.ldi_views = views;
    options
}

fn views(interior: &Interior) -> Vec<View> {
    let view = |seed| {
        let (eye, target) = viewpoint(interior, seed);
        view(eye, target, [64, 48])
    };
    (1..14).filter(|seed| seed % 8 != 0).map(view).collect()
}

/// Makes all LDIs that a walk may show into a folder; the names of their files.
fn keep(walk: &mut Walk<'_>, interior: &Interior, folder: &Path) -> Vec<String> {
    let mut names = Vec::new();
    for place in walk.library().ldi_places() {
        let name = walk.library().file_name(place, interior);
        let made = walk.make_ldi(place).unwrap();
        write(&folder.join(&name), &Option::as_ref(&made).unwrap().ldi).unwrap();
        names.push(name);
    }
    names
}

fn draw_all(walk: &mut Walk<'_>, views: &[View]) -> (Vec<Target>, FrameCost) {
    let mut sum = FrameCost::default();
    let draw = |view| {
        let cost = walk.draw(view, PortalFill::Ldi).unwrap();
        sum.ldis_made += cost.ldis_made;
        sum.ldis_read += cost.ldis_read;
        sum.ldis_ahead += cost.ldis_ahead;
        sum.references_made += cost.references_made;
        walk.picture().clone()
    };
    (views.iter().map(draw).collect(), sum)
}

#[test]
fn pictures_do_not_tell_whether_ldis_were_read_or_made() {
    let (house, contents) = small_house(4, 3);
    let interior = &house.interior;
    let views = views(interior);
    for of in [None, Some(3)] {
        let folder = tempfile::tempdir().unwrap();
        let walk = |options| Walk::new(interior, &contents, &house.model, options);
        let (pictures, without) = draw_all(&mut walk(options(of)), &views);
        assert!(without.ldis_made > 0 && without.ldis_read == 0);
        let mut maker = walk(options(of));
        let names = keep(&mut maker, interior, folder.path());
        // Memory for one side's.
        let kept = maker.library().residency();
        assert!(names.len() > 8 && kept.held * 4 < kept.loads * 32 * 32 * 9);
        for budget in [None, Some(1)] {
            let mut options = options(of);
            options.library.budget = budget;
            scope(|scope| {
                let mut walk = Walk::new(interior, &contents, &house.model, options);
                walk.make_ahead(scope).unwrap();
                walk.use_ldi_files(folder.path());
                let (again, with) = draw_all(&mut walk, &views);
                assert!(again == pictures, "{of:?} {budget:?}");
                let made = (with.ldis_made, with.ldis_ahead, with.references_made);
                assert!(made == (0, 0, 0) && with.ldis_read > 0, "{with:?}");
                assert!(with.ldis_read == without.ldis_made || budget.is_some());
            });
        }
        // What has no file is made, and what has none any more, or another.
        for (k, name) in names.iter().enumerate().filter(|(k, _)| k % 2 == 0) {
            let file = folder.path().join(name);
            let mut walk = walk(options(of));
            if k % 4 == 0 {
                std::fs::remove_file(&file).unwrap();
            }
            walk.use_ldi_files(folder.path());
            match k % 8 {
                2 => std::fs::remove_file(&file).unwrap(),
                6 => std::fs::write(&file, "nothing").unwrap(),
                _ => {}
            }
            if k < 8 {
                assert!(draw_all(&mut walk, &views).0 == pictures, "{of:?} {name}");
            }
        }
    }
}

#[test]
fn files_have_the_same_bytes_by_any_threads() {
    let (house, contents) = small_house(2, 1);
    let interior = &house.interior;
    let bytes = |threads: usize, of| {
        let folder = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let names = pool.build().unwrap().install(|| {
            let mut walk = Walk::new(interior, &contents, &house.model, options(of));
            keep(&mut walk, interior, folder.path())
        });
        let read = |name: &String| std::fs::read(folder.path().join(name)).unwrap();
        let files: Vec<Vec<u8>> = names.iter().map(read).collect();
        (names, files)
    };
    for of in [None, Some(3)] {
        let one = bytes(1, of);
        assert!(one == bytes(3, of) && one.0.len() > 3);
    }
}

#[test]
fn a_file_of_something_else_is_an_error_that_says_what_to_do() {
    let (house, contents) = small_house(2, 1);
    let interior = &house.interior;
    let folder = tempfile::tempdir().unwrap();
    let new = || Walk::new(interior, &contents, &house.model, options(None));
    let names = keep(&mut new(), interior, folder.path());
    let files: Vec<_> = names.iter().map(|name| folder.path().join(name)).collect();
    let contents_of: Vec<Vec<u8>> = files.iter().map(|f| std::fs::read(f).unwrap()).collect();
    let failed = || {
        let mut walk = new();
        walk.use_ldi_files(folder.path());
        let drawn = views(interior)
            .into_iter()
            .map(|view| walk.draw(&view, PortalFill::Ldi));
        match drawn.filter_map(Result::err).next() {
            Some(WalkError::Photos(RenderError::LdiFile(said))) => said,
            other => panic!("{other:?}"),
        }
    };
    type Change = fn(&[Vec<u8>], usize) -> Vec<u8>;
    let changes: [(Change, &str); 5] = [
        (
            |all, i| all[i][..50].to_vec(),
            "50 bytes, expected 128 for a header",
        ),
        (
            |all, i| all[i][..all[i].len() - 1].to_vec(),
            "; make it again",
        ),
        (|_, _| Vec::new(), "it does not begin with LUMI-LDI"),
        // Of the same portal's other side, and of another portal.
        (|all, i| all[i ^ 1].clone(), "an LDI of portal "),
        (
            |all, i| all[(i + 2) % all.len()].clone(),
            "expected portal ",
        ),
    ];
    for (change, said) in changes {
        for (i, file) in files.iter().enumerate() {
            std::fs::write(file, change(&contents_of, i)).unwrap();
        }
        let error = failed();
        assert!(error.contains(said), "{error}");
        let named = names.iter().any(|name| error.contains(name.as_str()));
        assert!(named, "{error}");
    }
}

#[test]
fn every_side_has_a_name_of_its_own_that_any_file_system_takes() {
    let (mut house, contents) = own_house(4, 3);
    let interior = &mut house.interior;
    let names = |interior: &Interior, of| {
        let library = Library::new(interior, &contents, &options(of).library);
        let places = library.ldi_places();
        let names = places
            .iter()
            .map(|place| library.file_name(*place, interior));
        names.collect::<Vec<String>>()
    };
    for portal in &mut interior.portals {
        portal.name = "door".to_owned();
    }
    for cell in &mut interior.cells {
        cell.name = "hall".to_owned();
    }
    assert!(names(interior, None).contains(&"000a-door-hall.ldi".to_owned()));
    assert!(names(interior, Some(3)).contains(&"000a-door-hall-00.ldi".to_owned()));
    let long = "Küche/".repeat(100);
    for odd in ["door", "", "..", "/etc/passwd", "a\0b\\c:d\n", "門", &long] {
        for cell in &mut interior.cells {
            cell.name = odd.to_owned();
        }
        for portal in &mut interior.portals {
            portal.name = odd.to_owned();
        }
        for of in [None, Some(1), Some(3)] {
            let all = names(interior, of);
            let distinct: BTreeSet<String> = all.iter().map(|n| n.to_lowercase()).collect();
            assert!(all.len() > 8 && distinct.len() == all.len(), "{odd:?}");
            assert!(all == names(interior, of));
            for name in &all {
                let stem = name.strip_suffix(".ldi").unwrap();
                let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
                assert!(stem.chars().all(is_plain) && name.len() < 90, "{name:?}");
            }
        }
    }
    // One to the outside, which nobody walks through, has the side that looks in from there left out.
    let sides = interior.portals.iter();
    let sides = sides
        .filter(|p| p.cells.iter().all(Option::is_some))
        .count();
    assert_eq!(names(interior, None).len(), 2 * sides);
}
