// The triangulated field: each triangle carries a list of source views with their weights
// at its corners (Buehler et al. 2001, section 4.2), drawn once for the whole list.

struct Entry {
    source_idx: u32,
    weights: array<f32, 3>,
}

@group(1) @binding(0) var photos: texture_2d_array<f32>;
@group(1) @binding(1) var photo_sampler: sampler;
@group(1) @binding(2) var<storage, read> entries: array<Entry>;

struct Corner {
    @builtin(position) position: vec4f,
    // The corners' shares.
    @location(0) shares: vec3f,
    // First entry, and how many.
    @location(1) @interpolate(flat) list: vec2u,
}

@vertex
fn corner(
    @builtin(vertex_index) vertex_idx: u32,
    @location(0) pixel: vec2f,
    @location(1) list: vec2u,
) -> Corner {
    let ndc = pixel / vec2f(params.size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let which = vertex_idx % 3u;
    let shares = vec3f(vec3u(0u, 1u, 2u) == vec3u(which));
    return Corner(vec4f(ndc, 0.0, 1.0), shares, list);
}

@fragment
fn triangle(in: Corner) -> @location(0) vec4f {
    let ray = ray_through(vec2u(in.position.xy));
    let s = dot(params.plane, ray);
    if s < 0.0 || all(ray == vec3f(0.0)) {
        return vec4f(0.0);
    }
    var mix = Mix(vec4f(0.0), vec3f(0.0), 0.0);
    for (var i = in.list.x; i < in.list.x + in.list.y; i++) {
        let w = entries[i].weights;
        let weight = in.shares.x * w[0] + in.shares.y * w[1] + in.shares.z * w[2];
        if weight <= 0.0 {
            continue;
        }
        let source = &sources[entries[i].source_idx];
        let sight = see(source, ray, s);
        let a = weight * sight.a;
        if a > 0.0 {
            let color = sample_photo(photos, photo_sampler, source, sight, ray);
            add(&mix, a, color, (*source).gain.rgb);
        }
    }
    return resolve(mix);
}
