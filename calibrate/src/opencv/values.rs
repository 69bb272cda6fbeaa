//! Finding values by the names that people give them.

use super::OpenCvError;
use super::storage::{Entries, FileStorage, Node, Value};
use std::path::{Path, PathBuf};

/// Every named value of a file, those within maps too.
pub(super) struct Values<'a> {
    pub(super) file: PathBuf,
    pub(super) all: Vec<Named<'a>>,
}

/// A value and what it is called.
#[derive(Clone)]
pub(super) struct Named<'a> {
    /// The names of the maps around it and its own, dots between them.
    pub(super) path: String,
    pub(super) node: &'a Node,
}

impl<'a> Values<'a> {
    pub(super) fn of(file: &Path, storage: &'a FileStorage) -> Self {
        let mut all = Vec::new();
        collect("", &storage.entries, &mut all);
        Self {
            file: file.to_owned(),
            all,
        }
    }

    /// The first value with one of the names, written in whatever way.
    pub(super) fn find(&self, names: &[&str]) -> Option<&Named<'a>> {
        let wanted = |named: &&Named<'a>| names.contains(&plain(&named.path).as_str());
        self.all.iter().find(wanted)
    }

    /// The same among the innermost names, whatever the maps around them are called.
    pub(super) fn find_within(&self, names: &[&str]) -> Option<&Named<'a>> {
        let wanted = |named: &&Named<'a>| names.contains(&plain(named.last()).as_str());
        self.find(names).or_else(|| self.all.iter().find(wanted))
    }

    /// The same for a camera whose matrix has a prefix: from its own map outwards, then in others, but not
    /// in those of other cameras.
    pub(super) fn find_for(&self, prefix: &str, names: &[&str]) -> Option<&Named<'a>> {
        let mut around = std::iter::successors(Some(prefix), |&inner| {
            let name = inner.strip_suffix('.')?;
            Some(&inner[..name.rfind('.').map_or(0, |at| at + 1)])
        });
        let found = around.find_map(|map| self.called(names).find(|named| named.prefix() == map));
        let elsewhere = || {
            let mut called = self.called(names);
            called.find(|named| !self.is_of_another(prefix, named))
        };
        found.or_else(|| self.find(names)).or_else(elsewhere)
    }

    /// All values with one of the names, with those of the maps around them or without.
    pub(super) fn called(&self, names: &[&str]) -> impl Iterator<Item = &Named<'a>> {
        self.all.iter().filter(move |named| {
            let [path, last] = [named.path.as_str(), named.last()].map(plain);
            names.contains(&path.as_str()) || names.contains(&last.as_str())
        })
    }

    /// Whether a value lies in the map of another camera than that whose matrix has a prefix.
    pub(super) fn is_of_another(&self, prefix: &str, named: &Named<'_>) -> bool {
        let within = |prefix: &str| prefix.starts_with(named.prefix());
        let mut all = self.all.iter();
        !within(prefix) && all.any(|other| within(other.prefix()) && other.is_camera())
    }

    /// A value by its exact path.
    pub(super) fn exactly(&self, path: &str) -> Option<&Named<'a>> {
        self.all.iter().find(|named| named.path == path)
    }

    /// What the matrices are called and their shapes, for people.
    pub(super) fn matrices(&self) -> Vec<String> {
        let describe = |named: &Named<'a>| {
            let matrix = named.node.matrix()?;
            Some(format!("{} ({})", named.path, matrix.shape()))
        };
        self.all.iter().filter_map(describe).collect()
    }

    /// The error that a value is not as it must be.
    pub(super) fn refuse(&self, named: &Named<'_>, problem: impl Into<String>) -> OpenCvError {
        OpenCvError::Value {
            path: self.file.clone(),
            line: named.node.line,
            key: named.path.clone(),
            problem: problem.into(),
        }
    }
}

impl Named<'_> {
    /// Its own name.
    pub(super) fn last(&self) -> &str {
        self.path.rsplit('.').next().unwrap_or_default()
    }

    /// What stands before its own name: empty, or ends with a dot.
    pub(super) fn prefix(&self) -> &str {
        &self.path[..self.path.len() - self.last().len()]
    }

    /// A camera matrix, or the first number of a camera that is written as numbers.
    fn is_camera(&self) -> bool {
        if ["fx", "mu"].contains(&plain(self.last()).as_str()) {
            return self.node.number().is_some();
        }
        matches!(role(self.last()), Some((Role::CameraMatrix, _))) && self.node.matrix().is_some()
    }
}

/// A name without case and punctuation: `Camera_Matrix` is `cameramatrix`.
pub(super) fn plain(name: &str) -> String {
    let kept = name.chars().filter(char::is_ascii_alphanumeric);
    kept.map(|c| c.to_ascii_lowercase()).collect()
}

fn collect<'a>(prefix: &str, entries: &'a Entries, all: &mut Vec<Named<'a>>) {
    for (key, node) in entries {
        let path = format!("{prefix}{key}");
        if let Value::Map(inner) = &node.value {
            collect(&format!("{path}."), inner, all);
        }
        all.push(Named { path, node });
    }
}

/// What a matrix is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    CameraMatrix,
    Distortion,
}

const CAMERA_MATRIX: [&str; 17] = [
    "cameramatrix",
    "cammatrix",
    "cameramat",
    "cammat",
    "cameramtx",
    "intrinsicmatrix",
    "intrinsicsmatrix",
    "intrinsicparameters",
    "intrinsicparams",
    "intrinsics",
    "intrinsic",
    "calibrationmatrix",
    "matrix",
    "kmatrix",
    "mtx",
    "k",
    "m",
];
const DISTORTION: [&str; 17] = [
    "distortioncoefficients",
    "distortioncoeffs",
    "distortioncoeff",
    "distortioncoefs",
    "distortionparameters",
    "distortionvector",
    "distortionmatrix",
    "distcoefficients",
    "distcoeffs",
    "distcoeff",
    "distcoefs",
    "distcoef",
    "distparams",
    "distmat",
    "distortion",
    "dist",
    "d",
];
/// What says which of several cameras is meant, behind or before the name.
const SIDES: [&str; 12] = [
    "left", "right", "l", "r", "rgb", "color", "depth", "ir", "fisheye", "cam", "camera", "",
];

/// What a name stands for, and which camera it belongs to: `M1` is camera `1`'s matrix.
/// The long names are certain; `K1` may be anything.
pub(super) fn role(name: &str) -> Option<(Role, String)> {
    let name = plain(name);
    for (role, names) in [
        (Role::CameraMatrix, CAMERA_MATRIX),
        (Role::Distortion, DISTORTION),
    ] {
        for known in names {
            let side = name
                .strip_prefix(known)
                .or_else(|| name.strip_suffix(known));
            let Some(side) = side else { continue };
            let word = side.trim_matches(|c: char| c.is_ascii_digit());
            if SIDES.contains(&word) {
                return Some((role, side.to_owned()));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_as_they_are_met() {
        use Role::{CameraMatrix, Distortion};
        for (name, expected) in [
            ("camera_matrix", Some((CameraMatrix, ""))),
            ("cameraMatrix", Some((CameraMatrix, ""))),
            ("Camera_Matrix", Some((CameraMatrix, ""))),
            ("K", Some((CameraMatrix, ""))),
            ("M1", Some((CameraMatrix, "1"))),
            ("intrinsic", Some((CameraMatrix, ""))),
            ("cameraMatrixLeft", Some((CameraMatrix, "left"))),
            ("left_camera_matrix", Some((CameraMatrix, "left"))),
            ("cam0_K", Some((CameraMatrix, "cam0"))),
            ("D2", Some((Distortion, "2"))),
            ("dist_coeffs", Some((Distortion, ""))),
            ("distCoeffs1", Some((Distortion, "1"))),
            ("Distortion_Coefficients", Some((Distortion, ""))),
            ("distortion_coefficients", Some((Distortion, ""))),
            ("fisheye_D", Some((Distortion, "fisheye"))),
            ("image_points", None),
            ("P1", None),
            ("rvecs", None),
            ("extrinsic_parameters", None),
        ] {
            let expected = expected.map(|(role, side)| (role, side.to_owned()));
            assert_eq!(role(name), expected, "{name}");
        }
    }
}
