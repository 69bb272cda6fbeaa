//! A closed surface carved out of space by the photos' lines of sight.
#![allow(dead_code)]

mod delaunay;
mod lattice;
