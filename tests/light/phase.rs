//! The phase functions' sampling against their densities.

use statrs::distribution::{ChiSquared, ContinuousCDF};
use tyndall::gpu::{Kernel, Readback, groups_1d, shader};

use crate::harness::gpu;

const PROBE: &str = "
#import lib/random.wgsl
#import lib/phase.wgsl
struct Job { kind: u32, shape: f32, axis: vec3f }
@group(0) @binding(0) var<storage, read> job: Job;
@group(0) @binding(1) var<storage, read_write> drawn: array<vec4f>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    var state = stream(id.x, 0u, 17u);
    let d = phase_sample(job.kind, job.shape, job.axis, vec2f(next_f32(&state), next_f32(&state)));
    let mu = dot(d, job.axis);
    let side = tangents(job.axis);
    drawn[id.x] = vec4f(mu, atan2(dot(d, side[1]), dot(d, side[0])), phase_eval(job.kind, job.shape, mu), length(d));
}
";

#[derive(encase::ShaderType)]
struct Job {
    kind: u32,
    shape: f32,
    axis: glam::Vec3,
}

const DRAWS: usize = 1 << 18;

/// (mu, azimuth, density at mu, length) of each draw.
fn draw(kind: u32, shape: f32) -> Vec<[f32; 4]> {
    let kernel = Kernel::new(gpu(), "probe", &shader::expand(PROBE), &[]);
    let job = gpu().uniform("job", &Job { kind, shape, axis: glam::Vec3::new(0.48, -0.6, 0.64) });
    let drawn = gpu().storage("drawn", DRAWS as u64 * 16).unwrap();
    let bound = kernel.bind(gpu(), &[("job", &job), ("drawn", &drawn)]);
    let mut encoder = gpu().encoder("probe");
    kernel.dispatch(&mut encoder, &bound, groups_1d(DRAWS as u64, 64));
    gpu().queue().submit([encoder.finish()]);
    Readback::default().values(gpu(), &drawn, DRAWS).unwrap()
}

/// The densities as published, in double precision.
fn density(kind: u32, shape: f64, mu: f64) -> f64 {
    let over_sphere = match kind {
        0 => 1.0,
        1 => (1.0 - shape * shape) / (1.0 + shape * shape - 2.0 * shape * mu).powf(1.5),
        _ => {
            let s = (1.0 - shape * shape * (1.0 - mu * mu)).sqrt();
            (shape * mu + s).powi(2) / s
        }
    };
    over_sphere / (4.0 * std::f64::consts::PI)
}

/// p of the χ² statistic of counts against expected counts; bins that expect fewer than 10 are put together.
fn p_value(counts: &[f64], expected: &[f64]) -> f64 {
    let (mut chi2, mut bins) = (0.0, 0);
    let (mut count, mut expect) = (0.0, 0.0);
    for (c, e) in counts.iter().zip(expected) {
        count += c;
        expect += e;
        if expect >= 10.0 {
            chi2 += (count - expect).powi(2) / expect;
            bins += 1;
            (count, expect) = (0.0, 0.0);
        }
    }
    ChiSquared::new(f64::from(bins - 1)).unwrap().sf(chi2)
}

fn shapes() -> Vec<(u32, f32)> {
    let hg = [-0.9, -0.4, 0.0, 0.3, 0.8, 0.95].map(|g| (1, g));
    let drift = [-0.99, -0.8, -0.3, 0.0, 0.5, 0.9].map(|w| (2, w));
    [(0, 0.0)].into_iter().chain(hg).chain(drift).collect()
}

#[test]
fn directions_are_drawn_by_the_phase_function() {
    const BINS: usize = 64;
    for (kind, shape) in shapes() {
        let drawn = draw(kind, shape);
        let mut counts = [0.0; BINS];
        let mut around = [0.0; BINS];
        for [mu, azimuth, _, length] in &drawn {
            assert!((length - 1.0).abs() < 1e-5, "kind {kind} shape {shape}: a direction of length {length}");
            counts[(((mu + 1.0) / 2.0 * BINS as f32) as usize).min(BINS - 1)] += 1.0;
            around[((f32::midpoint(azimuth / std::f32::consts::PI, 1.0) * BINS as f32) as usize).min(BINS - 1)] += 1.0;
        }
        let expected: Vec<f64> = (0..BINS)
            .map(|bin| {
                // Midpoint rule, fine enough for the sharpest lobe.
                let steps = 2000;
                let width = 2.0 / BINS as f64 / f64::from(steps);
                let first = -1.0 + bin as f64 * 2.0 / BINS as f64;
                let integral: f64 =
                    (0..steps).map(|i| density(kind, f64::from(shape), first + (f64::from(i) + 0.5) * width)).sum();
                integral * width * 2.0 * std::f64::consts::PI * DRAWS as f64
            })
            .collect();
        let total: f64 = expected.iter().sum();
        assert!((total / DRAWS as f64 - 1.0).abs() < 1e-4, "kind {kind} shape {shape}: the density integrates to {total}");
        let p = p_value(&counts, &expected);
        assert!(p > 1e-4, "kind {kind} shape {shape}: cosines have p = {p:.2e}");
        let p = p_value(&around, &[DRAWS as f64 / BINS as f64; BINS]);
        assert!(p > 1e-4, "kind {kind} shape {shape}: azimuths have p = {p:.2e}");
    }
}

#[test]
fn the_density_that_lights_are_weighed_by_is_the_published_one() {
    for (kind, shape) in shapes() {
        for [mu, _, value, _] in draw(kind, shape).iter().step_by(97) {
            let expected = density(kind, f64::from(shape), f64::from(*mu));
            assert!(
                (f64::from(*value) / expected - 1.0).abs() < 2e-3,
                "kind {kind} shape {shape} mu {mu}: {value}, expected {expected}"
            );
        }
    }
}

#[test]
fn drift_keeps_two_thirds_of_its_weight_as_mean_cosine() {
    for weight in [-1.0f32, -0.5, 0.4, 1.0] {
        let drawn = draw(2, weight);
        let n = drawn.len() as f64;
        let mean = drawn.iter().map(|d| f64::from(d[0])).sum::<f64>() / n;
        let variance = drawn.iter().map(|d| (f64::from(d[0]) - mean).powi(2)).sum::<f64>() / n;
        let z = (mean - 2.0 * f64::from(weight) / 3.0) / (variance / n).sqrt();
        assert!(z.abs() < 4.0, "weight {weight}: mean cosine {mean}, z = {z}");
    }
}
