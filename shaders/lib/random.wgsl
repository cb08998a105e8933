// Pseudo-random numbers: a counter hashed to a seed, and a stream from it.

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

/// The next word of the stream (O'Neill 2014, PCG-RXS-M-XS 32).
fn next_u32(state: ptr<function, u32>) -> u32 {
    let old = *state;
    *state = old * 747796405u + 2891336453u;
    let word = ((old >> ((old >> 28u) + 4u)) ^ old) * 277803737u;
    return (word >> 22u) ^ word;
}

/// The next number in [0, 1), a multiple of 2^-24.
fn next_f32(state: ptr<function, u32>) -> f32 {
    return f32(next_u32(state) >> 8u) * 0x1p-24f;
}
