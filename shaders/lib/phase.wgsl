// Phase functions: the density of the direction after a scattering, over solid angle, and how to draw from it.
// mu is the cosine between the directions of travel before and after.

const PI: f32 = 3.14159265358979;

const PHASE_ISOTROPIC: u32 = 0u;
const PHASE_HG: u32 = 1u;
const PHASE_DRIFT: u32 = 2u;

/// A direction, all alike.
fn sample_sphere(u: vec2f) -> vec3f {
    let z = 1.0 - 2.0 * u.x;
    let r = sqrt(max(0.0, 1.0 - z * z));
    let phi = 2.0 * PI * u.y;
    return vec3f(r * cos(phi), r * sin(phi), z);
}

/// Two unit vectors at right angles to n and to each other (Duff et al. 2017).
fn tangents(n: vec3f) -> mat2x3f {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat2x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y));
}

/// Density of a scattering through the angle whose cosine is mu. `shape` is g for hg, the weight for drift.
fn phase_eval(kind: u32, shape: f32, mu: f32) -> f32 {
    if (kind == PHASE_HG) {
        // Henyey and Greenstein 1941, with mu the cosine between directions of travel.
        let d = max(1.0 + shape * shape - 2.0 * shape * mu, 1e-12);
        return (1.0 - shape * shape) / (4.0 * PI * d * sqrt(d));
    }
    if (kind == PHASE_DRIFT) {
        // The new direction is normalize(w·old + unit): unit = s·new' projected back, Jacobian (w·mu+s)²/s.
        let s = sqrt(max(1.0 - shape * shape * (1.0 - mu * mu), 0.0));
        let k = max(shape * mu + s, 0.0);
        return k * k / (4.0 * PI * max(s, 1e-6));
    }
    return 1.0 / (4.0 * PI);
}

/// Draws the direction after a scattering of light that travels along d.
fn phase_sample(kind: u32, shape: f32, d: vec3f, u: vec2f) -> vec3f {
    if (kind == PHASE_HG && abs(shape) > 1e-3) {
        let k = (1.0 - shape * shape) / (1.0 + shape - 2.0 * shape * u.x);
        let mu = clamp((1.0 + shape * shape - k * k) / (2.0 * shape), -1.0, 1.0);
        let r = sqrt(max(0.0, 1.0 - mu * mu));
        let phi = 2.0 * PI * u.y;
        return normalize(tangents(d) * (r * vec2f(cos(phi), sin(phi))) + mu * d);
    }
    let unit = sample_sphere(u);
    if (kind != PHASE_DRIFT) {
        return unit;
    }
    let moved = shape * d + unit;
    let length = length(moved);
    // At |w| = 1 the sum can vanish: a set of measure zero that must not become NaN.
    return select(unit, moved / length, length > 1e-6);
}
