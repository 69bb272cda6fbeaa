//! Pictures of a triangulation.

use std::fmt::Write;

use glam::DVec2;

use super::Triangulation;

/// A triangulation as an SVG picture of `width` × `height` pixels: thin lines, each triangle
/// in its colour of `fills` (sRGB, one a triangle; without it, unfilled), and a dot at each
/// of `points` (epipoles, in pixels).
///
/// # Panics
/// If there are fills, but not one for each triangle.
pub fn to_svg(
    triangulation: &Triangulation,
    width: u32,
    height: u32,
    fills: Option<&[[u8; 3]]>,
    points: &[DVec2],
) -> String {
    let Triangulation {
        vertices,
        triangles,
        ..
    } = triangulation;
    if let Some(fills) = fills {
        assert_eq!(
            fills.len(),
            triangles.len(),
            "one fill colour for each triangle"
        );
    }
    // Lines and dots keep their looks whatever the size the picture is shown at.
    let side = f64::from(width.max(height));
    let (line, dot) = (side / 1000.0, side / 200.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n\
         <g fill=\"none\" stroke=\"#333\" stroke-width=\"{line}\" stroke-linejoin=\"round\">\n"
    );
    // Writing to a string cannot fail.
    for (i, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| vertices[v as usize]);
        let _ = write!(
            svg,
            "<path d=\"M{} {}L{} {}L{} {}Z\"",
            a.x, a.y, b.x, b.y, c.x, c.y
        );
        if let Some([r, g, b]) = fills.map(|fills| fills[i]) {
            let _ = write!(svg, " fill=\"#{r:02x}{g:02x}{b:02x}\"");
        }
        svg.push_str("/>\n");
    }
    svg.push_str("</g>\n<g fill=\"#d33\" stroke=\"white\" stroke-width=\"");
    let _ = writeln!(svg, "{line}\">");
    for point in points {
        let _ = writeln!(
            svg,
            "<circle cx=\"{}\" cy=\"{}\" r=\"{dot}\"/>",
            point.x, point.y
        );
    }
    svg.push_str("</g>\n</svg>\n");
    svg
}
