// Marks the photos that the exact field will sample, so that no other is decoded.

@group(1) @binding(0) var<storage, read_write> used: array<atomic<u32>>;

@compute @workgroup_size(8, 8)
fn mark(@builtin(global_invocation_id) within: vec3u) {
    if any(within.xy >= params.part_size) {
        return;
    }
    let pixel = params.part_origin + within.xy;
    let ray = ray_through(pixel);
    let plane = plane_at(pixel);
    let s = inverse_distance(plane, ray);
    if s < 0.0 || all(ray == vec3f(0.0)) {
        return;
    }
    var nearest = nearest_sources(ray, s, plane.xyz);
    let count = weigh(&nearest);
    for (var n = 0u; n < count; n++) {
        if nearest.a[n] > 0.0 {
            atomicOr(&used[nearest.source_idx[n]], 1u);
        }
    }
}
