//! From premultiplied colour to what image files hold.

/// Premultiplied sRGB and coverage (0…1) to straight 8-bit RGBA. Coverage zero is
/// transparent black.
pub(crate) fn straight_rgba8(premultiplied: [f64; 4]) -> [u8; 4] {
    let [r, g, b, alpha] = premultiplied;
    if !(alpha > 0.0) {
        return [0; 4];
    }
    let byte = |v: f64| (v * 255.0 + 0.5).clamp(0.0, 255.0) as u8;
    let alpha_byte = byte(alpha);
    if alpha_byte == 0 {
        return [0; 4];
    }
    [
        byte(r / alpha),
        byte(g / alpha),
        byte(b / alpha),
        alpha_byte,
    ]
}
