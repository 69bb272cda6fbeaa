// The exact field: at every pixel, all source views are weighed (the twin of
// `render/src/blend.rs`).

// MAX_CONTRIBUTORS, and one more whose difference caps the threshold.
const LISTED = 17u;

// The candidates with the smallest differences, nearest first, lower index first.
struct Nearest {
    count: u32,
    source_idx: array<u32, LISTED>,
    diff: array<f32, LISTED>,
    a: array<f32, LISTED>,
}

fn nearest_sources(ray: vec3f, s: f32, plane: vec3f) -> Nearest {
    var nearest: Nearest;
    let source_count = u32(source_data(0u, EXPOSURE).w);
    for (var i = 0u; i < source_count; i++) {
        let a = relevance(i, see(i, ray, s), ray, plane);
        if a <= 0.0 {
            continue;
        }
        let diff = without_noise(difference(i, ray, s));
        var at = nearest.count;
        if at == LISTED {
            if diff >= nearest.diff[LISTED - 1u] {
                continue;
            }
            at = LISTED - 1u;
        } else {
            nearest.count++;
        }
        while at > 0u && nearest.diff[at - 1u] > diff {
            nearest.source_idx[at] = nearest.source_idx[at - 1u];
            nearest.diff[at] = nearest.diff[at - 1u];
            nearest.a[at] = nearest.a[at - 1u];
            at--;
        }
        nearest.source_idx[at] = i;
        nearest.diff[at] = diff;
        nearest.a[at] = a;
    }
    return nearest;
}

fn threshold(nearest: ptr<function, Nearest>) -> f32 {
    if BLEND_OF_PAPER {
        let nth = min(params.k, (*nearest).count);
        return max((*nearest).diff[nth - 1u], SMALLEST_THRESHOLD);
    }
    let capped = (*nearest).count == LISTED;
    let limit = select(INFINITY, (*nearest).diff[LISTED - 1u], capped);
    var sum_a = 0.0;
    var sum_a_diff = 0.0;
    for (var n = 0u; n < (*nearest).count; n++) {
        sum_a += (*nearest).a[n];
        sum_a_diff += (*nearest).a[n] * (*nearest).diff[n];
        if sum_a > params.full_weight {
            let t = sum_a_diff / (sum_a - params.full_weight);
            if n + 1u == (*nearest).count || t <= (*nearest).diff[n + 1u] {
                return max(min(t, limit), SMALLEST_THRESHOLD);
            }
        }
    }
    return max(limit, SMALLEST_THRESHOLD);
}

// Leaves the weights in `a`; returns how many of the list count.
fn weigh(nearest: ptr<function, Nearest>) -> u32 {
    let count = (*nearest).count;
    if count == 0u {
        return 0u;
    }
    let t = threshold(nearest);
    var sum = 0.0;
    var tied = 0u;
    for (var n = 0u; n < count; n++) {
        let diff = (*nearest).diff[n];
        var relevance = nearness(diff, t);
        if !BLEND_OF_PAPER {
            relevance /= max(diff, SAME_RAY);
        }
        let weight = (*nearest).a[n] * relevance;
        if diff == (*nearest).diff[0] {
            tied = n + 1u;
        }
        sum += weight;
        if relevance <= 0.0 && tied <= n {
            // Sorted: the rest weighs nothing either, and is not tied with the nearest.
            break;
        }
    }
    if sum <= 0.0 {
        // The nearest are tied, and share.
        return min(tied, CONTRIBUTORS);
    }
    for (var n = 0u; n < count; n++) {
        let diff = (*nearest).diff[n];
        var relevance = nearness(diff, t);
        if !BLEND_OF_PAPER {
            relevance /= max(diff, SAME_RAY);
        }
        (*nearest).a[n] *= relevance;
    }
    return count;
}
