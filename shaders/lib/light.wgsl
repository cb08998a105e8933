// Light from outside the volumes: the sky by escaping paths, the sun and the lamps by next-event estimation.
// A kernel that imports this binds a `light: Light`.

const MAX_LAMPS: u32 = 16u;

struct Lamp {
    position: vec3f,
    /// Irradiance at distance 1.
    intensity: vec3f,
}

struct Light {
    zenith: vec3f,
    horizon: vec3f,
    ground: vec3f,
    /// Unit vector towards the sun.
    to_sun: vec3f,
    sun_irradiance: vec3f,
    lamps: array<Lamp, MAX_LAMPS>,
}

/// Radiance of the sky that arrives from where `direction` points: linear in its height.
fn sky(direction: vec3f) -> vec3f {
    let end = select(light.ground, light.zenith, direction.y > 0.0);
    // Not `mix`: a sky of one colour must give exactly that colour, whatever the direction.
    return light.horizon + (end - light.horizon) * abs(direction.y);
}
