//! Blending fields, pictures, interiors and layered depth images.
//!
//! One program, as linking one for each file takes minutes.

mod between_corners;
mod blend;
mod blend_continuity;
mod blend_promises;
mod bounded;
mod common;
mod edges;
mod engines;
mod engines_nothing;
mod engines_photos;
mod engines_triangulated;
mod exposure;
mod goals;

mod hard_places;
mod house;
mod interior_captured;
mod interior_concave;
mod interior_corner;
mod interior_files;
mod interior_geometry;
mod interior_gpu;
mod interior_hatch;
mod interior_kept;
mod interior_neighbourhood;
mod interior_photos;
mod interior_tour;
mod interior_walk;
mod invariance;
mod ldi;
mod ldi_order;
mod lens_edge;
mod limits;
mod masks;
mod mattes;
mod mesh;
mod near;
#[path = "../../../tests/once/mod.rs"]
mod once;
mod points;
mod residency;
mod soft;
mod time;
