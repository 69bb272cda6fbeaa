//! What is painted over and under the panels.

use crate::content::Content;
use crate::overlay::Overlay;
use crate::panel::Shows;
use crate::picture::Shown;
use crate::plan::{self, Plan};
use crate::state::State;
use egui::{Color32, Rect, pos2};

/// The picture, the photo beside it, and the lines over both.
pub(super) fn paint(
    context: &egui::Context,
    state: &State,
    shows: &Shows,
    shown: Option<&Shown>,
    plan: Option<&Plan>,
    [picture, photo]: [Option<egui::TextureId>; 2],
) {
    let painter = context.layer_painter(egui::LayerId::background());
    let rect = context.viewport_rect();
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    let Some((shown, picture)) = shown.zip(picture) else {
        return;
    };
    painter.image(picture, rect, whole, Color32::WHITE);
    let photo = state.wipe.zip(photo);
    if let Some((share, photo)) = photo {
        let mut right = rect;
        right.set_left(rect.left() + share as f32 * rect.width());
        painter
            .with_clip_rect(right)
            .image(photo, rect, whole, Color32::WHITE);
    }
    let painter = painter.with_clip_rect(rect);
    // What photos do not support is dimmed, gently.
    if state.support < 1.0 {
        let share = (1.0 - state.support) * 70.0;
        painter.rect_filled(rect, 0.0, Color32::from_black_alpha(share as u8));
    }
    // A picture of another size is stretched until there is one of this.
    let mut overlay = Overlay::new(&painter, &shown.view);
    overlay.edges(&shown.mesh);
    if shows.epipoles {
        overlay.epipoles(&shown.lines.epipoles);
    }
    if let Some(space) = state.space() {
        match (shows.frusta, space.is_interior) {
            (true, false) => overlay.frusta(&space.stops, space.depth, state.nearest()),
            (true, true) => overlay.frusta(&space.cameras, space.depth, None),
            (false, _) => {}
        }
        if !state.is_playing() {
            let keyframes = &state.keyframes;
            overlay.keyframes(keyframes.poses(), keyframes.chosen(), 0.05 * space.depth);
        }
        if let (Some((share, _)), Some((source, _))) = (photo, &shown.photo) {
            let name = space.stops.get(*source).map_or("", |s| s.name.as_str());
            overlay.wipe(share, name);
        }
    }
    if let (Some(Content::Interior(house)), true) = (state.content(), shows.frusta) {
        overlay.portals(&house.interior, 0.05);
    }
    overlay.finish();
    if let (Some(plan), true) = (plan, shows.plan) {
        plan.paint(&painter, plan::place(rect), state.pose(), state.cell());
    }
}
