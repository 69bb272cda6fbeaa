//! COLMAP models: `cameras`, `images` and `points3D`, binary or text.
