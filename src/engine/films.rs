//! The two films of a session: one of the size that clients show, one as small as motion needs.

use std::ops::Range;
use std::time::{Duration, Instant};

use crate::gpu::{Gpu, GpuError};
use crate::render::{Film, Stage, Subject, Tracer};

/// How long a film keeps the GPU although somebody else waits.
const MIN_SHARE: Duration = Duration::from_millis(10);

/// Turns that one turn may last as long as, where paths are too long for one.
const MAX_PATIENCE: u32 = 256;

/// Which of a session's films.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Which {
    Full,
    Swift,
}

/// Samples after which a film that blends is cleared when its subject changes: it counts to 2²¹ − 1, and a subject
/// may have 2²⁰.
const MAX_BLENDED: u32 = 1 << 20;

/// Least weight of a sample while a simulation runs: noise fades over some five steps, and motion trails as far.
const GROWTH_WEIGHT: f32 = 0.2;

/// A film, what it is of, and what it has cost so far.
pub(super) struct Exposure {
    pub(super) film: Film,
    subject: Option<Subject>,
    /// Samples that the film had when it turned to its subject: 0, unless pictures blend.
    since: u32,
    /// Whether the film blends steps of a running simulation: good to look at while it runs, never to converge.
    mixed: bool,
    /// Time spent since a sample was last complete.
    spent: Duration,
    /// Time that a sample takes.
    pub(super) per_sample: Duration,
    /// Turns that one turn lasts as long as.
    patience: u32,
    /// Mean relative standard error, when it was last measured.
    pub(super) noise: Option<f32>,
}

/// The largest size of these proportions, up to `size`, of which the adapter can hold a film.
pub(super) fn largest(gpu: &Gpu, size: [u32; 2]) -> [u32; 2] {
    let rows = Film::rows_that_fit(gpu, size[0]);
    if rows >= size[1] {
        return size;
    }
    let factor = (f64::from(rows) / f64::from(size[1])).sqrt();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "smaller than the edge it comes from")]
    size.map(|edge| ((f64::from(edge) * factor) as u32).max(1))
}

/// Both films; changing from one to the other allocates nothing.
pub(super) struct Films {
    full: Exposure,
    swift: Option<Exposure>,
    last: Which,
}

impl Exposure {
    /// A blank film of these rows of a picture.
    pub(super) fn new(gpu: &Gpu, size: [u32; 2], rows: Range<u32>) -> Result<Self, GpuError> {
        let film = Film::new(gpu, size, rows)?;
        Ok(Self {
            film,
            subject: None,
            since: 0,
            mixed: false,
            spent: Duration::ZERO,
            per_sample: Duration::ZERO,
            patience: 1,
            noise: None,
        })
    }

    /// Samples per pixel of the subject.
    pub(super) fn taken(&self) -> u32 {
        self.film.samples().saturating_sub(self.since)
    }

    /// Adds samples up to `samples` of the subject, for about `time` at most; stops where `wanted` says that somebody
    /// else is waiting, given whether this film has had its share. Gives the time that it took.
    ///
    /// # Errors
    /// [`GpuError::Fault`] when the device reported an error.
    pub(super) fn expose(
        &mut self,
        tracer: &mut Tracer,
        stage: &Stage,
        samples: u32,
        time: Duration,
        wanted: &dyn Fn(bool) -> bool,
    ) -> Result<Duration, GpuError> {
        let clock = Instant::now();
        let (before, progress) = (self.taken(), self.film.progress());
        let mut keep_going = || {
            let elapsed = clock.elapsed();
            elapsed < time * self.patience && !wanted(elapsed >= MIN_SHARE * self.patience)
        };
        tracer.sample(&mut self.film, stage, self.since.saturating_add(samples), &mut keep_going)?;
        let took = clock.elapsed();
        // Paths too long for a turn start over in the next, which must be longer.
        let stuck = self.film.progress() == progress;
        self.patience = if stuck { (self.patience * 2).min(MAX_PATIENCE) } else { 1 };
        self.spent += took;
        if let Some(samples) = self.taken().checked_sub(before).filter(|samples| *samples > 0) {
            self.per_sample = std::mem::take(&mut self.spent) / samples;
        }
        Ok(took)
    }

    /// Samples that fit into this time, at least one.
    pub(super) fn samples_in(&self, time: Duration) -> u32 {
        let count = time.as_nanos() / self.per_sample.as_nanos().max(1);
        u32::try_from(count).unwrap_or(u32::MAX).max(1)
    }

    /// Whether the film is of this subject.
    pub(super) fn is_of(&self, subject: &Subject) -> bool {
        self.subject.as_ref() == Some(subject)
    }

    /// Whether the film may count as converged once it has enough samples.
    pub(super) fn pure(&self) -> bool {
        !self.mixed
    }

    /// Takes on a subject; `fresh` if what the film showed last is long gone, `runs` if the simulation goes on.
    pub(super) fn turn_to(&mut self, subject: &Subject, fresh: bool, runs: bool) {
        if self.is_of(subject) && (runs || !self.mixed) {
            return;
        }
        if runs && !fresh && self.film.samples() < MAX_BLENDED && self.film.follow(subject, GROWTH_WEIGHT) {
            self.mixed = true;
            self.take_on(subject);
            return;
        }
        if self.mixed {
            self.film.clear();
            self.mixed = false;
        }
        // A film that blends never starts over by itself, and cannot count for ever.
        if subject.blends() && (fresh || self.film.samples() > MAX_BLENDED) {
            self.film.clear();
        }
        self.film.depict(subject);
        self.take_on(subject);
    }

    fn take_on(&mut self, subject: &Subject) {
        self.subject = Some(subject.clone());
        self.since = self.film.samples();
        self.spent = Duration::ZERO;
        self.patience = 1;
        self.noise = None;
    }
}

impl Films {
    /// A film of the full size; the other is made when something moves.
    pub(super) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, GpuError> {
        Ok(Self { full: Exposure::new(gpu, size, 0..size[1])?, swift: None, last: Which::Full })
    }

    /// Size of the full film.
    pub(super) fn size(&self) -> [u32; 2] {
        self.full.film.size()
    }

    /// Bytes on the GPU.
    pub(super) fn memory(&self) -> u64 {
        self.full.film.memory() + self.swift.as_ref().map_or(0, |swift| swift.film.memory())
    }

    /// The full film.
    pub(super) fn full(&self) -> &Exposure {
        &self.full
    }

    /// One of the films; the full one where the other was never needed.
    pub(super) fn get(&self, which: Which) -> &Exposure {
        match (which, &self.swift) {
            (Which::Swift, Some(swift)) => swift,
            _ => &self.full,
        }
    }

    /// The full film, turned to the subject; `runs` if the simulation goes on.
    pub(super) fn full_of(&mut self, subject: &Subject, runs: bool) -> &mut Exposure {
        // With `render.blend` a film keeps its old samples: those of the last time it was used would be ghosts.
        self.full.turn_to(subject, self.last != Which::Full, runs);
        self.last = Which::Full;
        &mut self.full
    }

    /// A film of this size, turned to the subject.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`].
    pub(super) fn of_size(
        &mut self,
        gpu: &Gpu,
        size: [u32; 2],
        subject: &Subject,
        runs: bool,
    ) -> Result<(Which, &mut Exposure), GpuError> {
        if size == self.size() {
            return Ok((Which::Full, self.full_of(subject, runs)));
        }
        let mut swift = match self.swift.take() {
            Some(swift) if swift.film.size() == size => swift,
            _ => Exposure::new(gpu, size, 0..size[1])?,
        };
        swift.turn_to(subject, self.last != Which::Swift, runs);
        self.last = Which::Swift;
        Ok((Which::Swift, self.swift.insert(swift)))
    }

    /// Whether a film is of this subject, with or without a sample.
    pub(super) fn are_of(&self, subject: &Subject) -> bool {
        self.full.is_of(subject) || self.swift.as_ref().is_some_and(|swift| swift.is_of(subject))
    }

    /// The film that shows the subject best, if one has a sample of it.
    pub(super) fn showing(&self, subject: &Subject) -> Option<(Which, &Exposure)> {
        let films = [(Which::Full, Some(&self.full)), (Which::Swift, self.swift.as_ref())];
        films
            .into_iter()
            .find_map(|(which, film)| film.filter(|film| film.is_of(subject) && film.taken() > 0).map(|film| (which, film)))
    }
}
