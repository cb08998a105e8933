// Pseudo-random numbers: words hashed to a seed, and a stream from it.

/// Hashes three words to three (Jarzynski and Olano 2020, pcg3d).
fn hash3(v: vec3u) -> vec3u {
    var x = v * 1664525u + 1013904223u;
    x.x += x.y * x.z;
    x.y += x.z * x.x;
    x.z += x.x * x.y;
    x = x ^ (x >> vec3u(16u));
    x.x += x.y * x.z;
    x.y += x.z * x.x;
    x.z += x.x * x.y;
    return x;
}

/// The next word of a stream of period 2^64 − 1 (Blackman and Vigna 2018, xoroshiro64**). The state must not be zero.
fn next_u32(state: ptr<function, vec2u>) -> u32 {
    let s = *state;
    let scrambled = s.x * 0x9E3779BBu;
    let word = ((scrambled << 5u) | (scrambled >> 27u)) * 5u;
    let mixed = s.y ^ s.x;
    *state = vec2u(((s.x << 26u) | (s.x >> 6u)) ^ mixed ^ (mixed << 9u), (mixed << 13u) | (mixed >> 19u));
    return word;
}

/// A word as a number in [0, 1): a multiple of 2^-24.
fn unit_f32(word: u32) -> f32 {
    return f32(word >> 8u) * 0x1p-24f;
}

/// The next number in [0, 1), a multiple of 2^-24.
fn next_f32(state: ptr<function, vec2u>) -> f32 {
    return unit_f32(next_u32(state));
}

/// A stream of its own for each (pixel, sample, seed).
fn stream(pixel: u32, sample: u32, seed: u32) -> vec2u {
    let h = hash3(vec3u(pixel, sample, seed));
    // The all-zero state is the one that never moves.
    return vec2u(h.x, h.y | 1u);
}
