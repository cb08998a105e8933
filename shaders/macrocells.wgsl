// Finds the greatest value and the sum of the values in each macrocell of one volume.
#import lib/volume.wgsl

struct Job {
    size: vec3i,
    format: u32,
    cells: vec3i,
    first_word: u32,
    first_cell: u32,
    /// Voxels around the cell that count for the greatest value.
    reach: i32,
}

@group(0) @binding(0) var<uniform> job: Job;
/// The volume's words, x fastest.
@group(0) @binding(1) var<storage, read> words: array<u32>;
/// Greatest value in reach of each cell.
@group(0) @binding(2) var<storage, read_write> cell_max: array<f32>;
/// Sum of the values in each cell.
@group(0) @binding(3) var<storage, read_write> cell_sum: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.y * groups.x + group.x) * 64u + lane;
    if (index >= u32(job.cells.x * job.cells.y * job.cells.z)) {
        return;
    }
    let i = i32(index);
    let cell = vec3i(i % job.cells.x, (i / job.cells.x) % job.cells.y, i / (job.cells.x * job.cells.y));
    let first = cell * CELL;
    let lo = max(first - job.reach, vec3i(0));
    let hi = min(first + CELL + job.reach, job.size);
    var greatest = -0x1.fffffep+127f;
    var sum = 0.0;
    for (var z = lo.z; z < hi.z; z++) {
        for (var y = lo.y; y < hi.y; y++) {
            let own = z >= first.z && z < first.z + CELL && y >= first.y && y < first.y + CELL;
            let row = job.first_word + u32((z * job.size.y + y) * job.size.x);
            var row_sum = 0.0;
            for (var x = lo.x; x < hi.x; x++) {
                let value = word_value(job.format, words[row + u32(x)]);
                greatest = max(greatest, value);
                row_sum += select(0.0, value, x >= first.x && x < first.x + CELL);
            }
            sum += select(0.0, row_sum, own);
        }
    }
    cell_max[job.first_cell + index] = greatest;
    cell_sum[job.first_cell + index] = sum;
}
