// Draws the exact field.

@group(1) @binding(0) var photos: texture_2d_array<f32>;
@group(1) @binding(1) var photo_sampler: sampler;

@group(2) @binding(0) var picture: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(8, 8)
fn draw(@builtin(global_invocation_id) within: vec3u) {
    if any(within.xy >= params.part_size) {
        return;
    }
    let pixel = params.part_origin + within.xy;
    textureStore(picture, pixel, vec4u(pack4x8unorm(color(pixel))));
}

// One triangle that covers the image.
@vertex
fn whole_image(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4f {
    let corner = vec2f(vec2u(vertex_idx & 1u, vertex_idx >> 1u));
    return vec4f(corner * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn draw_fragment(@builtin(position) position: vec4f) -> @location(0) u32 {
    return pack4x8unorm(color(vec2u(position.xy)));
}

fn color(pixel: vec2u) -> vec4f {
    let ray = ray_through(pixel);
    let plane = plane_at(pixel);
    let s = inverse_distance(plane, ray);
    if s < 0.0 || all(ray == vec3f(0.0)) {
        return vec4f(0.0);
    }
    var nearest = nearest_sources(ray, s, plane.xyz);
    let count = weigh(&nearest);
    var mix = Mix(vec4f(0.0), 0.0);
    for (var n = 0u; n < count; n++) {
        if nearest.a[n] <= 0.0 {
            continue;
        }
        let source_idx = nearest.source_idx[n];
        let sight = see(source_idx, ray, s);
        let layer = u32(source_data(source_idx, KIND).y);
        let uv = sight.pixel / params.array_size;
        let level = level_of_detail(source_idx, sight, ray, plane.xyz);
        let color = textureSampleLevel(photos, photo_sampler, uv, layer, level - params.finest);
        add(&mix, nearest.a[n], color, source_idx);
    }
    return resolve(mix);
}
