//! Masks, mattes and depth maps: matched to photos by name, decoded, checked.

use capture::{
    Beside, apply_matte, check_beside, decode_depth, decode_mask, is_black_and_white, is_in_alpha,
    match_by_name, match_jpegs_by_name, match_others_by_name,
};
use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, Rgba, RgbaImage};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

fn save(folder: &TempDir, name: &str, picture: impl Into<DynamicImage>) -> PathBuf {
    let path = folder.path().join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let format = image::ImageFormat::Png;
    picture.into().save_with_format(&path, format).unwrap();
    path
}

#[test]
fn pictures_belong_to_photos_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "a.jpg.png",
        "a.png",
        "b.png",
        "sub/c.JPG.png",
        "d.PNG",
        "frame.001.png",
        "astray.png",
        "b.jpg",
    ] {
        save(&folder, name, GrayImage::new(2, 2));
    }
    let photos = [
        "a.jpg",
        "b.jpeg",
        "sub/c.jpg",
        "d.JPG",
        "frame.001.jpg",
        "c.jpg",
        "none.png",
    ];
    let matched = match_by_name(folder.path(), &photos).unwrap();
    let at = |name: &str| folder.path().join(name);
    let expected = [
        ("a.jpg", "a.jpg.png"),
        ("b.jpeg", "b.png"),
        ("d.JPG", "d.PNG"),
        ("frame.001.jpg", "frame.001.png"),
        ("sub/c.jpg", "sub/c.JPG.png"),
    ];
    let expected = expected.map(|(photo, file)| (photo.to_owned(), at(file)));
    assert_eq!(matched.by_photo.into_iter().collect::<Vec<_>>(), expected);
    assert_eq!(matched.unmatched, ["a.png", "astray.png"]);
}

#[test]
fn files_of_other_kinds_belong_to_photos_by_name_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let none = match_others_by_name(folder.path(), &["a.jpg"]).unwrap();
    assert!(none.by_photo.is_empty());
    for name in [
        "a.tif",
        "a.JPG.exr",
        "b.png",
        "c.d/c.npy",
        "c.d/e",
        "stray.bmp",
        ".b.tif",
    ] {
        save(&folder, name, GrayImage::new(2, 2));
    }
    let photos = ["a.jpg", "b.jpg", "c.d/c.png", "c.jpg"];
    let matched = match_others_by_name(folder.path(), &photos).unwrap();
    let at = |name: &str| folder.path().join(name);
    let expected = [("a.jpg", "a.JPG.exr"), ("c.d/c.png", "c.d/c.npy")];
    let expected = expected.map(|(photo, file)| (photo.to_owned(), at(file)));
    assert_eq!(matched.by_photo.into_iter().collect::<Vec<_>>(), expected);
    assert_eq!(matched.unmatched, ["a.tif", "stray.bmp"]);
}

#[test]
fn a_picture_that_two_photos_could_claim_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = save(&folder, "a.png", GrayImage::new(2, 2));
    let error = match_by_name(folder.path(), &["a.jpg", "a.png"]).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!(
            "{}: belongs to a.jpg and a.png alike by its name; call it a.jpg.png if it is the \
             former's",
            path.display()
        )
    );
    // Named after them in full, each has its own.
    save(&folder, "a.jpg.png", GrayImage::new(2, 2));
    let matched = match_by_name(folder.path(), &["a.jpg", "a.png"]).unwrap();
    assert_eq!(matched.by_photo["a.jpg"], folder.path().join("a.jpg.png"));
    assert_eq!(matched.by_photo["a.png"], path);
}

#[test]
fn masks_are_grey_whatever_they_are_stored_as() {
    let folder = tempfile::tempdir().unwrap();
    let left = |x: u32| x < 2;
    let gray = |used: u8| move |x, _| Luma([if left(x) { 0 } else { used }]);
    let expected = GrayImage::from_fn(4, 3, gray(255));
    let paths = [
        save(&folder, "gray.png", GrayImage::from_fn(4, 3, gray(255))),
        // Zeros and ones.
        save(&folder, "ones.png", GrayImage::from_fn(4, 3, gray(1))),
        save(
            &folder,
            "rgb.png",
            ImageBuffer::from_fn(4, 3, |x, _| Rgb([if left(x) { 0_u8 } else { 255 }; 3])),
        ),
        save(
            &folder,
            "wide.png",
            ImageBuffer::from_fn(4, 3, |x, _| Luma([if left(x) { 0_u16 } else { 65535 }])),
        ),
        save(
            &folder,
            "wide-ones.png",
            ImageBuffer::from_fn(4, 3, |x, _| Luma([u16::from(!left(x))])),
        ),
        save(
            &folder,
            "wide-rgb-ones.png",
            ImageBuffer::from_fn(4, 3, |x, _| Rgb([u16::from(!left(x)); 3])),
        ),
    ];
    for path in paths {
        let mask = decode_mask(Beside::IgnoreMask, &path, "a.jpg", (4, 3)).unwrap();
        assert_eq!(mask, expected, "{}", path.display());
    }
}

#[test]
fn black_and_white_jpegs_are_masks() {
    let folder = tempfile::tempdir().unwrap();
    let expected = GrayImage::from_fn(16, 16, |x, _| Luma([if x < 8 { 0 } else { 255 }]));
    let jpeg = |name: &str, picture: DynamicImage| {
        let path = folder.path().join(name);
        let format = image::ImageFormat::Jpeg;
        picture.save_with_format(&path, format).unwrap();
        path
    };
    let whole = jpeg("a.jpg.jpg", expected.clone().into());
    let stem = jpeg("b.JPEG", expected.clone().into());
    let gray = ImageBuffer::from_fn(16, 16, |x, y| Rgb([(8 * (x + y)) as u8, 90, 90]));
    let photo = jpeg("c.jpg", gray.into());
    let matched = match_jpegs_by_name(folder.path(), &["a.jpg", "b.png", "d.jpg"]).unwrap();
    let files: Vec<PathBuf> = matched.by_photo.into_values().collect();
    assert_eq!(files, [whole.clone(), stem]);
    assert_eq!(matched.unmatched, ["c.jpg"]);
    assert!(
        match_by_name(folder.path(), &["a.jpg"])
            .unwrap()
            .by_photo
            .is_empty()
    );

    assert!(is_black_and_white(&whole).unwrap() && !is_black_and_white(&photo).unwrap());
    let black = jpeg("night.jpg", GrayImage::new(16, 16).into());
    assert!(!is_black_and_white(&black).unwrap());
    let mask = decode_mask(Beside::IgnoreMask, &whole, "a.jpg", (16, 16)).unwrap();
    assert_eq!(mask, expected);
}

#[test]
fn masks_that_are_only_in_an_alpha_channel_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let masks = |color: u8, alpha: u8| {
        RgbaImage::from_fn(4, 3, |x, _| match x {
            0 => Rgba([color, color, color, alpha]),
            _ => Rgba([255; 4]),
        })
    };
    for (i, (mask, expected)) in [
        (DynamicImage::from(masks(255, 0)), true),
        (
            DynamicImage::from(masks(255, 0)).into_luma_alpha8().into(),
            true,
        ),
        (DynamicImage::from(masks(0, 0)), false),
        (DynamicImage::from(masks(0, 255)), false),
        (DynamicImage::from(masks(255, 255)), false),
        (DynamicImage::from(GrayImage::new(4, 3)), false),
    ]
    .into_iter()
    .enumerate()
    {
        let path = save(&folder, "m.png", mask);
        assert_eq!(is_in_alpha(&path).unwrap(), expected, "{i}");
    }
}

#[test]
fn another_size_than_the_photos_is_refused_naming_both() {
    let folder = tempfile::tempdir().unwrap();
    let path = save(&folder, "m.png", GrayImage::new(4, 3));
    for kind in [Beside::IgnoreMask, Beside::ObjectMatte, Beside::DepthMap] {
        let expected = format!(
            "{}: the {kind} has 4 × 3 pixels and its photo a.jpg 8 × 6; make it as large as the \
             photo, or leave it out",
            path.display()
        );
        let error = check_beside(kind, &path, "a.jpg", (8, 6)).unwrap_err();
        assert_eq!(error.to_string(), expected);
        let error = decode_mask(kind, &path, "a.jpg", (8, 6)).unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
    assert!(check_beside(Beside::IgnoreMask, &path, "a.jpg", (4, 3)).is_ok());
}

#[test]
fn a_matte_takes_from_alpha_and_adds_nothing() {
    let mut photo = RgbaImage::from_fn(3, 1, |x, _| Rgba([9, 8, 7, [255, 100, 0][x as usize]]));
    let matte = GrayImage::from_vec(3, 1, vec![128, 255, 255]).unwrap();
    apply_matte(&mut photo, &matte);
    let alphas: Vec<u8> = photo.pixels().map(|p| p.0[3]).collect();
    assert_eq!(alphas, [128, 100, 0]);
    let before = photo.clone();
    apply_matte(&mut photo, &matte);
    assert_eq!(photo, before);
}

#[test]
fn depths_are_steps_times_the_scale() {
    let folder = tempfile::tempdir().unwrap();
    let steps: ImageBuffer<Luma<u16>, _> =
        ImageBuffer::from_vec(2, 2, vec![0, 1, 2500, 65535]).unwrap();
    let path = save(&folder, "d.png", steps);
    check_beside(Beside::DepthMap, &path, "a.jpg", (2, 2)).unwrap();
    let depth = decode_depth(&path, "a.jpg", (2, 2), 0.001).unwrap();
    assert_eq!(depth.depths, [0.0, 0.001, 2.5, 65.535]);
    assert_eq!(depth.at(0, 0), None);
    assert_eq!(depth.at(0, 1), Some(2.5));

    let bytes = save(&folder, "bytes.png", RgbaImage::new(2, 2));
    let expected = format!(
        "{}: found 4 channels of 8 bits, expected a depth map of one channel of 16 bits; write \
         depths as 16-bit grey PNG, or leave it out",
        bytes.display()
    );
    let error = check_beside(Beside::DepthMap, &bytes, "a.jpg", (2, 2)).unwrap_err();
    assert_eq!(error.to_string(), expected);
    let error = decode_depth(&bytes, "a.jpg", (2, 2), 0.001).unwrap_err();
    assert_eq!(error.to_string(), expected);
}
