// The warp of a layered depth image in any order; the same steps as `ldi/free.rs` has.
//
// 1. near: the nearest depth of every pixel, of what splats cover.
// 2. add: Gaussian weights of all samples within a few per cent of that depth.
// 3. near, add: the same with wider splats, for pixels that none covers.
// 4. resolve: the means.
//
// Sums are whole numbers, in 64 bits of two words each, so that nothing depends on the order in
// which samples come.

struct Warp {
    // x₂ ≐ base + x·per_x + y·per_y + s·per_depth: base is the row's.
    per_x: vec4f,
    per_y: vec4f,
    per_depth: vec4f,
    // Width and height in pixels; how many stretches there are; by how many quarters the samples' image is
    // turned in the picture.
    size: vec4u,
    // What patches are made larger by, the least and the greatest half side, in pixels; what makes
    // the nearest depth the farthest of the same surface.
    patches: vec4f,
    // What patches are made larger by, again, and the least half side, where none covers; the
    // Gaussian's deviation in half sides; how far beyond its patch a sample counts.
    wide: vec4f,
    // What of half a side a patch covers where its surface ends.
    end: vec4f,
}

@group(0) @binding(0) var<uniform> warp: Warp;
// By sample, five words: x, y from the row's middle, inverse depth, colour with where the surface
// ends in place of alpha, look.
@group(0) @binding(1) var<storage, read> samples: array<u32>;
// Samples of a row one after the other: the first, one past the last; then the row's base.
@group(0) @binding(2) var<storage, read> stretches: array<vec4u>;
// By normal, half the width and height of patches; then by step, their sides.
@group(0) @binding(3) var<storage, read> sizes: array<f32>;
// Of n pixels: n colours, n inverse depths (what is read back); n nearest, n widest inverse depths;
// then of each pixel red, green, blue, weight, low and high words. Last, how many samples were drawn.
@group(0) @binding(4) var<storage, read_write> pixels: array<atomic<u32>>;

// Whether splats are the wider ones.
override is_wide: bool = false;

const NORMALS: u32 = 1024u;
const WORDS: u32 = 5u;
// One, in sums; the least that counts is a millionth of it.
const ONE: f32 = 1048576.0;

struct Drawn {
    at: vec2f,
    inverse_depth: f32,
    half: vec2f,
    color: u32,
    is_seen: bool,
}

fn pixel_count() -> u32 {
    return warp.size.x * warp.size.y;
}

fn place(i: u32, base: vec3f) -> Drawn {
    let x = bitcast<f32>(samples[WORDS * i]);
    let y = bitcast<f32>(samples[WORDS * i + 1u]);
    let s = bitcast<f32>(samples[WORDS * i + 2u]);
    let look = samples[WORDS * i + 4u];
    let there = base + warp.per_x.xyz * x + warp.per_y.xyz * y + warp.per_depth.xyz * s;
    let scale = 1.0 / there.z;
    let at = there.xy * scale;
    let most = warp.patches.z;
    let normal = look % NORMALS;
    let side = sizes[2u * NORMALS + look / NORMALS];
    let flat_half = vec2f(sizes[2u * normal], sizes[2u * normal + 1u]) * side;
    var half = min(max(flat_half * (warp.patches.x * scale), vec2f(warp.patches.y)), vec2f(most));
    if is_wide {
        half = min(max(half * warp.wide.x, vec2f(warp.wide.y)), vec2f(most));
    }
    let size = vec2f(warp.size.xy);
    let is_seen = there.z > 0.0 && all(at > vec2f(-most)) && all(at < size + most);
    return Drawn(at, s * scale, half, samples[WORDS * i + 3u], is_seen);
}

struct Box {
    first: vec2u,
    end: vec2u,
}

// The pixels whose middles are within reach of a place.
fn pixels_around(at: vec2f, reach: vec2f) -> Box {
    let low = max(ceil(at - reach - 0.5), vec2f(0.0));
    let high = clamp(floor(at + reach + 0.5), vec2f(0.0), vec2f(warp.size.xy));
    return Box(vec2u(low), vec2u(high));
}

fn is_within(pixel: vec2u, at: vec2f, reach: vec2f) -> bool {
    return all(abs(vec2f(pixel) + 0.5 - at) <= reach);
}

// Whether a patch covers a pixel: less where its surface ends, 1 right, 2 below, 4 left, 8 above.
fn is_covered(pixel: vec2u, drawn: Drawn) -> bool {
    let ends = drawn.color >> 24u;
    let turned = (ends << warp.size.w) | (ends >> (4u - warp.size.w));
    let is_end = vec4u(turned & 1u, turned & 2u, turned & 4u, turned & 8u) != vec4u(0u);
    let reach = select(vec4f(1.0), vec4f(warp.end.x), is_end) * drawn.half.xyxy;
    let d = vec2f(pixel) + 0.5 - drawn.at;
    return all(d <= reach.xy) && all(d >= -reach.zw);
}

// e⁻ᵗ within 6 % of 1 for t ≥ 0: (1 − t/16)¹⁶, zero from 16 on.
fn gaussian(t: vec2f) -> vec2f {
    let base = max(1.0 - t * (1.0 / 16.0), vec2f(0.0));
    let two = base * base;
    let four = two * two;
    let eight = four * four;
    return eight * eight;
}

fn nearest_at(pixel: u32) -> f32 {
    return bitcast<f32>(atomicLoad(&pixels[2u * pixel_count() + pixel]));
}

fn widest_at(pixel: u32) -> f32 {
    return bitcast<f32>(atomicLoad(&pixels[3u * pixel_count() + pixel]));
}

// Adds to a sum of two words.
fn more(word: u32, value: u32) {
    let before = atomicAdd(&pixels[word], value);
    if before + value < before {
        atomicAdd(&pixels[word + 1u], 1u);
    }
}

fn add_at(pixel: vec2u, drawn: Drawn) {
    let deviation = warp.wide.z * drawn.half;
    let d = vec2f(pixel) + 0.5 - drawn.at;
    let weights = gaussian(d * d * (0.5 / (deviation * deviation)));
    let exact = weights.x * weights.y;
    if exact <= 0.0 {
        return;
    }
    let weight = max(round(exact * ONE), 1.0);
    let first = 4u * pixel_count() + 8u * (pixel.y * warp.size.x + pixel.x);
    let color = unpack4x8unorm(drawn.color).rgb * 255.0;
    more(first, u32(round(weight * color.r)));
    more(first + 2u, u32(round(weight * color.g)));
    more(first + 4u, u32(round(weight * color.b)));
    more(first + 6u, u32(weight));
}

struct Stretch {
    first: u32,
    end: u32,
    base: vec3f,
}

fn stretch(group: vec3u, groups: vec3u) -> Stretch {
    let index = group.y * groups.x + group.x;
    if index >= warp.size.z {
        return Stretch(0u, 0u, vec3f(0.0));
    }
    let range = stretches[2u * index];
    let base = bitcast<vec3f>(stretches[2u * index + 1u].xyz);
    return Stretch(range.x, range.y, base);
}

var<workgroup> drawn_here: atomic<u32>;

@compute @workgroup_size(64)
fn near(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) own: u32,
) {
    let all = stretch(group, groups);
    for (var i = all.first + own; i < all.end; i += 64u) {
        let drawn = place(i, all.base);
        if !drawn.is_seen {
            continue;
        }
        if !is_wide {
            atomicAdd(&drawn_here, 1u);
        }
        let box = pixels_around(drawn.at, drawn.half);
        for (var y = box.first.y; y < box.end.y; y++) {
            for (var x = box.first.x; x < box.end.x; x++) {
                let pixel = y * warp.size.x + x;
                let is_open = !is_wide || nearest_at(pixel) == 0.0;
                if is_open && is_covered(vec2u(x, y), drawn) {
                    // Positive numbers are in the order of their bits.
                    let word = select(2u, 3u, is_wide) * pixel_count() + pixel;
                    atomicMax(&pixels[word], bitcast<u32>(drawn.inverse_depth));
                }
            }
        }
    }
    workgroupBarrier();
    if own == 0u {
        atomicAdd(&pixels[12u * pixel_count()], atomicLoad(&drawn_here));
    }
}

@compute @workgroup_size(64)
fn add(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) own: u32,
) {
    let all = stretch(group, groups);
    for (var i = all.first + own; i < all.end; i += 64u) {
        let drawn = place(i, all.base);
        if !drawn.is_seen {
            continue;
        }
        let reach = select(warp.wide.w, 1.0, is_wide) * drawn.half;
        let box = pixels_around(drawn.at, reach);
        for (var y = box.first.y; y < box.end.y; y++) {
            for (var x = box.first.x; x < box.end.x; x++) {
                let pixel = y * warp.size.x + x;
                // Only pixels without a nearest have a widest.
                let nearest = select(nearest_at(pixel), widest_at(pixel), is_wide);
                let farthest = nearest * warp.patches.w;
                let is_same = drawn.inverse_depth >= farthest && farthest > 0.0;
                if is_same && is_within(vec2u(x, y), drawn.at, reach) {
                    add_at(vec2u(x, y), drawn);
                }
            }
        }
    }
}

fn sum(word: u32) -> f32 {
    let high = f32(atomicLoad(&pixels[word + 1u]));
    return high * 4294967296.0 + f32(atomicLoad(&pixels[word]));
}

@compute @workgroup_size(64)
fn resolve(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) own: u32,
) {
    let n = pixel_count();
    let pixel = 64u * (group.y * groups.x + group.x) + own;
    if pixel >= n {
        return;
    }
    let first = 4u * n + 8u * pixel;
    let weight = sum(first + 6u);
    if weight > 0.0 {
        let color = vec3f(sum(first), sum(first + 2u), sum(first + 4u)) / weight;
        let steps = vec3u(clamp(color + 0.5, vec3f(0.0), vec3f(255.0)));
        atomicStore(&pixels[pixel], steps.r | (steps.g << 8u) | (steps.b << 16u) | (255u << 24u));
        let inverse_depth = max(nearest_at(pixel), widest_at(pixel));
        atomicStore(&pixels[n + pixel], bitcast<u32>(inverse_depth));
    }
}
