// Holds at 2^32 - 1 the sums that have passed it, and counts them.

/// Counts.
@group(0) @binding(0) var<storage, read_write> field: array<u32>;
/// Voxels that physarum_deposit has listed.
@group(0) @binding(1) var<storage, read> passed: array<u32>;
/// How many of them there are.
@group(0) @binding(2) var<storage, read> passed_count: u32;
/// Sums held since the start: low and high word.
@group(0) @binding(3) var<storage, read_write> held: array<u32, 2>;

const INVOCATIONS = 1024u;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    for (var i = id.x; i < passed_count; i += INVOCATIONS) {
        field[passed[i]] = 0xffffffffu;
    }
    if id.x == 0u {
        let low = held[0] + passed_count;
        held[1] += u32(low < passed_count);
        held[0] = low;
    }
}
