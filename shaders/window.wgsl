// Writes the window of a volume whose window follows the mean of its field: from 0 to a multiple of the mean.

struct Job {
    first_cell: u32,
    cells: u32,
    /// 1 / number of voxels.
    per_voxel: f32,
    /// The multiple of the mean that becomes density 1.
    multiple: f32,
    /// Index of the volume.
    volume: u32,
}

@group(0) @binding(0) var<uniform> job: Job;
@group(0) @binding(1) var<storage, read> cell_sum: array<f32>;
/// (lowest value, 1 / width) of each volume.
@group(0) @binding(2) var<storage, read_write> windows: array<vec2f>;

var<workgroup> sums: array<f32, 256>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    // The order of the additions is fixed, so that the window, and with it every picture, has the same bits each time.
    var sum = 0.0;
    for (var i = lane; i < job.cells; i += 256u) {
        sum += cell_sum[job.first_cell + i];
    }
    sums[lane] = sum;
    for (var width = 128u; width > 0u; width /= 2u) {
        workgroupBarrier();
        if (lane < width) {
            sums[lane] += sums[lane + width];
        }
    }
    if (lane == 0u) {
        let width = sums[0] * job.per_voxel * job.multiple;
        windows[job.volume] = vec2f(0.0, select(0.0, 1.0 / width, width > 0.0));
    }
}
