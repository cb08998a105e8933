// Curves from linear radiance (Rec. 709 primaries) to what a screen is sent.

/// Linear light to sRGB's encoding (IEC 61966-2-1).
fn srgb_encode(linear: vec3f) -> vec3f {
    let x = clamp(linear, vec3f(0.0), vec3f(1.0));
    return select(1.055 * pow(x, vec3f(1.0 / 2.4)) - 0.055, 12.92 * x, x <= vec3f(0.0031308));
}

/// AgX (Troy Sobotka 2022), base look, in Benjamin Wrensch's polynomial fit (2023); its result is already encoded.
fn agx(linear: vec3f) -> vec3f {
    let inset = mat3x3f(
        vec3f(0.842479062253094, 0.0423282422610123, 0.0423756549057051),
        vec3f(0.0784335999999992, 0.878468636469772, 0.0784336),
        vec3f(0.0792237451477643, 0.0791661274605434, 0.879142973793104),
    );
    let outset = mat3x3f(
        vec3f(1.19687900512017, -0.0528968517574562, -0.0529716355144438),
        vec3f(-0.0980208811401368, 1.15190312990417, -0.0980434501171241),
        vec3f(-0.0990297440797205, -0.0989611768448433, 1.15107367264116),
    );
    let stops = vec2f(-12.47393, 4.026069);
    let logged = clamp(log2(max(inset * linear, vec3f(1e-10))), vec3f(stops.x), vec3f(stops.y));
    let x = (logged - stops.x) / (stops.y - stops.x);
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    return clamp(outset * curve, vec3f(0.0), vec3f(1.0));
}

/// ACES filmic in Krzysztof Narkowicz' fit (2015).
fn aces(linear: vec3f) -> vec3f {
    let x = linear * 0.6;
    return srgb_encode((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14));
}

/// Reinhard 2002 on luminance.
fn reinhard(linear: vec3f) -> vec3f {
    return srgb_encode(linear / (1.0 + dot(linear, vec3f(0.2126, 0.7152, 0.0722))));
}

fn tonemap(kind: u32, linear: vec3f) -> vec3f {
    switch kind {
        case 0u: { return agx(linear); }
        case 1u: { return aces(linear); }
        case 2u: { return reinhard(linear); }
        default: { return srgb_encode(linear); }
    }
}
