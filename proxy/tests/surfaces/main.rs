//! Surfaces made, read, and found rooms in.
//!
//! One program, as linking one for each file takes minutes.

mod carve;
mod common;
mod copies;
mod depth;
mod find;
mod find_captured;
mod find_odd;
mod find_refused;
mod hostile;
mod house;
mod hull;
mod hull_photos;
mod interior;
mod interior_nodes;
mod interior_odd;
mod interior_viewers;
mod mesh_files;
mod mesh_gltf;
mod mesh_obj;
mod mesh_ply;
mod model_files;
mod model_looks;
#[path = "../../../tests/once/mod.rs"]
mod once;
mod portals;
mod room;
mod strays;
