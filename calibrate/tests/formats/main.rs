//! Other programs' calibrations: read, and refused.

mod broken;
mod bundler;
mod captures;
mod detect;
mod llff;
mod meshroom;
mod nvm;
mod openmvg;
mod transforms;
