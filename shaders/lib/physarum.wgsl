// Physarum in three dimensions: its parameters, and the pose in which an agent starts.

#import lib/random.wgsl

/// What a step depends on. Lengths are in voxels.
struct Physarum {
    /// Voxels along x, y and z.
    size: vec3u,
    /// How many agents there are.
    agents: u32,
    /// 1 / size.
    inverse_size: vec3f,
    seed: u32,
    /// Number of the step under way; the first is 1.
    step_number: u32,
    /// Counts that an agent adds to its voxel.
    deposit: u32,
    /// Factor that the field keeps, in 65536ths.
    decay: u32,
    /// From an agent to its forward tap.
    sense_ahead: f32,
    /// From an agent to a flanking tap: along its heading, and aside.
    sense_flank: vec2f,
    /// From an agent to where a turn takes it: along its heading, and aside.
    move_flank: vec2f,
    /// Cosine and sine of half the angle by which a turn tilts the axes.
    half_tilt: vec2f,
    /// From an agent to where it goes without a turn.
    move_ahead: f32,
}

/// An agent: where it is, in voxels, and the quaternion (x, y, z, w) from its own axes to the box's. It heads along its own z.
struct Pose {
    position: vec3f,
    heading: vec4f,
}

/// Random words of an agent in a step; step 0 is the start.
fn agent_hash(params: Physarum, agent: u32, step_number: u32) -> vec3u {
    return hash3(vec3u(agent, step_number, params.seed));
}

/// A pose that is uniform in the box and over all rotations (Shoemake 1992).
fn random_pose(hash: vec3u, size: vec3f) -> Pose {
    let u = vec3f(hash3(hash ^ vec3u(0x68e31da4u)) >> vec3u(8u)) * 0x1p-24f;
    let v = vec3f(hash3(hash ^ vec3u(0xb5297a4du)) >> vec3u(8u)) * 0x1p-24f;
    let angle = 6.2831853f * v.yz;
    let radius = sqrt(vec2f(1.0 - v.x, v.x));
    let heading = vec4f(radius.x * sin(angle.x), radius.x * cos(angle.x), radius.y * sin(angle.y), radius.y * cos(angle.y));
    // One Newton step to length 1: the device's sines are not exact.
    return Pose(u * size, heading * (1.5 - 0.5 * dot(heading, heading)));
}

/// Index of the voxel that holds a position inside the box.
fn voxel_index(position: vec3f, size: vec3u) -> u32 {
    let voxel = min(vec3u(position), size - 1u);
    return (voxel.z * size.y + voxel.y) * size.x + voxel.x;
}
