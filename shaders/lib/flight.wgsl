// Flights through the volumes: free flights by delta tracking or voxel by voxel, transmittance by ratio tracking.
//
// A flight walks through one volume after the other, a step at a time, so that all lanes of a workgroup stay busy. It
// ends at the nearest collision of any volume: free flights are independent exponential races. The kernel that imports
// this owns `path` and `random`, and binds `volumes`, `windows`, `words`, `cell_max` and `limits`.

/// Transmittance below which a look to a light takes part in it.
const FADE: f32 = 0.5;

// Its flight: along path.direction, or towards a light.
var<private> flying: bool = false;
/// Whether the flight would not end: its path is dropped.
var<private> lost: bool = false;
var<private> to_light: bool = false;
var<private> ray: vec3f;
/// Length at which the flight must end: the lamp, or the nearest collision found in other volumes.
var<private> reach: f32;
/// The volume flown through, and the volume of the nearest collision so far.
var<private> volume: u32;
var<private> hit: u32;
/// Parameters of the volume last taken up.
var<private> here: Volume;
var<private> here_window: vec2f;
/// Transmittance towards the light.
var<private> transmittance: f32;
/// What arrives if nothing stands in the way.
var<private> arriving: vec3f;

// The walk through `volume`: position in it is start + ray_v·t.
var<private> start: vec3f;
var<private> ray_v: vec3f;
var<private> t: f32;
var<private> t_out: f32;
var<private> cell: vec3i;
var<private> t_next: vec3f;
/// Optical depth left until the next tentative collision.
var<private> depth: f32;
/// Whether the voxel entered next is the one of the last scattering.
var<private> skip: bool;

fn draw_u32() -> u32 {
    var state = random;
    let word = next_u32(&state);
    random = state;
    return word;
}

fn draw() -> f32 {
    return unit_f32(draw_u32());
}

/// Takes up the parameters of a volume. They are kept in registers: a storage load costs software drivers a
/// hundred cycles.
fn load_volume(index: u32) {
    if (!SINGLE) {
        here = volumes[index];
        here_window = windows[index];
    }
}

/// Begins the walk through the volume at hand; false where the ray misses it.
fn enter() -> bool {
    load_volume(volume);
    let o = vec4f(path.origin, 1.0);
    start = vec3f(dot(here.voxel_from_world_x, o), dot(here.voxel_from_world_y, o), dot(here.voxel_from_world_z, o));
    let d = vec3f(dot(here.voxel_from_world_x.xyz, ray), dot(here.voxel_from_world_y.xyz, ray), dot(here.voxel_from_world_z.xyz, ray));
    // No component may be 0: 0·∞ is NaN.
    ray_v = select(d, select(vec3f(-1e-12), vec3f(1e-12), d >= vec3f(0.0)), abs(d) < vec3f(1e-12));
    let size = vec3f(here.size);
    let a = -start / ray_v;
    let b = (size - start) / ray_v;
    let near = min(a, b);
    let far = max(a, b);
    t = max(max(near.x, near.y), max(near.z, 0.0));
    t_out = min(min(far.x, far.y), min(far.z, reach));
    if (here.ball == 1u) {
        clip_to_ball();
    }
    if (!(t < t_out)) {
        return false;
    }
    let edge = cell_edge();
    let cells = (here.size + edge - 1) / edge;
    cell = clamp(vec3i(floor((start + ray_v * t) / f32(edge))), vec3i(0), cells - 1);
    t_next = (vec3f(select(cell, cell + 1, ray_v > vec3f(0.0)) * edge) - start) / ray_v;
    depth = -log(1.0 - draw());
    skip = volume == select(path.scattered_in, hit, to_light);
    return true;
}

/// Shortens the way through the volume to the part inside its ball.
fn clip_to_ball() {
    let half = vec3f(here.size) / 2.0;
    let o = start / half - 1.0;
    let d = ray_v / half;
    let a = dot(d, d);
    let b = dot(o, d);
    let discriminant = b * b - a * (dot(o, o) - 1.0);
    let root = sqrt(max(discriminant, 0.0));
    t = max(t, (-b - root) / a);
    t_out = select(-1.0, min(t_out, (-b + root) / a), discriminant > 0.0);
}

/// What the clip leaves of the density at a point in voxels.
fn clip(p: vec3f) -> f32 {
    if (here.ball == 0u) {
        return 1.0;
    }
    let r = length(2.0 * p / vec3f(here.size) - 1.0);
    return 1.0 - smoothstep(1.0 - max(here.softness, 1e-4), 1.0, r);
}

/// Edge of the cells that a volume is walked by: macrocells, or the voxels themselves.
fn cell_edge() -> i32 {
    return select(CELL, 1, THRESHOLD && here.law == LAW_THRESHOLD);
}

/// Density in a voxel.
fn density_at(voxel: vec3i) -> f32 {
    if (here.format == FORMAT_SOLID) {
        return 1.0;
    }
    let size = here.size;
    let word = words[here.first_word + u32((voxel.z * size.y + voxel.y) * size.x + voxel.x)];
    return density_of(word_value(here.format, word), here_window);
}

/// Moves on to the next cell; false where the volume, or the flight's reach, ends.
fn advance(edge: i32, t_cell: f32) -> bool {
    if (t_cell >= t_out) {
        return false;
    }
    let axis = vec3<bool>(t_next.x <= t_cell, t_next.y <= t_cell && t_next.x > t_cell, t_next.z <= t_cell && t_next.x > t_cell && t_next.y > t_cell);
    let step = select(vec3i(-1), vec3i(1), ray_v > vec3f(0.0));
    cell = select(cell, cell + step, axis);
    t_next = select(t_next, (vec3f(select(cell, cell + 1, ray_v > vec3f(0.0)) * edge) - start) / ray_v, axis);
    t = t_cell;
    return true;
}

/// Walks on by one macrocell or one tentative collision; false when the flight through this volume has ended.
fn step_beer() -> bool {
    let cells = here.cells;
    var greatest = 1.0;
    if (here.format != FORMAT_SOLID) {
        let inside = clamp(cell, vec3i(0), cells - 1);
        greatest = density_of(cell_max[here.first_cell + u32((inside.z * cells.y + inside.y) * cells.x + inside.x)], here_window);
    }
    let majorant = here.track * greatest;
    let t_cell = min(t_next.x, min(t_next.y, t_next.z));
    let length = max(min(t_cell, t_out) - t, 0.0);
    if (depth >= majorant * length) {
        depth -= majorant * length;
        return advance(CELL, t_cell);
    }
    t += depth / majorant;
    depth = -log(1.0 - draw());
    // Trilinear interpolation is the mean over a jitter of half a voxel each way: one lookup a collision draws the
    // same lot as eight. Lookups stay where the majorant holds.
    let word = draw_u32();
    let reach_v = here.reach;
    let at = start + ray_v * t;
    var p = at;
    if (reach_v > 0) {
        let jitter = draw_u32();
        p += vec3f(vec3u(jitter & 0x7ffu, (jitter >> 11u) & 0x7ffu, (jitter >> 22u) << 1u)) / 2048.0 - vec3f(2047.0, 2047.0, 2046.0) / 4096.0;
    }
    let lo = max(cell * CELL - reach_v, vec3i(0));
    let hi = min(cell * CELL + (CELL - 1) + reach_v, here.size - 1);
    let density = density_at(clamp(vec3i(floor(p)), lo, hi)) * clip(at);
    if (to_light) {
        transmittance *= max(1.0 - here.sigma_t * density / majorant, 0.0);
        return fade();
    }
    if (EMISSION) {
        path.radiance += path.throughput * here.emission * (density / majorant);
    }
    if (unit_f32(word) * majorant < here.sigma_t * density) {
        reach = t;
        hit = volume;
        return false;
    }
    return true;
}

/// Enters one voxel by the threshold law; false when the flight through this volume has ended.
fn step_threshold() -> bool {
    let density = density_at(clamp(cell, vec3i(0), here.size - 1)) * clip(vec3f(cell) + 0.5);
    let t_cell = min(t_next.x, min(t_next.y, t_next.z));
    let length = max(min(t_cell, t_out) - t, 0.0);
    let p = select(min(here.voxel_probability * density, 1.0), 0.0, skip);
    skip = false;
    if (to_light) {
        transmittance *= 1.0 - p;
        return fade() && advance(1, t_cell);
    }
    var flown = length;
    let scatters = draw() < p;
    if (scatters) {
        flown = length * draw();
    }
    if (EMISSION) {
        path.radiance += path.throughput * here.emission * (density * flown);
    }
    if (scatters) {
        t += flown;
        reach = t;
        hit = volume;
        return false;
    }
    return advance(1, t_cell);
}

/// Russian roulette on light that is nearly gone; false when it is.
fn fade() -> bool {
    if (transmittance < FADE) {
        transmittance = select(0.0, FADE, draw() * FADE < transmittance);
    }
    return transmittance > 0.0;
}

/// Walks on by one cell; false when the flight through this volume has ended.
fn step() -> bool {
    if (THRESHOLD) {
        if (here.law == LAW_THRESHOLD) {
            return step_threshold();
        }
    }
    return step_beer();
}

/// Begins a flight at the first volume that the ray meets; false where there is none.
fn take_off(first: u32) -> bool {
    volume = first;
    while (volume < limits.volume_count) {
        if (enter()) {
            return true;
        }
        volume++;
    }
    return false;
}

