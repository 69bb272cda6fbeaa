//! Options that are given for nothing.

use super::interior::{is_interior, is_without_photos};
use super::options::Renderer;
use super::output::say;
use clap::ArgMatches;
use clap::parser::ValueSource;
use render::interior::{LibraryOptions, Painter, PortalFill};
use std::path::{Path, PathBuf};

/// Says which of a command's options were given for nothing, as another, or what is opened, leaves them
/// no effect.
pub(super) fn say_unused(command: &str, given: &ArgMatches) {
    // Of options that the command does not have nobody may ask.
    let has = |id: &str| matches!(given.try_contains_id(id), Ok(true));
    let is_given = |id: &str| has(id) && given.value_source(id) == Some(ValueSource::CommandLine);
    if command == "view"
        && let Ok(Some(scene)) = given.try_get_one::<PathBuf>("scene")
    {
        say_unused_of_view(scene, is_given);
        if is_interior(scene) {
            return;
        }
    }
    if command == "bench" && is_given("stress") {
        let why = "--stress writes no report, and draws by all that there is";
        say_idle(&["device", "output"], is_given, why);
    }
    // These leave no photo out.
    let of_all = match command {
        "export" => Some("all photos and points are exported"),
        "info" => Some("all photos and points are counted"),
        _ => None,
    };
    if let Some(why) = of_all {
        say_idle(&["keep_weak"], is_given, why);
    }
    if command == "proxy" && ["point", "through", "mesh"].into_iter().any(is_given) {
        let why = "a surface that is given by hand rests on no photos";
        say_idle(&["hold_out"], is_given, why);
    }
    if command == "plan" && matches!(given.try_get_one::<usize>("views"), Ok(Some(1))) {
        say_idle(&["span"], is_given, "a single camera stands in the middle");
    }
    let renderer = given.try_get_one::<Renderer>("renderer");
    // A triangulation that is drawn has a grid, whatever renders.
    if matches!(renderer, Ok(Some(Renderer::Exact))) && is_given("grid") && !has("triangulation") {
        say!("note: --grid changes nothing: --renderer exact has no grid");
    }
    let portals = given.try_get_many::<String>("portals");
    let portals = portals.ok().flatten().unwrap_or_default();
    let portals: Vec<&str> = portals.map(String::as_str).collect();
    if command == "walk" {
        // Of what may be left out, columns are all that is of LDIs alone.
        let kept = given.try_get_raw("no_skip").ok().flatten();
        let are_columns = kept.is_some_and(|mut kept| kept.all(|what| what == "columns"));
        let is_given = |id: &str| match id {
            COLUMNS => is_given("no_skip") && are_columns,
            id => is_given(id),
        };
        say_unused_of_walk(&portals, is_given);
    }
    if (command == "walk" || command == "ldis")
        && let Ok(Some(interior)) = given.try_get_one::<PathBuf>("interior")
    {
        // Of a walk without LDIs that was said already.
        let makes_ldis = command == "ldis" || portals.iter().any(|p| *p == "all" || *p == "ldi");
        let is_given = |id: &str| is_given(id) && (id != "ldi_from" || makes_ldis);
        say_unused_of_model(interior, is_given);
    }
}

/// Of `--no-skip`, for columns alone.
const COLUMNS: &str = "no_skip=columns";

/// Says of those of some options that are given that they change nothing, and why.
fn say_idle(ids: &[&str], is_given: impl Fn(&str) -> bool, why: &str) {
    let given = ids.iter().filter(|id| is_given(id));
    let option = |id: &&str| format!("--{}", id.replace('_', "-"));
    let given: Vec<String> = given.map(option).collect();
    let given = match &given[..] {
        [] => return,
        [one] => format!("{one} changes"),
        [most @ .., last] => format!("{} and {last} change", most.join(", ")),
    };
    say!("note: {given} nothing: {why}");
}

/// Of `walk`, by what portals show.
fn say_unused_of_walk(portals: &[&str], is_given: impl Fn(&str) -> bool) {
    type Holds = fn(&PortalFill) -> bool;
    let is_ldi: Holds = |fill| *fill == PortalFill::Ldi;
    let is_warped: Holds = |fill| matches!(fill, PortalFill::Warp1 | PortalFill::Warp2);
    let is_image: Holds = |fill| fill.shows_images();
    let of_images = ["near", "persist", "reference_size", "reference_views"];
    let of_ldis = ["ldi_views", "ldi_from", "no_ldi_files", COLUMNS];
    for (is_meant, ids, why) in [
        (is_image, &of_images[..], "portals show no images"),
        (is_warped, &["splat"], "no image is warped"),
        (is_ldi, &of_ldis, "portals show no LDIs"),
    ] {
        let kinds = PortalFill::ALL.into_iter().filter(is_meant);
        let kinds: Vec<&str> = kinds.map(PortalFill::name).collect();
        if !portals.iter().any(|p| *p == "all" || kinds.contains(p)) {
            let why = format!("{why} (--portals {} or all)", kinds.join(", "));
            say_idle(ids, &is_given, &why);
        }
    }
}

/// Of what draws interiors, where one has no photos, or they are not to be drawn.
fn say_unused_of_model(interior: &Path, is_given: impl Fn(&str) -> bool) {
    let of_photos = ["no_photos", "no_exposure", "ldi_from"];
    if of_photos.iter().any(|id| is_given(id)) && is_without_photos(interior) {
        let why = format!("{} is of a model, not of photos", interior.display());
        say_idle(&of_photos, is_given, &why);
    } else if is_given("no_photos") {
        say_idle(
            &of_photos[1..],
            is_given,
            "--no-photos draws the model's own colours",
        );
    }
}

/// What to say of `--ldi-views` where what draws makes LDIs of photos: each is of all of them. Which it does only the
/// opened photos tell.
pub(super) fn note_of_ldi_views(
    options: &LibraryOptions,
    painter: &Painter,
) -> Option<&'static str> {
    let of_all = options.with_photos(painter.captured()).ldi_views.is_none();
    (options.ldi_views.is_some() && of_all)
        .then_some("--ldi-views changes nothing: LDIs are made of photos")
}

/// Of `view`, by what is opened, where there is something.
fn say_unused_of_view(scene: &Path, is_given: impl Fn(&str) -> bool) {
    let of_scenes = [
        "strict",
        "keep_weak",
        "proxy",
        "renderer",
        "grid",
        "blend",
        "resolution",
        "k",
        "beta",
        "no_skip",
        "gpu_memory",
        "period",
        "time_window",
        "time",
    ];
    let of_interiors = ["portals", "ldi_views"];
    let (ids, what) = match is_interior(scene) {
        true => (&of_scenes[..], "is an interior"),
        false => (&of_interiors[..], "is no interior"),
    };
    if scene.exists() {
        say_idle(ids, is_given, &format!("{} {what}", scene.display()));
    }
}
