//! The window: looking at a lumigraph or walking through an interior, and seeing why it looks so.
//!
//! [`run`] opens it. Three threads work: this one takes events and puts frames on the screen, one
//! draws pictures, as `render` and `walk` would, and one loads, by a function that it is given.
//! Where one is and what is shown is the plain data of [`State`], which knows no window.

mod camera;
mod compose;
mod content;
mod draw_house;
mod draw_scene;
mod keyframes;
mod keys;
mod lines;
mod loader;
mod memory;
mod overlay;
mod panel;
mod picture;
mod plan;
mod screen;
mod shot;
mod state;
mod trace;
mod walker;
mod window;
mod worker;

pub use content::{Content, House, Space, Stop, Times};
pub use keyframes::Keyframes;
pub use loader::{Progress, Teller};
pub use picture::{DepthGrid, Hover, Layer, Lines, Look, Request, Shown, Support};
pub use shot::Shot;
pub use state::{Action, Button, Mode, Motion, State};
pub use walker::Obstacles;
pub use window::{ViewError, ViewOptions, run};
pub use worker::{News, Worker, WorkerOptions};
