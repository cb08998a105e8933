//! What a session tells: pictures, how it fares, what a person should know.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::films::Which;
use super::room::{Room, Tools};
use crate::gpu::GpuError;
use crate::stream::{Encodings, Picture};

/// How often a session that works says how it fares.
const STATS_EVERY: Duration = Duration::from_secs(1);

impl Room {
    /// Develops a film and puts the picture in its slot. It is final if the film has all its samples and nothing moves.
    pub(super) fn show(&mut self, which: Which, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        let clock = Instant::now();
        let converged = which == Which::Full && self.complete() && self.at_rest(clock);
        let exposure = self.films.get(which);
        let pixels = tools.tracer.develop(&exposure.film, &self.history.scene().display)?;
        let now = Instant::now();
        let begun = self.begun.take().unwrap_or(clock);
        let picture = Picture {
            size: exposure.film.size(),
            pixels,
            revision: self.history.revision(),
            spp: exposure.taken(),
            converged,
            seen: self.seen.clone(),
            begun_us: u64::try_from((begun - tools.start).as_micros()).unwrap_or(u64::MAX),
            work_us: micros(std::mem::take(&mut self.work)),
            readback_us: micros(now - clock),
            encodings: Encodings::default(),
        };
        self.stats.spp = picture.spp;
        self.stats.size = picture.size;
        self.stats.noise = exposure.noise;
        self.shown_at = clock;
        self.pictured_at.push_back(now);
        self.count_pictures(now);
        self.tell();
        self.pictures.send_replace(Some(Arc::new(picture)));
        self.owed = false;
        self.aim = None;
        self.overtaken = 0;
        if which == Which::Full {
            self.news = false;
        }
        if converged {
            self.settled = true;
            self.inspect(Which::Full, tools)?;
            self.publish_stats();
            self.stats_at = now;
        }
        Ok(())
    }

    /// Tells about once a second how the session fares.
    pub(super) fn report(&mut self, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        let now = Instant::now();
        if now - self.stats_at >= STATS_EVERY {
            self.stats_at = now;
            self.count_pictures(now);
            // The small film, where there is one: every pixel is read.
            self.inspect(Which::Swift, tools)?;
            self.publish_stats();
        }
        Ok(())
    }

    /// Looks for what went wrong without stopping the session.
    fn inspect(&mut self, which: Which, tools: &mut Tools<'_>) -> Result<(), GpuError> {
        if !self.noticed.contains(&"paths_dropped") {
            let dropped = tools.tracer.dropped(&self.films.get(which).film)?;
            if dropped > 0 {
                let text = format!("{dropped} paths were not finite and were left out of the picture");
                self.notice_once("warning", "paths_dropped", text);
            }
        }
        if !self.noticed.contains(&"sums_held") {
            let held = self.world.saturated()?;
            if held > 0 {
                let text = format!("{held} sums of the simulation would have passed 2^32-1 and were held there");
                self.notice_once("warning", "sums_held", text);
            }
        }
        Ok(())
    }

    fn notice_once(&mut self, level: &'static str, code: &'static str, text: String) {
        self.noticed.push(code);
        self.notice(level, code, text);
    }

    fn count_pictures(&mut self, now: Instant) {
        while self.pictured_at.front().is_some_and(|at| now - *at > Duration::from_secs(1)) {
            self.pictured_at.pop_front();
        }
        #[expect(clippy::cast_precision_loss, reason = "pictures in a second are few")]
        {
            self.stats.fps = self.pictured_at.len() as f32;
        }
    }
}

fn micros(time: Duration) -> u32 {
    u32::try_from(time.as_micros()).unwrap_or(u32::MAX)
}
