//! How large a picture may be while something moves.

use std::time::Duration;

/// Sizes that a moving picture may have, in sixteenths of the edge.
const SCALES: [u32; 7] = [16, 12, 8, 6, 4, 3, 2];

/// Shortest edge of a moving picture.
const MIN_EDGE: u32 = 16;

/// Most samples per pixel of a moving picture.
const MAX_SPP: u32 = 16;

/// Milliseconds that a whole picture may take before smaller ones come first.
const PATIENCE_MS: f64 = 400.0;

/// Share of a picture's time that is left to rendering however long a step takes.
const RENDER_SHARE: f64 = 0.25;

/// Share of a step's time that its picture may take, where steps are slow anyway.
const STEP_SHARE: f64 = 0.5;

/// What steps and samples have cost, and the size that follows from it.
pub(super) struct Pace {
    ns_per_sample: f64,
    measured: bool,
    step_ms: f64,
    scale: usize,
}

impl Pace {
    /// Knows nothing yet but whether the adapter computes on the CPU: the first picture is the smallest, and soon there.
    pub(super) fn new(software: bool) -> Self {
        Self { ns_per_sample: if software { 200.0 } else { 2.0 }, measured: false, step_ms: 0.0, scale: SCALES.len() - 1 }
    }

    /// Takes note of `samples` samples of one pixel each.
    pub(super) fn rendered(&mut self, samples: u64, took: Duration) {
        if samples == 0 {
            return;
        }
        #[expect(clippy::cast_precision_loss, reason = "a mean needs no more")]
        let ns = (took.as_secs_f64() * 1e9 / samples as f64).max(1e-3);
        if self.measured {
            // One slow picture, such as the first of a kernel, must not shrink the next twenty.
            let ns = ns.clamp(self.ns_per_sample / 4.0, self.ns_per_sample * 4.0);
            self.ns_per_sample += 0.3 * (ns - self.ns_per_sample);
        } else {
            self.ns_per_sample = ns.min(self.ns_per_sample * 16.0);
            self.measured = true;
        }
    }

    /// Takes note of a simulation step.
    pub(super) fn stepped(&mut self, took: Duration) {
        let ms = took.as_secs_f64() * 1e3;
        self.step_ms += if self.step_ms == 0.0 { ms } else { 0.3 * (ms - self.step_ms) };
    }

    /// Size and samples per pixel of the next moving picture, so that it and the step before it take one `period`.
    pub(super) fn choose(&mut self, full: [u32; 2], steps: bool, period: Duration) -> ([u32; 2], u32) {
        let period_ms = period.as_secs_f64() * 1e3;
        let step_ms = if steps { self.step_ms } else { 0.0 };
        let budget_ms = (period_ms - step_ms).max(period_ms * RENDER_SHARE).max(step_ms * STEP_SHARE);
        let last = SCALES.len() - 1;
        let fits = |scale: usize, share: f64| self.picture_ms(full, scale) <= budget_ms * share;
        let mut scale = self.scale;
        // Down as soon as a picture is late, up only where there is room to spare: sizes do not flicker.
        if !fits(scale, 1.15) {
            scale = (scale..last).find(|&scale| fits(scale, 1.0)).unwrap_or(last);
        }
        while scale > 0 && fits(scale - 1, 0.8) {
            scale -= 1;
        }
        self.scale = scale;
        let mut spp = 1;
        // Half of the time left buys samples; the other half keeps the answer to a camera message early.
        while spp < MAX_SPP && f64::from(spp * 2) * self.picture_ms(full, scale) <= budget_ms * 0.5 {
            spp *= 2;
        }
        (scaled(full, scale), spp)
    }

    /// The size of the next picture at rest, after one of `shown`, where a whole one would be long in coming.
    pub(super) fn rung(&self, full: [u32; 2], shown: [u32; 2]) -> Option<[u32; 2]> {
        let next = shown.map(|edge| edge * 2);
        let far = next[0] * 3 < full[0] * 2 && next[1] * 3 < full[1] * 2;
        (far && self.picture_ms(full, 0) > PATIENCE_MS).then_some(next)
    }

    fn picture_ms(&self, full: [u32; 2], scale: usize) -> f64 {
        let [width, height] = scaled(full, scale);
        f64::from(width) * f64::from(height) * self.ns_per_sample * 1e-6
    }
}

fn scaled(full: [u32; 2], scale: usize) -> [u32; 2] {
    full.map(|edge| ((edge * SCALES[scale] + 8) / 16).max(MIN_EDGE.min(edge)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: [u32; 2] = [1280, 720];
    const PERIOD: Duration = Duration::from_millis(33);

    fn settled(ns: u32, step_ms: u64) -> (Pace, [u32; 2]) {
        let mut pace = Pace::new(true);
        let mut size = FULL;
        for _ in 0..40 {
            size = pace.choose(FULL, step_ms > 0, PERIOD).0;
            let samples = u64::from(size[0]) * u64::from(size[1]);
            pace.rendered(samples, Duration::from_nanos(samples * u64::from(ns)));
            if step_ms > 0 {
                pace.stepped(Duration::from_millis(step_ms));
            }
        }
        (pace, size)
    }

    #[test]
    fn a_slower_renderer_makes_smaller_pictures() {
        assert_eq!(settled(1, 0).1, FULL);
        assert_eq!(settled(80, 0).1, [640, 360]);
        assert_eq!(settled(1_000_000, 0).1, [160, 90]);
    }

    #[test]
    fn a_step_takes_its_time_from_the_picture() {
        let [still, _] = settled(80, 0).1;
        let [running, _] = settled(80, 20).1;
        assert!(running < still, "{running} < {still}");
    }

    #[test]
    fn a_picture_of_a_slow_step_is_no_smaller_than_half_its_time_allows() {
        let (_, [width, height]) = settled(80, 200);
        assert_eq!([width, height], FULL);
    }

    #[test]
    fn a_small_waver_does_not_change_the_size() {
        let (mut pace, size) = settled(130, 0);
        for ns in [143, 117, 143, 117, 130, 143, 143, 117] {
            pace.rendered(1_000_000, Duration::from_millis(ns));
            assert_eq!(pace.choose(FULL, false, PERIOD).0, size);
        }
    }

    #[test]
    fn a_fast_renderer_takes_more_samples_and_stays_inside_half_the_period() {
        let (mut pace, _) = settled(2, 0);
        let (size, spp) = pace.choose(FULL, false, PERIOD);
        let ms = f64::from(size[0] * size[1] * spp) * 2e-6;
        assert!(spp > 1 && ms <= 16.5, "{spp} samples, {ms} ms");
    }

    #[test]
    fn a_picture_that_takes_long_comes_by_smaller_ones() {
        let (slow, size) = settled(20_000, 0);
        assert_eq!(size, [160, 90]);
        let rungs: Vec<_> = std::iter::successors(slow.rung(FULL, size), |size| slow.rung(FULL, *size)).collect();
        assert_eq!(rungs, [[320, 180], [640, 360]]);
        let (fast, size) = settled(100, 0);
        assert_eq!(fast.rung(FULL, size), None);
    }

    #[test]
    fn no_edge_is_shorter_than_sixteen_pixels_unless_the_picture_is() {
        assert_eq!(scaled([64, 48], SCALES.len() - 1), [16, 16]);
        assert_eq!(scaled([4, 1000], SCALES.len() - 1), [4, 125]);
    }
}
