// Blurs the field over 27 voxels with weights 8-4-2-1 and lets it decay; for rows of any length.
//
// An invocation walks along z with up to four voxels of x, the last of them perhaps beyond the row's end.

#import lib/physarum.wgsl
#import lib/walls.wgsl
#import lib/blur.wgsl

@group(0) @binding(0) var<uniform> params: Physarum;
/// Counts of the last step.
@group(0) @binding(1) var<storage, read> previous: array<u32>;
/// Counts after blur and decay.
@group(0) @binding(2) var<storage, read_write> next: array<u32>;

/// Voxels along z that an invocation walks.
override column: u32 = 32u;

fn counts(x: i32, row: u32) -> u32 {
    let width = i32(params.size.x);
    return select(previous[row + u32(folded_index(x, width))], 0u, is_void(x, width));
}

fn row(x: i32, y: i32, z: i32) -> Sums {
    let size = vec3i(params.size);
    if is_void(y, size.y) || is_void(z, size.z) {
        return Sums();
    }
    let start = (u32(folded_index(z, size.z)) * params.size.y + u32(folded_index(y, size.y))) * params.size.x;
    let middle = vec4u(counts(x, start), counts(x + 1, start), counts(x + 2, start), counts(x + 3, start));
    return tent_x(counts(x - 1, start), middle, counts(x + 4, start));
}

fn plane(x: i32, y: i32, z: i32) -> Sums {
    return tent(row(x, y - 1, z), row(x, y, z), row(x, y + 1, z));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let item = (group.y * groups.x + group.x) * 64u + local;
    let quads = (params.size.x + 3u) / 4u;
    let x = item % quads * 4u;
    let y = item / quads % params.size.y;
    let begin = item / quads / params.size.y * column;
    if begin >= params.size.z {
        return;
    }
    let end = min(begin + column, params.size.z);
    let width = params.size.x - x;

    var behind = plane(i32(x), i32(y), i32(begin) - 1);
    var here = plane(i32(x), i32(y), i32(begin));
    for (var z = begin; z < end; z++) {
        let beyond = plane(i32(x), i32(y), i32(z) + 1);
        let counts = decayed(tent(behind, here, beyond), params.decay);
        let at = (z * params.size.y + y) * params.size.x + x;
        next[at] = counts.x;
        if width > 1u {
            next[at + 1u] = counts.y;
        }
        if width > 2u {
            next[at + 2u] = counts.z;
        }
        if width > 3u {
            next[at + 3u] = counts.w;
        }
        behind = here;
        here = beyond;
    }
}
