// What both fields share: source views, their lenses, and how photos are sampled.
// The Rust twin of each function has the same name in `render/src/cpu/`.

struct Params {
    // Inverse distance along a ray: dot(plane, ray).
    plane: vec3f,
    // 1 where the rays come from the table, 0 for a pinhole.
    rays_in_table: u32,
    // Pinhole: ray.xy = (pixel - ray_offset) * ray_scale.
    ray_scale: vec2f,
    ray_offset: vec2f,
    // Photos' array, in texels.
    array_size: vec2f,
    size: vec2u,
    source_count: u32,
    desired_by_distance: u32,
    beta: f32,
    full_weight: f32,
    k: u32,
    // See BLEND_* and RESOLUTION_*.
    blend: u32,
    resolution: u32,
    plane_seen: u32,
}

const BLEND_CONSISTENT = 0u;
const BLEND_PAPER = 1u;
const RESOLUTION_RATIO = 0u;
const RESOLUTION_LENGTH = 1u;

struct Source {
    // Rows of the rotation from the desired camera's frame; w: the translation.
    x_axis: vec4f,
    y_axis: vec4f,
    z_axis: vec4f,
    // The source's centre in the desired camera's frame; w: footprint ratio g.
    center: vec4f,
    focal: vec2f,
    principal: vec2f,
    size: vec2f,
    inverse_feather: f32,
    area_scale: f32,
    // k1..k4, then k5, k6, p1, p2.
    k1234: vec4f,
    k56p12: vec4f,
    // Limit of the squared radius, or of theta for a fisheye.
    limit: f32,
    // g squared less one.
    footprint_excess: f32,
    // See LENS_*.
    lens: u32,
    // Layer of the photos' array.
    layer: u32,
    // rgb; w: the last mip level.
    gain: vec4f,
}

const LENS_PINHOLE = 0u;
const LENS_RATIONAL = 1u;
const LENS_FISHEYE = 2u;
const LENS_POLYNOMIAL = 3u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> sources: array<Source>;
@group(0) @binding(2) var rays: texture_2d<f32>;

// Where a proxy point falls in a photo.
struct Sight {
    pixel: vec2f,
    // fovBlend; 0 where the photo does not see the point.
    a: f32,
    in_camera: vec3f,
}

// atan2 for y >= 0; the polynomial is Cephes' atanf.
fn angle(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let larger = max(max(ax, y), 1.17549435e-38);
    let q = min(ax, y) / larger;
    let far = q > 0.41421356;
    let r = select(q, (q - 1.0) / (q + 1.0), far);
    let z = r * r;
    let polynomial = (((8.0537445e-2 * z - 1.3877686e-1) * z + 1.9977711e-1) * z - 3.333295e-1)
        * z * r + r;
    let first = polynomial + select(0.0, 0.785398163, far);
    let steep = select(first, 1.570796327 - first, y > ax);
    return select(steep, 3.141592654 - steep, x < 0.0);
}

// The ray through a pixel's centre; z = 1 where the lens allows. Zero where there is none.
fn ray_through(pixel: vec2u) -> vec3f {
    if params.rays_in_table == 1u {
        return textureLoad(rays, pixel, 0).xyz;
    }
    return vec3f((vec2f(pixel) + 0.5 - params.ray_offset) * params.ray_scale, 1.0);
}

fn see(source_idx: u32, ray: vec3f, s: f32) -> Sight {
    let p = vec3f(
        dot(sources[source_idx].x_axis.xyz, ray) + sources[source_idx].x_axis.w * s,
        dot(sources[source_idx].y_axis.xyz, ray) + sources[source_idx].y_axis.w * s,
        dot(sources[source_idx].z_axis.xyz, ray) + sources[source_idx].z_axis.w * s,
    );
    var sight = Sight(vec2f(0.0), 0.0, p);

    // 1. Through the lens.
    var bent: vec2f;
    let lens = sources[source_idx].lens;
    if lens == LENS_FISHEYE {
        let radius = length(p.xy);
        let theta = angle(radius, p.z);
        if theta > sources[source_idx].limit || (radius == 0.0 && p.z <= 0.0) {
            return sight;
        }
        let k = sources[source_idx].k1234;
        let t2 = theta * theta;
        let r = theta * (1.0 + t2 * (k.x + t2 * (k.y + t2 * (k.z + t2 * k.w))));
        bent = p.xy * select(1.0 / p.z, r / radius, radius > 0.0);
    } else {
        if p.z <= 0.0 {
            return sight;
        }
        let n = p.xy / p.z;
        bent = n;
        if lens != LENS_PINHOLE {
            let k = sources[source_idx].k1234;
            let r2 = dot(n, n);
            if r2 > sources[source_idx].limit {
                return sight;
            }
            let above = 1.0 + r2 * (k.x + r2 * (k.y + r2 * k.z));
            bent = n * above;
            if lens == LENS_RATIONAL {
                let h = sources[source_idx].k56p12;
                let below = 1.0 + r2 * (k.w + r2 * (h.x + r2 * h.y));
                bent = n * (above / below)
                    + 2.0 * h.zw * n.x * n.y + h.wz * (r2 + 2.0 * n * n);
            }
        }
    }
    sight.pixel = bent * sources[source_idx].focal + sources[source_idx].principal;

    // 2. fovBlend. On the very edge a view counts where there is no other.
    let to_border = min(sight.pixel, sources[source_idx].size - sight.pixel);
    let border = min(to_border.x, to_border.y);
    if border >= 0.0 {
        let f = clamp(border * sources[source_idx].inverse_feather, 0.0, 1.0);
        sight.a = max(f * f * (3.0 - 2.0 * f), 1e-12);
    }
    return sight;
}

// The photo's colour there: premultiplied, at the mip level of the projected footprint.
fn sample_photo(
    photos: texture_2d_array<f32>,
    photo_sampler: sampler,
    source_idx: u32,
    sight: Sight,
    ray: vec3f,
) -> vec4f {
    let here = select(ray.z, length(ray), params.desired_by_distance == 1u);
    let there = select(sight.in_camera.z, length(sight.in_camera), sources[source_idx].lens == LENS_FISHEYE);
    let ratio = here / there;
    let area = sources[source_idx].area_scale * ratio * ratio * ratio;
    var level = 0.0;
    if area > 1.0 {
        level = min(0.5 * log2(area), sources[source_idx].gain.w);
    }
    let uv = sight.pixel / params.array_size;
    return textureSampleLevel(photos, photo_sampler, uv, sources[source_idx].layer, level);
}

// angDiff + beta * resDiff.
fn difference(source_idx: u32, ray: vec3f, s: f32) -> f32 {
    let c = sources[source_idx].center.xyz;
    let across = s * length(cross(c, ray));
    let towards = dot(ray, c);
    let ray_squared = dot(ray, ray);
    var resolution: f32;
    if params.resolution == RESOLUTION_LENGTH {
        let squares = s * dot(c, c) - 2.0 * towards;
        resolution = squares / (length(ray - s * c) + sqrt(ray_squared));
    } else {
        let g = sources[source_idx].center.w;
        let excess = (s * s * dot(c, c) - 2.0 * s * towards) / ray_squared;
        resolution = (sources[source_idx].footprint_excess + g * g * excess)
            / (g * sqrt(max(1.0 + excess, 0.0)) + 1.0);
    }
    return angle(across, ray_squared - s * towards) + params.beta * max(resolution, 0.0);
}

// The blend of photos so far.
struct Mix {
    color: vec4f,
    gain: vec3f,
    sum: f32,
}

fn add(mix: ptr<function, Mix>, weight: f32, color: vec4f, gain: vec3f) {
    (*mix).color += weight * vec4f(color.rgb / gain, color.a);
    (*mix).gain += weight * gain;
    (*mix).sum += weight;
}

// Straight alpha; transparent black where nothing was added.
fn resolve(mix: Mix) -> vec4f {
    if mix.sum <= 0.0 || mix.color.a <= 0.0 {
        return vec4f(0.0);
    }
    let rgb = mix.color.rgb * (mix.gain / mix.sum) / mix.color.a;
    let alpha = mix.color.a / mix.sum;
    // What rounds to no coverage has no colour.
    return select(vec4f(rgb, alpha), vec4f(0.0), alpha * 255.0 < 0.5);
}
