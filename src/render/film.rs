//! The film: for each pixel the mean of its samples, their squared deviations, and their number.

use std::ops::Range;

use super::Subject;
use crate::gpu::{Gpu, GpuError};

/// Low bits of the counts: samples; dropped paths above them.
pub(super) const COUNT_MASK: u32 = (1 << 21) - 1;

/// A band of a picture, gathering samples (Welford 1962, so that equal samples give a deviation of exactly 0).
pub struct Film {
    gpu: Gpu,
    pub(super) pixels: wgpu::Buffer,
    pub(super) picture: [u32; 2],
    pub(super) rows: Range<u32>,
    pub(super) samples: u32,
    /// Samples per pixel aimed at by the pass under way, and the blocks of pixels that have them.
    pub(super) pass: Option<(u32, u32)>,
    /// Least weight of a new sample; 0: all samples weigh alike.
    pub(super) weight: f32,
    subject: Option<Subject>,
}

impl Film {
    /// Bytes of a pixel on the GPU: mean (r, g, b, alpha), squared deviations (r, g, b), counts.
    pub const BYTES_PER_PIXEL: u64 = 32;

    /// A blank film for the given rows of a picture of this size.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the adapter cannot hold it: a picture can then be taken in bands.
    pub fn new(gpu: &Gpu, picture: [u32; 2], rows: Range<u32>) -> Result<Self, GpuError> {
        let height = rows.end.saturating_sub(rows.start);
        let bytes = u64::from(picture[0]) * u64::from(height) * Self::BYTES_PER_PIXEL;
        let pixels = gpu.storage(&format!("a film of {}×{height} pixels", picture[0]), bytes)?;
        Ok(Self { gpu: gpu.clone(), pixels, picture, rows, samples: 0, pass: None, weight: 0.0, subject: None })
    }

    /// Rows of a film that fits the adapter, for a picture of this width.
    pub fn rows_that_fit(gpu: &Gpu, width: u32) -> u32 {
        let rows = gpu.largest_binding() / (Self::BYTES_PER_PIXEL * u64::from(width.max(1)));
        u32::try_from(rows).unwrap_or(u32::MAX)
    }

    /// Takes on a subject that has grown by a simulation step, and goes on: each new sample weighs at least `weight`, so
    /// that noise fades over the steps. A biased preview: what is to converge must start over. `false` where more than
    /// the grids has changed; the film is then as it was.
    pub fn follow(&mut self, subject: &Subject, weight: f32) -> bool {
        let grown = self.subject.as_ref().is_some_and(|before| subject.grew_from(before));
        if grown {
            self.weight = weight;
            self.subject = Some(subject.clone());
        }
        grown
    }

    /// Takes on a subject, and starts over if it is another than before; `true` if it did. With `blend`
    /// pictures of different subjects lie over one another: the film goes on.
    pub fn depict(&mut self, subject: &Subject) -> bool {
        self.weight = subject.blend();
        if self.subject.as_ref() == Some(subject) {
            return false;
        }
        let goes_on = subject.blends() && self.subject.as_ref().is_some_and(Subject::blends);
        self.subject = Some(subject.clone());
        if !goes_on {
            self.clear();
        }
        !goes_on
    }

    /// Starts over.
    pub fn clear(&mut self) {
        self.samples = 0;
        self.pass = None;
        let mut encoder = self.gpu.encoder("clear the film");
        encoder.clear_buffer(&self.pixels, 0, None);
        self.gpu.queue().submit([encoder.finish()]);
    }

    /// Samples that every pixel has.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// What is done so far, to be compared: it differs whenever more was done.
    pub fn progress(&self) -> (u32, u32) {
        (self.samples, self.pass.map_or(0, |(_, blocks)| blocks))
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.picture[0], self.rows.end.saturating_sub(self.rows.start)]
    }

    /// Number of pixels.
    pub fn pixel_count(&self) -> u32 {
        let [width, height] = self.size();
        width * height
    }

    /// Bytes on the GPU.
    pub fn memory(&self) -> u64 {
        self.pixels.size()
    }
}
