//! Procedural scenes ray-traced with exact colour, depth and pose.
