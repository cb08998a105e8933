// An exact blur of counts: sums of u32 that need 38 bits, as 16 low and the remaining high bits, added apart.

/// Σ low + 2^16 Σ high, for four voxels in a row along x.
struct Sums {
    low: vec4u,
    high: vec4u,
}

/// a + 2b + c, of values or of sums.
fn tent(a: Sums, b: Sums, c: Sums) -> Sums {
    return Sums(a.low + 2u * b.low + c.low, a.high + 2u * b.high + c.high);
}

/// left + 2 middle + right along x of four voxels and one on either side.
fn tent_x(left: u32, middle: vec4u, right: u32) -> Sums {
    let a = vec4u(left, middle.xyz);
    let c = vec4u(middle.yzw, right);
    let low = vec4u(0xffffu);
    let shift = vec4u(16u);
    return Sums((a & low) + 2u * (middle & low) + (c & low), (a >> shift) + 2u * (middle >> shift) + (c >> shift));
}

/// floor(sums · decay / 2^22): the weights 1-2-4-8 of 27 voxels come to 64 = 2^6, decay is in 2^-16.
/// Exact, with one rounding, towards 0, so that a field without deposits ends at 0.
fn decayed(sums: Sums, decay: u32) -> vec4u {
    let high = sums.high + (sums.low >> vec4u(16u));
    let whole = high >> vec4u(6u);
    let rest = ((high & vec4u(63u)) << vec4u(16u)) | (sums.low & vec4u(0xffffu));
    let part = (rest >> vec4u(6u)) * decay + (((rest & vec4u(63u)) * decay) >> vec4u(6u));
    return whole * decay + (part >> vec4u(16u));
}
