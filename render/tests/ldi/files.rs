//! Kept in files.

use super::*;

#[test]
fn files_read_back_the_same_and_bad_ones_are_refused() {
    let set = set(2, 5, 48, 5, 9);
    let ldi = ldi_of(&set.sides[0]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0-1.ldi");
    write(&path, &ldi).unwrap();
    let back = read(&path).unwrap();
    assert!(back.samples() == ldi.samples() && back.counts().eq(ldi.counts()));
    assert_eq!(
        (back.portal, back.near, back.size()),
        (ldi.portal, ldi.near, ldi.size())
    );
    let camera = Pinhole::new(&view(ldi.camera.center, DVec3::ZERO, [64, 48])).unwrap();
    let open = Window::whole(64, 48);
    let [a, b] = [&ldi, &back].map(|l| drawn_free(l, &Clipped::whole(l), &camera, &open));
    assert!(a == b);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let good = std::fs::read(&path).unwrap();
    write(&path, &back).unwrap();
    assert!(good == std::fs::read(&path).unwrap());
    let text = |content: &[u8]| parse(Path::new("a.ldi"), content).unwrap_err().to_string();
    assert_eq!(text(b""), "a.ldi: no LDI: it does not begin with LUMI-LDI");
    assert_eq!(
        text(&good[..40]),
        "a.ldi: 40 bytes, expected 128 for a header; make it again"
    );
    let changed = |at: usize, bytes: &[u8]| {
        let mut bad = good.clone();
        bad[at..at + bytes.len()].copy_from_slice(bytes);
        bad
    };
    assert_eq!(
        text(&changed(8, &[9])),
        "a.ldi: LDI version 9; expected 1: make it again with this program"
    );
    // Sizes that would need more memory than there is.
    for (at, bytes) in [
        (116, [255; 8].as_slice()),
        (120, &[255; 4]),
        (12, &[255; 4]),
        (12, &[1]),
    ] {
        assert!(
            text(&changed(at, bytes)).contains("bytes, expected"),
            "{at}"
        );
    }
    assert!(text(&good[..good.len() - 1]).contains("samples; make it again"));
    assert!(text(&changed(128 + 4, &[255; 4])).contains("row 1 begins at sample 4294967295"));
    assert!(text(&changed(72, &f64::NAN.to_le_bytes())).contains("camera"));
    assert!(text(&changed(16, &f64::NAN.to_le_bytes())).contains("camera"));
    let last = good.len() - 8;
    assert!(text(&changed(last, &(-1.0_f32).to_le_bytes())).contains("expected a positive number"));
}

proptest! {
    #[test]
    fn corrupt_files_are_no_trouble(at in 0_usize..2000, byte: u8, cut in 0_usize..2000) {
        let ldi = places::random_ldi(&[2; 20], [5, 4], 9);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.ldi");
        write(&path, &ldi).unwrap();
        let mut content = std::fs::read(&path).unwrap();
        let at = at % content.len();
        content[at] = byte;
        if let Ok(ldi) = parse(&path, &content) {
            places::draw_all(&ldi, &view(DVec3::new(0.1, 0.0, 0.2), DVec3::Z, [20, 16]));
        }
        content.truncate(cut);
        let _ = parse(&path, &content);
    }

    #[test]
    fn looks_are_close_to_what_they_are_of(x in -1.0..1.0, y in -1.0..1.0, side in -13.0..1.0) {
        let normal = DVec3::new(x, y, 0.4).normalize();
        let look = Look::new(-3.0 * normal, f64::exp2(side));
        prop_assert!(look.normal().dot(normal) > 0.995);
        prop_assert!((look.side().log2() - side).abs() < 0.13);
    }
}
