//! What an operator watches, in the Prometheus text format. No label names a session: its id is a key to it.

use std::fmt;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

use crate::engine::SessionInfo;

/// The media type of [`Metrics::text`].
pub(super) const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
pub(super) struct CodecLabel {
    pub(super) codec: &'static str,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
pub(super) struct CodeLabel {
    pub(super) code: &'static str,
}

type Seconds = Gauge<f64, std::sync::atomic::AtomicU64>;

/// The counters and gauges.
pub(super) struct Metrics {
    registry: Registry,
    pub(super) connections: Gauge,
    pub(super) connections_refused: Counter,
    pub(super) requests: Family<CodeLabel, Counter>,
    pub(super) clients: Gauge,
    pub(super) frames: Family<CodecLabel, Counter>,
    pub(super) frame_bytes: Counter,
    pub(super) encode: Histogram,
    pub(super) refused: Family<CodeLabel, Counter>,
    pub(super) slow_clients: Counter,
    sessions: Gauge,
    memory: Gauge,
    steps: Gauge,
    fps: Seconds,
    simulate: Seconds,
    render: Seconds,
}

impl Metrics {
    pub(super) fn new() -> Self {
        let mut registry = Registry::with_prefix("tyndall");
        let encode = Histogram::new(exponential_buckets(0.000_5, 2.0, 12));
        let metrics = Self {
            connections: add(&mut registry, "connections", "Connections open"),
            connections_refused: add(&mut registry, "connections_refused", "Connections refused because too many were open"),
            requests: add(&mut registry, "requests", "HTTP requests by class of status"),
            clients: add(&mut registry, "clients", "Clients of streams"),
            frames: add(&mut registry, "frames_sent", "Frames sent by codec"),
            frame_bytes: add(&mut registry, "frame_bytes_sent", "Bytes of frames sent"),
            refused: add(&mut registry, "messages_refused", "Messages refused by code"),
            slow_clients: add(&mut registry, "slow_clients_dropped", "Clients dropped because they did not read"),
            sessions: add(&mut registry, "sessions", "Sessions running"),
            memory: add(&mut registry, "gpu_memory_bytes", "Bytes of all sessions on the GPU"),
            steps: add(&mut registry, "simulation_steps", "Steps of the sessions' simulations since their starts, summed"),
            fps: add(&mut registry, "pictures_per_second", "Pictures made in the last second, summed over sessions"),
            simulate: add(&mut registry, "simulate_seconds", "Time of the last simulation step, of the slowest session"),
            render: add(&mut registry, "render_seconds", "Time of the last picture's samples, of the slowest session"),
            encode,
            registry: Registry::default(),
        };
        registry.register_with_unit("encode", "Time of encoding the frames sent", Unit::Seconds, metrics.encode.clone());
        Self { registry, ..metrics }
    }

    /// All values as text, with those of the sessions as they are now.
    pub(super) fn text(&self, sessions: &[SessionInfo]) -> Result<String, fmt::Error> {
        let longest = |ms: fn(&SessionInfo) -> f32| f64::from(sessions.iter().map(ms).fold(0.0, f32::max)) / 1000.0;
        self.sessions.set(whole(sessions.len() as u64));
        self.memory.set(whole(sessions.iter().map(|session| session.memory).sum()));
        self.steps.set(whole(sessions.iter().map(|session| u64::from(session.stats.steps)).sum()));
        self.fps.set(sessions.iter().map(|session| f64::from(session.stats.fps)).sum());
        self.simulate.set(longest(|session| session.stats.simulate_ms));
        self.render.set(longest(|session| session.stats.render_ms));
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

fn add<M>(registry: &mut Registry, name: &str, help: &str) -> M
where
    M: prometheus_client::registry::Metric + Default + Clone,
{
    let metric = M::default();
    registry.register(name, help, metric.clone());
    metric
}

fn whole(value: u64) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_holds_what_was_counted_and_ends_as_the_format_wants() {
        let metrics = Metrics::new();
        metrics.frames.get_or_create(&CodecLabel { codec: "jpeg" }).inc_by(3);
        metrics.encode.observe(0.004);
        let session = SessionInfo { id: "secret-id".into(), clients: 1, stats: crate::engine::Stats::default(), memory: 1 << 20 };
        let text = metrics.text(&[session]).unwrap();
        for line in [
            "tyndall_frames_sent_total{codec=\"jpeg\"} 3",
            "tyndall_sessions 1",
            "tyndall_gpu_memory_bytes 1048576",
            "tyndall_encode_seconds_count 1",
        ] {
            assert!(text.contains(line), "{line} in {text}");
        }
        assert!(text.ends_with("# EOF\n"));
        assert!(!text.contains("secret-id"));
    }
}
