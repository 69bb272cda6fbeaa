//! Other programs' calibrations: read, and refused.

mod broken;
mod bundler;
mod captures;
mod llff;
mod meshroom;
mod nvm;
mod transforms;
