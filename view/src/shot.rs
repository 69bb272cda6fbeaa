//! Screenshots: what their files have, and what of the screen they do not.

use crate::picture::{Layer, Look, Request};
use image::RgbaImage;
use render::path::{ShotLook, write_shot};
use std::path::{Path, PathBuf};

/// A screenshot that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shot {
    /// Its file.
    pub file: PathBuf,
    /// How the picture differs from the screen's, and from what is drawn of its view again, for
    /// people; empty, or to be said behind the file's name.
    pub note: String,
}

/// What a screenshot is of.
#[derive(Clone, Debug)]
pub(crate) enum Subject {
    /// A scene; see [`Space::meanwhile`](crate::content::Space::meanwhile).
    Scene { meanwhile: String },
    /// An interior, whose LDIs are made of so many views, or of all that there are.
    Interior { ldi_views: Option<usize> },
}

/// Writes a picture as files have it, with its view and how it was drawn, to the next free name in a
/// folder, which is made where it is missing.
///
/// # Errors
/// Why it is not written, for people.
pub(crate) fn write(
    folder: &Path,
    request: &Request,
    picture: &RgbaImage,
    subject: &Subject,
) -> Result<Shot, String> {
    make_folder(folder)?;
    let file = free_name(folder);
    let look = &request.look;
    let time_s = look.moment.map(|moment| moment.time_s);
    let kept = kept(look, subject);
    write_shot(&file, picture, &request.view, time_s, &kept).map_err(|error| error.to_string())?;
    let note = note(look, &kept, subject);
    Ok(Shot { file, note })
}

/// Makes the session's folder where it is missing, or says why it cannot, for people.
pub(crate) fn make_folder(folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|error| {
        let folder = folder.display();
        format!("{folder}: this folder cannot be made: {error}; make it by hand, and try again")
    })
}

/// What of a look the file knows.
fn kept(look: &Look, subject: &Subject) -> ShotLook {
    ShotLook {
        // What no photo covers is marked on the screen only.
        layer: match look.layer {
            Layer::Coverage => Layer::Picture.name().to_owned(),
            layer => layer.name().to_owned(),
        },
        options: match subject {
            Subject::Interior { ldi_views } => look.portals.spelled(*ldi_views),
            Subject::Scene { .. } => look.options.spelled(look.method),
        },
        meanwhile: match subject {
            Subject::Interior { .. } => String::new(),
            Subject::Scene { meanwhile } => meanwhile.clone(),
        },
    }
}

fn note(look: &Look, kept: &ShotLook, subject: &Subject) -> String {
    let command = match subject {
        Subject::Interior { .. } => "walk",
        Subject::Scene { .. } => "render",
    };
    let mut note = String::new();
    if look.exposure_stops != 0.0 {
        note += ", without the exposure";
    }
    if kept.layer != Layer::Picture.name() {
        note += &format!("; of its view `{command}` draws the picture");
    } else if !kept.meanwhile.is_empty() {
        let with = format!("{} {}", kept.options, kept.meanwhile);
        note += &format!(
            "; as loading goes on, `{command}` draws it with {}",
            with.trim_start()
        );
    } else if !kept.options.is_empty() {
        note += &format!("; `{command}` draws it with {}", kept.options);
    }
    note
}

/// A name in a folder that is not taken: `shot_0001.png` and so on.
fn free_name(folder: &Path) -> PathBuf {
    let name = |i: u32| folder.join(format!("shot_{i:04}.png"));
    let first = (1..u32::MAX).map(name).find(|path| !path.exists());
    first.unwrap_or_else(|| name(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3, View};
    use glam::DVec2;
    use render::Method;
    use render::interior::PortalFill;
    use render::path::read_shot_look;

    #[test]
    fn a_shot_says_what_it_takes_to_draw_it_again() {
        let folder = tempfile::tempdir().unwrap();
        let mut request = Request {
            id: 1,
            view: View {
                lens: Lens::pinhole(DVec2::splat(8.0), DVec2::splat(4.0)),
                width: 8,
                height: 8,
                camera_from_world: Rigid3::IDENTITY,
            },
            look: Look::default(),
            is_moving: false,
            hover: None,
        };
        let scene = &Subject::Scene {
            meanwhile: String::new(),
        };
        let all = &Subject::Interior { ldi_views: None };
        let three = &Subject::Interior { ldi_views: Some(3) };
        let mut told = |change: &dyn Fn(&mut Look), subject: &Subject| {
            request.look = Look::default();
            change(&mut request.look);
            let picture = RgbaImage::new(8, 8);
            let shot = write(folder.path(), &request, &picture, subject).unwrap();
            let kept = read_shot_look(&shot.file).unwrap();
            (kept.layer, kept.options, shot.note)
        };
        let texts = |layer: &str, options: &str, note: &str| {
            (layer.to_owned(), options.to_owned(), note.to_owned())
        };
        assert_eq!(told(&|_| {}, scene), texts("picture", "", ""));
        let panel = |look: &mut Look| {
            look.options.k = 11;
            look.options.beta = 0.05;
            look.method = Method::Triangulated { cells_across: 64 };
            look.exposure_stops = 0.7;
            look.portals = PortalFill::Ldi;
        };
        let options = "--k 11 --beta 0.05 --grid 64";
        let note = format!(", without the exposure; `render` draws it with {options}");
        assert_eq!(told(&panel, scene), texts("picture", options, &note));
        let note = ", without the exposure; `walk` draws it with --portals ldi";
        assert_eq!(told(&panel, all), texts("picture", "--portals ldi", note));
        let options = "--portals ldi --ldi-views 3";
        let note = format!(", without the exposure; `walk` draws it with {options}");
        assert_eq!(told(&panel, three), texts("picture", options, &note));
        // Of what has no LDIs there are no views of any.
        assert_eq!(told(&|_| {}, three), texts("picture", "", ""));
        let exact = |look: &mut Look| {
            look.layer = Layer::Field;
            look.method = Method::Exact;
        };
        let note = "; of its view `render` draws the picture";
        assert_eq!(
            told(&exact, scene),
            texts("field", "--renderer exact", note)
        );
        let coverage = |look: &mut Look| look.layer = Layer::Coverage;
        assert_eq!(told(&coverage, scene), texts("picture", "", ""));
        assert!(folder.path().join("shot_0007.png").is_file());
        // What is chosen behind the window is another soon.
        let early = &Subject::Scene {
            meanwhile: "--proxy points".to_owned(),
        };
        let note = "; as loading goes on, `render` draws it with --proxy points";
        assert_eq!(told(&|_| {}, early), texts("picture", "", note));
        let fewer = |look: &mut Look| look.options.k = 3;
        let note = "; as loading goes on, `render` draws it with --k 3 --proxy points";
        assert_eq!(told(&fewer, early), texts("picture", "--k 3", note));
    }
}
