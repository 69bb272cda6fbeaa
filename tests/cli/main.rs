//! The built program, end to end, on small synthetic captures.

mod bad_input;
mod bench;
mod captures;
mod degenerate;
mod evaluate;
mod export;
mod exposure;
mod faults;
mod field;
mod formats;
mod gpu;
mod help;
mod hull;
mod interior;
mod interior_folder;
mod kinds;
mod ldis;
mod masked_depth;
mod masks;
mod memory;
mod opencv;
mod path;
mod render;
mod repeat;
mod report;
mod run;
mod scene;
mod shape;
mod surface;
mod time;
mod turntable;
mod uncalibrated;
mod undistort;
#[cfg(feature = "window")]
mod view;
mod walk;
