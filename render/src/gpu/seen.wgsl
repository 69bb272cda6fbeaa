// Which triangle of a triangulated field each pixel sees.

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat, either) triangle: u32,
}

@vertex
fn corner(
    @builtin(vertex_index) vertex_idx: u32,
    // In normalised device coordinates: not every device lets this stage read buffers.
    @location(0) at: vec2f,
) -> Corner {
    return Corner(vec4f(at, 0.0, 1.0), vertex_idx / 3u);
}

// One more than the triangle, zero for none.
@fragment
fn number(it: Corner) -> @location(0) u32 {
    return it.triangle + 1u;
}
