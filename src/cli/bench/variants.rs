//! A scene with what can be changed of it, and the photos that judge.

use super::super::surface::{kind_of, seen_by};
use super::measured::Effort;
use super::settings::{Renderer, Setting};
use anyhow::Context;
use calibrate::View;
use image::RgbaImage;
use lumigraph::scene::{Kind, Scene, SceneProxy, Truth};
use proxy::Proxy;
use render::{Engine, Frame, Lumigraph, RenderError, prepare_within};
use std::collections::{BTreeMap, BTreeSet};

/// A photo that judges.
pub(super) struct HeldOut {
    pub(super) name: String,
    pub(super) view: View,
    pub(super) truth: Truth,
}

/// A scene with what can be changed of it.
pub(super) struct Variants<'a> {
    pub(super) scene: &'a Scene,
    pub(super) unmatched: Scene,
    pub(super) without: &'a BTreeSet<String>,
    pub(super) default: Proxy,
    pub(super) fitted: BTreeMap<&'static str, Proxy>,
}

impl Variants<'_> {
    /// What a setting draws from, no photo decoded.
    pub(super) fn lumigraph(&self, setting: &Setting) -> anyhow::Result<Lumigraph> {
        let scene = if setting.exposure {
            self.scene
        } else {
            &self.unmatched
        };
        let proxy = match setting.kind {
            None => &self.default,
            Some(kind) => self.fitted.get(kind.name()).context("was fitted before")?,
        };
        let sizes = self.scene.reconstruction.cameras.values();
        let longest = sizes.map(|c| c.width.max(c.height)).max().unwrap_or(1);
        let long_side = match setting.reduced {
            1 => u32::MAX,
            times => (longest / times).max(16),
        };
        Ok(scene.reduced_lumigraph(self.without, proxy.clone(), long_side)?)
    }
}

/// A view drawn as a setting has it.
pub(super) fn draw(
    engine: &mut Engine,
    lumigraph: &Lumigraph,
    view: &View,
    setting: &Setting,
) -> Result<RgbaImage, RenderError> {
    let frame = Frame::new(lumigraph, view.clone(), setting.options);
    match setting.renderer {
        Renderer::By(method) => engine.render(&frame, method),
        Renderer::Within(bound) => {
            let chosen = prepare_within(&frame, bound)?;
            engine.draw(&frame, &chosen.prepared)
        }
    }
}

/// The photos that judge, spread evenly over those held out, reduced.
pub(super) fn held_out(
    scene: &Scene,
    without: &BTreeSet<String>,
    effort: Effort,
) -> anyhow::Result<Vec<HeldOut>> {
    let names: Vec<&String> = without.iter().collect();
    let count = effort.views.min(names.len());
    let mut all = Vec::new();
    for i in 0..count {
        let name = names[(2 * i + 1) * names.len() / (2 * count)];
        let view = scene.view(name)?;
        let (width, height) = capture::reduced_size((view.width, view.height), effort.long_side);
        all.push(HeldOut {
            name: name.clone(),
            view: view.resized(width, height),
            truth: scene.truth(name, without)??.resized(width, height),
        });
    }
    Ok(all)
}

/// The surface that `render` would take, its kind where it was fitted, and what to say of it. What
/// takes minutes to choose is chosen only where time does not matter.
pub(super) fn default_proxy(
    scene: &Scene,
    without: &BTreeSet<String>,
    thorough: bool,
) -> anyhow::Result<(Proxy, Option<String>, String)> {
    let own = scene.proxy.as_ref();
    // Of one that is lost nobody knows the kind, to fit another of.
    own.map(SceneProxy::surface).transpose()?;
    if let Some(own) = own.filter(|own| seen_by(own, without).is_none()) {
        scene.check_own_proxy()?;
        return Ok((own.surface()?.clone(), None, "the scene's own".to_owned()));
    }
    let again = own.and_then(|own| kind_of(own, scene));
    let fitted = if let Some(kind) = again {
        scene.fit(kind, without)?
    } else if thorough {
        scene.fit_best(without)?
    } else {
        let kinds = [Kind::Points, Kind::Hull, Kind::Plane];
        let fitted = kinds.into_iter().find_map(|k| scene.fit(k, without).ok());
        fitted.context("no surface can be fitted")?
    };
    let kind = fitted.proxy.kind().to_owned();
    let text = format!("{kind}: {}", fitted.how);
    Ok((fitted.proxy, Some(kind), text))
}

/// Kinds of surface that are tried.
pub(super) fn tried(thorough: bool) -> Vec<Kind> {
    match thorough {
        true => Kind::ALL.to_vec(),
        false => vec![
            Kind::Plane,
            Kind::ViewPlane,
            Kind::Points,
            Kind::Tunnel,
            Kind::Hull,
        ],
    }
}
