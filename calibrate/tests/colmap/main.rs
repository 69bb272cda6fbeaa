//! COLMAP models: read, written, and refused.

mod captures;
mod errors;
mod find;
mod round_trip;
#[cfg(unix)]
mod run;
mod synthetic;
