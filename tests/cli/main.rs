//! The built program, end to end, on small synthetic captures.

mod bad_input;
mod captures;
mod evaluate;
mod field;
mod formats;
mod gpu;
mod help;
mod opencv;
mod render;
mod repeat;
mod run;
mod scene;
mod uncalibrated;
