//! The tracer: plans dispatches of bounded length, and develops what they gathered.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "counts become paces and back; each is clamped to a small range"
)]

use std::collections::HashMap;
use std::time::Instant;

use encase::ShaderType;
use glam::UVec2;

use super::film::COUNT_MASK;
use super::stage::Variant;
use super::{Film, Stage};
use crate::gpu::{Gpu, GpuError, Kernel, Readback, groups_1d};
use crate::scene::{Display, Tonemap};

/// Bytes of a suspended path.
const PATH_BYTES: u64 = 96;
/// Rounds of flights after which a dispatch ends: long paths go on in the next. Together with the longest flight, and with
/// BURST steps a round, this stays below the 65535 loop iterations of Mesa's software driver.
const BUDGET: u32 = 2000;
/// Seconds that a dispatch should take where somebody waits for an answer between two.
const INTERACTIVE_S: f32 = 0.012;
/// Invocations of the noise kernel.
const NOISE_INVOCATIONS: u32 = 4096;

#[derive(ShaderType, Clone, Default)]
struct Batch {
    picture: UVec2,
    film: UVec2,
    first_row: u32,
    target_samples: u32,
    blocks_x: u32,
    blocks: u32,
    stride: u32,
    first_block: u32,
    end_block: u32,
    blocks_per_group: u32,
    budget: u32,
    resume: u32,
    least_weight: f32,
}

#[derive(ShaderType)]
struct DevelopJob {
    pixels: u32,
    gain: f32,
    tonemap: u32,
}

#[derive(ShaderType)]
struct NoiseJob {
    pixels: u32,
    invocations: u32,
}

/// The kernels that make pictures, and the paths under way between two dispatches.
pub struct Tracer {
    gpu: Gpu,
    kernels: HashMap<Variant, Kernel>,
    develop: Kernel,
    noise: Kernel,
    batch: wgpu::Buffer,
    suspended: wgpu::Buffer,
    status: wgpu::Buffer,
    picture: wgpu::Buffer,
    sums: wgpu::Buffer,
    readback: Readback,
    /// Lanes of a dispatch, at most.
    lanes: u32,
    /// Seconds that a dispatch should take.
    dispatch_s: f32,
    /// Workgroups wanted in a dispatch: fewer leave the adapter idle, more leave lanes idle that have finished their pixels.
    groups: u32,
    /// Seconds that a block's sample took lately.
    pace: f32,
}

impl Tracer {
    /// Compiles what every scene needs; the path kernel's variants are compiled when a scene first needs them.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the adapter is too small for the paths of one dispatch.
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let lanes = if gpu.is_software() { 1 << 15 } else { 1 << 20 };
        Ok(Self {
            gpu: gpu.clone(),
            kernels: HashMap::new(),
            develop: Kernel::load(gpu, "develop.wgsl"),
            noise: Kernel::load(gpu, "noise.wgsl"),
            batch: gpu.uniform("batch", &Batch::default()),
            suspended: gpu.storage("suspended paths", u64::from(lanes) * PATH_BYTES)?,
            status: gpu.storage("status", 8)?,
            picture: gpu.storage("picture", 4)?,
            sums: gpu.storage("noise sums", u64::from(NOISE_INVOCATIONS) * 8)?,
            readback: Readback::default(),
            lanes,
            groups: if gpu.is_software() { 32 } else { 1 << 14 },
            dispatch_s: INTERACTIVE_S,
            pace: 1e-5,
        })
    }

    /// Sets how long a dispatch should take, in seconds (12 ms at first). Longer ones are up to twice as fast on software
    /// adapters, because lanes whose paths are short go on to further samples; no GPU's watchdog likes more than a second.
    pub fn set_dispatch_time(&mut self, seconds: f32) {
        self.dispatch_s = seconds.clamp(0.001, 1.0);
    }

    /// Brings every pixel of the film to `target` samples, in dispatches of bounded length; asks `keep_going`
    /// between them. `true`: all are there. `false`: stopped; calling again ends in the same bits.
    ///
    /// # Errors
    /// [`GpuError::Fault`] when the device reported an error.
    pub fn sample(
        &mut self,
        film: &mut Film,
        stage: &Stage,
        target: u32,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<bool, GpuError> {
        let target = target.min(COUNT_MASK);
        if film.samples >= target {
            return Ok(true);
        }
        let gpu = self.gpu.clone();
        let kernel = self.kernels.entry(stage.variant).or_insert_with(|| compile(&gpu, stage.variant));
        let bound = kernel.bind(
            &gpu,
            &[
                ("scene", &stage.scene),
                ("light", &stage.light),
                ("volumes", &stage.volumes),
                ("batch", &self.batch),
                ("windows", &stage.majorants.windows),
                ("words", &stage.majorants.words),
                ("cell_max", &stage.majorants.cell_max),
                ("film", &film.pixels),
                ("suspended", &self.suspended),
                ("status", &self.status),
                ("limits_in", &stage.limits),
            ],
        );
        let mut batch = plan(film);
        while film.samples < target {
            // As many samples at once as a dispatch has time for, once it holds all blocks.
            let a_round = self.pace * batch.blocks as f32;
            let rounds = (self.dispatch_s / a_round).clamp(1.0, 64.0) as u32;
            batch.target_samples = target.min(film.samples + rounds);
            let blocks_at_once = ((self.dispatch_s / self.pace) as u32).clamp(64, self.lanes / 64);
            // One pass over the picture. One that was stopped goes on at its block, or a picture that takes longer
            // than its turn would pass over finished pixels for ever.
            batch.end_block = 0;
            if let Some((samples, blocks)) = film.pass.filter(|(samples, _)| *samples <= target) {
                (batch.target_samples, batch.end_block) = (samples, blocks);
            }
            while batch.end_block < batch.blocks {
                batch.first_block = batch.end_block;
                batch.end_block = (batch.first_block + blocks_at_once).min(batch.blocks);
                batch.resume = 0;
                loop {
                    if !keep_going() {
                        return Ok(false);
                    }
                    let blocks = batch.end_block - batch.first_block;
                    batch.blocks_per_group = (blocks / self.groups).max(1);
                    let groups = blocks.div_ceil(batch.blocks_per_group);
                    gpu.write_uniform(&self.batch, &batch);
                    gpu.queue().write_buffer(&self.status, 0, &[0; 4]);
                    let begun = Instant::now();
                    let mut encoder = gpu.encoder("trace");
                    kernel.dispatch(&mut encoder, &bound, groups_1d(u64::from(groups), 1));
                    let suspended = self.readback.read(&gpu, encoder, &self.status, 4, bytemuck::pod_read_unaligned::<u32>)?;
                    if batch.resume == 0 {
                        let pace = begun.elapsed().as_secs_f32() / (blocks * (batch.target_samples - film.samples)) as f32;
                        self.pace = (0.7 * self.pace + 0.3 * pace).clamp(1e-9, 1.0);
                    }
                    if suspended == 0 {
                        break;
                    }
                    batch.resume = 1;
                }
                film.pass = Some((batch.target_samples, batch.end_block));
            }
            film.samples = batch.target_samples;
            film.pass = None;
        }
        Ok(true)
    }

    /// The picture as shown: RGBA, 8 bits, sRGB, row 0 on top, alpha not premultiplied.
    ///
    /// # Errors
    /// As [`Tracer::sample`], or [`GpuError::TooLarge`].
    pub fn develop(&mut self, film: &Film, display: &Display) -> Result<Vec<u8>, GpuError> {
        let pixels = film.pixel_count();
        let bytes = u64::from(pixels) * 4;
        if self.picture.size() < bytes {
            self.picture = self.gpu.storage("picture", bytes)?;
        }
        let tonemap = match display.tonemap {
            Tonemap::Agx => 0,
            Tonemap::Aces => 1,
            Tonemap::Reinhard => 2,
            Tonemap::None => 3,
        };
        let job = self.gpu.uniform("develop", &DevelopJob { pixels, gain: display.exposure.exp2(), tonemap });
        let bound = self.develop.bind(&self.gpu, &[("job", &job), ("film", &film.pixels), ("picture", &self.picture)]);
        let mut encoder = self.gpu.encoder("develop");
        self.develop.dispatch(&mut encoder, &bound, groups_1d(u64::from(pixels), 64));
        self.readback.read(&self.gpu, encoder, &self.picture, bytes, <[u8]>::to_vec)
    }

    /// Mean relative standard error: the pixels' mean standard error of luminance over their mean luminance.
    /// `None` below two samples, or where the picture is black.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn noise(&mut self, film: &Film) -> Result<Option<f32>, GpuError> {
        if film.samples < 2 {
            return Ok(None);
        }
        let job = self.gpu.uniform("noise", &NoiseJob { pixels: film.pixel_count(), invocations: NOISE_INVOCATIONS });
        let bound = self.noise.bind(&self.gpu, &[("job", &job), ("film", &film.pixels), ("sums", &self.sums)]);
        let mut encoder = self.gpu.encoder("noise");
        self.noise.dispatch(&mut encoder, &bound, groups_1d(u64::from(NOISE_INVOCATIONS), 64));
        let bytes = u64::from(NOISE_INVOCATIONS) * 8;
        let sums: Vec<[f32; 2]> = self.readback.read(&self.gpu, encoder, &self.sums, bytes, bytemuck::pod_collect_to_vec)?;
        let (error, light) = sums.iter().fold((0.0, 0.0), |(e, l), [de, dl]| (e + f64::from(*de), l + f64::from(*dl)));
        Ok((light > 0.0).then(|| (error / light) as f32))
    }

    /// Linear radiance and alpha of each pixel, row 0 on top; radiance is premultiplied by alpha.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn radiance(&mut self, film: &Film) -> Result<Vec<[f32; 4]>, GpuError> {
        Ok(self.download(film)?.iter().map(|pixel| pixel.mean).collect())
    }

    /// Standard error of each pixel's mean in r, g and b (alpha 1). Samples are independent of each other,
    /// and so are pixels. Infinite below two samples.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn error(&mut self, film: &Film) -> Result<Vec<[f32; 4]>, GpuError> {
        let error = |pixel: &FilmPixel| {
            let n = (pixel.counts & COUNT_MASK) as f32;
            let [r, g, b] =
                pixel.spread.map(|spread| if n < 2.0 { f32::INFINITY } else { (spread.max(0.0) / (n * (n - 1.0))).sqrt() });
            [r, g, b, 1.0]
        };
        Ok(self.download(film)?.iter().map(error).collect())
    }

    /// Paths that were dropped because they were not finite.
    ///
    /// # Errors
    /// As [`Tracer::sample`].
    pub fn dropped(&mut self, film: &Film) -> Result<u64, GpuError> {
        Ok(self.download(film)?.iter().map(|pixel| u64::from(pixel.counts >> COUNT_MASK.count_ones())).sum())
    }

    fn download(&mut self, film: &Film) -> Result<Vec<FilmPixel>, GpuError> {
        self.readback.values(&self.gpu, &film.pixels, film.pixel_count() as usize)
    }
}

/// A pixel as it lies on the GPU.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct FilmPixel {
    mean: [f32; 4],
    spread: [f32; 3],
    counts: u32,
}

fn compile(gpu: &Gpu, variant: Variant) -> Kernel {
    let constants = [
        ("SINGLE", f64::from(u8::from(variant.single))),
        ("THRESHOLD", f64::from(u8::from(variant.threshold))),
        ("EMISSION", f64::from(u8::from(variant.emission))),
    ];
    Kernel::load_with(gpu, "trace.wgsl", &constants)
}

fn plan(film: &Film) -> Batch {
    let [width, height] = film.size();
    let blocks_x = width.div_ceil(8);
    let blocks = blocks_x * height.div_ceil(8);
    Batch {
        picture: film.picture.into(),
        film: [width, height].into(),
        first_row: film.rows.start,
        target_samples: 0,
        blocks_x,
        blocks,
        stride: stride(blocks),
        first_block: 0,
        end_block: 0,
        blocks_per_group: 1,
        budget: BUDGET,
        resume: 0,
        least_weight: film.weight,
    }
}

/// A step through `count` blocks that comes to each once, and leaves neighbours far apart.
fn stride(count: u32) -> u32 {
    // Block times stride must not pass 32 bits in the kernel.
    let golden = ((f64::from(count) * 0.618_034) as u32).min(u32::MAX / count.max(1) / 2);
    (1..=golden.max(1)).rev().find(|step| gcd(*step, count) == 1).unwrap_or(1)
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stride_comes_to_every_block_once() {
        for count in [1, 2, 3, 64, 100, 14_400] {
            let step = u64::from(stride(count));
            let mut seen: Vec<_> = (0..u64::from(count)).map(|i| i * step % u64::from(count)).collect();
            seen.sort_unstable();
            assert!(seen.iter().copied().eq(0..u64::from(count)), "{count} blocks, stride {step}");
        }
    }
}
