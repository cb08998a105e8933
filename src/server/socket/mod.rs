//! A session's stream: one WebSocket a client.
//!
//! Two loops share a connection. [`reader`] reads messages and does what they say; [`writer`] sends pictures as far as
//! the client has credit, and what happened in the session. Neither keeps a queue that could grow: pictures and stats
//! wait in slots where the newest replaces the last, replies in a channel of a few places, and a client that does not
//! take its messages in time is dropped.

mod message;
mod reader;
mod reply;
mod writer;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message as Frame, Utf8Bytes, WebSocket, WebSocketUpgrade, close_code};
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use tokio::sync::{Notify, Semaphore, mpsc, watch};

use self::message::{Hello, Message};
use super::listener::Slot;
use super::metrics::CodeLabel;
use super::query::Named;
use super::rooms::Seat;
use super::{App, Problem};
use crate::engine::{ClientId, Session};
use crate::scene::Refusal;
use crate::stream::Credit;

/// Bytes of a message; more close the connection with 1009.
pub(super) const MAX_MESSAGE: usize = 64 << 10;
/// Bytes of a message that are read before the connection is given up. A message between the two limits is read to its
/// end, so that the client is there to receive the close and is not cut off in the middle of sending.
const MAX_READ: usize = 4 << 20;
/// Bytes of a connection's read buffer; messages are small, and idle clients many.
const READ_BUFFER: usize = 8 << 10;
/// Replies that wait for the writer; when there are more, reading waits.
const REPLIES: usize = 16;
/// Messages of a client that ask for steps and may be under way.
const STEPPING: usize = 4;
/// Time that a client has to answer a close.
const GOODBYE: Duration = Duration::from_secs(2);

/// Why a connection ends.
#[derive(Debug)]
enum End {
    /// The client cannot be reached.
    Left,
    /// The client has said goodbye.
    Parted,
    /// The client does not take its messages.
    Slow,
    /// It is told why.
    Close(u16, &'static str),
    /// It is told why; nothing more of it can be read.
    Broken(u16, &'static str),
}

/// What both loops of a connection know.
struct Client {
    app: App,
    session: Session,
    id: ClientId,
    hello: Hello,
    seat: Seat,
    credit: Mutex<Credit>,
    /// The newest picture is wanted again.
    resend: AtomicBool,
    /// Messages received, of any kind: a sign of life.
    heard: AtomicU64,
    /// Places for steps that were asked for and are not all taken.
    steps: Arc<Semaphore>,
    /// Wakes the writer when there is credit, or a wish.
    wake: Notify,
}

impl Client {
    fn credit(&self) -> MutexGuard<'_, Credit> {
        self.credit.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn hear(&self) {
        self.heard.fetch_add(1, Ordering::Relaxed);
    }
}

/// Opens a session's stream: a WebSocket with the subprotocol `tyndall.v1`.
///
/// The client sends JSON text, at most 64 KiB a message:
/// - `{"type":"hello","codecs":["jpeg","png"],"size":[1280,720],"role":"control"}` first, within 10 s; `view` only looks.
/// - `{"type":"camera","seq":812,"position":[1,2,3],…}` with any of the camera's keys; the newest message wins.
/// - `{"type":"patch","patch":{…},"gesture":"g3","commit":true}`: a merge patch of the scene. Uncommitted patches of one
///   gesture are one undo step.
/// - `{"type":"ack","frame":9001,"decode_ms":3.1}` once a frame is drawn: at most 2 are under way without.
/// - `{"type":"keyframe"}` asks for the newest picture again, `{"type":"resize","size":[640,360]}` for another size.
/// - `{"type":"control","cmd":"play"}`, or `pause`, `step` (with `steps`), `reset`, `undo`, `redo`; `take` makes the client
///   the only one that may change anything, until it sends `release` or leaves.
///
/// The server sends JSON text: `welcome` (again where the client has missed changes: it replaces all), `patch`, `stats`,
/// `notice`, `control` (who holds it), `error` (`code`, `path`, `text` of a message that was refused).
///
/// It sends each picture as one binary message: 40 bytes little-endian, then the payload. At 0 u8 version 1; 1 u8 codec
/// (0 PNG, 1 JPEG); 2 u8 flags (1 key frame, 2 final, 4 lossless); 3 u8 0; 4 u16 width; 6 u16 height; 8 u32 frame number;
/// 12 u32 `seq` of the client's newest camera message shown; 16 u32 revision; 20 u32 samples per pixel; 24 u64 server's
/// clock in µs when the picture was begun; 32 u32 µs of simulation and rendering; 36 u32 µs of read-back and encoding.
///
/// Closes: 1001 the session has ended, 1008 no hello came, 1009 a message was too long, 1012 the server stops.
#[utoipa::path(
    get, operation_id = "open_stream", path = "/api/v1/sessions/{id}/ws", tag = "stream",
    params(("id" = String, Path, description = "Name of the session")),
    responses(
        (status = 101, description = "JSON messages both ways, frames with a 40-byte header from the server"),
        (status = 403, description = "The Origin is foreign"),
        (status = 404),
        (status = 426, description = "The request is no upgrade"),
    )
)]
pub(super) async fn upgrade(
    State(app): State<App>,
    Named(id): Named,
    Extension(slot): Extension<Slot>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    if !app.origins.admit(&headers) {
        let detail = "the Origin is neither this server nor allowed with --origin";
        return Err(Problem::new(StatusCode::FORBIDDEN, "foreign_origin", detail));
    }
    let session = app.session(&id)?;
    let upgrade = upgrade.map_err(|rejection| {
        let problem = Problem::bad_request("bad_upgrade", rejection.body_text());
        let problem = problem.with_header(header::SEC_WEBSOCKET_VERSION, "13");
        let asks = headers.contains_key(header::UPGRADE);
        if asks { problem } else { problem.with_status(StatusCode::UPGRADE_REQUIRED).with_header(header::UPGRADE, "websocket") }
    })?;
    let upgrade = upgrade
        .protocols([reply::PROTOCOL])
        .max_message_size(MAX_READ)
        .max_frame_size(MAX_READ)
        .read_buffer_size(READ_BUFFER)
        .write_buffer_size(0);
    let run = move |socket| async move {
        // The connection keeps its place until the socket ends.
        let _slot = slot;
        run(app, session, socket).await;
    };
    Ok(upgrade.on_failed_upgrade(|error| tracing::debug!(%error, "an upgrade failed")).on_upgrade(run).into_response())
}

async fn run(app: App, session: Session, mut socket: WebSocket) {
    let greeted = tokio::select! {
        greeted = tokio::time::timeout(app.config.timing.hello, greet(&app, &mut socket)) => {
            greeted.unwrap_or(Err(End::Close(close_code::POLICY, "no hello came")))
        }
        () = app.stopped() => Err(End::Close(close_code::RESTART, "the server stops")),
        () = gone(session.pictures()) => Err(End::Close(close_code::AWAY, "the session has ended")),
    };
    let end = match greeted {
        Ok(hello) => {
            app.metrics.clients.inc();
            let end = stream(&app, session, hello, &mut socket).await;
            app.metrics.clients.dec();
            end
        }
        Err(end) => end,
    };
    tracing::debug!(?end, "a stream ended");
    match end {
        End::Left => {}
        End::Slow => {
            app.metrics.slow_clients.inc();
        }
        // Its close is answered while the rest is read.
        End::Parted => while_polite(drain(&mut socket)).await,
        End::Close(code, reason) => while_polite(close(&mut socket, code, reason, drain)).await,
        End::Broken(code, reason) => while_polite(close(&mut socket, code, reason, async |_| std::future::pending().await)).await,
    }
}

/// Waits for the first message; anything else is answered and does not count.
async fn greet(app: &App, socket: &mut WebSocket) -> Result<Hello, End> {
    let mut patience = reader::Patience::default();
    loop {
        let refusal = match reader::understand(socket.recv().await)? {
            None => continue,
            Some(Ok(Message::Hello(hello))) => return Ok(hello),
            Some(Ok(_)) => refused("hello_first", "the first message must be a hello"),
            Some(Err(refusal)) => refusal,
        };
        app.metrics.refused.get_or_create(&CodeLabel { code: refusal.code }).inc();
        if patience.allows(Instant::now()) {
            let text = Frame::text(reply::error(&refusal));
            tokio::time::timeout(app.config.timing.send, socket.send(text))
                .await
                .map_err(|_| End::Slow)?
                .map_err(|_| End::Left)?;
        }
    }
}

async fn stream(app: &App, session: Session, hello: Hello, socket: &mut WebSocket) -> End {
    let id = app.next_client();
    let seat = app.rooms.enter(session.clone(), id, hello.role);
    session.attach(id).await;
    if let Some(size) = hello.size.filter(|size| seat.tell_size(*size).is_ok()) {
        session.resize(id, size).await;
    }
    let client = Client {
        app: app.clone(),
        session,
        id,
        hello,
        seat,
        credit: Mutex::default(),
        resend: AtomicBool::new(false),
        heard: AtomicU64::new(0),
        steps: Arc::new(Semaphore::new(STEPPING)),
        wake: Notify::new(),
    };
    let (sink, source) = socket.split();
    let (replies, queue) = mpsc::channel(REPLIES);
    tokio::select! {
        end = reader::read(&client, source, replies) => end,
        end = writer::write(&client, sink, queue) => end,
        () = app.stopped() => End::Close(close_code::RESTART, "the server stops"),
    }
}

/// Ready when the session has ended.
async fn gone<T>(mut pictures: watch::Receiver<T>) {
    while pictures.changed().await.is_ok() {}
}

/// Sends a close and waits for what the client does about it: ending the connection over bytes that were not read resets
/// it, and the client might never see why.
async fn close(socket: &mut WebSocket, code: u16, reason: &'static str, answered: impl AsyncFnOnce(&mut WebSocket)) {
    let close = Frame::Close(Some(CloseFrame { code, reason: Utf8Bytes::from_static(reason) }));
    if socket.send(close).await.is_ok() {
        answered(socket).await;
    }
}

/// Reads to the end and throws away what comes.
async fn drain(socket: &mut WebSocket) {
    while let Some(Ok(_)) = socket.recv().await {}
}

async fn while_polite(goodbye: impl Future<Output = ()>) {
    if tokio::time::timeout(GOODBYE, goodbye).await.is_err() {
        tracing::debug!("a client took too long to say goodbye");
    }
}

fn refused(code: &'static str, text: &str) -> Refusal {
    Refusal { code, path: String::new(), text: text.to_owned() }
}
