// Adds every agent's deposit to its voxel, and lists the voxels whose sum has passed 2^32 - 1.

#import lib/physarum.wgsl

@group(0) @binding(0) var<uniform> params: Physarum;
/// Counts, modulo 2^32 until physarum_hold has run.
@group(0) @binding(1) var<storage, read_write> field: array<atomic<u32>>;
/// Position of each agent in voxels, as bits, and the index of its voxel.
@group(0) @binding(2) var<storage, read> places: array<vec4u>;
/// A voxel for each time that a sum has passed a multiple of 2^32. It lies in the field of the last step, which is free by now.
@group(0) @binding(3) var<storage, read_write> passed: array<u32>;
/// How many of them there are.
@group(0) @binding(4) var<storage, read_write> passed_count: atomic<u32>;

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
    let voxel = places[agent].w;
    let before = atomicAdd(&field[voxel], params.deposit);
    // Exactly one of the agents sees the sum pass, and how often it does depends on the sum alone: not on the order.
    if before + params.deposit < before {
        passed[atomicAdd(&passed_count, 1u)] = voxel;
    }
}
