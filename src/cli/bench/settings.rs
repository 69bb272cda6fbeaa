//! What is measured: the default, and one thing changed at a time.

use lumigraph::scene::Kind;
use render::{Blend, FieldOptions, Method, Resolution};

/// How the field is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Renderer {
    By(Method),
    /// Whatever keeps within so many steps of 255.
    Within(f64),
}

/// What pictures are made with.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Setting {
    /// Which of its things differs from the default, and what it is then.
    pub(super) knob: &'static str,
    pub(super) value: String,
    pub(super) renderer: Renderer,
    pub(super) options: FieldOptions,
    /// The surface; `None` for the scene's default.
    pub(super) kind: Option<Kind>,
    /// Photos are reduced so many times, by area.
    pub(super) reduced: u32,
    /// Whether photos have gains: the scene's own, else those that are matched.
    pub(super) exposure: bool,
}

impl Setting {
    /// What nobody changed.
    pub(super) fn default_one() -> Self {
        Self {
            knob: "default",
            value: String::new(),
            renderer: Renderer::By(Method::TRIANGULATED),
            options: FieldOptions::default(),
            kind: None,
            reduced: 1,
            exposure: true,
        }
    }

    /// `grid 64`; unique among those of a scene.
    pub(super) fn name(&self) -> String {
        format!("{} {}", self.knob, self.value)
            .trim_end()
            .to_owned()
    }

    pub(super) fn is_default(&self) -> bool {
        self.knob == "default"
    }
}

/// All that is measured of a scene, the default first. `kinds` are the surfaces that the scene can
/// have and that are not its default.
pub(super) fn settings(thorough: bool, kinds: &[Kind]) -> Vec<Setting> {
    let mut all = vec![Setting::default_one()];
    let mut add = |knob: &'static str, value: String, change: &dyn Fn(&mut Setting)| {
        let mut setting = Setting::default_one();
        change(&mut setting);
        (setting.knob, setting.value) = (knob, value);
        all.push(setting);
    };
    let by = |method| Renderer::By(method);
    add("renderer", "exact".to_owned(), &|s| {
        s.renderer = by(Method::Exact);
    });
    let grids: &[u32] = if thorough {
        &[4, 8, 16, 24, 48, 64, 128]
    } else {
        &[8, 16, 64]
    };
    for &cells_across in grids {
        add("grid", cells_across.to_string(), &|s| {
            s.renderer = by(Method::Triangulated { cells_across });
        });
    }
    let bounds: &[f64] = if thorough {
        &[0.25, 0.5, 1.0, 2.0]
    } else {
        &[1.0]
    };
    for &bound in bounds {
        add("max-error", bound.to_string(), &|s| {
            s.renderer = Renderer::Within(bound)
        });
    }
    let ks: &[usize] = if thorough {
        &[1, 2, 3, 4, 6, 8, 12, 16]
    } else {
        &[2, 3, 8]
    };
    for &k in ks {
        add("k", k.to_string(), &|s| s.options.k = k);
    }
    let betas: &[f64] = if thorough {
        &[0.0, 0.03, 0.3, 1.0]
    } else {
        &[0.0, 1.0]
    };
    for &beta in betas {
        add("beta", beta.to_string(), &|s| s.options.beta = beta);
    }
    add("blend", "paper".to_owned(), &|s| {
        s.options.blend = Blend::Paper
    });
    if thorough {
        add("resolution", "distance".to_owned(), &|s| {
            s.options.resolution = Resolution::Distance;
        });
    }
    let reductions: &[u32] = if thorough { &[2, 4] } else { &[2] };
    for &times in reductions {
        add("photos", format!("1/{times}"), &|s| s.reduced = times);
    }
    add("exposure", "off".to_owned(), &|s| s.exposure = false);
    for &kind in kinds {
        add("proxy", kind.name().to_owned(), &|s| s.kind = Some(kind));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::scatter::COLORS;
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn settings_have_names_of_their_own_and_each_differs_from_the_default() {
        for thorough in [false, true] {
            let all = settings(thorough, &[Kind::Plane, Kind::Dense]);
            let names: BTreeSet<String> = all.iter().map(Setting::name).collect();
            assert_eq!(names.len(), all.len());
            let knobs: BTreeSet<&str> = all.iter().map(|setting| setting.knob).collect();
            assert!(knobs.len() <= COLORS.len());
            assert!(all[0].is_default() && !all[1..].iter().any(Setting::is_default));
            for setting in &all[1..] {
                let mut same = setting.clone();
                (same.knob, same.value) = (all[0].knob, all[0].value.clone());
                assert_ne!(same, all[0], "{}", setting.name());
            }
        }
    }
}
