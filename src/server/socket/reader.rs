//! Reads a client's messages and does what they say.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use axum::extract::ws::{Message as Frame, WebSocket, close_code};
use futures_util::StreamExt;
use futures_util::stream::SplitStream;
use tokio::sync::mpsc;

use super::message::Message;
use super::{Client, End, MAX_MESSAGE, refused, reply};
use crate::engine::Control;
use crate::scene::Refusal;
use crate::server::metrics::CodeLabel;
use crate::server::rooms::Role;
use crate::server::sources;

/// How many refused messages are answered: 200 at once, then 100 a second. What a client sends wrongly in a loop must not
/// become a stream of answers.
pub(super) struct Patience {
    left: f32,
    at: Instant,
}

impl Patience {
    const MOST: f32 = 200.0;
    const A_SECOND: f32 = 100.0;

    /// Whether one more may be answered.
    pub(super) fn allows(&mut self, now: Instant) -> bool {
        self.left = (self.left + now.duration_since(self.at).as_secs_f32() * Self::A_SECOND).min(Self::MOST);
        self.at = now;
        let allowed = self.left >= 1.0;
        if allowed {
            self.left -= 1.0;
        }
        allowed
    }
}

impl Default for Patience {
    fn default() -> Self {
        Self { left: Self::MOST, at: Instant::now() }
    }
}

/// What came out of a socket: a message, its refusal, nothing that matters, or the end.
pub(super) fn understand(received: Option<Result<Frame, axum::Error>>) -> Result<Option<Result<Message, Refusal>>, End> {
    let too_long = End::Close(close_code::SIZE, "a message may have 65536 bytes");
    match received {
        Some(Ok(Frame::Text(text))) if text.len() <= MAX_MESSAGE => Ok(Some(Message::parse(text.as_str()))),
        Some(Ok(Frame::Binary(bytes))) if bytes.len() <= MAX_MESSAGE => {
            Ok(Some(Err(refused("not_text", "messages are JSON text; this one is binary"))))
        }
        Some(Ok(Frame::Text(_) | Frame::Binary(_))) => Err(too_long),
        Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => Ok(None),
        Some(Ok(Frame::Close(_))) => Err(End::Parted),
        None => Err(End::Left),
        Some(Err(error)) => Err(broken(&error)),
    }
}

/// The close for what is no WebSocket message. The library's error has no public type here, only its words.
fn broken(error: &axum::Error) -> End {
    let words = error.to_string();
    tracing::debug!(words, "a socket broke");
    if words.contains("too long") {
        End::Broken(close_code::SIZE, "a message may have 65536 bytes")
    } else if words.contains("UTF-8") {
        End::Broken(close_code::INVALID, "a text is not UTF-8")
    } else if words.contains("protocol") {
        End::Broken(close_code::PROTOCOL, "this is not the WebSocket protocol")
    } else {
        End::Left
    }
}

/// Reads until the connection ends. While a reply finds no place or the engine is busy nothing more is read, so that a
/// client that sends faster than it is served waits at its own end.
pub(super) async fn read(client: &Client, mut source: SplitStream<&mut WebSocket>, replies: mpsc::Sender<String>) -> End {
    let mut patience = Patience::default();
    loop {
        let message = match understand(source.next().await) {
            Ok(message) => message,
            Err(end) => return end,
        };
        client.hear();
        let done = match message {
            None => Ok(()),
            Some(Ok(Message::Control(Control::Step(steps)))) => step(client, steps, &replies),
            Some(Ok(message)) => obey(client, message).await,
            Some(Err(refusal)) => Err(refusal),
        };
        if let Err(refusal) = done {
            client.app.metrics.refused.get_or_create(&CodeLabel { code: refusal.code }).inc();
            if patience.allows(Instant::now()) && replies.send(reply::error(&refusal)).await.is_err() {
                return End::Left;
            }
        }
    }
}

/// Has steps taken and does not wait for them: the camera moves meanwhile.
fn step(client: &Client, steps: u32, replies: &mpsc::Sender<String>) -> Result<(), Refusal> {
    client.seat.may_change().map_err(|(code, text)| refused(code, text))?;
    let permit = Arc::clone(&client.steps).try_acquire_owned();
    let permit = permit.map_err(|_| refused("busy", "steps that were asked for are still being taken"))?;
    let (session, id, replies) = (client.session.clone(), client.id, replies.clone());
    tokio::spawn(async move {
        let _permit = permit;
        if let Err(error) = session.control(id, Control::Step(steps)).await {
            let _ = replies.send(reply::error(&reply::refusal(error))).await;
        }
    });
    Ok(())
}

async fn obey(client: &Client, message: Message) -> Result<(), Refusal> {
    let may_change = || client.seat.may_change().map_err(|(code, text)| refused(code, text));
    match message {
        Message::Hello(_) => Err(refused("hello_again", "there was a hello already")),
        Message::Ack { frame } => {
            if client.credit().acknowledge(frame) {
                client.wake.notify_one();
            }
            Ok(())
        }
        Message::Keyframe => {
            client.resend.store(true, Ordering::Relaxed);
            client.wake.notify_one();
            Ok(())
        }
        Message::Resize(size) => {
            client.seat.tell_size(size).map_err(|(code, text)| refused(code, text))?;
            client.session.resize(client.id, size).await;
            Ok(())
        }
        Message::Camera { seq, keys } => {
            may_change()?;
            client.session.move_camera(client.id, seq, keys)
        }
        Message::Patch { patch, gesture, commit } => {
            may_change()?;
            let current = client.session.scene().borrow().document.clone();
            sources::check(&patch, Some(&current), client.app.config.data.as_deref())?;
            client.session.patch(client.id, patch, gesture, commit, None).await.map_err(reply::refusal)?;
            Ok(())
        }
        Message::Control(command) => {
            may_change()?;
            client.session.control(client.id, command).await.map_err(reply::refusal)
        }
        Message::Take => {
            // Who controls can take over from a holder that does not let go.
            if client.hello.role == Role::View {
                return may_change();
            }
            client.seat.take();
            Ok(())
        }
        Message::Release => {
            client.seat.release();
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn wrong_messages_in_a_loop_are_not_all_answered() {
        let mut patience = Patience::default();
        let start = patience.at;
        let mut answered = |seconds| (0..1000).filter(|_| patience.allows(start + Duration::from_secs(seconds))).count();
        assert_eq!([answered(0), answered(0), answered(1), answered(60)], [200, 0, 100, 200]);
    }

    #[test]
    fn a_message_of_the_limit_is_read_and_one_byte_more_closes_with_1009() {
        let text = |length: usize| Some(Ok(Frame::text("x".repeat(length))));
        assert!(matches!(understand(text(MAX_MESSAGE)), Ok(Some(Err(refusal))) if refusal.code == "bad_json"));
        assert!(matches!(understand(text(MAX_MESSAGE + 1)), Err(End::Close(1009, _))));
        assert!(matches!(understand(Some(Ok(Frame::binary(vec![0; MAX_MESSAGE + 1])))), Err(End::Close(1009, _))));
    }
}
