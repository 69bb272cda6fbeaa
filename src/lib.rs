//! Unstructured lumigraph rendering: calibrated photos in, novel views out.
//!
//! A thin facade. The stages are crates of their own, in the order the data meets them;
//! [`scene`] is the folder that carries a photo set from one command to the next.
//!
//! ```no_run
//! use lumigraph::render::{DeviceChoice, Engine, FieldOptions, Frame, Method};
//! use lumigraph::scene::Scene;
//! use std::collections::BTreeSet;
//! use std::path::Path;
//!
//! let (scene, _warnings) = Scene::open(Path::new("my-capture"), false)?;
//! let proxy = scene.fit_best(&BTreeSet::new())?.proxy;
//! let lumigraph = scene.lumigraph(&BTreeSet::new(), proxy)?;
//! let desired = scene.view("a.jpg")?;
//! let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
//! let picture = Engine::open(DeviceChoice::Auto)?.render(&frame, Method::TRIANGULATED)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use {calibrate, capture, datasets, proxy, render};

pub mod bench;
pub mod scene;
