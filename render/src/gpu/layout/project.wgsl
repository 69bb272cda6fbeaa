// A test's harness: where points fall in one photo.

@group(1) @binding(0) var<storage, read> points: array<vec4f>;
// Pixel, fovBlend, depth.
@group(1) @binding(1) var<storage, read_write> sights: array<vec4f>;

override SOURCE_IDX: u32;

@compute @workgroup_size(64)
fn project(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&points) {
        return;
    }
    let point = points[id.x];
    let sight = see(SOURCE_IDX, point.xyz, point.w);
    sights[id.x] = vec4f(sight.pixel, fov_blend(SOURCE_IDX, sight), sight.depth);
}
