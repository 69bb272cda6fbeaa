//! Kept in files.

use super::*;
use render::ldi::{LdiFileError, fault};

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
        "a.ldi: LDI version 9; expected 3; make it again"
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
    assert_eq!(
        text(&changed(
            16,
            &[2.0_f64, 2.0, 1.0, 0.0].map(f64::to_le_bytes).concat()
        )),
        "a.ldi: its camera's rotation is a quaternion of length 3, expected 1; make it again"
    );
    let last = good.len() - 8;
    assert!(text(&changed(last, &(-1.0_f32).to_le_bytes())).contains("expected a positive number"));
}

/// Read by what `docs/ldi.md` says alone.
#[test]
fn the_layout_is_as_it_is_written_down() {
    let counts = [2, 0, 1, 3, 0, 1_u8];
    let ldi = places::random_ldi(&counts, [3, 2], 9);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ldi");
    write(&path, &ldi).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let f64_at = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    // The header.
    assert_eq!(&bytes[..8], b"LUMI-LDI");
    assert_eq!([8, 12].map(u32_at), [3, 128]);
    let pose = ldi.view.camera_from_world;
    let lens = ldi.view.lens;
    let [fx, fy, cx, cy] = [72, 80, 88, 96].map(f64_at);
    assert_eq!([16, 24, 32, 40].map(f64_at), pose.rotation.to_array());
    assert_eq!([48, 56, 64].map(f64_at), pose.translation.to_array());
    assert_eq!([fx, fy], lens.focal.to_array());
    assert_eq!([cx, cy], lens.principal.to_array());
    assert_eq!(f64_at(104), ldi.near);
    assert_eq!([112, 116, 120].map(u32_at), [ldi.portal, 3, 2]);
    // Rows, pixels and samples, each part from a multiple of 8 on.
    assert_eq!([128, 132, 136].map(u32_at), [0, 3, 7]);
    assert_eq!(bytes[144..150], counts);
    assert_eq!(bytes[150..152], [0; 2]);
    assert_eq!(bytes.len(), 152 + 7 * 12);
    let samples = ldi.samples();
    for (record, sample) in bytes[152..].chunks(12).zip(&samples) {
        assert_eq!(record[..3], sample.color[..3]);
        assert_eq!(record[3], sample.ends.0);
        let inverse_depth = f32::from_le_bytes(record[4..8].try_into().unwrap());
        assert_eq!(inverse_depth, sample.inverse_depth);
        assert_eq!([record[8], record[9]].map(|o| o as i8), sample.offset);
        let look = u16::from_le_bytes([record[10], record[11]]);
        assert_eq!(look, sample.look.0);
        // What it stands for.
        let [m, a, b] = [look / 1024, look / 32 % 32, look % 32].map(f64::from);
        let side = ((m - 63.0) / 4.0 + 1.0).exp2();
        assert!((sample.look.side() / side - 1.0).abs() < 1e-12);
        let [u, v] = [a, b].map(|step| (2.0 * step + 1.0) / 32.0 - 1.0);
        let (x, y) = ((u + v) / 2.0, (u - v) / 2.0);
        let normal = DVec3::new(x, y, 1.0 - x.abs() - y.abs()).normalize();
        assert!(sample.look.normal().distance(normal) < 1e-12);
    }
    // Where the first of them is.
    let (at, s) = ldi.place(0, 0);
    let [dx, dy] = samples[0].offset.map(|o| f64::from(o) / 256.0);
    assert_eq!(at, DVec2::new(0.5 + dx, 0.5 + dy));
    assert_eq!(s, f64::from(samples[0].inverse_depth));
    // The checksum.
    let mut sum = bytes.len() as u64;
    for part in [&bytes[..124], &bytes[128..]] {
        let mut part = part.to_vec();
        part.resize(8 * (part.len() / 8 + 1), 0);
        for word in part.chunks(8) {
            let word = u64::from_le_bytes(word.try_into().unwrap());
            sum = (sum ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            sum ^= sum >> 32;
        }
    }
    assert_eq!(u32_at(124), sum as u32);
}

#[test]
fn a_file_with_any_bit_changed_is_told_to_be_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.ldi");
    write(&path, &places::random_ldi(&[2; 20], [5, 4], 9)).unwrap();
    let good = std::fs::read(&path).unwrap();
    assert!(read(&path).is_ok());
    let mut by_checksum = 0;
    for at in 0..good.len() {
        let mut content = good.clone();
        content[at] ^= 1 << (at % 8);
        std::fs::write(&path, &content).unwrap();
        let error = read(&path).unwrap_err();
        by_checksum += usize::from(matches!(error, LdiFileError::Checksum(_)));
        assert!(parse(&path, &content).is_err() || matches!(error, LdiFileError::Checksum(_)));
    }
    // Most of it is samples.
    assert!(by_checksum > good.len() / 2, "{by_checksum}");
    let said = LdiFileError::Checksum("a.ldi".into()).to_string();
    assert_eq!(fault(&said), "a.ldi: damaged: its checksum is another");
    assert_eq!(fault("a.ldi: no file"), "a.ldi: no file");
    let said = render::RenderError::LdiFile(said).to_string();
    assert!(!said.contains("make it again") && said.contains("`lumigraph ldis` makes it again"));
}

/// What `fuzz/targets/ldi.rs` asserts, of files changed in several places at once, as a fuzzer does: bytes
/// of any value and of those at which numbers turn over, parts cut out, doubled and swapped.
#[test]
fn files_changed_in_several_places_are_refused_or_sound() {
    let mut state = 0x1d1_u64;
    let mut below = |count: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % count.max(1)
    };
    let folder = tempfile::tempdir().unwrap();
    let seeds: Vec<Vec<u8>> = [
        (&[2_u8; 20][..], [5, 4]),
        (&[0, 1, 255, 3][..], [2, 2]),
        (&[1][..], [1, 1]),
    ]
    .map(|(counts, size)| {
        let path = folder.path().join("x.ldi");
        write(&path, &places::random_ldi(counts, size, 9)).unwrap();
        std::fs::read(&path).unwrap()
    })
    .into();
    const TELLING: [&[u8]; 8] = [
        &[0; 8],
        &[255; 8],
        &[0, 0, 0x80, 0x7f],
        &[0, 0, 0xc0, 0x7f],
        &[0, 0, 0, 0, 0, 0, 0xf0, 0x7f],
        &[1, 0, 0, 0],
        &[0xff, 0xff, 0xff, 0x7f],
        &[0, 0, 0, 0x80],
    ];
    let (mut sound, path) = (0, Path::new("x.ldi"));
    for _ in 0..60_000 {
        let mut content = seeds[below(seeds.len())].clone();
        for _ in 0..1 + below(4) {
            // The header and the rows' offsets decide most.
            let reach = [content.len(), 160.min(content.len())][below(2)];
            let at = below(reach);
            match below(6) {
                0 | 1 => content[at] = below(256) as u8,
                2 => content[at] ^= 1 << below(8),
                3 => {
                    let bytes = TELLING[below(TELLING.len())];
                    let end = (at + bytes.len()).min(content.len());
                    content[at..end].copy_from_slice(&bytes[..end - at]);
                }
                4 => {
                    let end = (at + 1 + below(16)).min(content.len());
                    let part: Vec<u8> = content.drain(at..end).collect();
                    if below(2) == 0 {
                        let to = below(content.len() + 1);
                        content.splice(to..to, part);
                    }
                }
                _ => {
                    let end = (at + 1 + below(16)).min(content.len());
                    let part = content[at..end].to_vec();
                    content.splice(at..at, part);
                }
            }
            if content.is_empty() {
                break;
            }
        }
        match parse(path, &content) {
            Err(error) => assert!(!error.to_string().is_empty()),
            Ok(ldi) => {
                sound += 1;
                assert_eq!(layers(&ldi).total(), ldi.len());
                let [width, height] = ldi.size();
                for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                    assert!(ldi.pixel(x, y).all(|sample| sample.inverse_depth > 0.0));
                }
                ClipTree::new(&ldi);
            }
        }
    }
    assert!(sound > 1000, "{sound}");
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
