//! A still cloud: gradient noise with a seed and a frequency, cut by an ellipsoid, as in the voxel-smoke
//! recipe: x and z radii N/2 + uniform(−N/4, N/2), y radius N/3; empty where n − d² < 0.04 or d² > 1.5;
//! five classes of density by n, or a continuous density.

use encase::ShaderType;
use glam::Vec3;

use super::{AutoWindow, Format, Grid};
use crate::gpu::{Gpu, GpuError, Kernel, groups_1d};
use crate::scene::Cloud;

#[derive(ShaderType)]
struct Job {
    size: u32,
    seed: u32,
    frequency: f32,
    octaves: u32,
    radii: Vec3,
    classes: u32,
}

/// Grows the cloud on the GPU. The same parameters give the same cloud.
///
/// # Errors
/// [`GpuError::TooLarge`] where the adapter cannot hold it.
pub fn grow(gpu: &Gpu, cloud: &Cloud) -> Result<Grid, GpuError> {
    let n = cloud.size;
    let voxels = u64::from(n).pow(3);
    let words = gpu.storage(&format!("a cloud of {n}×{n}×{n} voxels"), voxels * 4)?;
    let job = Job {
        size: n,
        seed: cloud.seed,
        frequency: cloud.frequency,
        octaves: cloud.octaves,
        radii: radii(n, cloud.seed),
        classes: u32::from(cloud.classes),
    };
    let kernel = Kernel::load(gpu, "cloud.wgsl");
    let bound = kernel.bind(gpu, &[("job", &gpu.uniform("cloud", &job)), ("density", &words)]);
    let mut encoder = gpu.encoder("cloud");
    kernel.dispatch(&mut encoder, &bound, groups_1d(voxels, 64));
    gpu.queue().submit([encoder.finish()]);
    Ok(Grid { words, format: Format::F32, size: [n; 3], spacing: [1.0; 3], auto: AutoWindow::Fixed([0.0, 1.0]), version: 0 })
}

/// Radii of the ellipsoid in voxels.
fn radii(size: u32, seed: u32) -> Vec3 {
    #[expect(clippy::cast_precision_loss, reason = "sizes are below 2^24, and so are the bits of the numbers drawn")]
    let (n, [a, b]) = (size as f32, draws(seed).map(|word| (word >> 8) as f32 / 16_777_216.0));
    let radius = |u: f32| n / 2.0 + n * (0.75 * u - 0.25);
    Vec3::new(radius(a), n / 3.0, radius(b))
}

/// Two words of a seed (Steele et al. 2014, `SplitMix64`).
fn draws(seed: u32) -> [u32; 2] {
    let mut z = u64::from(seed).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    #[expect(clippy::cast_possible_truncation, reason = "the two halves of 64 bits")]
    [z as u32, (z >> 32) as u32]
}
