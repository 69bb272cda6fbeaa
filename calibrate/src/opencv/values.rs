//! Finding values by the names that people give them.

use super::OpenCvError;
use super::storage::{Entries, FileStorage, Node, Value};
use std::cell::OnceCell;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Values whose paths are longer are left out: no calibration has any, and a long name around
/// many values would fill memory.
const LONGEST_PATH: usize = 200;

/// Every named value of a file, those within maps too.
pub(super) struct Values<'a> {
    pub(super) file: PathBuf,
    pub(super) all: Vec<Named<'a>>,
    index: Index,
    unknown_coefficients: OnceCell<Option<usize>>,
}

/// A value and what it is called.
#[derive(Clone)]
pub(super) struct Named<'a> {
    /// The names of the maps around it and its own, dots between them.
    pub(super) path: String,
    pub(super) node: &'a Node,
    /// What its own name says that it is for, and of which side: see [`role`].
    pub(super) role: Option<(Role, String)>,
    plain_path: String,
    /// Where its own name begins in that.
    plain_own: usize,
}

/// Where in [`Values::all`] the first value of each name is: files may hold thousands of cameras,
/// and all values are not gone through for each.
#[derive(Default)]
struct Index {
    by_path: HashMap<String, usize>,
    by_plain_path: HashMap<String, usize>,
    by_plain_name: HashMap<String, usize>,
    /// By prefix and plain name.
    in_map: HashMap<String, usize>,
    /// By plain path and by plain name: those that lie in no camera's map.
    of_no_camera: HashMap<String, usize>,
    /// Matrices, by prefix and side.
    distortion: HashMap<String, usize>,
    /// The prefixes of cameras and of the maps around them.
    of_cameras: HashSet<String>,
}

impl Index {
    fn of(all: &[Named<'_>]) -> Self {
        let mut index = Self::default();
        for named in all.iter().filter(|named| named.is_camera()) {
            for map in around(named.prefix()) {
                if !index.of_cameras.insert(map.to_owned()) {
                    break;
                }
            }
        }
        for (i, named) in all.iter().enumerate() {
            let (path, name, prefix) = (&named.plain_path, named.plain(), named.prefix());
            let first = |map: &mut HashMap<String, usize>, key: &str| {
                if !map.contains_key(key) {
                    map.insert(key.to_owned(), i);
                }
            };
            first(&mut index.by_path, &named.path);
            first(&mut index.by_plain_path, path);
            first(&mut index.by_plain_name, name);
            first(&mut index.in_map, &format!("{prefix}{name}"));
            if !index.of_cameras.contains(prefix) {
                first(&mut index.of_no_camera, path);
                first(&mut index.of_no_camera, name);
            }
            if let Some((Role::Distortion, side)) = &named.role
                && named.node.matrix().is_some()
            {
                first(&mut index.distortion, &format!("{prefix}{side}"));
            }
        }
        index
    }
}

/// The prefix of a map and those of the maps around it, outwards.
pub(super) fn around(prefix: &str) -> impl Iterator<Item = &str> {
    std::iter::successors(Some(prefix), |&inner| {
        let name = inner.strip_suffix('.')?;
        Some(&inner[..name.rfind('.').map_or(0, |at| at + 1)])
    })
}

impl<'a> Values<'a> {
    pub(super) fn of(file: &Path, storage: &'a FileStorage) -> Self {
        let mut all = Vec::new();
        collect("", &storage.entries, &mut all);
        Self {
            file: file.to_owned(),
            index: Index::of(&all),
            unknown_coefficients: OnceCell::new(),
            all,
        }
    }

    /// The first value with one of the names, written in whatever way.
    pub(super) fn find(&self, names: &[&str]) -> Option<&Named<'a>> {
        self.first(&self.index.by_plain_path, names)
    }

    /// The same among the innermost names, whatever the maps around them are called.
    pub(super) fn find_within(&self, names: &[&str]) -> Option<&Named<'a>> {
        let within = || self.first(&self.index.by_plain_name, names);
        self.find(names).or_else(within)
    }

    /// The same for a camera whose matrix has a prefix: from its own map outwards, then in others, but not
    /// in those of other cameras.
    pub(super) fn find_for(&self, prefix: &str, names: &[&str]) -> Option<&Named<'a>> {
        let found = around(prefix).find_map(|map| self.find_in(map, names));
        let elsewhere = || self.first(&self.index.of_no_camera, names);
        found.or_else(|| self.find(names)).or_else(elsewhere)
    }

    /// The first value in the map of a prefix, but not in those within it, that is called so with the
    /// names of the maps around it or without.
    pub(super) fn find_in(&self, prefix: &str, names: &[&str]) -> Option<&Named<'a>> {
        let map = plain(prefix);
        let own = names.iter().copied();
        let own = own.chain(names.iter().filter_map(|name| name.strip_prefix(&*map)));
        let keys: Vec<String> = own.map(|name| format!("{prefix}{name}")).collect();
        let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
        self.first(&self.index.in_map, &keys)
    }

    fn first(&self, index: &HashMap<String, usize>, keys: &[&str]) -> Option<&Named<'a>> {
        let first = keys.iter().filter_map(|&key| index.get(key)).min();
        first.map(|&i| &self.all[i])
    }

    /// All values with one of the names, with those of the maps around them or without.
    pub(super) fn called(&self, names: &[&str]) -> impl Iterator<Item = &Named<'a>> {
        self.all.iter().filter(move |named| {
            names.contains(&named.plain_path.as_str()) || names.contains(&named.plain())
        })
    }

    /// Whether a value lies in the map of another camera than that whose matrix has a prefix.
    pub(super) fn is_of_another(&self, prefix: &str, named: &Named<'_>) -> bool {
        !prefix.starts_with(named.prefix()) && self.index.of_cameras.contains(named.prefix())
    }

    /// A value by its exact path.
    pub(super) fn exactly(&self, path: &str) -> Option<&Named<'a>> {
        self.first(&self.index.by_path, &[path])
    }

    /// The first matrix in the map of a prefix that is called distortion coefficients of a side.
    pub(super) fn distortion(&self, prefix: &str, side: &str) -> Option<&Named<'a>> {
        self.first(&self.index.distortion, &[&format!("{prefix}{side}")])
    }

    /// The first value that may be distortion coefficients by its shape, and by a name that says
    /// nothing.
    pub(super) fn unknown_coefficients(&self) -> Option<&Named<'a>> {
        let maybe = |named: &Named<'_>| {
            let matrix = || named.node.matrix();
            named.role.is_none()
                && !named.plain().contains("roi")
                && matrix().is_some_and(|m| {
                    m.channels == 1
                        && m.rows.min(m.cols) == 1
                        && [4, 5, 8, 12, 14].contains(&m.data.len())
                })
        };
        let first = self.unknown_coefficients.get_or_init(|| {
            let mut all = self.all.iter();
            all.position(maybe)
        });
        first.map(|i| &self.all[i])
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

impl<'a> Named<'a> {
    fn new(prefix: &str, name: &str, node: &'a Node) -> Self {
        let path = format!("{prefix}{name}");
        let mut named = Self {
            plain_path: plain(&path),
            path,
            node,
            role: None,
            plain_own: 0,
        };
        // A name may have dots of its own.
        named.plain_own = plain(named.prefix()).len();
        named.role = role(named.last());
        named
    }

    /// Its own name.
    pub(super) fn last(&self) -> &str {
        self.path.rsplit('.').next().unwrap_or_default()
    }

    /// What stands before its own name: empty, or ends with a dot.
    pub(super) fn prefix(&self) -> &str {
        &self.path[..self.path.len() - self.last().len()]
    }

    /// Its own name as [`plain`] has it.
    pub(super) fn plain(&self) -> &str {
        &self.plain_path[self.plain_own..]
    }

    /// A camera matrix, or the first number of a camera that is written as numbers.
    fn is_camera(&self) -> bool {
        if ["fx", "mu"].contains(&self.plain()) {
            return self.node.number().is_some();
        }
        matches!(self.role, Some((Role::CameraMatrix, _))) && self.node.matrix().is_some()
    }
}

/// A name without case and punctuation: `Camera_Matrix` is `cameramatrix`.
pub(super) fn plain(name: &str) -> String {
    let kept = name.chars().filter(char::is_ascii_alphanumeric);
    kept.map(|c| c.to_ascii_lowercase()).collect()
}

fn collect<'a>(prefix: &str, entries: &'a Entries, all: &mut Vec<Named<'a>>) {
    for (key, node) in entries {
        if prefix.len() + key.len() > LONGEST_PATH {
            continue;
        }
        if let Value::Map(inner) = &node.value {
            collect(&format!("{prefix}{key}."), inner, all);
        }
        all.push(Named::new(prefix, key, node));
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
fn role(name: &str) -> Option<(Role, String)> {
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
