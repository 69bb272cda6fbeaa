//! The blending field, its triangulation, and the engine that draws it.

pub mod triangulation;
