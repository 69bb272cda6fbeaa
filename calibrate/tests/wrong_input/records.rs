//! Records that contradict each other, or nothing.

use super::*;

#[test]
fn names_and_ids_that_are_there_twice() {
    refused(&[
        (
            Cameras,
            "7 PINHOLE",
            "1 PINHOLE",
            &["cameras.txt, line 3", "camera 1 is there twice"],
        ),
        (
            Images,
            "\n2 0.7",
            "\n1 0.7",
            &["images.txt, line 3", "image 1 is there twice"],
        ),
        (
            Images,
            "dir\\b c.jpg",
            "a.jpg",
            &["images.txt", "images 1 and 2", "\"a.jpg\""],
        ),
        (
            Points,
            "\n",
            "\n3 1 0 10 1 2 255 0.5 1 0\n",
            &["points3D.txt, line 2", "point 3 is there twice"],
        ),
        (
            Nvm,
            ".\\d\\c 1.jpg",
            "a\"b.jpg",
            &["model.nvm, line 5 (image 1", "\"a b.jpg\""],
        ),
        (
            Transforms,
            "\"d.jpg\"",
            "\"a/b c.jpg\"",
            &["transforms.json, frames[1]", "frames[0]"],
        ),
        (
            Meshroom,
            "\"poseId\": \"7\", \"intrinsicId\": \"9\", \"path\": \"images/b.jpg\"",
            "\"poseId\": \"6\", \"intrinsicId\": \"9\", \"path\": \"images/a.jpg\"",
            &["cameras.sfm, views[1]", "images/a.jpg"],
        ),
    ]);
}

#[test]
fn references_to_what_is_not_there() {
    refused(&[
        (
            Images,
            "1 a.jpg",
            "4 a.jpg",
            &[
                "images.txt",
                "image 1 (\"a.jpg\")",
                "camera 4",
                "cameras.txt",
            ],
        ),
        (
            Images,
            "55 40 3",
            "55 40 33",
            &["images.txt", "keypoint 0 of image 1", "point 33"],
        ),
        (
            Points,
            "1 0 2 0",
            "1 0 9 0",
            &["points3D.txt", "point 3", "image 9"],
        ),
        (
            Points,
            "1 0 2 0",
            "1 0 2 8",
            &["points3D.txt", "point 3", "keypoint 8 of image 2"],
        ),
        (
            Nvm,
            "0 5 9.5 19",
            "7 5 9.5 19",
            &["model.nvm, line 8 (point 0", "image 7"],
        ),
        (
            Bundler,
            " 1 7 9.95025",
            " 9 7 9.95025",
            &["bundle.out, line", "point 0", "camera 9"],
        ),
        (
            Meshroom,
            "\"poseId\": \"6\", \"intrinsicId\": \"9\"",
            "\"poseId\": \"6\", \"intrinsicId\": \"8\"",
            &["cameras.sfm, views[0]", "no intrinsics of that id"],
        ),
        (
            Bundler,
            "2 1\n",
            "3 1\n",
            &["bundle.out", "3 cameras", "2 photos"],
        ),
    ]);
}

#[test]
fn sizes_of_nothing() {
    refused(&[
        (
            Cameras,
            "100 80",
            "0 80",
            &["cameras.txt", "camera 1", "0 × 80"],
        ),
        (
            Transforms,
            "\"w\": 100",
            "\"w\": 0",
            &["transforms.json, frames[0]", "0 × 80"],
        ),
        (
            Meshroom,
            "\"height\": \"80\"",
            "\"height\": \"0\"",
            &["cameras.sfm, ", "× 0"],
        ),
        (
            OpenMvg,
            "\"width\": 100, \"height\": 80, \"focal_length\": 91.0",
            "\"width\": 0, \"height\": 80, \"focal_length\": 91.0",
            &["sfm_data.json, intrinsics[1]", "0 × 80"],
        ),
        (
            Yaml,
            "image_width: 640",
            "image_width: 0",
            &["camera.yml, line 2", "image_width"],
        ),
    ]);
}
