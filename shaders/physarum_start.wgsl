// Puts every agent at a random place with a random heading.

#import lib/physarum.wgsl

@group(0) @binding(0) var<uniform> params: Physarum;
/// Position of each agent in voxels, as bits, and the index of its voxel.
@group(0) @binding(1) var<storage, read_write> places: array<vec4u>;
/// Quaternion of each agent, from its own axes to the box's.
@group(0) @binding(2) var<storage, read_write> headings: array<vec4f>;

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
    let pose = random_pose(agent_hash(params, agent, 0u), vec3f(params.size));
    places[agent] = vec4u(bitcast<vec3u>(pose.position), voxel_index(pose.position, params.size));
    headings[agent] = pose.heading;
}
