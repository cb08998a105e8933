// Follows paths through the volumes by delta tracking (or voxel by voxel) and adds what they gather to the film.
//
// An invocation owns `pixels_per_lane` pixels, one after the other, and brings each to `target_samples` samples. Its state
// is one path: it flies (cell by cell through one volume after the other), and when the flight has ended it
// scatters, escapes, or looks to a light. A dispatch ends after `budget` rounds; the path under way is
// then kept in `suspended` and goes on in the next dispatch.
#import lib/random.wgsl
#import lib/phase.wgsl
#import lib/volume.wgsl
#import lib/light.wgsl

/// Whether the scene has exactly one volume: lets the compiler drop the walk over volumes.
override SINGLE: bool = false;
/// Whether any volume has the threshold law.
override THRESHOLD: bool = true;
/// Whether any volume shines.
override EMISSION: bool = true;

const NONE: u32 = 0xffffffffu;
const BACKGROUND_SKY: u32 = 0u;
const BACKGROUND_TRANSPARENT: u32 = 2u;
/// Throughput below which a path takes part in Russian roulette.
const ROULETTE: f32 = 0.3;

struct Camera {
    position: vec3f,
    forward: vec3f,
    /// To the right and up, as long as half the picture's height at distance 1.
    right: vec3f,
    up: vec3f,
    /// Axes of the lens, as long as its radius.
    lens_right: vec3f,
    lens_up: vec3f,
    /// Distance of the plane in focus, along `forward`.
    focus: f32,
}

struct Scene {
    camera: Camera,
    seed: u32,
}

/// What loops and branches depend on in a scene.
struct Limits {
    volume_count: u32,
    max_bounces: u32,
    background: u32,
    /// 1 if the sun shines; lamps are counted after it.
    suns: u32,
    lamps: u32,
}

/// What one dispatch does.
struct Batch {
    /// Size of the whole picture, of which the film is a band.
    picture: vec2u,
    /// Size of the film, and the picture's row at which it begins.
    film: vec2u,
    first_row: u32,
    /// Samples that each pixel shall have.
    target_samples: u32,
    /// Blocks of 8×8 pixels along x and in all; block i stands at (i·stride) mod count, to spread work over the picture.
    blocks_x: u32,
    blocks: u32,
    stride: u32,
    /// The part of the blocks that this dispatch works on.
    first_block: u32,
    end_block: u32,
    /// Blocks of one workgroup.
    blocks_per_group: u32,
    /// Rounds of flights after which a lane begins no further one.
    budget: u32,
    /// 1: go on with suspended paths.
    resume: u32,
    /// Least weight of a new sample over all before it; 0: each counts alike.
    least_weight: f32,
}

/// A path between two flights.
struct Path {
    origin: vec3f,
    /// The lane's block under way.
    block: u32,
    direction: vec3f,
    bounces: u32,
    throughput: vec3f,
    /// The volume in whose voxel the flight begins after a scattering: the threshold law draws no lot there again.
    scattered_in: u32,
    radiance: vec3f,
    alpha: f32,
    random: vec2u,
    alive: u32,
    pad: u32,
}

struct Status {
    /// Lanes whose path is suspended.
    suspended: atomic<u32>,
    /// Paths dropped because they were not finite.
    dropped: atomic<u32>,
}

// What control flow depends on stands in storage, not in uniforms: see `Gpu::uniform`.
@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<uniform> light: Light;
@group(0) @binding(2) var<storage, read> volumes: array<Volume, MAX_VOLUMES>;
@group(0) @binding(3) var<storage, read> batch: Batch;
/// (lowest value, 1 / width) of each volume.
@group(0) @binding(4) var<storage, read> windows: array<vec2f>;
/// All volumes' words.
@group(0) @binding(5) var<storage, read> words: array<u32>;
/// Greatest value in reach of each macrocell.
@group(0) @binding(6) var<storage, read> cell_max: array<f32>;
/// Two words of four a pixel: mean of r, g, b, alpha; sum of squared deviations of r, g, b, and the counts
/// (samples in the low 21 bits, dropped paths above).
@group(0) @binding(7) var<storage, read_write> film: array<vec4u>;
@group(0) @binding(8) var<storage, read_write> suspended: array<Path>;
@group(0) @binding(9) var<storage, read_write> status: Status;
@group(0) @binding(10) var<storage, read> limits_in: Limits;

/// Steps of a flight before other lanes get their turn.
const BURST: u32 = 16u;
/// Bursts after which a flight's path is dropped: where a majorant is out of all proportion, it would never end.
const MAX_BURSTS: u32 = 1024u;
const COUNT_BITS: u32 = 21u;
const COUNT_MASK: u32 = 0x1fffffu;

// Copies of parameters in registers: a storage load costs software drivers dozens of cycles, even where nobody needs it.
var<private> limits: Limits;
var<private> target_samples: u32;
var<private> least_weight: f32;

// The path of this invocation.
var<private> path: Path;
var<private> random: vec2u;

// Its pixel: index in the film, running mean and squared deviations, counts.
var<private> pixel: u32 = NONE;
var<private> pixel_mean: vec4f;
var<private> pixel_spread: vec3f;
var<private> pixel_counts: u32;

#import lib/flight.wgsl

/// Begins the flight along the path.
fn fly() {
    ray = path.direction;
    to_light = false;
    reach = 0x1.fffffep+127f;
    hit = NONE;
    flying = take_off(0u);
}

/// Chooses a light and begins the flight towards it; false where there is none.
fn look_to_light() -> bool {
    let lights = limits.suns + limits.lamps;
    if (lights == 0u) {
        return false;
    }
    var chosen = 0u;
    if (lights > 1u) {
        chosen = min(u32(draw() * f32(lights)), lights - 1u);
    }
    reach = 0x1.fffffep+127f;
    if (chosen < limits.suns) {
        ray = light.to_sun;
        arriving = light.sun_irradiance;
    } else {
        let lamp = light.lamps[chosen - limits.suns];
        let way = lamp.position - path.origin;
        reach = max(length(way), 1e-6);
        ray = way / reach;
        arriving = lamp.intensity / (reach * reach);
    }
    load_volume(hit);
    arriving *= f32(lights) * phase_eval(here.phase, here.phase_shape, dot(path.direction, ray));
    transmittance = 1.0;
    to_light = true;
    flying = take_off(0u);
    return true;
}

/// Scatters at the collision found: the path loses what is absorbed.
fn scatter() {
    load_volume(hit);
    path.origin += path.direction * reach;
    path.throughput *= here.albedo;
    path.scattered_in = hit;
    path.bounces++;
    path.alpha = 1.0;
    if (THRESHOLD) {
        if (here.law == LAW_THRESHOLD && here.scatter_loss > 0.0) {
            let p = path.origin;
            let q = vec3f(dot(here.voxel_from_world_x, vec4f(p, 1.0)), dot(here.voxel_from_world_y, vec4f(p, 1.0)), dot(here.voxel_from_world_z, vec4f(p, 1.0)));
            let voxel = clamp(vec3i(floor(q)), vec3i(0), here.size - 1);
            let density = density_at(voxel) * clip(vec3f(voxel) + 0.5);
            path.throughput *= 1.0 - here.scatter_loss * min(density, 1.0);
        }
    }
}

/// Turns the path after a scattering; false where it ends.
fn turn() -> bool {
    if (path.bounces >= limits.max_bounces) {
        return false;
    }
    let strongest = max(path.throughput.x, max(path.throughput.y, path.throughput.z));
    if (strongest < ROULETTE) {
        let survival = strongest / ROULETTE;
        if (draw() >= survival) {
            return false;
        }
        path.throughput /= survival;
    }
    load_volume(hit);
    path.direction = phase_sample(here.phase, here.phase_shape, path.direction, vec2f(draw(), draw()));
    return true;
}

/// What a path that met nothing more sees.
fn escape() {
    if (path.bounces > 0u || limits.background == BACKGROUND_SKY) {
        path.radiance += path.throughput * sky(path.direction);
    }
    if (path.bounces == 0u && limits.background != BACKGROUND_TRANSPARENT) {
        path.alpha = 1.0;
    }
}

fn finite(x: vec3f) -> bool {
    // Spelled in bits: compilers may assume that floats are finite.
    return all((bitcast<vec3u>(x) & vec3u(0x7f800000u)) != vec3u(0x7f800000u));
}

/// Adds the finished path to its pixel.
fn gather() {
    if (lost || !finite(path.radiance)) {
        // A single bad path would poison the film for ever.
        lost = false;
        atomicAdd(&status.dropped, 1u);
        pixel_counts += 1u << COUNT_BITS;
        return;
    }
    pixel_counts++;
    let weight = max(1.0 / f32(pixel_counts & COUNT_MASK), least_weight);
    let change = vec4f(path.radiance, path.alpha) - pixel_mean;
    pixel_mean += change * weight;
    pixel_spread += change.xyz * (vec4f(path.radiance, path.alpha) - pixel_mean).xyz;
}

fn samples_done() -> u32 {
    return (pixel_counts & COUNT_MASK) + (pixel_counts >> COUNT_BITS);
}

fn put_pixel() {
    if (pixel != NONE) {
        film[2u * pixel] = bitcast<vec4u>(pixel_mean);
        film[2u * pixel + 1u] = vec4u(bitcast<vec3u>(pixel_spread), pixel_counts);
    }
}

/// Position in the film of this lane's pixel in a block.
fn place(block: u32, lane: u32) -> vec2u {
    let at = (block * batch.stride) % batch.blocks;
    return vec2u(at % batch.blocks_x, at / batch.blocks_x) * 8u + vec2u(lane % 8u, lane / 8u);
}

/// Takes up the lane's pixel in the block under way, if it stands in the film.
fn take_pixel(lane: u32) {
    let at = place(path.block, lane);
    pixel = NONE;
    if (all(at < batch.film)) {
        pixel = at.y * batch.film.x + at.x;
        pixel_mean = bitcast<vec4f>(film[2u * pixel]);
        let spread = film[2u * pixel + 1u];
        pixel_spread = bitcast<vec3f>(spread.xyz);
        pixel_counts = spread.w;
    }
}

/// Begins a path at the camera.
fn depart(lane: u32) {
    let at = place(path.block, lane) + vec2u(0u, batch.first_row);
    random = stream(at.y * batch.picture.x + at.x, samples_done(), scene.seed);
    let p = 2.0 * (vec2f(at) + vec2f(draw(), draw())) / vec2f(batch.picture) - 1.0;
    let aspect = f32(batch.picture.x) / f32(batch.picture.y);
    let way = scene.camera.forward + p.x * aspect * scene.camera.right - p.y * scene.camera.up;
    let r = sqrt(draw());
    let phi = 2.0 * PI * draw();
    let lens = r * (cos(phi) * scene.camera.lens_right + sin(phi) * scene.camera.lens_up);
    path.origin = scene.camera.position + lens;
    path.direction = normalize(way * scene.camera.focus - lens);
    path.throughput = vec3f(1.0);
    path.radiance = vec3f(0.0);
    path.alpha = 0.0;
    path.bounces = 0u;
    path.scattered_in = NONE;
    path.alive = 1u;
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group_id: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let group = group_id.y * groups.x + group_id.x;
    let slot = group * 64u + lane;
    let first = batch.first_block + group * batch.blocks_per_group;
    let end = min(first + batch.blocks_per_group, batch.end_block);
    if (first >= end) {
        return;
    }
    if (batch.resume == 1u) {
        path = suspended[slot];
        if (path.alive == 0u) {
            return;
        }
        random = path.random;
    } else {
        path.block = first;
        path.alive = 0u;
    }
    limits = limits_in;
    target_samples = batch.target_samples;
    least_weight = batch.least_weight;
    let budget = batch.budget;
    var rounds = 0u;
    var bursts = 0u;
    if (SINGLE) {
        here = volumes[0];
        here_window = windows[0];
    }
    take_pixel(lane);
    if (path.alive == 1u) {
        fly();
    }
    loop {
        // Fly on, at most BURST steps, so that the number of loop iterations is bounded: Mesa's software driver leaves
        // every loop without a word once an invocation has been through 65535 iterations in all.
        rounds++;
        for (var i = 0u; i < BURST && flying; i++) {
            if (step()) {
                continue;
            }
            // A light that is hidden, or the last volume: the flight is over; else on to the next volume.
            if (SINGLE || (to_light && transmittance <= 0.0)) {
                flying = false;
            } else {
                flying = take_off(volume + 1u);
            }
        }
        if (flying) {
            bursts++;
            if (bursts < MAX_BURSTS) {
                continue;
            }
            flying = false;
            lost = true;
        }
        bursts = 0u;
        // Then decide what comes next.
        if (path.alive == 1u) {
            var goes_on = true;
            if (lost) {
                goes_on = false;
            } else if (to_light) {
                path.radiance += path.throughput * arriving * transmittance;
                goes_on = turn();
            } else if (hit != NONE) {
                scatter();
                if (look_to_light()) {
                    continue;
                }
                goes_on = turn();
            } else {
                escape();
                goes_on = false;
            }
            if (!goes_on) {
                gather();
                path.alive = 0u;
            }
        }
        if (path.alive == 0u) {
            while (path.block < end && (pixel == NONE || samples_done() >= target_samples)) {
                put_pixel();
                path.block++;
                if (path.block < end) {
                    take_pixel(lane);
                }
            }
            if (path.block >= end) {
                break;
            }
            depart(lane);
        }
        if (rounds > budget) {
            break;
        }
        fly();
    }
    if (path.block < end) {
        put_pixel();
        atomicAdd(&status.suspended, 1u);
    }
    path.random = random;
    suspended[slot] = path;
}
