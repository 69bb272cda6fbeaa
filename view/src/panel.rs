//! The panel, the lines of text, and the help.

use crate::compose::BEHIND;
use crate::picture::{Layer, Shown};
use crate::state::{Action, Mode, State};
use egui::{
    Align2, Color32, ComboBox, Context, Frame, Id, RichText, Slider, SliderClamping, Ui, emath,
};
use render::Method;
use render::interior::PortalFill;
use render::path::Interpolation;
use std::ops::RangeInclusive;

/// What is drawn over the picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shows {
    /// The panel itself.
    pub(crate) panel: bool,
    /// Times, and what was skipped.
    pub(crate) hud: bool,
    /// Which key does what.
    pub(crate) help: bool,
    /// The photos' cameras, or the portals.
    pub(crate) frusta: bool,
    /// Where other cameras' centres are seen.
    pub(crate) epipoles: bool,
    /// The floor plan.
    pub(crate) plan: bool,
}

impl Shows {
    /// What fits on a window of a size, in points.
    pub(crate) fn fitting(width: f32) -> Self {
        Self {
            panel: width >= 700.0,
            hud: width >= 500.0,
            help: false,
            frusta: false,
            epipoles: false,
            plan: true,
        }
    }
}

/// What the panel wants done that is not the state's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Command {
    /// See [`Action`].
    Act(Action),
    /// Take a screenshot.
    Shoot,
    /// Save the path.
    SavePath,
}

/// What people should know now.
#[derive(Clone, Debug, Default)]
pub(crate) struct Status {
    /// What is being loaded or fitted.
    pub(crate) doing: Option<String>,
    /// The last thing that happened.
    pub(crate) said: Option<String>,
    /// Why there is nothing more.
    pub(crate) failed: Option<String>,
    /// Frames a second on the screen, and the longest step of the last that was not drawing.
    pub(crate) step_ms: f64,
    /// Acquiring, drawing and showing the last.
    pub(crate) draw_ms: f64,
}

/// The panel; what it wants done.
pub(crate) fn panel(
    context: &Context,
    state: &mut State,
    shows: &mut Shows,
    shown: Option<&Shown>,
) -> Vec<Command> {
    let mut commands = Vec::new();
    let height = context.content_rect().height();
    let mut is_open = true;
    egui::Window::new("lumigraph")
        .anchor(Align2::RIGHT_TOP, [-8.0, 8.0])
        .resizable(false)
        .default_size([230.0, height])
        .open(&mut is_open)
        .show(context, |ui| {
            egui::ScrollArea::vertical()
                .max_height((height - 64.0).max(60.0))
                .min_scrolled_height((height - 64.0).max(60.0))
                .show(ui, |ui| contents(ui, state, shows, shown, &mut commands));
        });
    shows.panel &= is_open;
    commands
}

fn contents(
    ui: &mut Ui,
    state: &mut State,
    shows: &mut Shows,
    shown: Option<&Shown>,
    commands: &mut Vec<Command>,
) {
    let is_interior = state.space().is_some_and(|s| s.is_interior);
    ui.horizontal(|ui| {
        let modes = [
            (Mode::Orbit, "Orbit"),
            (Mode::Fly, "Fly"),
            (Mode::Walk, "Walk"),
        ];
        for (mode, name) in modes {
            if (mode != Mode::Walk || is_interior)
                && ui.selectable_label(state.mode == mode, name).clicked()
            {
                commands.push(Command::Act(Action::Move(mode)));
            }
        }
    });
    ui.horizontal(|ui| {
        for (action, name, hint) in [
            (Action::Previous, "Before", "The camera (room) before: B"),
            (Action::Next, "Next", "The next camera (room): N"),
            (Action::Home, "Back", "Where photos show something: R"),
        ] {
            if ui.button(name).on_hover_text(hint).clicked() {
                commands.push(Command::Act(action));
            }
        }
        let stop = state.stop().or_else(|| state.nearest());
        let names = state.space().zip(stop).and_then(|(s, i)| s.stops.get(i));
        ui.label(names.map_or("", |stop| stop.name.as_str()));
    });
    ui.separator();
    ui.label("Show");
    ui.horizontal_wrapped(|ui| {
        for layer in Layer::ALL {
            if !is_interior || layer.is_of_interiors() {
                ui.selectable_value(&mut state.look.layer, layer, layer.name());
            }
        }
    });
    if is_interior {
        ui.checkbox(&mut shows.frusta, "portals (V)");
        ui.checkbox(&mut shows.plan, "floor plan (M)");
        ComboBox::from_label("through portals")
            .selected_text(state.look.portals.name())
            .show_ui(ui, |ui| {
                for fill in PortalFill::ALL {
                    ui.selectable_value(&mut state.look.portals, fill, fill.name());
                }
            });
    } else {
        ui.checkbox(&mut shows.frusta, "cameras (V)");
        ui.checkbox(&mut state.look.triangulation, "triangulation (T)");
        ui.checkbox(&mut shows.epipoles, "epipoles (E)");
        ui.checkbox(&mut state.look.wireframe, "proxy's edges (G)");
        ui.checkbox(&mut state.tells_weights, "weights under the cursor (I)");
        let mut has_wipe = state.wipe.is_some();
        ui.checkbox(&mut has_wipe, "wipe to the nearest photo (O)");
        state.wipe = has_wipe.then(|| state.wipe.unwrap_or(0.5));
        if let Some(share) = &mut state.wipe {
            ui.add(slider(share, 0.0..=1.0).text("wipe").show_value(false));
        }
        ui.separator();
        field_sliders(ui, state);
    }
    let times = state.space().and_then(|space| space.times);
    if let (Some(times), Some(moment)) = (times, &mut state.look.moment) {
        let [first, last] = times.range_s;
        ui.add(slider(&mut moment.time_s, first..=last).text("time, s"));
    }
    let exposure = &mut state.look.exposure_stops;
    ui.add(slider(exposure, -3.0..=3.0).text("exposure").step_by(0.1));
    ui.horizontal(|ui| {
        let background = &mut state.look.background;
        let mut is_clear = background.is_none();
        if ui.checkbox(&mut is_clear, "transparent").changed() {
            *background = (!is_clear).then_some(BEHIND);
        }
        if let Some(color) = background {
            ui.color_edit_button_srgb(color).on_hover_text("behind");
        }
    });
    if let Some(shown) = shown {
        ui.label(format!("frame: {:.1} ms", shown.time_ms()));
    }
    ui.separator();
    path(ui, state, commands);
    ui.separator();
    ui.horizontal(|ui| {
        if ui.button("Screenshot").on_hover_text("P").clicked() {
            commands.push(Command::Shoot);
        }
        ui.checkbox(&mut shows.hud, "times (H)");
        ui.checkbox(&mut shows.help, "help (F1)");
    });
}

/// A slider. What the command line or a file gave stays as it is until it is moved, be it outside
/// the range or between the steps.
fn slider<Number: emath::Numeric>(value: &mut Number, range: RangeInclusive<Number>) -> Slider<'_> {
    Slider::new(value, range).clamping(SliderClamping::Edits)
}

fn field_sliders(ui: &mut Ui, state: &mut State) {
    let mut is_exact = state.look.method == Method::Exact;
    ui.add(slider(&mut state.look.options.k, 1..=render::MAX_CONTRIBUTORS).text("k"));
    let alpha = slider(&mut state.alpha, 0.1..=10.0);
    ui.add(alpha.logarithmic(true).text("α"));
    ui.add(slider(&mut state.beta, 0.0..=2.0).text("β"));
    ui.horizontal(|ui| {
        ui.selectable_value(&mut is_exact, false, "triangulated");
        ui.selectable_value(&mut is_exact, true, "exact (X)");
    });
    state.set_exact(is_exact);
    if let Method::Triangulated { cells_across } = &mut state.look.method {
        let grid = slider(cells_across, 4..=128);
        ui.add(grid.logarithmic(true).text("grid"));
    }
}

fn path(ui: &mut Ui, state: &mut State, commands: &mut Vec<Command>) {
    let count = state.keyframes.len();
    ui.label(format!(
        "Path: {count} keyframes, {:.1} s",
        state.keyframes.duration_s()
    ));
    ui.horizontal(|ui| {
        let mut button = |name: &str, hint: &str, action: Action, is_enabled: bool| {
            let button = ui.add_enabled(is_enabled, egui::Button::new(name));
            if button.on_hover_text(hint).clicked() {
                commands.push(Command::Act(action));
            }
        };
        button(
            "Add",
            "Here, after the chosen one: K",
            Action::AddKeyframe,
            true,
        );
        button(
            "Move",
            "The chosen one here: U",
            Action::PlaceKeyframe,
            count > 0,
        );
        button(
            "Delete",
            "The chosen one: Delete",
            Action::DeleteKeyframe,
            count > 0,
        );
        let play = if state.is_playing() { "Stop" } else { "Play" };
        button(play, "Space", Action::Play, count > 1);
    });
    if count == 0 {
        return;
    }
    ui.horizontal_wrapped(|ui| {
        for i in 0..count {
            let is_chosen = state.keyframes.chosen() == Some(i);
            if ui
                .selectable_label(is_chosen, (i + 1).to_string())
                .clicked()
            {
                // The one before it and one step on: its pose, too.
                state.keyframes.choose((i + count - 1) % count);
                commands.push(Command::Act(Action::StepKeyframe(true)));
            }
        }
        if ui
            .button("Earlier")
            .on_hover_text("The chosen one, in the order")
            .clicked()
        {
            state.keyframes.shift(false);
        }
        if ui
            .button("Later")
            .on_hover_text("The chosen one, in the order")
            .clicked()
        {
            state.keyframes.shift(true);
        }
    });
    let apart = &mut state.keyframes.apart_s;
    ui.add(slider(apart, 0.2..=10.0).text("s apart").step_by(0.1));
    ui.horizontal(|ui| {
        let interpolation = &mut state.keyframes.interpolation;
        ui.selectable_value(interpolation, Interpolation::Spline, "smooth");
        ui.selectable_value(interpolation, Interpolation::Linear, "straight");
        if ui.button("Save").on_hover_text("Ctrl+S").clicked() {
            commands.push(Command::SavePath);
        }
    });
}

/// What people should know: what is being done, what took how long, what is under the cursor.
pub(crate) fn texts(
    context: &Context,
    state: &State,
    shows: &Shows,
    status: &Status,
    shown: Option<&Shown>,
) {
    let mut lines: Vec<(String, Color32)> = Vec::new();
    let plain = Color32::from_gray(230);
    let warning = Color32::from_rgb(255, 190, 90);
    if let Some(failed) = &status.failed {
        lines.push((failed.clone(), Color32::from_rgb(255, 120, 110)));
    }
    if let Some(doing) = &status.doing {
        lines.push((format!("… {doing}"), Color32::from_rgb(140, 210, 255)));
    }
    if let Some(said) = &status.said {
        lines.push((said.clone(), plain));
    }
    if state.support < 0.4 {
        let text = "beyond what the photos show; R goes back";
        lines.push((text.to_owned(), warning));
    }
    if let (true, Some(shown)) = (shows.hud, shown) {
        let [width, height] = shown.image.size;
        lines.push((
            format!(
                "{width} × {height}, {:.1} ms, {}",
                shown.time_ms(),
                shown.device
            ),
            plain,
        ));
        let stages = shown.stages.iter().filter(|(_, ms)| *ms >= 0.05);
        let stages: Vec<String> = stages.map(|(name, ms)| format!("{name} {ms:.1}")).collect();
        lines.push((stages.join(", "), plain));
        lines.push((shown.skipped.clone(), plain));
        if let Some(support) = shown.support {
            lines.push((
                format!(
                    "{:.0} % covered, nearest photos {:.1}° off",
                    100.0 * support.covered,
                    support.difference.to_degrees()
                ),
                plain,
            ));
        }
        let text = format!(
            "window: {:.1} ms, drawing {:.1} ms",
            status.step_ms, status.draw_ms
        );
        lines.push((text, plain));
    }
    if let Some(hover) = shown
        .and_then(|s| s.hover.as_ref())
        .filter(|_| state.tells_weights)
    {
        let text = match hover.point_in_world {
            Some(p) => format!("({:.3}, {:.3}, {:.3})", p.x, p.y, p.z),
            None => "no proxy there".to_owned(),
        };
        lines.push((text, plain));
        let names = |i: usize| {
            state
                .space()
                .and_then(|s| s.stops.get(i))
                .map(|s| s.name.as_str())
        };
        for (source, weight) in hover.weights.iter().take(8) {
            let name = names(*source).unwrap_or("?");
            lines.push((format!("{:5.1} %  {name}", 100.0 * weight), plain));
        }
    }
    if lines.is_empty() {
        return;
    }
    egui::Area::new(Id::unique("texts"))
        .anchor(Align2::LEFT_TOP, [8.0, 8.0])
        .interactable(false)
        .show(context, |ui| {
            Frame::NONE
                .fill(Color32::from_black_alpha(150))
                .corner_radius(4.0)
                .inner_margin(6.0)
                .show(ui, |ui| {
                    ui.set_max_width(0.6 * context.content_rect().width());
                    for (text, color) in lines {
                        ui.label(RichText::new(text).color(color).size(12.0));
                    }
                });
        });
}

/// Keys, and what they do.
const HELP: [(&str, &str); 20] = [
    (
        "drag",
        "orbit: go around what is under the cursor; fly, walk: look around",
    ),
    ("Shift or right drag", "move aside"),
    ("wheel", "towards what is under the cursor, or away"),
    ("click", "with cameras shown: go to that camera"),
    ("W A S D, Page Up/Down", "move; with Shift faster"),
    ("arrows", "turn"),
    ("1, 2, 3", "orbit, fly, walk"),
    ("N, B", "next camera or room, the one before"),
    ("R", "back to where photos show something"),
    ("V", "cameras, or portals"),
    (
        "F, Z, C, L",
        "field in colours, depth, coverage, the proxy shaded",
    ),
    ("T, E, G", "triangulation, epipoles, the proxy's edges"),
    ("I", "which photos paint the pixel under the cursor"),
    ("O", "wipe to the nearest photo"),
    ("X", "exact or triangulated field"),
    ("K, U, Delete", "keyframe: add, move here, delete"),
    ("[ ], Space", "keyframe before or next; play"),
    ("Ctrl+S", "save the path"),
    ("P", "screenshot"),
    (
        "Tab, H, M, F1, Esc",
        "panel, times, floor plan, this help, close (this help first)",
    ),
];

/// The help.
pub(crate) fn help(context: &Context, shows: &mut Shows) {
    egui::Window::new("Keys")
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .resizable(false)
        .collapsible(false)
        .open(&mut shows.help)
        .show(context, |ui| {
            egui::Grid::new("keys").show(ui, |ui| {
                for (keys, what) in HELP {
                    ui.label(RichText::new(keys).strong());
                    ui.label(what);
                    ui.end_row();
                }
            });
        });
}
