// A model's triangles to pixels, in two passes: which triangle each pixel sees, then its colour
// and inverse depth. Lengths are in units of about the model's size, from its middle.

struct Camera {
    // Rows of the rotation from the world's axes to the camera's.
    rotation: array<vec4f, 3>,
    // The centre of projection, and what rounding left of it.
    eye: vec4f,
    eye_rest: vec4f,
    // Focal lengths and principal point, in pixels.
    lens: vec4f,
    // Width and height in pixels, the depth of the near plane, world units per unit here.
    picture: vec4f,
    // Bits of a table's row.
    row_bits: vec4u,
}

@group(0) @binding(0) var<uniform> camera: Camera;
// By triangle: its three corners and its material.
@group(0) @binding(1) var triangles: texture_2d<u32>;
// By corner: its place and its colour, then what rounding left of the place.
@group(0) @binding(2) var places: texture_2d<u32>;

// What is drawn: triangles, each with the window that it is seen in; 0 is everywhere.
@group(1) @binding(0) var list: texture_2d<u32>;
// By window from 1 on, and by row: the pixels from … to before.
@group(1) @binding(1) var windows: texture_2d<u32>;

// By pixel: one more than the triangle, 0 for none, and its window.
@group(2) @binding(0) var seen: texture_2d<u32>;
// By corner.
@group(2) @binding(1) var uvs: texture_2d<u32>;
// By material: base colour and wrap, then its texture's first texel, width and height.
@group(2) @binding(2) var materials: texture_2d<u32>;
// All textures', one after the other, row by row.
@group(2) @binding(3) var texels: texture_2d<u32>;

fn entry(i: u32) -> vec2u {
    let bits = camera.row_bits.x;
    return vec2u(i & ((1u << bits) - 1u), i >> bits);
}

// In the camera's frame. The eye is subtracted before anything is rounded to fewer digits.
fn corner_place(i: u32) -> vec3f {
    let place = bitcast<vec3f>(textureLoad(places, entry(2u * i), 0).xyz);
    let rest = bitcast<vec3f>(textureLoad(places, entry(2u * i + 1u), 0).xyz);
    let offset = (place - camera.eye.xyz) + (rest - camera.eye_rest.xyz);
    return vec3f(
        dot(camera.rotation[0].xyz, offset),
        dot(camera.rotation[1].xyz, offset),
        dot(camera.rotation[2].xyz, offset),
    );
}

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) @interpolate(flat, either) triangle: u32,
    @location(1) @interpolate(flat, either) window: u32,
}

@vertex
fn corner(@builtin(vertex_index) vertex_idx: u32) -> Corner {
    let listed = textureLoad(list, entry(vertex_idx / 3u), 0).xy;
    let corners = textureLoad(triangles, entry(listed.x), 0);
    let p = corner_place(corners[vertex_idx % 3u]);
    let focal = camera.lens.xy;
    let principal = camera.lens.zw;
    let at = 2.0 * (focal * p.xy + principal * p.z) / camera.picture.xy - p.z;
    // Depth over w is near / z: the nearer the greater.
    return Corner(vec4f(at.x, -at.y, camera.picture.z, p.z), listed.x, listed.y);
}

fn is_outside(window: u32, pixel: vec2u) -> bool {
    if window == 0u {
        return false;
    }
    let open = textureLoad(windows, entry((window - 1u) * u32(camera.picture.y) + pixel.y), 0).xy;
    return pixel.x < open.x || pixel.x >= open.y;
}

// A triangle whose depths the device interpolates well.
@fragment
fn in_front(it: Corner) -> @location(0) vec2u {
    return vec2u(it.triangle + 1u, 0u);
}

@fragment
fn in_front_in_window(it: Corner) -> @location(0) vec2u {
    if is_outside(it.window, vec2u(it.position.xy)) {
        discard;
    }
    return vec2u(it.triangle + 1u, it.window);
}

struct Across {
    @location(0) seen: vec2u,
    @builtin(frag_depth) depth: f32,
}

// One that goes past the eye, or nearly: from a point cut off near the eye to one far away nothing
// is interpolated well.
@fragment
fn across(it: Corner) -> Across {
    let pixel = vec2u(it.position.xy);
    if is_outside(it.window, pixel) {
        discard;
    }
    let depth = camera.picture.z * met(it.triangle, pixel).inverse_depth;
    return Across(vec2u(it.triangle + 1u, it.window), clamp(depth, 0.0, 1.0));
}

struct Met {
    corners: vec4u,
    // Barycentric weights, none negative.
    shares: vec3f,
    // 1 / z there; 0 where it does not meet the plane in front.
    inverse_depth: f32,
    // Whether it meets the triangle.
    is_inside: bool,
    // How much of the triangle a pixel covers: see `proxy::mesh::footprint`.
    footprint: f32,
}

// How far outside of a triangle still counts as inside, in shares of its size.
const NEARLY: f32 = 3e-5;

// Where the ray through a pixel's centre meets a triangle's plane.
fn met(triangle: u32, pixel: vec2u) -> Met {
    let corners = textureLoad(triangles, entry(triangle), 0);
    let a = corner_place(corners.x);
    let b = corner_place(corners.y);
    let c = corner_place(corners.z);
    let ray = vec3f((vec2f(pixel) + 0.5 - camera.lens.zw) / camera.lens.xy, 1.0);
    // Olano and Greer 1997: the edges' values are the weights but for their sum.
    let weights = vec3f(dot(cross(b, c), ray), dot(cross(c, a), ray), dot(cross(a, b), ray));
    let sum = weights.x + weights.y + weights.z;
    let turned = select(weights, -weights, sum < 0.0);
    let inside = max(turned, vec3f(0.0));
    let all = inside.x + inside.y + inside.z;
    let shares = select(vec3f(1.0, 0.0, 0.0), inside / all, all > 0.0);
    let depth = dot(shares, vec3f(a.z, b.z, c.z));
    let is_inside = all > 0.0 && all_at_least(turned, -NEARLY * all);
    // The volume over the sum is the depth.
    let footprint = depth * depth / (abs(sum) * camera.lens.x * camera.lens.y);
    return Met(corners, shares, select(0.0, 1.0 / depth, depth > 0.0), is_inside, footprint);
}

fn all_at_least(v: vec3f, least: f32) -> bool {
    return v.x >= least && v.y >= least && v.z >= least;
}

// One triangle that covers the picture.
@vertex
fn whole_picture(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4f {
    let corner = vec2f(vec2u(vertex_idx & 1u, vertex_idx >> 1u));
    return vec4f(corner * 4.0 - 1.0, 0.0, 1.0);
}

fn unpacked(color: u32) -> vec3f {
    return vec3f(f32(color & 255u), f32((color >> 8u) & 255u), f32((color >> 16u) & 255u));
}

fn corner_color(i: u32) -> vec3f {
    return unpacked(textureLoad(places, entry(2u * i), 0).w);
}

// How textures go on beyond their sides, as `Wrap` counts.
const REPEAT: u32 = 0u;
const MIRROR: u32 = 1u;

// The column, or row, of a texture of that many.
fn wrapped(i: i32, count: i32, wrap: u32) -> u32 {
    if wrap == REPEAT {
        return u32(((i % count) + count) % count);
    }
    if wrap == MIRROR {
        let at = ((i % (2 * count)) + 2 * count) % (2 * count);
        return u32(min(at, 2 * count - 1 - at));
    }
    return u32(clamp(i, 0, count - 1));
}

// Bilinear between the centres of a level's texels; x is its first one, y and z columns and rows.
fn bilinear(level: vec3u, wrap: vec2u, uv: vec2f) -> vec3f {
    let size = vec2i(level.yz);
    let at = clamp(uv * vec2f(size) - 0.5, vec2f(-1e9), vec2f(1e9));
    let corner = floor(at);
    let share = at - corner;
    let left = wrapped(i32(corner.x), size.x, wrap.x);
    let right = wrapped(i32(corner.x) + 1, size.x, wrap.x);
    let top = level.x + level.y * wrapped(i32(corner.y), size.y, wrap.y);
    let bottom = level.x + level.y * wrapped(i32(corner.y) + 1, size.y, wrap.y);
    let above = mix(texel(top + left), texel(top + right), share.x);
    let below = mix(texel(bottom + left), texel(bottom + right), share.x);
    return mix(above, below, share.y);
}

fn coarser(level: vec3u) -> vec3u {
    return vec3u(level.x + level.y * level.z, max(level.yz, vec2u(2u)) / 2u);
}

// As `level_of` of a model's textures on the CPU (`proxy/src/mesh/texture.rs`).
fn level_of(texels: f32) -> f32 {
    // 1's bits, and a power of 2 of the rest.
    return f32(bitcast<i32>(texels) - 0x3f800000) * (0.5 / 8388608.0);
}

// Where a pixel covers so many of the finest texels; w is how many levels there are.
fn sampled(texture: vec4u, wrap: vec2u, uv: vec2f, texels: f32) -> vec3f {
    let at = clamp(level_of(texels), 0.0, f32(texture.w - 1u));
    let fine = u32(at);
    var level = texture.xyz;
    for (var i = 0u; i < fine; i++) {
        level = coarser(level);
    }
    let color = bilinear(level, wrap, uv);
    let share = at - f32(fine);
    if share == 0.0 {
        return color;
    }
    return mix(color, bilinear(coarser(level), wrap, uv), share);
}

fn texel(i: u32) -> vec3f {
    return unpacked(textureLoad(texels, entry(i), 0).x);
}

fn corner_uv(i: u32) -> vec2f {
    return bitcast<vec2f>(textureLoad(uvs, entry(i), 0).xy);
}

// The colour as sRGB codes, and the bits of the inverse depth.
@fragment
fn shade(@builtin(position) position: vec4f) -> @location(0) vec2u {
    let pixel = vec2u(position.xy);
    let found = textureLoad(seen, pixel, 0).x;
    var it = Met(vec4u(0u), vec3f(0.0), 0.0, false, 0.0);
    if found > 0u {
        it = met(found - 1u, pixel);
    }
    // Devices move corners to a grid. Where one lies on another triangle's side that opens cracks;
    // what should be there is next to them.
    let size = vec2i(camera.picture.xy);
    for (var k = 0u; k < 4u; k++) {
        let step = select(-1, 1, (k & 1u) == 1u);
        let beside = vec2i(pixel) + select(vec2i(0, step), vec2i(step, 0), k < 2u);
        if any(beside < vec2i(0)) || any(beside >= size) {
            continue;
        }
        let other = textureLoad(seen, beside, 0).xy;
        if other.x == 0u || other.x == found || is_outside(other.y, pixel) {
            continue;
        }
        let there = met(other.x - 1u, pixel);
        if there.is_inside && there.inverse_depth > it.inverse_depth {
            it = there;
        }
    }
    if it.inverse_depth == 0.0 {
        return vec2u(0u);
    }
    var color = it.shares.x * corner_color(it.corners.x)
        + it.shares.y * corner_color(it.corners.y)
        + it.shares.z * corner_color(it.corners.z);
    let looks = textureLoad(materials, entry(2u * it.corners.w), 0);
    color *= bitcast<vec3f>(looks.xyz);
    let texture = textureLoad(materials, entry(2u * it.corners.w + 1u), 0);
    if texture.y > 0u && texture.z > 0u {
        let wrap = vec2u(looks.w & 3u, looks.w >> 2u);
        // Periods of the texture are left out before digits are.
        let first = corner_uv(it.corners.x);
        let base = select(vec2f(0.0), 2.0 * floor(0.5 * first), wrap <= vec2u(MIRROR));
        let second = corner_uv(it.corners.y);
        let third = corner_uv(it.corners.z);
        let uv = it.shares.x * (first - base)
            + it.shares.y * (second - base)
            + it.shares.z * (third - base);
        let across = second - first;
        let down = third - first;
        let area = abs(across.x * down.y - across.y * down.x);
        let texels = it.footprint * area * f32(texture.y) * f32(texture.z);
        color *= sampled(texture, wrap, uv, texels) / 255.0;
    }
    let codes = vec3u(clamp(floor(color + 0.5), vec3f(0.0), vec3f(255.0)));
    let packed = codes.x | (codes.y << 8u) | (codes.z << 16u) | (255u << 24u);
    return vec2u(packed, bitcast<u32>(it.inverse_depth / camera.picture.w));
}
