//! Taking a picture until it is good enough: in bands where one film would not fit, in rounds that grow.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tyndall::gpu::{Gpu, GpuError};
use tyndall::render::{Film, Stage, Tracer};
use tyndall::scene::Display;

use super::progress::Progress;

/// When a picture is done: at the first of these.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    /// Samples per pixel that no pixel stays below.
    pub(crate) at_least: u32,
    /// Samples per pixel.
    pub(crate) spp: u32,
    /// Mean relative standard error.
    pub(crate) noise: Option<f32>,
    /// Time.
    pub(crate) time: Option<Duration>,
}

/// One picture on as many films as it takes.
pub(crate) struct Picture {
    pub(crate) size: [u32; 2],
    bands: Vec<Film>,
}

impl Picture {
    /// Blank films.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, GpuError> {
        let [width, height] = size;
        let rows = Film::rows_that_fit(gpu, width).clamp(1, height);
        let bands = (0..height).step_by(rows as usize).map(|first| Film::new(gpu, size, first..height.min(first + rows)));
        Ok(Self { size, bands: bands.collect::<Result<_, _>>()? })
    }

    /// Samples that every pixel has.
    pub(crate) fn samples(&self) -> u32 {
        self.bands.iter().map(Film::samples).min().unwrap_or(0)
    }

    /// Takes the picture of what stands on the stage, anew, until the budget is spent. `false` where a bound on the noise was
    /// asked for and not reached.
    pub(crate) fn expose(
        &mut self,
        tracer: &mut Tracer,
        stage: &Stage,
        budget: &Budget,
        progress: &mut Progress,
    ) -> Result<bool, GpuError> {
        let begun = Instant::now();
        self.bands.iter_mut().for_each(Film::clear);
        let mut taken = 0;
        let spent = loop {
            let mut round = (taken / 8).max(1);
            if let Some(time) = budget.time.filter(|_| taken > 0) {
                let left = time.saturating_sub(begun.elapsed()).as_secs_f64();
                let per_sample = begun.elapsed().as_secs_f64() / f64::from(taken);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
                let fitting = (left / per_sample.max(1e-9)) as u32;
                if fitting == 0 && taken >= budget.at_least {
                    break true;
                }
                round = round.min(fitting.max(1));
            }
            taken = (taken + round).min(budget.spp.max(budget.at_least));
            for band in &mut self.bands {
                tracer.sample(band, stage, taken, &mut || true)?;
            }
            progress.at(taken.into());
            if taken >= budget.at_least {
                if let Some(bound) = budget.noise
                    && self.noise(tracer)?.is_some_and(|noise| noise < bound)
                {
                    break true;
                }
                if taken >= budget.spp {
                    break budget.noise.is_none();
                }
            }
        };
        Ok(spent)
    }

    /// Mean relative standard error of all pixels; none below two samples.
    fn noise(&self, tracer: &mut Tracer) -> Result<Option<f32>, GpuError> {
        let mut sum = 0.0;
        for band in &self.bands {
            let Some(noise) = tracer.noise(band)? else { return Ok(None) };
            sum += f64::from(noise) * f64::from(band.size()[1]);
        }
        #[expect(clippy::cast_possible_truncation, reason = "a ratio that came as f32")]
        Ok(Some((sum / f64::from(self.size[1])) as f32))
    }

    /// The picture as shown.
    pub(crate) fn develop(&self, tracer: &mut Tracer, display: &Display) -> Result<Vec<u8>, GpuError> {
        self.gather(|band| tracer.develop(band, display))
    }

    /// Linear radiance and alpha.
    pub(crate) fn radiance(&self, tracer: &mut Tracer) -> Result<Vec<[f32; 4]>, GpuError> {
        self.gather(|band| tracer.radiance(band))
    }

    /// Standard error of the mean.
    pub(crate) fn error(&self, tracer: &mut Tracer) -> Result<Vec<[f32; 4]>, GpuError> {
        self.gather(|band| tracer.error(band))
    }

    fn gather<T>(&self, read: impl FnMut(&Film) -> Result<Vec<T>, GpuError>) -> Result<Vec<T>, GpuError> {
        self.bands.iter().map(read).collect::<Result<Vec<_>, _>>().map(|bands| bands.into_iter().flatten().collect())
    }
}

/// Mean radiance of a picture in red, green and blue, and the standard error of that mean; null where one sample tells none.
pub(crate) fn mean_and_error(radiance: &[[f32; 4]], error: &[[f32; 4]]) -> (Value, Value) {
    #[expect(clippy::cast_precision_loss, reason = "pixels are far fewer than 2^53")]
    let count = radiance.len() as f64;
    let over = |pixels: &[[f32; 4]], value: &dyn Fn(f64) -> f64| -> [f64; 3] {
        std::array::from_fn(|part| pixels.iter().map(|pixel| value(f64::from(pixel[part]))).sum())
    };
    let mean = over(radiance, &|x| x).map(|sum| sum / count);
    // Pixels are independent of each other.
    let se = over(error, &|x| x * x).map(|sum| sum.sqrt() / count);
    (json!(mean), json!(se.map(|se| se.is_finite().then_some(se))))
}
