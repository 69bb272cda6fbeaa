//! Options that choose a proxy, and what to say of one.

use super::Usage;
use super::damaged::leave_out;
use super::output::say;
use super::session::spinner;
use anyhow::Context;
use capture::as_argument;
use clap::Args;
use glam::DVec3;
use lumigraph::scene::{Fitted, Kind, Scene, SceneError, SceneProxy, Trial, trials_text};
use proxy::Proxy;
use proxy::mesh::Coarse;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

/// Which surface.
#[derive(Args, Clone)]
pub(super) struct ProxyArgs {
    /// plane, dominant-plane, view-plane, tunnel, hull, points, carved, depth, dense, carved-dense,
    /// auto, or a file: a proxy's (.json, .ply, .glb) or a mesh (.gltf, .obj) [default: the scene's own, else
    /// auto]
    #[arg(long, value_name = "KIND|FILE")]
    pub(super) proxy: Option<String>,
}

/// A proxy and where it came from.
pub(super) struct ChosenProxy {
    pub(super) proxy: Proxy,
    origin: String,
    trials: Vec<Trial>,
    /// Photos that were found damaged as it was fitted, by name, with what is wrong with each.
    pub(super) left_out: BTreeMap<String, String>,
}

/// Fits a proxy of a kind, or the best, and says on stderr what people should know of it. With
/// `strict` a photo that it finds damaged is an error.
pub(super) fn fit(
    scene: &Scene,
    kind: Option<Kind>,
    without: &BTreeSet<String>,
    strict: bool,
) -> anyhow::Result<Fitted> {
    let start = Instant::now();
    let busy = spinner("fitting the proxy");
    let fitted = match kind {
        Some(kind) => scene.fit(kind, without),
        None => scene.fit_best(without),
    };
    busy.finish_and_clear();
    if let Err(SceneError::Damaged(damaged)) = &fitted {
        scene.check_enough(without, damaged)?;
    }
    let fitted = fitted.context("no such proxy can be fitted to this scene")?;
    leave_out(scene, &fitted.left_out, &mut without.clone(), strict)?;
    if let Some(note) = scene.note_of_unobserved(kind) {
        say!("note: {note}");
    }
    if let Some(note) = &fitted.note {
        say!("note: {note}; see `lumigraph proxy`");
    }
    if !fitted.trials.is_empty() {
        let kind = fitted.proxy.kind();
        say!(
            "proxy: {kind}, by photos held out for it: {} ({:.1} s)",
            trials_text(&fitted.trials),
            start.elapsed().as_secs_f64()
        );
    }
    Ok(fitted)
}

impl ProxyArgs {
    /// Whether [`Self::choose`] takes a scene's own whatever it was fitted with: it has one, none is asked for, and
    /// no photo is held out.
    ///
    /// # Errors
    /// It would, and that is lost, or of none of the scene's photos.
    #[cfg(feature = "window")]
    pub(super) fn takes_own(
        &self,
        scene: &Scene,
        without: &BTreeSet<String>,
    ) -> Result<bool, SceneError> {
        let is_taken = self.proxy.is_none() && scene.proxy.is_some() && without.is_empty();
        if is_taken {
            scene.check_own_proxy()?;
        }
        Ok(is_taken)
    }

    /// Whether kinds are to be compared.
    pub(super) fn is_searched(&self, scene: &Scene, without: &BTreeSet<String>) -> bool {
        match (self.proxy.as_deref(), &scene.proxy) {
            (Some(asked), _) => asked == "auto",
            // Of one that is lost no kind is known, and it is an error.
            (None, Some(own)) => {
                let is_another = own.surface().is_ok() && seen_by(own, without).is_some();
                is_another && kind_of(own, scene).is_none()
            }
            (None, None) => true,
        }
    }

    /// The proxy asked for. A fitted one rests on none of the photos in `without`. With `strict` a
    /// photo that fitting it finds damaged is an error.
    pub(super) fn choose(
        &self,
        scene: &Scene,
        without: &BTreeSet<String>,
        strict: bool,
    ) -> anyhow::Result<ChosenProxy> {
        let chosen = self.found(scene, without, strict)?;
        let mut fewer = without.clone();
        fewer.extend(chosen.left_out.keys().cloned());
        say_lack(scene, &chosen.proxy, &fewer)?;
        Ok(chosen)
    }

    /// The same, but for a note on what it is made of.
    fn found(
        &self,
        scene: &Scene,
        without: &BTreeSet<String>,
        strict: bool,
    ) -> anyhow::Result<ChosenProxy> {
        let fitted = |kind: Option<Kind>| {
            let fitted = fit(scene, kind, without, strict)?;
            Ok(ChosenProxy {
                proxy: fitted.proxy,
                origin: fitted.how,
                trials: fitted.trials,
                left_out: fitted.left_out,
            })
        };
        match self.proxy.as_deref() {
            Some("auto") => fitted(None),
            Some(name) if let Some(kind) = Kind::from_name(name) => fitted(Some(kind)),
            Some(file) if is_proxy_file(file) && !Path::new(file).exists() => Err(Usage(format!(
                "--proxy {file}: there is no such file; `lumigraph proxy SCENE KIND -o {}` makes one",
                as_argument(Path::new(file))
            ))
            .into()),
            Some(file) if is_proxy_file(file) => {
                let proxy = proxy::read(Path::new(file))?;
                scene.check_proxy(&proxy, Path::new(file))?;
                if let Proxy::Mesh(solid) = &proxy
                    && let Some(coarse) = Coarse::of(solid.mesh())
                {
                    say!(
                        "warning: {file}: {coarse}, and give it to `lumigraph proxy SCENE mesh FILE --transform …`"
                    );
                }
                if !without.is_empty() {
                    say!(
                        "note: nothing tells whether {file} was fitted with held-out photos, too; \
                         --proxy KIND fits one without"
                    );
                }
                Ok(ChosenProxy {
                    proxy,
                    origin: file.to_owned(),
                    trials: Vec::new(),
                    left_out: BTreeMap::new(),
                })
            }
            Some(other) => Err(Usage(format!(
                "--proxy {other}: expected {}, auto, or a file ending in {}",
                Kind::ALL.map(Kind::name).join(", "),
                FILES.map(|e| format!(".{e}")).join(", ")
            ))
            .into()),
            None => match &scene.proxy {
                Some(own) => {
                    let proxy = own.surface()?;
                    if let Some(name) = seen_by(own, without) {
                        let kind = kind_of(own, scene);
                        let named = |kind: Kind| format!(" {}", kind.name());
                        let another = kind.map_or_else(String::new, named);
                        say!(
                            "note: the scene's own proxy was fitted with held-out {name}; \
                             fitting another{another} without"
                        );
                        return fitted(kind);
                    }
                    scene.check_own_proxy()?;
                    Ok(ChosenProxy {
                        proxy: proxy.clone(),
                        origin: "the scene's own".to_owned(),
                        trials: Vec::new(),
                        left_out: BTreeMap::new(),
                    })
                }
                None => {
                    let chosen = fitted(None)?;
                    let is_kept = scene.folder.is_some() && without.is_empty();
                    if is_kept && !chosen.trials.is_empty() {
                        say!("note: `lumigraph proxy SCENE auto` keeps this proxy with the scene");
                    }
                    Ok(chosen)
                }
            },
        }
    }
}

/// Says so where a proxy is made of sparse points for every view, and the photos but those of the given names observe
/// none.
pub(super) fn say_lack(
    scene: &Scene,
    proxy: &Proxy,
    without: &BTreeSet<String>,
) -> Result<(), SceneError> {
    if let Some(note) = scene.note_of_lack(proxy, without)? {
        say!("note: {note}");
    }
    Ok(())
}

/// A photo among some that a scene's own proxy was fitted with, if there is one.
pub(super) fn seen_by<'n>(own: &SceneProxy, names: &'n BTreeSet<String>) -> Option<&'n String> {
    // Of what the photos that are left see, for every view.
    if matches!(
        own.proxy,
        Ok(Proxy::ViewPlane | Proxy::Points { within: None })
    ) {
        return None;
    }
    let unseen = own.fitted_without.as_ref()?;
    names.iter().find(|name| !unseen.contains(name))
}

/// The kind that a scene's own proxy was fitted as; `None` where kinds are to be compared anew, and of one that is
/// lost.
pub(super) fn kind_of(own: &SceneProxy, scene: &Scene) -> Option<Kind> {
    match own.surface().ok()? {
        // Two kinds are planes, and files do not say which: it is the one that gives this plane.
        Proxy::Plane(plane) => {
            let names = own.fitted_without.iter().flatten();
            let without: BTreeSet<String> = names.cloned().collect();
            let off = |kind: Kind| {
                let again = scene.fit(kind, &without).ok()?.proxy.plane()?;
                let turned = again.normal().distance(plane.normal());
                Some((kind, turned + again.signed_distance(plane.point()).abs()))
            };
            let kinds = [Kind::Plane, Kind::DominantPlane].into_iter();
            let nearest = kinds.filter_map(off).min_by(|a, b| a.1.total_cmp(&b.1));
            nearest.map(|(kind, _)| kind)
        }
        // Comparing kinds alone finds that a mesh is to hide nothing.
        Proxy::Mesh(solid) if solid.kind().can_occlude_itself() && !solid.occludes() => None,
        proxy => Kind::from_name(proxy.kind()),
    }
}

/// What proxies' files end in.
const FILES: [&str; 5] = ["json", "glb", "gltf", "ply", "obj"];

fn is_proxy_file(name: &str) -> bool {
    let extension = Path::new(name).extension().unwrap_or_default();
    FILES.iter().any(|e| extension.eq_ignore_ascii_case(e))
}

impl ChosenProxy {
    pub(super) fn json(&self) -> Value {
        let mut value = proxy_json(&self.proxy);
        value["from"] = json!(self.origin);
        if !self.trials.is_empty() {
            let trial = |t: &Trial| {
                let (kind, occludes) = (t.kind.name(), t.occludes);
                match &t.score {
                    Ok(db) => json!({"kind": kind, "occludes": occludes, "psnr": db}),
                    Err(why) => json!({"kind": kind, "occludes": occludes, "not": why}),
                }
            };
            value["trials"] = json!(self.trials.iter().map(trial).collect::<Vec<_>>());
        }
        value
    }

    pub(super) fn text(&self) -> String {
        format!("{} ({})", proxy_text(&self.proxy), self.origin)
    }
}

pub(super) fn proxy_json(proxy: &Proxy) -> Value {
    let mut value = json!({"kind": proxy.kind()});
    if let Proxy::Plane(plane) = proxy {
        value["point"] = json!(plane.point().to_array());
        value["normal"] = json!(plane.normal().to_array());
    }
    value
}

/// What bounds a proxy, if anything: the hull of silhouettes, or one that was given by hand.
fn within_text(proxy: &Proxy) -> String {
    proxy.within().map_or_else(String::new, |hull| {
        let count = hull.mesh().triangles.len();
        format!(", within a hull of {count} triangles")
    })
}

/// Of the greatest of three coordinates: these are told to six decimals, others in powers of ten.
const USUAL: Range<f64> = 1e-3..1e9;

pub(super) fn proxy_text(proxy: &Proxy) -> String {
    let plane = match proxy {
        Proxy::Plane(plane) => plane,
        Proxy::ViewPlane => return "a plane for every view".to_owned(),
        Proxy::Points { .. } => {
            let points = "the sparse points that views like the desired one observe";
            return format!("{points}{}", within_text(proxy));
        }
        Proxy::Dense(dense) => {
            let (count, within) = (dense.points.len(), within_text(proxy));
            return format!(
                "those of {count} dense points that views like the desired one see{within}"
            );
        }
        Proxy::Mesh(solid) => {
            let (kind, count) = (solid.kind().name(), solid.mesh().triangles.len());
            return format!("{kind} of {count} triangles{}", within_text(proxy));
        }
    };
    // Whatever the unit, as many digits as tell planes apart, and no noise beside them.
    let is_usual = |most: f64| most == 0.0 || USUAL.contains(&most);
    let triple = |v: DVec3| match is_usual(v.abs().max_element()) {
        true => format!("({:.6}, {:.6}, {:.6})", v.x, v.y, v.z),
        false => format!("({:.6e}, {:.6e}, {:.6e})", v.x, v.y, v.z),
    };
    format!(
        "plane through {} across {}",
        triple(plane.point()),
        triple(plane.normal())
    )
}

#[cfg(all(test, feature = "window"))]
mod tests {
    use super::*;
    use lumigraph::scene::file::Extra;
    use std::path::PathBuf;

    #[test]
    fn a_scenes_own_points_of_other_photos_are_not_taken_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let capture = folder.path().join("wall");
        let options = datasets::Options {
            size: Some((64, 48)),
            views: Some(5),
            samples_per_side: Some(2),
        };
        let wall = datasets::by_name("wall", &options).unwrap();
        datasets::write(&wall, &capture).unwrap();
        let (mut scene, _) = Scene::open(&capture, false).unwrap();
        scene.folder = Some(PathBuf::from("scene"));
        let none = BTreeSet::new();
        let any = ProxyArgs { proxy: None };
        assert!(!any.takes_own(&scene, &none).unwrap(), "it has none");

        let mut of_photo = |name: &str| {
            let text = format!(
                r#"{{"version": 1, "kind": "dense", "views": ["{name}"],
                    "points": [[0, 0, 1], [1, 0, 1], [0, 1, 1]], "seen_by": [[0], [0], [0]]}}"#
            );
            scene.proxy = Some(SceneProxy {
                proxy: Ok(proxy::parse(Path::new("proxy.json"), text.as_bytes()).unwrap()),
                file: "proxy.json".to_owned(),
                fitted_without: Some(Vec::new()),
                other: Extra::new(),
            });
            any.takes_own(&scene, &none)
        };
        assert!(of_photo("0001.png").unwrap());
        let error = of_photo("nope.jpg").unwrap_err().to_string();
        let said = Path::new("scene").join("proxy.json");
        let said = format!("{}: its points were found in nope.jpg", said.display());
        assert!(error.starts_with(&said), "{error}");
        // Nobody asks for it.
        let plane = ProxyArgs {
            proxy: Some("plane".to_owned()),
        };
        assert!(!plane.takes_own(&scene, &none).unwrap());
        let held_out = BTreeSet::from(["0002.png".to_owned()]);
        assert!(!any.takes_own(&scene, &held_out).unwrap());
    }
}
