//! A small COLMAP model in both formats.

use calibrate::colmap;
use std::path::Path;

/// `cameras.txt`, `images.txt` and `points3D.txt`.
pub const TEXT: [&str; 3] = [
    "# comment\n1 SIMPLE_RADIAL 100 80 90 50 40 -0.1\n7 PINHOLE 64 48 60 61 32 24\n",
    "1 1 0 0 0 0 0 0 1 a.jpg\n55 40 3 10 20 -1\n\
     2 0.7071067811865476 0 0.7071067811865476 0 -1 0.5 2 7 dir\\b c.jpg\n32 24 3\n",
    "3 1 0 10 1 2 255 0.5 1 0 2 0\n",
];

/// The same as `cameras.bin`, `images.bin` and `points3D.bin`.
pub fn binary() -> &'static [Vec<u8>; 3] {
    static BINARY: std::sync::OnceLock<[Vec<u8>; 3]> = std::sync::OnceLock::new();
    BINARY.get_or_init(|| {
        let whole = colmap::parse_text(Path::new("model"), TEXT.map(str::as_bytes));
        written(
            &whole.expect("a model that is whole"),
            colmap::write_binary,
            "bin",
        )
    })
}

/// The three files that `write` makes of a reconstruction.
pub fn written(
    whole: &calibrate::Reconstruction,
    write: fn(&calibrate::Reconstruction, &Path) -> Result<(), colmap::ColmapError>,
    extension: &str,
) -> [Vec<u8>; 3] {
    let folder = std::env::temp_dir().join(format!("lumigraph-fuzz-{}", std::process::id()));
    write(whole, &folder).expect("the temporary folder takes files");
    let files = ["cameras", "images", "points3D"].map(|stem| {
        std::fs::read(folder.join(stem).with_extension(extension)).expect("just written")
    });
    std::fs::remove_dir_all(folder).expect("just written");
    files
}
