//! Pictures that are asked for by themselves, made in slices beside the stream.

use std::collections::BTreeMap;
use std::ops::Range;

use super::films::Exposure;
use super::handle::Reply;
use super::room::{Room, Tools, afford, camera_in};
use super::{EngineError, Still, StillRequest};
use crate::gpu::{Gpu, GpuError};
use crate::render::{Film, Stage, Subject};
use crate::scene::Display;
use crate::volume::Grid;
use crate::world::World;

/// Most pictures of a session that wait.
const MAX_JOBS: usize = 2;

/// Longest edge of a picture.
const MAX_EDGE: u32 = 8192;

/// A picture in the making: the scene as it was when it was asked for, whatever the stream does meanwhile. A film that
/// is too large for the adapter is taken band by band.
pub(super) struct Job {
    request: StillRequest,
    display: Display,
    stage: Stage,
    subject: Subject,
    /// Bytes of the grids that were copied.
    copied: u64,
    band: Exposure,
    rows: Range<u32>,
    still: Still,
}

impl Job {
    /// Bytes on the GPU.
    pub(super) fn memory(&self) -> u64 {
        self.stage.memory() + self.band.film.memory() + self.copied
    }

    /// Puts the band that is done to the picture, and begins the next; `false` if there is none.
    fn next_band(&mut self, tools: &mut Tools<'_>) -> Result<bool, GpuError> {
        self.still.pixels.extend(tools.tracer.develop(&self.band.film, &self.display)?);
        if self.request.radiance {
            self.still.radiance.extend(tools.tracer.radiance(&self.band.film)?);
        }
        let [width, height] = self.request.size;
        if self.rows.end >= height {
            return Ok(false);
        }
        self.rows = self.rows.end..height.min(self.rows.end + Film::rows_that_fit(tools.gpu, width));
        self.band = Exposure::new(tools.gpu, self.request.size, self.rows.clone())?;
        self.band.turn_to(&self.subject, true, false);
        Ok(true)
    }
}

impl Room {
    /// Queues a picture, or refuses it.
    pub(super) fn begin_still(&mut self, request: StillRequest, reply: Reply<Still>, tools: &Tools<'_>) {
        let [width, height] = request.size;
        let refused = if self.jobs.len() >= MAX_JOBS {
            Some(format!("{MAX_JOBS} pictures of this session are in the making already"))
        } else if !(1..=MAX_EDGE).contains(&width) || !(1..=MAX_EDGE).contains(&height) || request.spp == 0 {
            Some(format!("{width}×{height} pixels of {} samples: an edge is 1 to {MAX_EDGE}, a sample the least", request.spp))
        } else {
            None
        };
        if let Some(text) = refused {
            let _ = reply.send(Err(EngineError::Limit(text)));
            return;
        }
        match self.prepare_still(request, tools) {
            Ok(job) => self.jobs.push_back((job, reply)),
            Err(error) => {
                let _ = reply.send(Err(error));
            }
        }
    }

    fn prepare_still(&self, request: StillRequest, tools: &Tools<'_>) -> Result<Job, EngineError> {
        let [width, height] = request.size;
        let rows = 0..height.min(Film::rows_that_fit(tools.gpu, width).max(1));
        let living = self.world.grids().iter().filter(|(name, _)| self.world.lives(name));
        let copied = living.map(|(_, grid)| grid.words.size()).sum::<u64>();
        let film = u64::from(width) * u64::from(rows.end) * Film::BYTES_PER_PIXEL;
        afford(self.memory().saturating_add(film).saturating_add(copied).saturating_add(self.stage.memory()), tools)?;
        let grids = snapshot(&self.world, tools.gpu)?;
        let scene = self.history.scene();
        let stage = Stage::new(tools.gpu, scene, &grids)?;
        let subject = Subject::of(scene, &grids);
        let mut band = Exposure::new(tools.gpu, request.size, rows.clone())?;
        band.turn_to(&subject, true, false);
        let still = Still { size: request.size, pixels: Vec::new(), radiance: Vec::new(), revision: self.history.revision() };
        let display = scene.display.clone();
        Ok(Job { request, display, stage, subject, copied, band, rows, still })
    }

    /// Adds samples to the picture that waits longest, and gives it away when it has them all.
    pub(super) fn work_on_still(&mut self, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        let Some((mut job, reply)) = self.jobs.pop_front() else { return Ok(()) };
        if reply.is_closed() {
            return Ok(());
        }
        let (camera, waiting) = (&self.camera, tools.waiting);
        let wanted = |served: bool| served && (camera_in(camera) || !waiting.is_empty());
        let period = tools.settings.period();
        job.band.expose(tools.tracer, &job.stage, job.request.spp, period, &wanted)?;
        if job.band.taken() < job.request.spp || job.next_band(tools)? {
            self.jobs.push_front((job, reply));
        } else {
            let _ = reply.send(Ok(job.still));
        }
        Ok(())
    }
}

/// The grids as they are now; those of simulations are copied, for the next step overwrites them.
fn snapshot(world: &World, gpu: &Gpu) -> Result<BTreeMap<String, Grid>, GpuError> {
    let mut grids = world.grids().clone();
    let mut encoder = gpu.encoder("snapshot");
    for (name, grid) in &mut grids {
        if world.lives(name) {
            let copy = gpu.storage(&format!("a copy of the volume {name}"), grid.words.size())?;
            encoder.copy_buffer_to_buffer(&grid.words, 0, &copy, 0, grid.words.size());
            grid.words = copy;
        }
    }
    gpu.finish(encoder)?;
    Ok(grids)
}
