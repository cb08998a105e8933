//! A session's turn: the camera, a simulation step, the stage, samples, a picture.

use std::time::{Duration, Instant};

use super::Settings;
use super::films::Which;
use super::room::{Room, Tools, camera_in};
use crate::gpu::GpuError;

/// How long after the last change a scene counts as moving.
const MOTION: Duration = Duration::from_millis(80);

/// How often the noise is looked at while samples accumulate towards `render.noise`.
const NOISE_EVERY: Duration = Duration::from_secs(1);

/// Times that the time for a picture is doubled, at most.
const MAX_OVERTAKEN: u32 = 6;

/// When a session has something to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wants {
    Now,
    At(Instant),
    Nothing,
}

impl Settings {
    /// Time that a moving picture may take, with the step before it.
    pub(super) fn period(&self) -> Duration {
        Duration::from_secs_f32(1.0 / self.fps.clamp(0.1, 1000.0))
    }
}

impl Room {
    /// When this session has something to do, if no command comes first.
    pub(super) fn wants(&self, now: Instant, settings: &Settings) -> Wants {
        let at = |due: Instant| if now >= due { Wants::Now } else { Wants::At(due) };
        if self.urgent(now, settings) || !self.stepping.is_empty() || !self.jobs.is_empty() {
            Wants::Now
        } else if self.runs() {
            at(if self.camera_waits() { self.next_step.min(self.next_answer(settings)) } else { self.next_step })
        } else if !self.complete() {
            Wants::Now
        } else if self.camera_waits() {
            at(self.next_answer(settings))
        } else if !self.settled {
            at(self.moved_at + MOTION)
        } else {
            Wants::Nothing
        }
    }

    /// Whether somebody waits for a picture.
    pub(super) fn urgent(&self, now: Instant, settings: &Settings) -> bool {
        self.owed || (self.camera_waits() && now >= self.next_answer(settings))
    }

    /// When a camera message may be answered: a client that sends a thousand a second gets two pictures a period.
    fn next_answer(&self, settings: &Settings) -> Instant {
        self.shown_at + settings.period() / 2
    }

    /// Whether the simulations go on by themselves.
    fn runs(&self) -> bool {
        self.playing && self.stepping.is_empty() && !self.world.frozen()
    }

    /// Whether the full film has all the samples that the scene asks for.
    pub(super) fn complete(&self) -> bool {
        let render = &self.history.scene().render;
        let full = self.films.full();
        !self.stale
            && full.is_of(&self.subject)
            && full.pure()
            && (full.taken() >= render.spp || render.noise.zip(full.noise).is_some_and(|(enough, noise)| noise <= enough))
    }

    pub(super) fn at_rest(&self, now: Instant) -> bool {
        !self.runs() && self.stepping.is_empty() && now >= self.moved_at + MOTION
    }

    /// One bounded piece of this session's work.
    ///
    /// # Errors
    /// A [`GpuError`] that the session does not survive.
    pub(super) fn slice(&mut self, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        let streams = self.urgent(Instant::now(), tools.settings)
            || !self.stepping.is_empty()
            || self.runs()
            || !self.complete()
            || !self.settled;
        if !self.jobs.is_empty() && (self.job_next || !streams) {
            self.job_next = false;
            return self.work_on_still(tools);
        }
        self.job_next = !self.jobs.is_empty();
        self.move_on(tools)?;
        if self.stale {
            self.stage.update(self.history.scene(), self.world.grids())?;
            self.subject = crate::render::Subject::of(self.history.scene(), self.world.grids());
            self.stale = false;
        }
        let now = Instant::now();
        if self.owed {
            self.answer(tools)?;
        } else if self.runs() || !self.stepping.is_empty() {
            // The next step changes the subject: samples until then would be thrown away.
        } else if self.complete() {
            if !self.settled && self.at_rest(now) {
                self.show(Which::Full, tools)?;
            }
        } else if self.news && self.at_rest(now) {
            self.show(Which::Full, tools)?;
        } else if let Some(size) = self.next_rung() {
            self.climb(size, tools)?;
        } else {
            self.accumulate(tools)?;
        }
        self.report(tools)
    }

    /// Takes the camera message that waits, and the simulation steps that are due.
    fn move_on(&mut self, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        // A picture that is under way is finished first, or a stream of messages would never see one.
        if self.aim.is_some() && self.owed {
            return Ok(());
        }
        let clock = Instant::now();
        let early = clock < self.next_answer(tools.settings);
        let due = !self.stepping.is_empty() || (self.runs() && clock >= self.next_step);
        // A picture that is made for a step shows the newest camera, however early it is.
        let moved = (due || !early) && self.take_camera();
        if !due || (moved && !early && self.watched() && !self.answered) {
            self.answered |= moved;
            return Ok(());
        }
        self.answered = false;
        if self.stepping.is_empty() {
            let next = self.next_step + tools.settings.period();
            // A late step is not made up for.
            self.next_step = if next > clock { next } else { clock };
            return self.step(tools);
        }
        while let Some(stepping) = self.stepping.front_mut() {
            if stepping.left > 0 && !self.world.frozen() {
                stepping.left -= 1;
                self.step(tools)?;
                if clock.elapsed() >= tools.settings.period() {
                    break;
                }
            } else if let Some(done) = self.stepping.pop_front() {
                self.tell();
                let _ = done.reply.send(Ok(()));
            }
        }
        Ok(())
    }

    fn step(&mut self, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        let clock = Instant::now();
        self.begun.get_or_insert(clock);
        self.world.step()?;
        // The step is waited for: its time decides how large the picture may be.
        tools.gpu.finish(tools.gpu.encoder("step"))?;
        let took = clock.elapsed();
        self.pace.stepped(took);
        self.work += took;
        self.stats.simulate_ms = took.as_secs_f32() * 1e3;
        self.stale = true;
        self.owe();
        Ok(())
    }

    /// Makes the picture that is owed: of a film that has samples of the subject, or of new ones at the size that
    /// motion allows.
    fn answer(&mut self, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        if !self.watched() && self.pictures.borrow().is_some() {
            self.owed = false;
            self.aim = None;
            return Ok(());
        }
        if let Some((which, _)) = self.films.showing(&self.subject) {
            return self.show(which, tools);
        }
        self.begun.get_or_insert_with(Instant::now);
        let period = tools.settings.period();
        let (size, spp) = self.aim.unwrap_or_else(|| {
            let (size, spp) = self.pace.choose(self.films.size(), self.runs(), period);
            // Where pictures blend, each has one sample: the weight is a sample's.
            (size, if self.subject.blends() { 1 } else { spp.min(self.history.scene().render.spp) })
        });
        // A slider that is dragged changes the subject before a slow picture is done: the next one gets more time.
        let overtaken = self.aim.is_some() && !self.films.are_of(&self.subject);
        self.overtaken = (self.overtaken + u32::from(overtaken)).min(MAX_OVERTAKEN);
        self.aim = Some((size, spp));
        let runs = self.runs();
        let (which, exposure) = self.films.of_size(tools.gpu, size, &self.subject, runs)?;
        let before = exposure.taken();
        let took = exposure.expose(tools.tracer, &self.stage, spp, period * (2 << self.overtaken), &|_| false)?;
        let taken = exposure.taken();
        if taken > before {
            self.pace.rendered(u64::from(size[0]) * u64::from(size[1]), exposure.per_sample);
        }
        self.work += took;
        self.stats.render_ms = took.as_secs_f32() * 1e3;
        if taken > 0 { self.show(which, tools) } else { Ok(()) }
    }

    /// The size of the picture that comes before the full film's first sample, where that is long in coming.
    fn next_rung(&self) -> Option<[u32; 2]> {
        if !self.watched() || self.films.full().is_of(&self.subject) && self.films.full().taken() > 0 {
            return None;
        }
        let shown = self.films.showing(&self.subject);
        self.rung.or_else(|| shown.and_then(|(_, shown)| self.pace.rung(self.films.size(), shown.film.size())))
    }

    /// Makes a picture of one sample a pixel that is larger than the last.
    fn climb(&mut self, size: [u32; 2], tools: &mut Tools<'_>) -> Result<(), GpuError> {
        self.begun.get_or_insert_with(Instant::now);
        self.rung = Some(size);
        let (camera, waiting, next_answer) = (&self.camera, tools.waiting, self.next_answer(tools.settings));
        let moved = || camera_in(camera) && Instant::now() >= next_answer;
        let wanted = |served: bool| moved() || (served && !waiting.is_empty());
        let (which, exposure) = self.films.of_size(tools.gpu, size, &self.subject, false)?;
        let took = exposure.expose(tools.tracer, &self.stage, 1, tools.settings.period(), &wanted)?;
        let done = exposure.taken() > 0;
        self.work += took;
        self.stats.render_ms = took.as_secs_f32() * 1e3;
        if done {
            self.rung = None;
            self.show(which, tools)?;
        }
        Ok(())
    }

    /// Adds samples to the full film, until the next picture is due or somebody else is.
    fn accumulate(&mut self, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        self.begun.get_or_insert_with(Instant::now);
        let render = &self.history.scene().render;
        let (spp, noise) = (render.spp, render.noise);
        let (camera, waiting, next_answer) = (&self.camera, tools.waiting, self.next_answer(tools.settings));
        let exposure = self.films.full_of(&self.subject, false);
        let before = exposure.taken();
        let milestone = before.saturating_add(1).checked_next_power_of_two().unwrap_or(spp).min(spp);
        let goal =
            if noise.is_some() { milestone.min(before.saturating_add(exposure.samples_in(NOISE_EVERY))) } else { milestone };
        let moved = || camera_in(camera) && Instant::now() >= next_answer;
        let wanted = |served: bool| moved() || (served && !waiting.is_empty());
        let took = exposure.expose(tools.tracer, &self.stage, goal, tools.settings.period(), &wanted)?;
        self.work += took;
        self.stats.render_ms = took.as_secs_f32() * 1e3;
        let taken = self.films.full().taken();
        if taken < goal {
            return Ok(());
        }
        if noise.is_some() || self.watched() || taken >= spp {
            let noise = tools.tracer.noise(&self.films.full().film)?;
            self.films.full_of(&self.subject, false).noise = noise;
        }
        self.news |= taken == milestone && self.watched();
        Ok(())
    }
}
