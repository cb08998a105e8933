// Blurs the field over 27 voxels with weights 8-4-2-1 and lets it decay; for rows that are a multiple of four voxels.
//
// An invocation walks along z with 4×4 voxels of x and y, and keeps the sums of the last two planes:
// 36 words loaded for 16 voxels. On software Vulkan loads are what counts: each is a loop over the lanes.

#import lib/physarum.wgsl
#import lib/walls.wgsl
#import lib/blur.wgsl

@group(0) @binding(0) var<uniform> params: Physarum;
/// Counts of the last step, four along x a word.
@group(0) @binding(1) var<storage, read> previous: array<vec4u>;
/// Counts after blur and decay.
@group(0) @binding(2) var<storage, read_write> next: array<vec4u>;

/// Voxels along z that an invocation walks.
override column: u32 = 32u;

/// Sums over x and y of a plane, at four rows.
struct Plane {
    a: Sums,
    b: Sums,
    c: Sums,
    d: Sums,
}

/// The four voxels along x that an invocation owns, and its neighbours', in words from the start of a row.
var<private> quad: vec3u;

fn row(y: i32, plane: u32) -> Sums {
    let words = params.size.x / 4u;
    let start = plane + u32(folded_index(y, i32(params.size.y))) * words;
    var left = previous[start + quad.x].w;
    var right = previous[start + quad.z].x;
    let middle = previous[start + quad.y];
    if walls != PERIODIC {
        let first = quad.y == 0u;
        let last = quad.y == words - 1u;
        left = select(left, select(0u, middle.x, walls == REFLECT), first);
        right = select(right, select(0u, middle.w, walls == REFLECT), last);
    }
    let sums = tent_x(left, middle, right);
    let void_row = is_void(y, i32(params.size.y));
    return Sums(select(sums.low, vec4u(0u), void_row), select(sums.high, vec4u(0u), void_row));
}

fn plane(z: i32, y: i32) -> Plane {
    let depth = i32(params.size.z);
    if is_void(z, depth) {
        return Plane();
    }
    let start = u32(folded_index(z, depth)) * params.size.y * (params.size.x / 4u);
    let r0 = row(y - 1, start);
    let r1 = row(y, start);
    let r2 = row(y + 1, start);
    let r3 = row(y + 2, start);
    let r4 = row(y + 3, start);
    let r5 = row(y + 4, start);
    return Plane(tent(r0, r1, r2), tent(r1, r2, r3), tent(r2, r3, r4), tent(r3, r4, r5));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let item = (group.y * groups.x + group.x) * 64u + local;
    let words = params.size.x / 4u;
    let blocks = (params.size.y + 3u) / 4u;
    let x = item % words;
    let y = item / words % blocks * 4u;
    let begin = item / words / blocks * column;
    if begin >= params.size.z {
        return;
    }
    quad = vec3u(select(x, words, x == 0u) - 1u, x, select(x + 1u, 0u, x == words - 1u));
    let end = min(begin + column, params.size.z);
    let rows = params.size.y - y;

    var behind = plane(i32(begin) - 1, i32(y));
    var here = plane(i32(begin), i32(y));
    for (var z = begin; z < end; z++) {
        let beyond = plane(i32(z) + 1, i32(y));
        let at = (z * params.size.y + y) * words + x;
        next[at] = decayed(tent(behind.a, here.a, beyond.a), params.decay);
        if rows > 1u {
            next[at + words] = decayed(tent(behind.b, here.b, beyond.b), params.decay);
        }
        if rows > 2u {
            next[at + 2u * words] = decayed(tent(behind.c, here.c, beyond.c), params.decay);
        }
        if rows > 3u {
            next[at + 3u * words] = decayed(tent(behind.d, here.d, beyond.d), params.decay);
        }
        behind = here;
        here = beyond;
    }
}
