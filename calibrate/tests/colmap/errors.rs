//! What is refused, and in which words.

use crate::synthetic::small;
use calibrate::colmap::{ColmapError, parse_binary, read_model, write_binary, write_text};
use calibrate::{CameraId, ImageId, Point3DId, Reconstruction};
use proptest::prelude::*;
use std::fs;
use std::path::Path;

const BINARY: [&str; 3] = ["cameras.bin", "images.bin", "points3D.bin"];
const REMEDY: &str = "; copy the file again, or re-export the model with `colmap model_converter`";
const ONE_MODEL: &str =
    "; use three files of one and the same model, or re-export it with `colmap model_converter`";

/// The error of reading a folder, the folder itself left out.
fn error_of(folder: &Path) -> String {
    let error = read_model(folder).unwrap_err().to_string();
    error.replace(&format!("{}/", folder.display()), "")
}

/// The error of the small binary model after an edit of one file's bytes.
fn binary_error(file: &str, edit: impl FnOnce(&mut Vec<u8>)) -> String {
    let folder = tempfile::tempdir().unwrap();
    write_binary(&small(), folder.path()).unwrap();
    let path = folder.path().join(file);
    let mut bytes = fs::read(&path).unwrap();
    edit(&mut bytes);
    fs::write(&path, bytes).unwrap();
    error_of(folder.path())
}

/// The error of the small text model after replacing a passage of one file.
fn text_error(file: &str, from: &str, to: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    write_text(&small(), folder.path()).unwrap();
    let path = folder.path().join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from:?} is not in {text}");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
    error_of(folder.path())
}

fn put<const N: usize>(at: usize, new: [u8; N]) -> impl FnOnce(&mut Vec<u8>) {
    move |bytes| bytes[at..at + N].copy_from_slice(&new)
}

#[test]
fn every_truncation_of_a_binary_model_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    write_binary(&small(), folder.path()).unwrap();
    for file in BINARY {
        let path = folder.path().join(file);
        let bytes = fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            fs::write(&path, &bytes[..length]).unwrap();
            let error = error_of(folder.path());
            assert!(
                error.starts_with(file),
                "{file} cut to {length} bytes: {error}"
            );
        }
        fs::write(&path, &bytes).unwrap();
    }
    assert_eq!(read_model(folder.path()).unwrap(), small());
}

#[test]
fn truncations_of_a_text_model_do_not_panic() {
    let folder = tempfile::tempdir().unwrap();
    write_text(&small(), folder.path()).unwrap();
    for file in ["cameras.txt", "images.txt", "points3D.txt"] {
        let path = folder.path().join(file);
        let bytes = fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            fs::write(&path, &bytes[..length]).unwrap();
            let _ = read_model(folder.path());
        }
        fs::write(&path, &bytes).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    /// Whatever is read despite them can be written.
    #[test]
    fn flipped_bytes_do_not_panic(
        file in 0..3_usize,
        text: bool,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let name = if text {
            write_text(&small(), folder.path()).unwrap();
            BINARY[file].replace(".bin", ".txt")
        } else {
            write_binary(&small(), folder.path()).unwrap();
            BINARY[file].to_owned()
        };
        let path = folder.path().join(name);
        let mut bytes = fs::read(&path).unwrap();
        for (index, value) in flips {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        fs::write(&path, bytes).unwrap();
        if let Ok(model) = read_model(folder.path()) {
            write_binary(&model, &folder.path().join("again")).unwrap();
        }
    }
}

#[test]
fn a_file_cut_short_names_the_record_and_the_byte() {
    assert_eq!(
        binary_error("images.bin", |bytes| bytes.truncate(8 + 4 + 8 * 2 + 3)),
        format!(
            "images.bin, image 1 of 2, byte 28: the file is cut short: 3 bytes left, expected 8 \
             for its rotation{REMEDY}"
        )
    );
    assert_eq!(
        binary_error("points3D.bin", |bytes| bytes.truncate(5)),
        format!(
            "points3D.bin, the number of points, byte 0: the file is cut short: 5 bytes left, \
             expected 8 for their number{REMEDY}"
        )
    );
}

#[test]
fn counts_are_not_believed() {
    let mut expected = String::new();
    let error = binary_error("points3D.bin", |bytes| {
        let at = 8 + 8 + 24 + 3 + 8;
        let left = bytes.len() - at - 8;
        put(at, u64::MAX.to_le_bytes())(bytes);
        expected = format!(
            "points3D.bin, point 1 of 2, byte {at}: the file is cut short or garbled: \
             18446744073709551615 track elements announced, but the {left} bytes left hold at \
             most {}{REMEDY}",
            left / 8
        );
    });
    assert_eq!(error, expected);
    let error = binary_error("cameras.bin", put(0, (1_u64 << 60).to_le_bytes()));
    assert!(
        error.starts_with("cameras.bin, camera 3 of 1152921504606846976, byte 112: the file is"),
        "{error}"
    );
}

#[test]
fn bytes_after_the_last_record_are_an_error() {
    assert_eq!(
        binary_error("cameras.bin", |bytes| bytes.extend(b"end")),
        format!(
            "cameras.bin, camera 2 of 2, byte 112: 3 bytes follow the last camera, expected the \
             file's end{REMEDY}"
        )
    );
}

#[test]
fn an_empty_file_is_said_to_be_empty() {
    assert_eq!(
        binary_error("cameras.bin", Vec::clear),
        "cameras.bin: the file is empty (0 bytes); copy it again, or re-export the model with \
         `colmap model_converter`"
    );
}

#[test]
fn an_unknown_camera_model_is_named() {
    assert_eq!(
        binary_error("cameras.bin", put(8 + 4, 99_i32.to_le_bytes())),
        "cameras.bin, camera 1 of 2, byte 12: camera 1 has the camera model 99, which is not \
         among those read here: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, \
         OPENCV_FISHEYE, FULL_OPENCV, FOV, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE, \
         THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE, SIMPLE_DIVISION, DIVISION, \
         SIMPLE_FISHEYE, FISHEYE, EUCM, EQUIRECTANGULAR, OPENCV_TILTED, \
         OPENCV_SKEWED_FISHEYE, INVERSE_RADIAL; undistort the photos with \
         `colmap image_undistorter` and use the model it writes"
    );
    let error = text_error("cameras.txt", "SIMPLE_RADIAL", "MY_LENS");
    assert!(
        error.starts_with(
            "cameras.txt, line 5: camera 4 has the camera model MY_LENS, which is not among"
        ),
        "{error}"
    );
}

#[test]
fn an_impossible_camera_is_named() {
    assert_eq!(
        binary_error("cameras.bin", put(8 + 24, (-500.0_f64).to_le_bytes())),
        "cameras.bin: camera 1: focal length f of SIMPLE_PINHOLE is -500; it must be positive; \
         calibrate it again, or leave its images out"
    );
    assert_eq!(
        text_error("cameras.txt", " -0.1", ""),
        "cameras.txt: camera 4: SIMPLE_RADIAL has 4 parameters (f, cx, cy, k), found 3; calibrate \
         it again, or leave its images out"
    );
    assert_eq!(
        binary_error("cameras.bin", put(8 + 8, u64::MAX.to_le_bytes())),
        format!(
            "cameras.bin, camera 1 of 2, byte 16: the width is 18446744073709551615, expected \
             fewer than 2³² pixels{REMEDY}"
        )
    );
}

#[test]
fn impossible_poses_are_refused() {
    assert_eq!(
        binary_error("images.bin", put(8 + 4, [0; 32])),
        format!(
            "images.bin, image 1 of 2, byte 68: the rotation's quaternion (0, 0, 0, 0) has \
             length 0, expected 1{REMEDY}"
        )
    );
    assert_eq!(
        text_error("images.txt", "0.5 -1 2 1 a.jpg", "0.5 inf 2 1 a.jpg"),
        format!(
            "images.txt, line 5: the translation is [0.5, inf, 2], expected three finite \
             numbers{REMEDY}"
        )
    );
    let error = binary_error("images.bin", put(8 + 4, f64::NAN.to_le_bytes()));
    assert!(error.contains("the rotation is (NaN, 0, "), "{error}");
    let error = binary_error("images.bin", put(8 + 4, 1.1_f64.to_le_bytes()));
    assert!(error.contains(" has length 1.1011"), "{error}");
}

#[test]
fn text_that_is_no_number_is_quoted() {
    assert_eq!(
        text_error("points3D.txt", "-4 2 3", "-4 two 3"),
        format!("points3D.txt, line 5: found \"two\", expected the position{REMEDY}")
    );
    assert_eq!(
        text_error("points3D.txt", "10 20 30", "10 20 300"),
        format!("points3D.txt, line 4: found \"300\", expected the colour, 0 to 255{REMEDY}")
    );
    assert_eq!(
        text_error("points3D.txt", " 3 0 8 0", " 3 0 8"),
        format!(
            "points3D.txt, line 4: the track has 3 numbers, expected pairs of an image's id and \
             a keypoint's index{REMEDY}"
        )
    );
    let mut names_line = text_error("images.txt", " a.jpg", "");
    names_line.truncate(names_line.find(';').unwrap());
    assert_eq!(
        names_line,
        "images.txt, line 5: the image has no name, expected its photo's path"
    );
}

#[test]
fn a_left_out_keypoint_line_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    write_text(&small(), folder.path()).unwrap();
    fs::write(
        folder.path().join("images.txt"),
        "3 1 0 0 0 0 0 0 1 a.jpg\n8 1 0 0 0 0 0 0 4 b.jpg\n",
    )
    .unwrap();
    assert_eq!(
        error_of(folder.path()),
        format!(
            "images.txt, line 2: found 10 words, expected the keypoints of the image on the line \
             before, three words each (an image without any has an empty second line){REMEDY}"
        )
    );
    // A name of three words makes twelve, which four keypoints would have, too.
    fs::write(
        folder.path().join("images.txt"),
        "3 1 0 0 0 0 0 0 1 a.jpg\n8 0.8 0.6 0 0 0 0 0 4 my second photo.jpg\n",
    )
    .unwrap();
    assert_eq!(
        error_of(folder.path()),
        format!(
            "images.txt, line 2: found an image, expected the keypoints of the image on the line \
             before, three words each (an image without any has an empty second line){REMEDY}"
        )
    );
    // Keypoints of which one is damaged are no image.
    fs::write(
        folder.path().join("images.txt"),
        "3 1 0 0 0 0 0 0 1 a.jpg\n8 0.8 -1 0 0 -1 0 0 -1 1 2 x\n",
    )
    .unwrap();
    let damaged = error_of(folder.path());
    let expected = "images.txt, line 2: found \"x\", expected a point's id";
    assert!(damaged.starts_with(expected), "{damaged}");
}

#[test]
fn text_that_is_not_utf8_names_the_line() {
    let folder = tempfile::tempdir().unwrap();
    write_text(&small(), folder.path()).unwrap();
    fs::write(folder.path().join("images.txt"), b"# one\n# two \xff\n").unwrap();
    assert_eq!(
        error_of(folder.path()),
        format!("images.txt, line 2: the line is not UTF-8 text{REMEDY}")
    );
}

#[test]
fn nothing_may_be_there_twice() {
    assert_eq!(
        text_error("cameras.txt", "4 SIMPLE_RADIAL", "1 SIMPLE_RADIAL"),
        format!("cameras.txt, line 5: camera 1 is there twice, expected once{REMEDY}")
    );
    assert_eq!(
        text_error("images.txt", "b/c d.jpg", "a.jpg"),
        format!("images.txt: images 3 and 8 are both named \"a.jpg\"{ONE_MODEL}")
    );
    assert_eq!(
        text_error("points3D.txt", "9 -4", "7 -4"),
        format!("points3D.txt, line 5: point 7 is there twice, expected once{REMEDY}")
    );
}

#[test]
fn what_is_referred_to_must_exist() {
    assert_eq!(
        text_error("images.txt", " 1 a.jpg", " 2 a.jpg"),
        format!(
            "images.txt: image 3 (\"a.jpg\") was taken with camera 2, which cameras.txt does not \
             hold{ONE_MODEL}"
        )
    );
    assert_eq!(
        text_error("images.txt", "10.5 20.25 7", "10.5 20.25 70"),
        format!(
            "images.txt: keypoint 0 of image 3 (\"a.jpg\") observes point 70, which points3D.txt \
             does not hold{ONE_MODEL}"
        )
    );
    assert_eq!(
        text_error("points3D.txt", " 3 0 8 0", " 3 0 5 0"),
        format!(
            "points3D.txt: point 7 is seen by image 5, which images.txt does not hold{ONE_MODEL}"
        )
    );
    assert_eq!(
        text_error("points3D.txt", " 3 0 8 0", " 3 0 8 1"),
        format!(
            "points3D.txt: point 7 is keypoint 1 of image 8 (\"b/c d.jpg\"), which has only 1 \
             keypoints, the first being 0{ONE_MODEL}"
        )
    );
}

#[test]
fn a_model_without_images_is_refused() {
    assert_eq!(
        binary_error("images.bin", |bytes| *bytes = vec![0; 8]),
        "images.bin: the model holds no images; give one in which COLMAP registered some"
    );
}

/// The error of writing a model that cannot be read again, in either format.
fn write_errors(change: impl FnOnce(&mut Reconstruction)) -> [String; 2] {
    let folder = tempfile::tempdir().unwrap();
    let mut model = small();
    change(&mut model);
    let out = folder.path().join("out");
    let errors = [write_text(&model, &out), write_binary(&model, &out)]
        .map(|result| result.map_or_else(|error| error.to_string(), |()| String::new()));
    let left = fs::read_dir(&out).map_or(0, |entries| entries.count());
    assert_eq!(
        left,
        3 * errors.iter().filter(|error| error.is_empty()).count(),
        "a refused model leaves nothing behind"
    );
    errors.map(|error| error.replace(&format!("{}/", out.display()), ""))
}

#[test]
fn what_cannot_be_read_is_not_written() {
    let named = |name: &'static str| {
        write_errors(move |model| model.images.get_mut(&ImageId(3)).unwrap().name = name.into())
    };
    let refused = |file: &str, name: &str| {
        format!(
            "{file}: image 3 is named {name:?}, which this format cannot hold; rename the photo"
        )
    };
    assert_eq!(
        named("a\nb.jpg"),
        [refused("images.txt", "a\nb.jpg"), String::new()]
    );
    assert_eq!(
        named("a.jpg "),
        [refused("images.txt", "a.jpg "), String::new()]
    );
    assert_eq!(named("")[1], refused("images.bin", ""));
    assert_eq!(named("a\0")[1], refused("images.bin", "a\0"));

    let [text, binary] = write_errors(|model| {
        model.cameras.get_mut(&CameraId(1)).unwrap().params.clear();
    });
    assert!(text.starts_with("cameras.txt: camera 1: SIMPLE_PINHOLE has 3 parameters"));
    assert!(binary.starts_with("cameras.bin: camera 1: SIMPLE_PINHOLE has 3 parameters"));
    let [text, _] = write_errors(|model| {
        model.points.remove(&Point3DId(9));
    });
    assert!(text.starts_with("images.txt: keypoint 2 of image 3 (\"a.jpg\") observes point 9"));
}

#[test]
fn a_text_model_is_not_hidden_behind_a_binary_one() {
    let folder = tempfile::tempdir().unwrap();
    write_binary(&small(), folder.path()).unwrap();
    assert_eq!(
        write_text(&small(), folder.path()).unwrap_err().to_string(),
        format!(
            "{}: the folder already holds a binary model, which would be read instead of the \
             text model to be written; choose another folder, or remove the .bin files first",
            folder.path().display()
        )
    );
}

#[test]
fn a_model_that_cannot_be_replaced_stays() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let count = || fs::read_dir(folder.path()).unwrap().count();
    write_binary(&small(), folder.path()).unwrap();
    for name in ["cameras.bin", "points3D.bin"] {
        fs::write(at(name), "of before").unwrap();
    }
    // The second of three files cannot take its place.
    fs::remove_file(at("images.bin")).unwrap();
    fs::create_dir(at("images.bin")).unwrap();
    let error = write_binary(&small(), folder.path()).unwrap_err();
    assert!(error.to_string().contains("images.bin"), "{error}");
    for name in ["cameras.bin", "points3D.bin"] {
        assert_eq!(fs::read(at(name)).unwrap(), b"of before", "{name}");
    }
    assert_eq!(count(), 3);
    // Files that can are replaced, and nothing else stays.
    fs::remove_dir(at("images.bin")).unwrap();
    write_binary(&small(), folder.path()).unwrap();
    assert_eq!(count(), 3);
    assert_eq!(read_model(folder.path()).unwrap(), small());
}

/// COLMAP 4 cannot open three files of one model and rigs and frames of another.
#[test]
fn a_model_is_not_written_beside_the_rigs_of_another() {
    type Write = fn(&Reconstruction, &Path) -> Result<(), ColmapError>;
    let writes: [(&str, Write); 2] = [("bin", write_binary), ("txt", write_text)];
    for (end, write) in writes {
        for further in ["rigs", "frames"] {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join(format!("{further}.{end}"));
            fs::write(&file, "of another model").unwrap();
            let error = write(&small(), folder.path()).unwrap_err().to_string();
            let expected = format!(
                "{}: the file is of a model that COLMAP 4 wrote, which would read it with the one to be \
                 written and fail; choose another folder, or remove rigs and frames there first",
                file.display()
            );
            assert_eq!(error, expected);
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
            fs::remove_file(&file).unwrap();
            write(&small(), folder.path()).unwrap();
        }
    }
}

/// Older versions of COLMAP wrote records in any order.
#[test]
fn binary_records_come_in_any_order_but_once() {
    let mut model = small();
    model.points.clear();
    for keypoint in model.images.values_mut().flat_map(|i| &mut i.keypoints) {
        keypoint.point = None;
    }
    let folder = tempfile::tempdir().unwrap();
    write_binary(&model, folder.path()).unwrap();
    let [cameras, images] =
        ["cameras.bin", "images.bin"].map(|file| fs::read(folder.path().join(file)).unwrap());
    let with_points = |ids: [u64; 3]| {
        let mut points = 3_u64.to_le_bytes().to_vec();
        for id in ids {
            points.extend(id.to_le_bytes());
            points.extend([0; 43]);
        }
        parse_binary(Path::new("model"), [&cameras, &images, &points])
    };
    let ids: Vec<u64> = with_points([9, 4, u64::MAX - 1])
        .unwrap()
        .points
        .keys()
        .map(|id| id.0)
        .collect();
    assert_eq!(ids, [4, 9, u64::MAX - 1]);
    assert_eq!(
        with_points([9, 4, 9]).unwrap_err().to_string(),
        format!(
            "model/points3D.bin, point 3 of 3, byte 161: point 9 is there twice, expected \
             once{REMEDY}"
        )
    );
}
