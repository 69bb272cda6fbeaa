//! Numbers, matrices and rotations that are none.

use super::*;

#[test]
fn numbers_that_are_none() {
    refused(&[
        (
            Cameras,
            "90 50",
            "nan 50",
            &["cameras.txt", "camera 1", "NaN"],
        ),
        (Cameras, "-0.1", "inf", &["cameras.txt", "camera 1", "inf"]),
        (
            Images,
            "0 0 0 0 0 0 1 a",
            "nan 0 0 0 0 0 1 a",
            &["images.txt, line 1", "NaN"],
        ),
        (
            Images,
            "0 0 0 1 a",
            "0 0 inf 1 a",
            &["images.txt, line 1", "inf"],
        ),
        (
            Images,
            "10 20 -1",
            "10 -inf -1",
            &["images.txt, line 2", "keypoint 1", "-inf"],
        ),
        (
            Points,
            "3 1 0",
            "3 nan 0",
            &["points3D.txt, line 1", "point 3", "NaN"],
        ),
        (
            Nvm,
            "\t100 1",
            "\tnan 1",
            &["model.nvm, line 4 (image 0", "\"nan\""],
        ),
        (
            Nvm,
            "1 2 3 0.2",
            "1 2 inf 0.2",
            &["model.nvm, line 4", "\"inf\""],
        ),
        (
            Nvm,
            "2 4 13",
            "2 nan 13",
            &["model.nvm, line 8 (point 0", "NaN"],
        ),
        (
            NvmFixed,
            "FixedK 100",
            "FixedK nan",
            &["model.nvm, line", "NaN"],
        ),
        (
            Bundler,
            "100 -0.1",
            "inf -0.1",
            &["bundle.out, line", "camera 1", "inf"],
        ),
        (
            Bundler,
            "-1 -2 -3",
            "-1 nan -3",
            &["bundle.out, line", "camera 1", "NaN"],
        ),
        (
            Bundler,
            "2 4 -7",
            "2 inf -7",
            &["bundle.out, line", "point 0", "inf"],
        ),
        (
            Transforms,
            "\"fl_x\": 90",
            "\"fl_x\": \"nan\"",
            &["transforms.json, fl_x", "\"nan\""],
        ),
        (
            Transforms,
            "0, 1, 3]",
            "0, 1, 1e999]",
            &["transforms.json, line 3", "number out of range"],
        ),
        (
            Meshroom,
            "\"focalLength\": \"9\"",
            "\"focalLength\": \"nan\"",
            &["cameras.sfm, intrinsics[0].focalLength", "nan"],
        ),
        (
            Meshroom,
            "[\"1\", \"2\", \"3\"]}}}",
            "[\"1\", \"inf\", \"3\"]}}}",
            &["cameras.sfm, poses[0].pose.transform.center[1]", "inf"],
        ),
        (
            OpenMvg,
            "91.0",
            "\"nan\"",
            &["sfm_data.json, intrinsics[1]", "nan"],
        ),
        (
            Yaml,
            "500., 0.",
            ".Nan, 0.",
            &["camera.yml, line 4", "camera_matrix"],
        ),
        (
            Yaml,
            "-0.1, .01",
            "-0.1, .Inf",
            &["camera.yml, line 9", "distortion_coefficients", "inf"],
        ),
        (
            Yaml,
            "0., 0.2, 0.,",
            "0., .Inf, 0.,",
            &[
                "camera.yml, line 14",
                "extrinsic_parameters",
                "view 2",
                "inf",
            ],
        ),
        (
            Json,
            "500.0, 0.0",
            ".Inf, 0.0",
            &["camera.json, line 3", "camera_matrix", "inf"],
        ),
        (
            Xml,
            "500. 0.",
            ".Nan 0.",
            &["camera.xml, line", "camera_matrix", "NaN"],
        ),
        (
            Xml,
            "0 0 5",
            "0 0 .Nan",
            &["camera.xml, line", "rvecs", "NaN"],
        ),
    ]);
}

#[test]
fn focal_lengths_that_are_not_positive() {
    refused(&[
        (
            Cameras,
            "90 50",
            "0 50",
            &["cameras.txt", "camera 1", "is 0", "positive"],
        ),
        (
            Cameras,
            "60 61",
            "60 -61",
            &["cameras.txt", "camera 7", "-61"],
        ),
        (
            Nvm,
            "\t100 1",
            "\t-100 1",
            &["model.nvm, line 4 (image 0", "-100"],
        ),
        (
            NvmFixed,
            "FixedK 100",
            "FixedK 0",
            &["model.nvm, line 3 (image 0", "is 0"],
        ),
        (
            Bundler,
            "100 -0.1",
            "-100 -0.1",
            &["bundle.out, line", "camera 1", "-100"],
        ),
        (
            Transforms,
            "\"fl_x\": 90",
            "\"fl_x\": 0",
            &["transforms.json, frames[0]", "is 0"],
        ),
        (
            Transforms,
            "_angle_x\": 0.7",
            "_angle_x\": -0.7",
            &["transforms.json, frames[1]", "-0.7"],
        ),
        (
            Meshroom,
            "\"focalLength\": \"9\"",
            "\"focalLength\": \"-9\"",
            &["cameras.sfm, intrinsics[0]", "-90"],
        ),
        (
            OpenMvg,
            "91.0",
            "-91.0",
            &["sfm_data.json, intrinsics[1]", "-91"],
        ),
        (
            Yaml,
            "500., 0.",
            "0., 0.",
            &["camera.yml, line 4", "camera_matrix"],
        ),
        (
            Json,
            "500.0, 0.0",
            "-500.0, 0.0",
            &["camera.json, line 3", "camera_matrix", "-500"],
        ),
        (
            Xml,
            "500. 0.",
            "-500. 0.",
            &["camera.xml, line", "camera_matrix", "-500"],
        ),
    ]);
}

#[test]
fn rotations_that_are_none() {
    refused(&[
        // COLMAP would make it one; but such a line is more often out of step.
        (
            Images,
            "1 1 0 0 0 0",
            "1 2 0 0 0 0",
            &["images.txt, line 1", "length 2, expected 1"],
        ),
        (
            Images,
            "1 1 0 0 0 0",
            "1 0 0 0 0 0",
            &["images.txt, line 1", "length 0, expected 1"],
        ),
        (
            Nvm,
            "100 1 0",
            "100 0.5 0",
            &["model.nvm, line 4 (image 0", "length 0.5"],
        ),
        (
            Bundler,
            "1 0 0\n0 1 0",
            "2 0 0\n0 1 0",
            &["bundle.out, line", "camera 1", "lengths"],
        ),
        (
            Bundler,
            "1 0 0\n0 1 0",
            "-1 0 0\n0 1 0",
            &["bundle.out, line", "camera 1", "mirrors"],
        ),
        (
            Transforms,
            "[0, 1, 0, 2]",
            "[0.5, 1, 0, 2]",
            &["transforms.json, frames[0]", "transform_matrix", "RᵀR"],
        ),
        (
            Transforms,
            "[0, 1, 0, 2]",
            "[0, -1, 0, 2]",
            &["transforms.json, frames[0]", "mirrors"],
        ),
        (
            Meshroom,
            "[\"0\", \"0\", \"1\", \"-1\"",
            "[\"0\", \"0\", \"1\", \"1\"",
            &["cameras.sfm, poses[0]", "mirrors"],
        ),
        (
            OpenMvg,
            "[1.0, 0.0, 0.0]]",
            "[1.0, 0.0, 0.5]]",
            &["sfm_data.json, extrinsics[0]", "RᵀR"],
        ),
        (
            JsonRig,
            "[[1,0,0],",
            "[[1,0,0.5],",
            &["rig.json, line 4", "R: no rotation"],
        ),
        (
            JsonRig,
            "[[1,0,0],",
            "[[-1,0,0],",
            &["rig.json, line 4", "R: no rotation"],
        ),
    ]);
    // A few digits short of a rotation is one.
    accepted(&[
        (
            Images,
            "0.7071067811865476 0 0.7071067811865476",
            "0.7071 0 0.7071",
        ),
        (Transforms, "[1, 0, 0, 1]", "[1.00001, 0, 0, 1]"),
    ]);
}

#[test]
fn matrices_of_another_shape() {
    refused(&[
        (
            Yaml,
            "rows: 3\n   cols: 3",
            "rows: 1\n   cols: 9",
            &["camera.yml, line 4", "camera_matrix", "1 × 9"],
        ),
        (
            Yaml,
            "rows: 3\n   cols: 3",
            "rows: 3\n   cols: 2",
            &["camera.yml, line", "9", "6"],
        ),
        (
            Yaml,
            "500., 0., 320., 0., 510., 240., 0., 0., 1.",
            "500., 0., 0., 0., 510., 0., 320., 240., 1.",
            &["camera.yml, line 4", "camera_matrix"],
        ),
        (
            Json,
            "\"rows\": 3, \"cols\": 3",
            "\"rows\": 9, \"cols\": 1",
            &["camera.json, line 3", "9 × 1"],
        ),
        (
            Transforms,
            "[[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]",
            "[1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]",
            &["transforms.json, frames[0]", "transform_matrix", "16 rows"],
        ),
        (
            Transforms,
            "[[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]",
            "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [1, 2, 3, 1]]",
            &[
                "transforms.json, frames[0]",
                "transform_matrix[3]",
                "[0, 0, 0, 1]",
            ],
        ),
        (
            OpenMvg,
            "[[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]",
            "[0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0]",
            &["sfm_data.json, extrinsics[0]", "array of 9"],
        ),
        (
            Meshroom,
            "\"-1\", \"0\"],",
            "\"-1\"],",
            &["cameras.sfm, poses[0]", "array of 8"],
        ),
        (
            Cameras,
            "90 50 40 -0.1",
            "90 50 40",
            &["cameras.txt", "camera 1", "found 3"],
        ),
        (
            Images,
            "1 1 0 0 0 0 0 0 1 a.jpg",
            "1 1 0 0 0 0 0 1 a.jpg",
            &["images.txt, line 1"],
        ),
    ]);
    accepted(&[
        // A row or a column of coefficients: both are OpenCV's.
        (Yaml, "rows: 1\n   cols: 5", "rows: 5\n   cols: 1"),
        (Transforms, ", [0, 0, 0, 1]]},", "]},"),
    ]);
}
