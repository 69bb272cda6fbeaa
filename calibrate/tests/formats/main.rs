//! Other programs' calibrations: read, and refused.

mod broken;
mod bundler;
mod captures;
mod nvm;
mod transforms;
