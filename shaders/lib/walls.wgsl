// What the walls of a box do to what passes them.

const PERIODIC = 0u;
const REFLECT = 1u;
const ABSORB = 2u;

/// One of the three above, known when the pipeline is made: a step pays for no other.
override walls: u32 = 0u;

/// The position inside the box, in voxels, that stands for `position`. It is meaningless beyond walls that absorb.
fn folded_position(position: vec3f, size: vec3f, inverse_size: vec3f) -> vec3f {
    let boxes = floor(position * inverse_size);
    let rest = max(position - boxes * size, vec3f(0.0));
    if walls == REFLECT {
        let mirrored = (vec3i(boxes) & vec3i(1)) != vec3i(0);
        // The largest number below size: a mirrored 0 would lie outside.
        return min(select(rest, size - rest, mirrored), size * 0.99999994);
    }
    // Rounding may leave a length of the box, which is 0 again.
    return select(rest, vec3f(0.0), rest >= size);
}

/// Whether a position is beyond a wall.
fn is_outside(position: vec3f, size: vec3f) -> bool {
    return any(position < vec3f(0.0)) || any(position >= size);
}

/// The voxel that stands for voxel `i` of `count` along one axis, for -count <= i < 2 count.
fn folded_index(i: i32, count: i32) -> i32 {
    if walls == PERIODIC {
        return select(select(i, i - count, i >= count), i + count, i < 0);
    }
    if walls == REFLECT {
        return select(select(i, 2 * count - 1 - i, i >= count), -1 - i, i < 0);
    }
    return clamp(i, 0, count - 1);
}

/// Whether what stands at voxel `i` of `count` is nothing.
fn is_void(i: i32, count: i32) -> bool {
    return walls == ABSORB && (i < 0 || i >= count);
}
