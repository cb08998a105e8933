// What the tracer knows of a volume: where it stands, its words, and its greatest value in each cell of CELL³ voxels.

/// Edge of a macrocell in voxels.
const CELL: i32 = 4;
const MAX_VOLUMES: u32 = 16u;

const FORMAT_U32: u32 = 0u;
const FORMAT_F32: u32 = 1u;
/// Density 1 throughout, without words.
const FORMAT_SOLID: u32 = 2u;

const LAW_BEER: u32 = 0u;
const LAW_THRESHOLD: u32 = 1u;

struct Volume {
    /// Rows of the affine map from world to voxel coordinates.
    voxel_from_world_x: vec4f,
    voxel_from_world_y: vec4f,
    voxel_from_world_z: vec4f,
    /// Voxels along each axis.
    size: vec3i,
    format: u32,
    /// Macrocells along each axis.
    cells: vec3i,
    /// Index of the first macrocell in `cell_max`.
    first_cell: u32,
    albedo: vec3f,
    /// Index of the first word in `words`.
    first_word: u32,
    /// Radiance per world unit where density is 1.
    emission: vec3f,
    law: u32,
    /// Extinction per world unit where density is 1.
    sigma_t: f32,
    /// Majorant per world unit where the greatest density is 1: at least sigma_t; above it where thin light shines.
    track: f32,
    /// sigma_t·h of the threshold law: probability to scatter in a voxel where density is 1.
    voxel_probability: f32,
    scatter_loss: f32,
    phase: u32,
    /// g of hg, weight of drift.
    phase_shape: f32,
    /// Voxels beyond a macrocell that a lookup inside it can reach: 1 if trilinear, else 0.
    reach: i32,
    /// 1: only the ball that touches the box's faces is shown.
    ball: u32,
    /// Share of the ball's radius over which density fades to 0.
    softness: f32,
}

/// A word as the field's value.
fn word_value(format: u32, word: u32) -> f32 {
    return select(f32(word), bitcast<f32>(word), format == FORMAT_F32);
}

/// Density of a value; window is (lowest value, 1 / width).
fn density_of(value: f32, window: vec2f) -> f32 {
    return max((value - window.x) * window.y, 0.0);
}
