//! Photos that turn out damaged when they are decoded: what is said of them.

use super::output::say;
use lumigraph::scene::{Scene, SceneError};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;

/// Leaves photos of a scene out of all that follows and says so, but for those that were left out before;
/// `damaged` are their names, with what is wrong with each.
///
/// # Errors
/// With `strict`, any of them; too few others remain.
pub(super) fn leave_out(
    scene: &Scene,
    damaged: &BTreeMap<String, String>,
    without: &mut BTreeSet<String>,
    strict: bool,
) -> anyhow::Result<()> {
    for (name, reason) in damaged {
        if !without.insert(name.clone()) {
            continue;
        }
        if strict {
            let (name, reason) = (name.clone(), reason.clone());
            return Err(SceneError::Strict { name, reason }.into());
        }
        say!("warning: {}", left_out_text((name, reason)));
    }
    Ok(scene.check_enough(without, damaged)?)
}

/// What to say of a photo that is left out: its name, and what is wrong with it.
pub(super) fn left_out_text((name, reason): (impl Display, impl Display)) -> String {
    format!("photo {name} is left out: {reason}")
}
