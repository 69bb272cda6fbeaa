// What both fields share: source views, their lenses, and how photos are sampled.
// The Rust twin of each function has the same name in `render/src/cpu/`.

struct Params {
    // Inverse distance along a ray: dot(plane, ray); where all pixels see one plane.
    plane: vec3f,
    beta: f32,
    // Pinhole: ray.xy = (pixel - ray_offset) * ray_scale.
    ray_scale: vec2f,
    ray_offset: vec2f,
    // IMAGE of every source view, where they are the same.
    image: vec4f,
    // Photos' array, in texels.
    array_size: vec2f,
    // The pixels whose photos are marked.
    part_origin: vec2u,
    part_size: vec2u,
    full_weight: f32,
    k: u32,
    // The photos' mip level that is the finest of their array.
    finest: f32,
    // 1 where all pixels see one plane, 0 where none sees anything.
    plane_seen: f32,
    table_row_bits: u32,
    tiles_across: u32,
}

// MAX_CONTRIBUTORS and SAME_RAY of the Rust side.
const CONTRIBUTORS = 16u;
const SAME_RAY: f32 = 1e-12;
// SHOULDER of frame.rs.
const SHOULDER: f32 = 0.25;
// TRANSPARENT of frame.rs.
const TRANSPARENT: f32 = 0.25;
const SMALLEST_THRESHOLD: f32 = 1e-30;
const INFINITY: f32 = 3e38;

// A source view is SOURCE_TEXELS texels of a texture (`Source` of layout.rs): software
// drivers fetch texels many pixels at a time, and buffers one number of one pixel at a time.
const SOURCE_TEXELS = 13u;
const SOURCES_PER_ROW = 128u;
// Rows of the rotation from the desired camera's frame; w: the translation. All are scaled
// so that a patch of the proxy at equal depth in both cameras covers equally many pixels. A
// pinhole's are those of its matrix, times the rotation: they lead to pixels.
const X_AXIS = 0u;
const Y_AXIS = 1u;
const Z_AXIS = 2u;
// Focal lengths, principal point, for all other lenses.
const PINHOLE = 3u;
// k1, k2, p1, p2; of a fisheye k1, k2. FOV: 2 tan(omega / 2), 1 / omega. Division and
// inverse radial: k. EUCM: alpha, beta, and z over the radius at its limit.
const LENS = 4u;
// k3, k4, k5, k6; of a fisheye k3, k4.
const LENS_REST = 5u;
// Image size; inverse feather; limit of the squared radius, or of theta for a fisheye.
const IMAGE = 6u;
// LENS_*; layer of the photos' array; g squared less one; radius of the lens's edge in bent
// coordinates, 1e30 where it is not within the photo, negative unless the level of detail follows
// the distance.
const KIND = 7u;
// The source's centre in the desired camera's frame; w: footprint ratio g.
const CENTER = 8u;
// rgb; w: how many source views there are.
const EXPOSURE = 9u;
// Prism terms by r^2, and by r^4.
const PRISM = 10u;
// Shear and horizon of a sensor that is tilted or skewed (`Sensor` of sensor.rs).
const SENSOR = 11u;
// Layer of the masks' array, negative without a mask; what its time adds to its difference;
// layer of the distance maps' array, negative without one; what turns the inverse of a
// distance into the map's units.
const REST = 12u;

// What a frame's pixels have in common is set when a pipeline is made (`Special` of layout.rs),
// so that none pays for what is not there.

// The one kind of lens that all source views have; negative where they differ.
override COMMON_LENS: f32 = -1.0;
// Whether all source views have the same IMAGE.
override SAME_IMAGES: bool = false;
// Whether any source view's lens ends within its photo.
override LENS_EDGES: bool = false;
// Whether any source view has an ignore mask.
override MASKED: bool = false;
// Whether the proxy can hide a part of itself.
override OCCLUDED: bool = false;
// Whether each pixel sees a plane of its own.
override FACETS: bool = false;
// Whether these are looked up by tiles.
override BY_TILES: bool = false;
// Whether the rays come from the table: the desired lens is not a pinhole.
override RAYS_IN_TABLE: bool = false;
// Whether levels of detail go by the distance from the desired camera, for a wide lens.
override BY_DISTANCE: bool = false;
// Whether any photo is made brighter or darker.
override EXPOSED: bool = false;
// Whether times add to the differences.
override TIMED: bool = false;
// The paper's blend, of a fixed number of source views.
override BLEND_OF_PAPER: bool = false;
// The resolution penalty by lengths.
override RESOLUTION_BY_LENGTH: bool = false;

const LENS_PINHOLE: f32 = 0.0;
const LENS_RATIONAL: f32 = 1.0;
const LENS_FISHEYE: f32 = 2.0;
// Rational with k3 to k6 zero.
const LENS_BROWN: f32 = 3.0;
// The rarer ones.
const LENS_THIN_PRISM: f32 = 4.0;
const LENS_BENT_PRISM: f32 = 5.0;
const LENS_FOV: f32 = 6.0;
const LENS_DIVISION: f32 = 7.0;
const LENS_EUCM: f32 = 8.0;
const LENS_EQUIRECTANGULAR: f32 = 9.0;
const LENS_INVERSE_RADIAL: f32 = 10.0;
// Those whose sensor is not upright.
const LENS_TILTED: f32 = 11.0;
const LENS_SKEWED_FISHEYE: f32 = 12.0;

// Nothing may branch on these alone, nor may loops end by them: lavapipe makes and keeps a shader of
// its own for every value, 1 to 2 MB each. (From a storage buffer it reads one number of one pixel at a
// time.)
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var sources: texture_2d<f32>;
@group(0) @binding(2) var rays: texture_2d<f32>;
// The planes that pixels see, where they differ, in rows of a power of two; w: 1 but for the first, which
// is that of pixels that see none.
@group(0) @binding(3) var planes: texture_2d<f32>;
// As large as the photos' array; a single texel where nothing is masked.
@group(0) @binding(4) var masks: texture_2d_array<f32>;
@group(0) @binding(5) var mask_sampler: sampler;
// Half as large as the photos' array; a single texel where nothing can be hidden.
@group(0) @binding(6) var distances: texture_2d_array<f32>;
// Which of the planes each pixel sees (`Packed` of surface.rs); by tiles in rows of the same power of two.
@group(0) @binding(7) var facets: texture_2d<u32>;

fn source_data(source_idx: u32, texel: u32) -> vec4f {
    let x = (source_idx % SOURCES_PER_ROW) * SOURCE_TEXELS + texel;
    return textureLoad(sources, vec2u(x, source_idx / SOURCES_PER_ROW), 0);
}

// Where a proxy point falls in a photo.
struct Sight {
    pixel: vec2f,
    // Depth, or distance for a wide lens, scaled as the axes are; 0 where the camera looks
    // the other way.
    depth: f32,
    // Squared radius, or theta for a fisheye; beyond the lens' limit the pixel means nothing.
    reach: f32,
    // 1/distance; only where something can hide the point.
    inverse_distance: f32,
    // Pixels to the lens's edge, where it is within the photo; see lens_edge.rs.
    to_edge: f32,
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
    if RAYS_IN_TABLE {
        return textureLoad(rays, pixel, 0).xyz;
    }
    return vec3f((vec2f(pixel) + 0.5 - params.ray_offset) * params.ray_scale, 1.0);
}

// Brown's distortion of a point on the plane z = 1, with its full radial term or without k3
// to k6.
fn rational(source_idx: u32, n: vec2f, r2: f32, full: bool) -> vec2f {
    let k = source_data(source_idx, LENS);
    var radial = 1.0 + r2 * (k.x + r2 * k.y);
    if full {
        let rest = source_data(source_idx, LENS_REST);
        let below = 1.0 + r2 * (rest.y + r2 * (rest.z + r2 * rest.w));
        radial = (radial + r2 * r2 * r2 * rest.x) / below;
    }
    return n * radial + 2.0 * k.zw * n.x * n.y + k.wz * (r2 + 2.0 * n * n);
}

// Pixels of a tile's side: TILE of tiles.rs.
const TILE = 8u;

fn facet_number(at: u32) -> u32 {
    let bits = params.table_row_bits;
    return textureLoad(facets, vec2u(at & ((1u << bits) - 1u), at >> bits), 0).x;
}

// The place of the plane that a pixel sees.
fn facet_at(pixel: vec2u) -> u32 {
    if !BY_TILES {
        return textureLoad(facets, pixel, 0).x;
    }
    let tile = pixel / TILE;
    let of_tile = facet_number(tile.y * params.tiles_across + tile.x);
    if (of_tile & 1u) == 0u {
        return of_tile >> 1u;
    }
    let within = pixel % TILE;
    return facet_number((of_tile >> 1u) + within.y * TILE + within.x);
}

// The plane of the proxy seen at a pixel; w is 0 where there is none.
fn plane_at(pixel: vec2u) -> vec4f {
    if FACETS {
        let facet = facet_at(pixel);
        let bits = params.table_row_bits;
        return textureLoad(planes, vec2u(facet & ((1u << bits) - 1u), facet >> bits), 0);
    }
    return vec4f(params.plane, params.plane_seen);
}

// The inverse distance along a ray to the plane it meets; negative where there is none.
fn inverse_distance(plane: vec4f, ray: vec3f) -> f32 {
    return select(-1.0, dot(plane.xyz, ray), plane.w > 0.0);
}

// What a rarer lens makes of a point of its camera's frame.
struct Bent {
    at: vec2f,
    seen: bool,
    // See Sight.
    reach: f32,
}

const UNSEEN = Bent(vec2f(0.0), false, 0.0);

// Fisheyes with tangential and prism terms: of the undistorted point, or of the bent one.
fn bend_prism(source_idx: u32, p: vec3f, of_bent: bool) -> Bent {
    let radius = length(p.xy);
    let theta = angle(radius, p.z);
    if radius == 0.0 && p.z <= 0.0 {
        return UNSEEN;
    }
    let k = source_data(source_idx, LENS);
    let rest = source_data(source_idx, LENS_REST);
    let prism = source_data(source_idx, PRISM);
    let t2 = theta * theta;
    let higher = rest.x + t2 * (rest.y + t2 * (rest.z + t2 * rest.w));
    let factor = 1.0 + t2 * (k.x + t2 * (k.y + t2 * higher));
    let unbent = p.xy * select(1.0 / p.z, theta / radius, radius > 0.0);
    let bent = unbent * factor;
    let m = select(unbent, bent, of_bent);
    let r2 = dot(m, m);
    let sideways = 2.0 * k.zw * m.x * m.y + k.wz * (r2 + 2.0 * m * m);
    return Bent(bent + sideways + r2 * (prism.xy + r2 * prism.zw), true, theta);
}

fn bend_fov(p: vec3f, c: f32, inverse_omega: f32) -> Bent {
    if p.z <= 0.0 {
        return UNSEEN;
    }
    let radius = length(p.xy);
    let r = angle(c * radius, p.z) * inverse_omega;
    let scale = select(c * inverse_omega / p.z, r / radius, radius > 0.0);
    return Bent(p.xy * scale, true, 0.0);
}

fn bend_division(p: vec3f, k: f32) -> Bent {
    let four = 4.0 * k * dot(p.xy, p.xy);
    let square = p.z * p.z - four;
    let root = sqrt(max(square, 0.0));
    // z + root, without its cancelling behind.
    let below = select(-four / (root - p.z), p.z + root, p.z >= 0.0);
    // Straight back is nowhere.
    if square <= 0.0 || (p.z <= 0.0 && k >= 0.0) || below <= 1e-6 * root {
        return UNSEEN;
    }
    return Bent(p.xy * (2.0 / below), true, 0.0);
}

// Newton's steps for the cubic of `at = n * g`, g + t * g^3 = 1, approach its root from one
// side; beyond the largest t they stop outside every image.
const CUBIC_STEPS = 8;
const LARGEST_CUBIC_TERM: f32 = 1e6;

fn bend_inverse_radial(p: vec3f, k: f32) -> Bent {
    let n = p.xy / p.z;
    let t = k * dot(n, n);
    // Where t is -4/27 the image folds.
    if p.z <= 0.0 || t <= -4.0 / 27.0 || t >= LARGEST_CUBIC_TERM {
        return UNSEEN;
    }
    var g = 1.0;
    for (var step = 0; step < CUBIC_STEPS; step++) {
        let term = t * g * g;
        g = (1.0 + 2.0 * term * g) / (1.0 + 3.0 * term);
    }
    return Bent(n * g, true, 0.0);
}

// Rational with thin prisms.
fn bend_rational_prism(source_idx: u32, p: vec3f) -> Bent {
    if p.z <= 0.0 {
        return UNSEEN;
    }
    let n = p.xy / p.z;
    let r2 = dot(n, n);
    let prism = source_data(source_idx, PRISM);
    let at = rational(source_idx, n, r2, true) + r2 * (prism.xy + r2 * prism.zw);
    return Bent(at, true, r2);
}

fn onto_sensor(source_idx: u32, bent: Bent) -> Bent {
    let sensor = source_data(source_idx, SENSOR);
    let w = 1.0 + dot(sensor.zw, bent.at);
    return Bent((bent.at + sensor.xy * bent.at.yx) / w, bent.seen && w > 0.0, bent.reach);
}

fn bend_eucm(p: vec3f, alpha: f32, beta: f32, cotangent: f32) -> Bent {
    let r2 = dot(p.xy, p.xy);
    let distance = sqrt(beta * r2 + p.z * p.z);
    let a = alpha * distance;
    let b = (1.0 - alpha) * p.z;
    // a + b, without its cancelling behind.
    let behind = (alpha * alpha * beta * r2 + (2.0 * alpha - 1.0) * p.z * p.z) / (a - b);
    let below = select(behind, a + b, p.z >= 0.0);
    if p.z < cotangent * sqrt(r2) || below <= 1e-12 * distance {
        return UNSEEN;
    }
    return Bent(p.xy / below, true, 0.0);
}

// Keeps the seam and the poles in the image: no rounding error takes them across its border.
const ALMOST_PI: f32 = 3.141591;

fn bend_equirectangular(p: vec3f) -> Bent {
    let azimuth = min(angle(abs(p.x), p.z), ALMOST_PI);
    let elevation = min(angle(abs(p.y), length(p.xz)), 0.5 * ALMOST_PI);
    let at = vec2f(azimuth, elevation);
    return Bent(select(at, -at, p.xy < vec2f(0.0)), true, 0.0);
}

fn bend_rare(source_idx: u32, lens: f32, p: vec3f) -> Bent {
    if lens <= LENS_BENT_PRISM {
        return bend_prism(source_idx, p, lens == LENS_BENT_PRISM);
    }
    if lens == LENS_EQUIRECTANGULAR {
        return bend_equirectangular(p);
    }
    if lens == LENS_TILTED {
        return onto_sensor(source_idx, bend_rational_prism(source_idx, p));
    }
    if lens == LENS_SKEWED_FISHEYE {
        return onto_sensor(source_idx, bend_prism(source_idx, p, false));
    }
    let own = source_data(source_idx, LENS);
    if lens == LENS_FOV {
        return bend_fov(p, own.x, own.y);
    }
    if lens == LENS_DIVISION {
        return bend_division(p, own.x);
    }
    if lens == LENS_INVERSE_RADIAL {
        return bend_inverse_radial(p, own.x);
    }
    return bend_eucm(p, own.x, own.y, own.z);
}

fn see(source_idx: u32, ray: vec3f, s: f32) -> Sight {
    let x_axis = source_data(source_idx, X_AXIS);
    let y_axis = source_data(source_idx, Y_AXIS);
    let z_axis = source_data(source_idx, Z_AXIS);
    let p = vec3f(
        dot(x_axis.xyz, ray) + x_axis.w * s,
        dot(y_axis.xyz, ray) + y_axis.w * s,
        dot(z_axis.xyz, ray) + z_axis.w * s,
    );
    var lens = COMMON_LENS;
    if COMMON_LENS < 0.0 {
        lens = source_data(source_idx, KIND).x;
    }
    var sight = Sight(vec2f(0.0), 0.0, 0.0, 0.0, INFINITY);
    if OCCLUDED {
        sight.inverse_distance = s / length(ray - s * source_data(source_idx, CENTER).xyz);
    }
    var bent: vec2f;
    if lens == LENS_PINHOLE {
        if p.z > 0.0 {
            sight.pixel = p.xy / p.z;
            sight.depth = p.z;
        }
        return sight;
    }
    if lens == LENS_FISHEYE {
        let radius = length(p.xy);
        let theta = angle(radius, p.z);
        if radius == 0.0 && p.z <= 0.0 {
            return sight;
        }
        let k12 = source_data(source_idx, LENS);
        let k34 = source_data(source_idx, LENS_REST);
        let t2 = theta * theta;
        let r = theta * (1.0 + t2 * (k12.x + t2 * (k12.y + t2 * (k34.x + t2 * k34.y))));
        bent = p.xy * select(1.0 / p.z, r / radius, radius > 0.0);
        sight.depth = length(p);
        sight.reach = theta;
    } else if lens >= LENS_THIN_PRISM {
        let rare = bend_rare(source_idx, lens, p);
        if !rare.seen {
            return sight;
        }
        bent = rare.at;
        sight.depth = select(p.z, length(p), source_data(source_idx, KIND).w > 0.0);
        sight.reach = rare.reach;
    } else {
        if p.z <= 0.0 {
            return sight;
        }
        let n = p.xy / p.z;
        sight.reach = dot(n, n);
        bent = rational(source_idx, n, sight.reach, lens == LENS_RATIONAL);
        sight.depth = p.z;
    }
    let pinhole = source_data(source_idx, PINHOLE);
    sight.pixel = bent * pinhole.xy + pinhole.zw;
    if LENS_EDGES {
        let radius = abs(source_data(source_idx, KIND).w);
        let pixels = min(abs(pinhole.x), abs(pinhole.y));
        sight.to_edge = max((radius - length(bent)) * pixels, LEAST_PX);
    }
    return sight;
}

// Of lens_edge.rs.
const LEAST_PX: f32 = 1e-4;

// fovBlend: 0 where the photo does not see the point. On the photo's very edge a view
// counts where there is no other.
fn fov_blend(source_idx: u32, sight: Sight) -> f32 {
    var image = params.image;
    if !SAME_IMAGES {
        image = source_data(source_idx, IMAGE);
    }
    let to_border = min(sight.pixel, image.xy - sight.pixel);
    let border = min(to_border.x, to_border.y);
    if sight.depth <= 0.0 || sight.reach > image.w || border < 0.0 {
        return 0.0;
    }
    var within = border;
    if LENS_EDGES {
        within = min(border, sight.to_edge);
    }
    let f = clamp(within * image.z, 0.0, 1.0);
    return max(f * f * (3.0 - 2.0 * f), 1e-12);
}

// The mip level of the projected footprint; see LEVEL_BIAS of frame.rs.
const LEVEL_BIAS: f32 = 0.25;

fn level_of_detail(source_idx: u32, sight: Sight, ray: vec3f, plane: vec3f) -> f32 {
    let here = select(ray.z, length(ray), BY_DISTANCE);
    let ratio = here / sight.depth;
    var area = ratio * ratio * ratio;
    if FACETS {
        // With one plane for all this is in the axes' scale.
        area *= abs(1.0 - dot(plane, source_data(source_idx, CENTER).xyz));
    }
    return max(0.5 * log2(max(area, 1.0)) - LEVEL_BIAS, 0.0);
}

// See IGNORED of mask.rs.
const IGNORED: f32 = 0.5;

// As in visibility.rs.
const TOLERANCE: f32 = 0.02;
const FADE: f32 = 1.75;
const HIDDEN_ROOT: f32 = 0.17782794;

// How much a photo counts at a point: little where something is before it.
fn visible(source_idx: u32, sight: Sight) -> f32 {
    let rest = source_data(source_idx, REST);
    if rest.z < 0.0 {
        return 1.0;
    }
    let uv = sight.pixel / params.array_size;
    let nearest = textureSampleLevel(distances, mask_sampler, uv, u32(rest.z), 0.0).r;
    let slack = nearest * TOLERANCE;
    let beyond = nearest - sight.inverse_distance * rest.w;
    if beyond <= slack {
        return 1.0;
    }
    let r = clamp((beyond - slack) / (FADE * slack), 0.0, 1.0);
    let root = 1.0 - (1.0 - HIDDEN_ROOT) * r * r * (3.0 - 2.0 * r);
    return (root * root) * (root * root);
}

// fovBlend, what the ignore mask leaves of it, and what is before the point.
fn relevance(source_idx: u32, sight: Sight, ray: vec3f, plane: vec3f) -> f32 {
    var a = fov_blend(source_idx, sight);
    if MASKED && a > 0.0 {
        let layer = source_data(source_idx, REST).x;
        if layer >= 0.0 {
            let uv = sight.pixel / params.array_size;
            let level = level_of_detail(source_idx, sight, ray, plane);
            let value = textureSampleLevel(masks, mask_sampler, uv, u32(layer), level).r;
            a *= max((value * 255.0 - IGNORED) / (255.0 - IGNORED), 0.0);
        }
    }
    if OCCLUDED && a > 0.0 {
        a *= visible(source_idx, sight);
    }
    return a;
}

// Up to this, a difference is noise: it counts as none.
fn without_noise(diff: f32) -> f32 {
    return select(0.0, diff, diff > SAME_RAY);
}

// max(0, 1 - diff/t); where so many tie at zero that they are the threshold, none is nearer.
fn nearness(diff: f32, t: f32) -> f32 {
    return select(0.0, max(1.0 - diff / t, 0.0), t > SMALLEST_THRESHOLD);
}

// angDiff + beta * resDiff, and what time adds.
fn difference(source_idx: u32, ray: vec3f, s: f32) -> f32 {
    let center = source_data(source_idx, CENTER);
    let c = center.xyz;
    let across = s * length(cross(c, ray));
    let towards = dot(ray, c);
    let ray_squared = dot(ray, ray);
    var resolution: f32;
    if RESOLUTION_BY_LENGTH {
        let squares = s * dot(c, c) - 2.0 * towards;
        resolution = squares / (length(ray - s * c) + sqrt(ray_squared));
    } else {
        let g = center.w;
        let excess = (s * s * dot(c, c) - 2.0 * s * towards) / ray_squared;
        resolution = (source_data(source_idx, KIND).z + g * g * excess)
            / (g * sqrt(max(1.0 + excess, 0.0)) + 1.0);
    }
    var ang = angle(across, ray_squared - s * towards);
    if TIMED {
        ang += source_data(source_idx, REST).y;
    }
    return ang + params.beta * max(resolution, 0.0);
}

// The blend of photos so far.
struct Mix {
    color: vec4f,
    sum: f32,
}

// The frame's exposure: multiplied, but for what is clipped; see `exposed` in frame.rs.
fn exposed(color: vec4f, exposure: vec4f) -> vec4f {
    let white = max(color.a, 1e-9);
    let share = clamp((color.a - color) / ((1.0 - SHOULDER) * white), vec4f(0.0), vec4f(1.0));
    return color + (vec4f(exposure.rgb, 1.0) - 1.0) * color * share;
}

fn add(mix: ptr<function, Mix>, share: f32, color: vec4f, source_idx: u32) {
    // `trust` of frame.rs.
    let weight = share * (TRANSPARENT + (1.0 - TRANSPARENT) * color.a);
    if EXPOSED {
        (*mix).color += weight * exposed(color, source_data(source_idx, EXPOSURE));
    } else {
        (*mix).color += weight * color;
    }
    (*mix).sum += weight;
}

// Straight alpha; transparent black where nothing was added.
fn resolve(mix: Mix) -> vec4f {
    if mix.sum <= 0.0 || mix.color.a <= 0.0 {
        return vec4f(0.0);
    }
    let rgb = mix.color.rgb / mix.color.a;
    let alpha = mix.color.a / mix.sum;
    // What rounds to no coverage has no colour.
    return select(vec4f(rgb, alpha), vec4f(0.0), alpha * 255.0 < 0.5);
}
