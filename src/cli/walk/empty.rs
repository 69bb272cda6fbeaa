//! Frames of a walk that show nothing.

use super::super::report::note_of_empty;
use super::Args;
use super::report::{Drawn, Walked};

/// How many frames show nothing at all, whatever portals show.
pub(super) fn count(walks: &[Walked]) -> usize {
    frames(walks).filter(|frame| frame.is_empty).count()
}

/// What to say of frames that show nothing, if there are any.
pub(super) fn note(args: &Args, walks: &[Walked]) -> Option<String> {
    let mut empty = frames(walks).filter(|frame| frame.is_empty);
    let are_outside = empty.all(|frame| frame.cost.cell.is_none());
    let what = if args.held_out { "pictures" } else { "frames" };
    let why = why(args, are_outside);
    note_of_empty(count(walks), frames(walks).count(), what, &why)
}

/// Why frames may show nothing, for people; `are_outside` where none of their eyes is in a cell.
fn why(args: &Args, are_outside: bool) -> String {
    if !are_outside {
        return "nothing of the model lies before their eyes".to_owned();
    }
    let may_be = match &args.path {
        _ if args.held_out => "do the cells reach to where those photos were taken?",
        Some(_) if args.nerfstudio.is_unplaced(args.path.as_ref()) => {
            "does the path lie in this interior's world (see --dataparser-transforms)?"
        }
        Some(_) => "does the path lie in this interior's world?",
        None => "is the interior's `eye_height` right?",
    };
    format!("their eyes are in no cell; {may_be}")
}

fn frames(walks: &[Walked]) -> impl Iterator<Item = &Drawn> {
    walks.iter().flat_map(|walk| &walk.frames)
}
