// Fills a grid with a cloud: gradient noise, cut by an ellipsoid.
#import lib/random.wgsl

struct Job {
    /// Voxels along each edge.
    size: u32,
    seed: u32,
    /// Cells of noise along an edge.
    frequency: f32,
    octaves: u32,
    /// Radii of the ellipsoid in voxels.
    radii: vec3f,
    /// 1: five classes of density; 0: continuous.
    classes: u32,
}

@group(0) @binding(0) var<storage, read> job: Job;
/// Density, x fastest.
@group(0) @binding(1) var<storage, read_write> density: array<f32>;

/// Dot product of the offset with the gradient at a lattice point: one of the twelve edges of a cube (Perlin 2002).
fn gradient(at: vec3i, offset: vec3f, seed: u32) -> f32 {
    let h = hash3(bitcast<vec3u>(at) ^ vec3u(seed)).x % 12u;
    let a = select(offset.x, offset.y, h >= 8u);
    let b = select(offset.y, offset.z, h >= 4u);
    return select(a, -a, (h & 1u) == 1u) + select(b, -b, (h & 2u) == 2u);
}

/// Gradient noise in about [−1, 1].
fn noise(p: vec3f, seed: u32) -> f32 {
    let base = floor(p);
    let at = vec3i(base);
    let f = p - base;
    let u = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    var corners: array<f32, 8>;
    for (var i = 0; i < 8; i++) {
        let corner = vec3i(i & 1, (i >> 1u) & 1, i >> 2u);
        corners[i] = gradient(at + corner, f - vec3f(corner), seed);
    }
    let x0 = mix(vec2f(corners[0], corners[2]), vec2f(corners[1], corners[3]), u.x);
    let x1 = mix(vec2f(corners[4], corners[6]), vec2f(corners[5], corners[7]), u.x);
    return mix(mix(x0.x, x0.y, u.y), mix(x1.x, x1.y, u.y), u.z);
}

/// Density of the five classes, denser where only the middle of the ellipsoid lets low noise stand.
fn class_density(n: f32) -> f32 {
    if (n < 0.3) { return 1.0; }
    if (n < 0.4) { return 15.0 / 16.0; }
    if (n < 0.6) { return 12.0 / 16.0; }
    if (n < 0.7) { return 8.0 / 16.0; }
    return 3.0 / 16.0;
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.y * groups.x + group.x) * 64u + lane;
    if (index >= job.size * job.size * job.size) {
        return;
    }
    let voxel = vec3f(vec3u(index % job.size, (index / job.size) % job.size, index / (job.size * job.size))) + 0.5;
    let at = voxel / f32(job.size) * job.frequency;
    var sum = 0.0;
    var weight = 1.0;
    var scale = 1.0;
    for (var octave = 0u; octave < job.octaves; octave++) {
        sum += weight * noise(at * scale, job.seed + octave);
        weight *= 0.5;
        scale *= 2.0;
    }
    let n = clamp(0.5 + 0.5 * sum, 0.0, 0.9999);
    let r = (voxel - f32(job.size) / 2.0) / job.radii;
    let d2 = dot(r, r);
    let inside = n - d2 >= 0.04 && d2 <= 1.5;
    let smooth_density = clamp((n - d2 - 0.04) / 0.25, 0.0, 1.0);
    density[index] = select(0.0, select(smooth_density, class_density(n), job.classes == 1u), inside);
}
