//! Faults on purpose, to see that tests catch them: `tests/planted.sh` runs tests with each.
//!
//! Only builds with debug assertions hold them, and only the environment variable
//! `LUMIGRAPH_PLANTED` brings them out.

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The blending field's vertices are evaluated half a pixel to the right.
    ShiftedField,
    /// A lack of resolution makes a view better.
    TurnedPenalty,
    /// Cells of the triangulation forget one constraint.
    MissingConstraint,
    /// Layered depth images are visited the wrong way round.
    FrontToBack,
    /// The hierarchy of views leaves out one that counts.
    DroppedView,
}

#[cfg(debug_assertions)]
const ALL: [(Fault, &str); 5] = [
    (Fault::ShiftedField, "shifted-field"),
    (Fault::TurnedPenalty, "turned-penalty"),
    (Fault::MissingConstraint, "missing-constraint"),
    (Fault::FrontToBack, "front-to-back"),
    (Fault::DroppedView, "dropped-view"),
];

/// Whether the program is to have a fault.
#[cfg(debug_assertions)]
pub(crate) fn is_planted(fault: Fault) -> bool {
    use std::sync::OnceLock;
    static PLANTED: OnceLock<Option<Fault>> = OnceLock::new();
    let planted = PLANTED.get_or_init(|| {
        let name = std::env::var("LUMIGRAPH_PLANTED").ok()?;
        let found = ALL.iter().find(|(_, known)| *known == name);
        found.map(|(fault, _)| *fault)
    });
    *planted == Some(fault)
}

/// Never.
#[cfg(not(debug_assertions))]
pub(crate) const fn is_planted(_: Fault) -> bool {
    false
}
