//! Captures opened without `import`: of options that messages suggest they say whose they are.

use super::put_back::is_between_scenes;
use super::{Aside, ImportOptions, Scene, SceneError, Warning};
use calibrate::opencv::Keys;
use capture::as_argument;
use std::path::Path;

/// Options that choose among the matrices of OpenCV's file.
const OF_KEYS: [&str; 3] = ["--camera-matrix", "--distortion", "--fisheye"];
/// Others that say how a capture is to be read.
const OF_READING: [&str; 4] = ["--mattes", "--masks", "--depth-scale", "--no-depth"];

impl Scene {
    /// Imports a capture in memory with the defaults, for a command that has no options for anything else, but
    /// those for `keys` where it gives them. Messages that suggest others say that `import` has them.
    ///
    /// # Errors
    /// As for [`Scene::import`]; the folder's scene lies aside, while an import replaces it.
    pub fn open_capture(
        capture: &Path,
        strict: bool,
        keys: Option<&Keys>,
    ) -> Result<(Self, Vec<Warning>), SceneError> {
        if Aside::left(capture).is_some() || is_between_scenes(capture) {
            return Err(SceneError::Aside {
                folder: capture.to_owned(),
            });
        }
        let options = ImportOptions {
            strict,
            keys: keys.cloned().unwrap_or_default(),
            ..ImportOptions::default()
        };
        let whose = |text: &str| whose(text, capture, keys.is_some());
        match Self::import(capture, &options) {
            Ok((scene, mut warnings)) => {
                for warning in &mut warnings {
                    if let Warning::Note(note) = warning
                        && let Some(whose) = whose(note)
                    {
                        *note = format!("{note}; {whose}");
                    }
                }
                Ok((scene, warnings))
            }
            Err(error) => Err(match whose(&error.to_string()) {
                Some(whose) => SceneError::OfImport {
                    source: Box::new(error),
                    whose,
                },
                None => error,
            }),
        }
    }
}

/// Which of the options that a text suggests `import` alone has, if it suggests any.
fn whose(text: &str, capture: &Path, has_keys: bool) -> Option<String> {
    let of_keys = OF_KEYS.into_iter().filter(|_| !has_keys);
    let options = of_keys.chain(OF_READING);
    let suggested: Vec<&str> = options.filter(|option| text.contains(*option)).collect();
    let are = match suggested.len() {
        0 => return None,
        1 => "is an option",
        _ => "are options",
    };
    Some(format!(
        "{} {are} of `lumigraph import {} -o SCENE`",
        suggested.join(" and "),
        as_argument(capture)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_a_command_lacks_are_told_to_be_those_of_import() {
        let capture = Path::new("my wall");
        let matrix = "choose with --camera-matrix KEY --distortion KEY";
        assert_eq!(
            whose(matrix, capture, false).unwrap(),
            "--camera-matrix and --distortion are options of `lumigraph import 'my wall' -o SCENE`"
        );
        assert_eq!(whose(matrix, capture, true), None);
        assert_eq!(
            whose("were they not meant, --depth-scale 2", capture, true).unwrap(),
            "--depth-scale is an option of `lumigraph import 'my wall' -o SCENE`"
        );
        assert_eq!(whose("--no-masks leaves them out", capture, false), None);
        assert_eq!(whose("no such folder", capture, false), None);
    }
}
