//! Sends a client its pictures, as far as it has credit, and what happens in its session.

use std::future::Future;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::{Message as Frame, WebSocket, close_code};
use futures_util::SinkExt;
use futures_util::stream::SplitSink;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, mpsc, watch};
use tokio::time::MissedTickBehavior;

use super::reply::{self, Welcome};
use super::{Client, End};
use crate::engine::{Event, SceneState, Stats};
use crate::server::metrics::CodecLabel;
use crate::stream::{Codec, FLAG_FINAL, FLAG_KEY, FLAG_LOSSLESS, FrameHeader, HEADER_LEN, Picture};

/// The slowest client that is kept takes this many bytes a second.
const LEAST_RATE: usize = 64 << 10;

type Sink<'a> = SplitSink<&'a mut WebSocket, Frame>;

struct Writer<'a> {
    client: &'a Client,
    sink: Sink<'a>,
    pictures: watch::Receiver<Option<Arc<Picture>>>,
    scene: watch::Receiver<SceneState>,
    holder: watch::Receiver<Option<u64>>,
    /// Revision of the scene in the last welcome.
    known: u32,
    /// The newest of the client's camera messages shown so far.
    seq: u32,
    /// The last picture sent, if it was final.
    last_final: Option<Arc<Picture>>,
    /// Bytes of frames sent since the last stats.
    bytes: usize,
    since: Instant,
    encode_us: u32,
}

/// Sends until the connection ends.
pub(super) async fn write<'a>(client: &'a Client, sink: Sink<'a>, mut replies: mpsc::Receiver<String>) -> End {
    // Events are heard before the scene is read: a change in between is told twice at worst, and left out by its revision.
    let mut events = client.session.events();
    let mut writer = Writer {
        client,
        sink,
        pictures: client.session.pictures(),
        scene: client.session.scene(),
        holder: client.seat.holder(),
        known: 0,
        seq: 0,
        last_final: None,
        bytes: 0,
        since: Instant::now(),
        encode_us: 0,
    };
    // The newest picture of before counts as new to this client.
    writer.pictures.mark_changed();
    match writer.run(&mut events, &mut replies).await {
        Ok(never) => match never {},
        Err(end) => end,
    }
}

impl Writer<'_> {
    async fn run(
        &mut self,
        events: &mut broadcast::Receiver<Event>,
        replies: &mut mpsc::Receiver<String>,
    ) -> Result<std::convert::Infallible, End> {
        self.welcome().await?;
        let every = self.client.app.config.timing.ping;
        let mut ping = tokio::time::interval_at(tokio::time::Instant::now() + every, every);
        ping.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut silence = Silence::default();
        let mut gone = pin!(super::gone(self.client.session.pictures()));
        loop {
            self.send_newest().await?;
            let has_credit = self.client.credit().is_open();
            tokio::select! {
                reply = replies.recv() => self.text(reply.ok_or(End::Left)?).await?,
                event = events.recv() => self.tell(event).await?,
                () = gone.as_mut() => {
                    // Why it ended may have been said last.
                    while let Ok(event) = events.try_recv() {
                        self.tell(Ok(event)).await?;
                    }
                    return Err(End::Close(close_code::AWAY, "the session has ended"));
                }
                changed = self.holder.changed() => {
                    changed.map_err(|_| End::Left)?;
                    self.tell_holder().await?;
                }
                Ok(()) = self.pictures.changed(), if has_credit => {
                    // Seen only once it is sent.
                    self.pictures.mark_changed();
                }
                () = self.client.wake.notified() => {}
                _ = ping.tick() => {
                    if silence.lasts(self.client.heard.load(Ordering::Relaxed)) {
                        return Err(End::Left);
                    }
                    self.send(Frame::Ping(Bytes::new())).await?;
                }
            }
        }
    }

    async fn welcome(&mut self) -> Result<(), End> {
        let client = self.client;
        let holder = *self.holder.borrow_and_update();
        let text = {
            let scene = self.scene.borrow_and_update();
            self.known = scene.revision;
            Welcome {
                session: client.session.id(),
                client: client.id,
                role: client.hello.role.word(),
                codec: client.hello.codec.name(),
                scene: &scene,
                holder,
            }
            .text()
        };
        self.text(text).await?;
        if holder.is_some() { self.tell_holder().await } else { Ok(()) }
    }

    async fn tell_holder(&mut self) -> Result<(), End> {
        let holder = *self.holder.borrow_and_update();
        self.text(reply::control(holder, self.client.id)).await
    }

    async fn tell(&mut self, event: Result<Event, RecvError>) -> Result<(), End> {
        match event {
            Ok(Event::Stats(stats)) => self.tell_stats(&stats).await,
            Ok(event) => match reply::event(&event, self.client.id, self.known) {
                Some(text) => self.text(text).await,
                None => Ok(()),
            },
            // Changes were missed, so the client gets the whole scene again.
            Err(RecvError::Lagged(missed)) => {
                tracing::debug!(missed, "a client lagged behind its session");
                self.welcome().await
            }
            Err(RecvError::Closed) => Err(End::Left),
        }
    }

    async fn tell_stats(&mut self, stats: &Stats) -> Result<(), End> {
        let seconds = self.since.elapsed().as_secs_f32().max(1e-3);
        #[expect(clippy::cast_precision_loss, reason = "shown to people")]
        let (kbps, encode_ms) = (self.bytes as f32 * 8e-3 / seconds, self.encode_us as f32 * 1e-3);
        (self.bytes, self.since) = (0, Instant::now());
        self.text(reply::stats(stats, encode_ms, kbps)).await
    }

    /// Sends the newest picture, if the client has not had it and has credit.
    async fn send_newest(&mut self) -> Result<(), End> {
        if !self.client.credit().is_open() {
            return Ok(());
        }
        let wanted = self.client.resend.swap(false, Ordering::Relaxed);
        if !wanted && !self.pictures.has_changed().unwrap_or(false) {
            return Ok(());
        }
        let Some(picture) = self.pictures.borrow_and_update().clone() else { return Ok(()) };
        let seen = picture.seen.iter().find(|(client, _)| *client == self.client.id);
        let seq = seen.map_or(self.seq, |(_, seq)| *seq);
        // A final picture may be made again because another client came.
        if !wanted && seq == self.seq && self.last_final.as_ref().is_some_and(|last| is_same(last, &picture)) {
            return Ok(());
        }
        let hello = &self.client.hello;
        let codec = if picture.converged && hello.png { Codec::Png } else { hello.codec };
        let encoded = match picture.encoded(codec).await {
            Ok(encoded) => encoded,
            Err(error) => {
                tracing::error!(%error, "a picture is not sent");
                return self.text(reply::notice("error", "encode", &error.to_string())).await;
            }
        };
        let Some(frame) = self.client.credit().take() else { return Ok(()) };
        self.seq = seq;
        self.last_final = picture.converged.then(|| Arc::clone(&picture));
        let header = FrameHeader {
            codec,
            flags: FLAG_KEY
                | if picture.converged { FLAG_FINAL } else { 0 }
                | if codec.is_lossless() { FLAG_LOSSLESS } else { 0 },
            size: picture.size.map(|edge| u16::try_from(edge).unwrap_or(u16::MAX)),
            frame,
            seq: self.seq,
            revision: picture.revision,
            spp: picture.spp,
            begun_us: picture.begun_us,
            work_us: picture.work_us,
            encode_us: picture.readback_us.saturating_add(encoded.encode_us),
        };
        let mut message = Vec::with_capacity(HEADER_LEN + encoded.bytes.len());
        message.extend_from_slice(&header.to_bytes());
        message.extend_from_slice(&encoded.bytes);
        self.bytes += message.len();
        self.encode_us = encoded.encode_us;
        let metrics = &self.client.app.metrics;
        metrics.frames.get_or_create(&CodecLabel { codec: codec.name() }).inc();
        metrics.frame_bytes.inc_by(message.len() as u64);
        metrics.encode.observe(f64::from(encoded.encode_us) * 1e-6);
        self.send(Frame::binary(message)).await
    }

    async fn text(&mut self, text: String) -> Result<(), End> {
        self.send(Frame::text(text)).await
    }

    /// Sends one message. A client that takes it too slowly is given up, and holds nothing up but its own loop until then.
    async fn send(&mut self, message: Frame) -> Result<(), End> {
        let length = match &message {
            Frame::Text(text) => text.len(),
            Frame::Binary(bytes) => bytes.len(),
            _ => 0,
        };
        let more = Duration::from_secs((length / LEAST_RATE) as u64);
        let patience = self.client.app.config.timing.send + more;
        within(patience, self.sink.send(message)).await
    }
}

/// Whether two final pictures show the same.
fn is_same(a: &Picture, b: &Picture) -> bool {
    b.converged && a.revision == b.revision && a.spp == b.spp && a.size == b.size && a.pixels == b.pixels
}

async fn within(patience: Duration, sending: impl Future<Output = Result<(), axum::Error>>) -> Result<(), End> {
    tokio::time::timeout(patience, sending).await.map_err(|_| End::Slow)?.map_err(|_| End::Left)
}

/// How long a client has said nothing, in pings.
#[derive(Default)]
struct Silence {
    heard: u64,
    pings: u32,
}

impl Silence {
    /// Counts a ping; whether two before it stayed without any answer.
    fn lasts(&mut self, heard: u64) -> bool {
        if heard == self.heard {
            self.pings += 1;
        } else {
            (self.heard, self.pings) = (heard, 0);
        }
        self.pings > 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_is_gone_after_two_pings_without_a_word() {
        let mut silence = Silence::default();
        assert_eq!([5, 5, 5, 6, 6, 6, 6].map(|heard| silence.lasts(heard)), [false, false, false, false, false, false, true]);
    }
}
