// Lets every agent sense the field at four taps, turn to the strongest and move.
//
// Nothing is deposited meanwhile: all agents see the same field, whatever the order in which they run.

#import lib/physarum.wgsl
#import lib/walls.wgsl

@group(0) @binding(0) var<uniform> params: Physarum;
/// Counts after blur and decay.
@group(0) @binding(1) var<storage, read> field: array<u32>;
/// Position of each agent in voxels, as bits, and the index of its voxel.
@group(0) @binding(2) var<storage, read_write> places: array<vec4u>;
/// Quaternion of each agent, from its own axes to the box's.
@group(0) @binding(3) var<storage, read_write> headings: array<vec4f>;

/// Sine and cosine of 120°.
const FLANK = vec2f(0.8660254, -0.5);
/// Sine and cosine of 60°.
const HALF_FLANK = vec2f(0.8660254, 0.5);

fn counts_at(position: vec3f) -> u32 {
    let size = vec3f(params.size);
    let counts = field[voxel_index(folded_position(position, size, params.inverse_size), params.size)];
    return select(counts, 0u, walls == ABSORB && is_outside(position, size));
}

/// The tap to follow: 0 is forward, 1 to 3 flank it.
fn choice(counts: vec4u, random: u32) -> u32 {
    let flanks_equal = counts.y == counts.z && counts.z == counts.w;
    if flanks_equal && counts.x == counts.y {
        return random >> 30u;
    }
    if flanks_equal && counts.y > counts.x {
        return 1u + (((random >> 16u) * 3u) >> 16u);
    }
    let most = max(max(counts.x, counts.y), max(counts.z, counts.w));
    return select(select(select(3u, 2u, counts.z == most), 1u, counts.y == most), 0u, counts.x == most);
}

/// First turns by `b`, then by `a`.
fn turned(a: vec4f, b: vec4f) -> vec4f {
    return vec4f(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

/// The heading after the walls crossed have mirrored it. The agent's own x is mirrored with each: its axes stay right-handed.
fn mirrored(heading: vec4f, crossed: vec3i) -> vec4f {
    var q = heading;
    q = select(q, vec4f(q.x, -q.y, -q.z, q.w), (crossed.x & 1) != 0);
    q = select(q, vec4f(q.y, q.x, q.w, q.z), (crossed.y & 1) != 0);
    q = select(q, vec4f(-q.z, q.w, -q.x, q.y), (crossed.z & 1) != 0);
    return q;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let agent = (group.y * groups.x + group.x) * 64u + local;
    if agent >= params.agents {
        return;
    }
    let size = vec3f(params.size);
    let p = bitcast<vec3f>(places[agent].xyz);
    let q = headings[agent];

    let x = vec3f(1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y + q.w * q.z), 2.0 * (q.x * q.z - q.w * q.y));
    let y = vec3f(2.0 * (q.x * q.y - q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z), 2.0 * (q.y * q.z + q.w * q.x));
    let z = vec3f(2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), 1.0 - 2.0 * (q.x * q.x + q.y * q.y));

    // R(φ about z)·R(angle about x)·z = (sin φ sin angle, −cos φ sin angle, cos angle), with φ = 120°, 240°, 360°.
    let ahead = p + z * params.sense_flank.x;
    let aside_x = x * (FLANK.x * params.sense_flank.y);
    let aside_y = y * params.sense_flank.y;
    let counts = vec4u(
        counts_at(p + z * params.sense_ahead),
        counts_at(ahead + aside_x - FLANK.y * aside_y),
        counts_at(ahead - aside_x - FLANK.y * aside_y),
        counts_at(ahead - aside_y),
    );
    let hash = agent_hash(params, agent, params.step_number);
    let tap = choice(counts, hash.x);

    // Sine and cosine of φ, and of φ / 2 up to a common sign.
    let sine = select(select(0.0, -FLANK.x, tap == 2u), FLANK.x, tap == 1u);
    let cosine = select(FLANK.y, 1.0, tap == 3u);
    let half_sine = select(HALF_FLANK.x, 0.0, tap == 3u);
    let half_cosine = select(select(1.0, -HALF_FLANK.y, tap == 2u), HALF_FLANK.y, tap == 1u);

    let flank = z * params.move_flank.x + (x * sine - y * cosine) * params.move_flank.y;
    let goal = p + select(flank, z * params.move_ahead, tap == 0u);
    let tilt = params.half_tilt;
    let turn = vec4f(half_cosine * tilt.y, half_sine * tilt.y, half_sine * tilt.x, half_cosine * tilt.x);
    let next = turned(q, turn);
    // One Newton step to length 1: rounding must not add up over the steps.
    var heading = select(next * (1.5 - 0.5 * dot(next, next)), q, tap == 0u);
    var position = folded_position(goal, size, params.inverse_size);

    if walls == REFLECT {
        heading = mirrored(heading, vec3i(floor(goal * params.inverse_size)));
    }
    if walls == ABSORB && is_outside(goal, size) {
        let pose = random_pose(hash, size);
        position = pose.position;
        heading = pose.heading;
    }
    places[agent] = vec4u(bitcast<vec3u>(position), voxel_index(position, params.size));
    headings[agent] = heading;
}
