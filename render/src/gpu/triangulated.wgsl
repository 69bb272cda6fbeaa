// The triangulated field: each triangle carries a list of source views with their weights
// at its corners (Buehler et al. 2001, section 4.2), drawn once for the whole list.

// MAX_LISTED of field.rs.
const LISTED = 32u;

@group(1) @binding(0) var photos: texture_2d_array<f32>;
@group(1) @binding(1) var photo_sampler: sampler;
// A texel an entry: the source view, then its values at the corners: weights, or in a
// bordered triangle differences. Source views are numbered by their layer of the array.
@group(1) @binding(2) var entries: texture_2d<f32>;
const ENTRIES_PER_ROW = 1024u;

// Two texels a triangle: its corners in pixels, then its first entry, and twice how many, one more if
// it is bordered.
@group(1) @binding(3) var triangles: texture_2d<u32>;
// Of the same size: one more than the triangle that each pixel sees (see seen.wgsl), and the picture.
@group(2) @binding(0) var seen: texture_2d<u32>;
@group(2) @binding(1) var picture: texture_storage_2d<r32uint, write>;

// A triangle at a pixel.
struct Listed {
    // The corners' shares of the pixel.
    shares: vec3f,
    first: u32,
    end: u32,
    bordered: bool,
}

// The number that a pixel has; zero outside of the picture, too.
fn number_at(pixel: vec2u) -> u32 {
    if any(pixel >= textureDimensions(seen)) {
        return 0u;
    }
    return textureLoad(seen, pixel, 0).x;
}

fn listed_at(pixel: vec2u, number: u32) -> Listed {
    let at = 2u * (number - 1u);
    let row = at / ENTRIES_PER_ROW;
    let column = at % ENTRIES_PER_ROW;
    let one = textureLoad(triangles, vec2u(column, row), 0);
    let other = textureLoad(triangles, vec2u(column + 1u, row), 0);
    // From the pixel's centre.
    let center = vec2f(pixel) + 0.5;
    let a = bitcast<vec2f>(one.xy) - center;
    let b = bitcast<vec2f>(one.zw) - center;
    let c = bitcast<vec2f>(other.xy) - center;
    let areas = vec3f(b.x * c.y - b.y * c.x, c.x * a.y - c.y * a.x, a.x * b.y - a.y * b.x);
    // A triangle is drawn a little aside of where it is: what is outside of it is on its border.
    let turned = select(areas, -areas, areas.x + areas.y + areas.z < 0.0);
    let inside = max(turned, vec3f(0.0));
    let all = inside.x + inside.y + inside.z;
    let shares = select(vec3f(1.0, 0.0, 0.0), inside / all, all > 0.0);
    return Listed(shares, other.z, other.z + (other.w >> 1u), (other.w & 1u) == 1u);
}

fn add_photo(mix: ptr<function, Mix>, weight: f32, source_idx: u32, texel: vec3f) {
    let uv = texel.xy / params.array_size;
    let color = textureSampleLevel(photos, photo_sampler, uv, source_idx, texel.z - params.finest);
    add(mix, weight, color, source_idx);
}

// Where a photo is sampled, and at which mip level.
fn texel_of(source_idx: u32, sight: Sight, ray: vec3f, plane: vec3f) -> vec3f {
    return vec3f(sight.pixel, level_of_detail(source_idx, sight, ray, plane));
}

fn entry(entry_idx: u32) -> vec4f {
    return textureLoad(entries, vec2u(entry_idx % ENTRIES_PER_ROW, entry_idx / ENTRIES_PER_ROW), 0);
}

@compute @workgroup_size(8, 8)
fn plain(@builtin(global_invocation_id) at: vec3u) {
    let number = number_at(at.xy);
    if number == 0u {
        return;
    }
    let listed = listed_at(at.xy, number);
    if !listed.bordered {
        textureStore(picture, at.xy, vec4u(pack4x8unorm(plain_color(at.xy, listed))));
    }
}

@fragment
fn plain_fragment(it: Corner) -> @location(0) u32 {
    let pixel = vec2u(it.position.xy);
    return pack4x8unorm(plain_color(pixel, listed_at(pixel, it.triangle + 1u)));
}

fn plain_color(pixel: vec2u, it: Listed) -> vec4f {
    let ray = ray_through(pixel);
    let plane = plane_at(pixel);
    let s = inverse_distance(plane, ray);
    if s < 0.0 || all(ray == vec3f(0.0)) {
        return vec4f(0.0);
    }
    var mix = Mix(vec4f(0.0), 0.0);
    for (var i = it.first; i < it.end; i++) {
        let listed = entry(i);
        let weight = dot(it.shares, listed.yzw);
        if weight <= 0.0 {
            continue;
        }
        let source_idx = u32(listed.x);
        let sight = see(source_idx, ray, s);
        // By its corners every listed view sees all of the triangle: fovBlend and mask are one. But a lens may bend
        // more between corners than they tell, the desired one or a photo's, and a facet may lie before or behind
        // what is seen at all three. Of a plane through lenses that don't bend they tell all.
        var fov = select(0.0, 1.0, sight.depth > 0.0);
        if RAYS_IN_TABLE || FACETS || COMMON_LENS != LENS_PINHOLE {
            fov = fov_blend(source_idx, sight);
        }
        if fov > 0.0 {
            add_photo(&mix, fov * weight, source_idx, texel_of(source_idx, sight, ray, plane.xyz));
        }
    }
    return resolve(mix);
}

// The views' terms of the blend at a pixel.
struct Terms {
    diff: array<f32, LISTED>,
    a: array<f32, LISTED>,
    source_idx: array<u32, LISTED>,
    // Where to sample, and the mip level, where they are kept.
    texel: array<vec3f, LISTED>,
}

// Whether they are, rather than found again for the few that have weight (`ShadeBy` of pipelines.rs).
override KEEPS_TEXELS: bool = false;

// Where the border of a photo or a mask crosses the triangle: interpolated differences, the
// pixel's own fovBlend and mask, and the blend of the exact field. A pipeline of its own, because software
// drivers pay for its arrays in every pixel.
@compute @workgroup_size(8, 8)
fn bordered(@builtin(global_invocation_id) at: vec3u) {
    let number = number_at(at.xy);
    if number == 0u {
        return;
    }
    let listed = listed_at(at.xy, number);
    if listed.bordered {
        textureStore(picture, at.xy, vec4u(pack4x8unorm(bordered_color(at.xy, listed))));
    }
}

@fragment
fn bordered_fragment(it: Corner) -> @location(0) u32 {
    let pixel = vec2u(it.position.xy);
    return pack4x8unorm(bordered_color(pixel, listed_at(pixel, it.triangle + 1u)));
}

fn bordered_color(pixel: vec2u, it: Listed) -> vec4f {
    let ray = ray_through(pixel);
    let plane = plane_at(pixel);
    let s = inverse_distance(plane, ray);
    if s < 0.0 || all(ray == vec3f(0.0)) {
        return vec4f(0.0);
    }
    // 1. Who sees the point.
    var terms: Terms;
    var count = 0u;
    var nearest = INFINITY;
    var sums = vec2f(0.0);
    for (var i = it.first; i < it.end; i++) {
        let listed = entry(i);
        let source_idx = u32(listed.x);
        let sight = see(source_idx, ray, s);
        let a = relevance(source_idx, sight, ray, plane.xyz);
        if a > 0.0 {
            let diff = without_noise(dot(it.shares, listed.yzw));
            nearest = min(nearest, diff);
            sums += a * vec2f(1.0, diff);
            terms.diff[count] = diff;
            terms.a[count] = a;
            terms.source_idx[count] = source_idx;
            if KEEPS_TEXELS {
                terms.texel[count] = texel_of(source_idx, sight, ray, plane.xyz);
            }
            count++;
        }
    }
    if count == 0u {
        return vec4f(0.0);
    }
    // 2. Their weights and colours.
    let t = max(threshold(&terms, count, sums), SMALLEST_THRESHOLD);
    // Where the nearest is as far as the threshold, or no view differs that counts, all are tied: those of
    // lowest index share, as many as may contribute.
    let are_tied = nearest >= t || t <= SMALLEST_THRESHOLD;
    var tied = 0u;
    var mix = Mix(vec4f(0.0), 0.0);
    for (var n = 0u; n < count; n++) {
        let diff = terms.diff[n];
        var weight = terms.a[n] * nearness(diff, t);
        if !BLEND_OF_PAPER {
            weight /= max(diff, SAME_RAY);
        }
        if are_tied && diff <= nearest && tied < CONTRIBUTORS {
            weight = terms.a[n];
            tied++;
        }
        if weight > 0.0 {
            let source_idx = terms.source_idx[n];
            var texel: vec3f;
            if KEEPS_TEXELS {
                texel = terms.texel[n];
            } else {
                texel = texel_of(source_idx, see(source_idx, ray, s), ray, plane.xyz);
            }
            add_photo(&mix, weight, source_idx, texel);
        }
    }
    return resolve(mix);
}

// `all_sums`: of a and of a times the difference, over all terms.
fn threshold(terms: ptr<function, Terms>, count: u32, all_sums: vec2f) -> f32 {
    if BLEND_OF_PAPER {
        return nth_smallest(terms, count, params.k);
    }
    // Newton's method in 1/t, from above; it lands on the root (see weights.rs).
    var t = INFINITY;
    var sums = all_sums;
    var contributors = count;
    for (var step = 0u; step <= count; step++) {
        if sums.x <= params.full_weight {
            break;
        }
        let next = max(sums.y / (sums.x - params.full_weight), SMALLEST_THRESHOLD);
        if next >= t {
            break;
        }
        t = next;
        sums = vec2f(0.0);
        contributors = 0u;
        for (var n = 0u; n < count; n++) {
            let a = (*terms).a[n];
            let diff = (*terms).diff[n];
            if diff < t {
                sums += a * vec2f(1.0, diff);
                contributors++;
            }
        }
    }
    if contributors > CONTRIBUTORS {
        t = min(t, nth_smallest(terms, count, CONTRIBUTORS + 1u));
    }
    return t;
}

// The n-th smallest difference among the views that see the point, or the largest.
fn nth_smallest(terms: ptr<function, Terms>, count: u32, nth: u32) -> f32 {
    var value = -1.0;
    var found = 0u;
    while found < nth {
        var next = INFINITY;
        var ties = 0u;
        for (var n = 0u; n < count; n++) {
            let diff = (*terms).diff[n];
            if diff <= value {
                continue;
            }
            ties = select(ties, 0u, diff < next);
            next = min(next, diff);
            ties += u32(diff == next);
        }
        if ties == 0u {
            break;
        }
        value = next;
        found += ties;
    }
    return value;
}
