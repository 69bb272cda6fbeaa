//! What is said where the view of a screenshot is drawn again.

use super::output::say;
use render::path::{ShotLook, read_shot_look};
use std::path::Path;

/// Notes that a file, if it is a screenshot, shows something else than what is drawn of its view by one of
/// these options, as the command line spells them.
pub(super) fn say_other_look(file: &Path, options: &[String]) {
    let note = read_shot_look(file).and_then(|look| other_look(&look, options));
    if let Some(note) = note {
        say!("note: {}: {note}", file.display());
    }
}

fn other_look(look: &ShotLook, options: &[String]) -> Option<String> {
    if look.layer != "picture" {
        return Some(format!(
            "it shows the {} of its view; what is drawn is the picture",
            look.layer
        ));
    }
    if !look.meanwhile.is_empty() {
        return Some(format!(
            "it was taken while loading went on, and drawn with {} until then; the picture may be another",
            look.meanwhile
        ));
    }
    if options.contains(&look.options) {
        return None;
    }
    let spelled = |options: &str| match options {
        "" => "default options".to_owned(),
        given => given.to_owned(),
    };
    let now: Vec<String> = options.iter().map(|given| spelled(given)).collect();
    Some(format!(
        "it was drawn with {}; with {} the picture is another",
        spelled(&look.options),
        now.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::super::options::FieldArgs;
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Given {
        #[command(flatten)]
        field: FieldArgs,
    }

    #[test]
    fn options_are_spelled_as_the_command_line_has_them() {
        for line in [
            "",
            "--k 11 --beta 0.05 --grid 64",
            "--resolution distance",
            "--blend paper --resolution length --renderer exact",
        ] {
            let words = ["render"].into_iter().chain(line.split_whitespace());
            let field = Given::try_parse_from(words).unwrap().field;
            assert_eq!(field.options().spelled(field.method()), line);
        }
    }

    #[test]
    fn what_a_screenshot_shows_otherwise_is_told() {
        let note = |layer: &str, own: &str, given: &[&str]| {
            let look = ShotLook {
                layer: layer.to_owned(),
                options: own.to_owned(),
                meanwhile: String::new(),
            };
            let given: Vec<String> = given.iter().map(|g| (*g).to_owned()).collect();
            other_look(&look, &given)
        };
        assert_eq!(note("picture", "", &[""]), None);
        assert_eq!(note("picture", "--k 3", &["--k 3"]), None);
        assert_eq!(
            note("picture", "--portals ldi", &["", "--portals ldi"]),
            None
        );
        assert_eq!(
            note("picture", "--k 3", &[""]).unwrap(),
            "it was drawn with --k 3; with default options the picture is another"
        );
        assert_eq!(
            note("picture", "", &["--grid 8"]).unwrap(),
            "it was drawn with default options; with --grid 8 the picture is another"
        );
        assert_eq!(
            note("field", "", &[""]).unwrap(),
            "it shows the field of its view; what is drawn is the picture"
        );
        let early = ShotLook {
            layer: "picture".to_owned(),
            options: String::new(),
            meanwhile: "--proxy points --no-exposure".to_owned(),
        };
        assert_eq!(
            other_look(&early, &[String::new()]).unwrap(),
            "it was taken while loading went on, and drawn with --proxy points --no-exposure until then; the picture may \
             be another"
        );
    }
}
