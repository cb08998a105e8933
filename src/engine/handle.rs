//! The engine's outside: handles that can be cloned, channels that are bounded.

use std::sync::{Arc, Mutex};

use serde_json::{Map, Value};
use tokio::sync::{broadcast, mpsc, oneshot, watch};

use crate::gpu::{Gpu, GpuError};
use crate::scene::history::Change;
use crate::scene::{Refusal, Scene};
use crate::stream::Picture;
use crate::volume::Field;

/// A connection, or any other party that changes a scene; 0 is the HTTP API.
pub type ClientId = u64;

/// How the engine runs.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Pictures a second aimed at while something moves; simulation and rendering together.
    pub fps: f32,
    /// Most sessions at once.
    pub max_sessions: usize,
    /// Most bytes that the volumes and films of all sessions may take.
    pub max_memory: u64,
}

/// Why the engine does not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The document or a message is at fault.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The revision is not the one that the caller has seen.
    #[error("the scene is at revision {0}")]
    Stale(u32),
    /// The adapter cannot hold it, or failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// There is no such session, volume or field.
    #[error("there is no {0}")]
    NotFound(String),
    /// A limit of the server was reached.
    #[error("{0}")]
    Limit(String),
    /// The session has ended, or the engine is shutting down.
    #[error("the session has ended")]
    Gone,
}

/// What a client can tell a session to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Lets the simulations run.
    Play,
    /// Lets them stand.
    Pause,
    /// Takes this many steps, and pauses.
    Step(u32),
    /// Starts the simulations again from their seeds.
    Reset,
    /// Takes the last change back.
    Undo,
    /// Takes the last undone change again.
    Redo,
}

/// The scene of a session at one revision.
#[derive(Debug, Clone)]
pub struct SceneState {
    /// Rises with every change.
    pub revision: u32,
    /// The document, every key written out.
    pub document: Arc<Value>,
    /// Whether the simulations run.
    pub playing: bool,
}

/// What happens in a session, for all its clients.
#[derive(Debug, Clone)]
pub enum Event {
    /// The scene changed. A client's own camera messages come with `camera` set and are not echoed to it.
    Patched {
        /// Revision and patch.
        change: Arc<Change>,
        /// Who changed it.
        by: ClientId,
        /// Whether it was a camera message.
        camera: bool,
    },
    /// How the session fares, about once a second and at every rest.
    Stats(Stats),
    /// Something that a person should know: `level` is info, warning or error.
    Notice {
        /// How grave it is.
        level: &'static str,
        /// A stable word for programs.
        code: &'static str,
        /// A sentence for people.
        text: String,
    },
    /// A client's camera message was refused after it was taken.
    Refused(ClientId, Refusal),
}

/// How a session fares.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, utoipa::ToSchema)]
pub struct Stats {
    /// Pictures made in the last second.
    pub fps: f32,
    /// Samples per pixel of the newest picture.
    pub spp: u32,
    /// Its mean relative standard error; null below two samples.
    pub noise: Option<f32>,
    /// Milliseconds of the last simulation step.
    pub simulate_ms: f32,
    /// Milliseconds of the last picture's samples.
    pub render_ms: f32,
    /// Simulation steps since the start.
    pub steps: u32,
    /// Whether the simulations run.
    pub playing: bool,
    /// Size of the newest picture.
    pub size: [u32; 2],
}

/// A line of the list of sessions.
#[derive(Debug, Clone, serde::Serialize, utoipa::ToSchema)]
pub struct SessionInfo {
    /// Name of the session.
    pub id: String,
    /// Clients connected.
    pub clients: usize,
    /// How it fares.
    pub stats: Stats,
    /// Bytes on the GPU.
    pub memory: u64,
}

/// A picture asked for by itself.
#[derive(Debug, Clone, Copy)]
pub struct StillRequest {
    /// Size in pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub spp: u32,
    /// Whether linear radiance is wanted beside the picture as shown.
    pub radiance: bool,
}

/// A picture made by itself.
#[derive(Debug, Clone)]
pub struct Still {
    /// Size in pixels.
    pub size: [u32; 2],
    /// The picture as shown: RGBA, 8 bits, sRGB, row 0 on top.
    pub pixels: Vec<u8>,
    /// Linear radiance and alpha, if it was asked for.
    pub radiance: Vec<[f32; 4]>,
    /// Revision shown.
    pub revision: u32,
}

/// A field as it was at a step.
pub type Exported = Field;

pub(super) type Reply<T> = oneshot::Sender<Result<T, EngineError>>;

/// What the engine thread is asked to do.
pub(super) enum Command {
    Create {
        id: Option<String>,
        scene: Box<Scene>,
        reply: Reply<Session>,
    },
    Remove {
        id: String,
        reply: Reply<()>,
    },
    Session {
        id: String,
        order: Order,
    },
    /// A camera message waits in a slot.
    Wake,
    Stop,
}

/// What one session is asked to do.
pub(super) enum Order {
    Patch { patch: Value, gesture: Option<String>, commit: bool, if_match: Option<u32>, by: ClientId, reply: Reply<Arc<Change>> },
    Put { document: Value, if_match: Option<u32>, by: ClientId, reply: Reply<Arc<Change>> },
    Control { control: Control, by: ClientId, reply: Reply<()> },
    Attach { by: ClientId },
    Resize { size: [u32; 2], by: ClientId },
    Detach { by: ClientId },
    Still { request: StillRequest, reply: Reply<Still> },
    Export { volume: String, field: String, reply: Reply<Exported> },
}

/// Camera messages that the engine has not taken yet: their keys merged, the newest winning.
#[derive(Default)]
pub(super) struct CameraSlot {
    pub(super) keys: Map<String, Value>,
    pub(super) seen: Vec<(ClientId, u32)>,
}

/// How the engine thread came to its end.
#[derive(Debug, Clone)]
pub(super) enum Ending {
    Stopped,
    Failed(GpuError),
}

/// Ends the engine thread when the last [`Engine`] is dropped.
pub(super) struct Life(pub(super) mpsc::Sender<Command>);

impl Drop for Life {
    fn drop(&mut self) {
        // Where the channel is full the thread is awake, and sees by itself that nobody is left.
        let _ = self.0.try_send(Command::Stop);
    }
}

/// The way to the engine thread, which ends when the last of these is dropped. Cloning is cheap.
#[derive(Clone)]
pub struct Engine {
    pub(super) commands: mpsc::Sender<Command>,
    pub(super) sessions: watch::Receiver<Arc<Vec<Session>>>,
    pub(super) gpu: Gpu,
    pub(super) ending: watch::Receiver<Option<Ending>>,
    pub(super) _alive: Arc<Life>,
}

/// The way to one session. Cloning is cheap.
#[derive(Clone)]
pub struct Session {
    pub(super) id: Arc<str>,
    pub(super) commands: mpsc::Sender<Command>,
    pub(super) camera: Arc<Mutex<CameraSlot>>,
    pub(super) pictures: watch::Receiver<Option<Arc<Picture>>>,
    pub(super) scene: watch::Receiver<SceneState>,
    pub(super) events: broadcast::Sender<Event>,
    pub(super) stats: watch::Receiver<SessionInfo>,
}

impl Engine {
    /// The GPU in use, for its name and limits.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Whether the engine thread takes commands.
    pub fn is_running(&self) -> bool {
        !self.commands.is_closed()
    }

    /// Starts a session; without a name it gets one that cannot be guessed.
    ///
    /// # Errors
    /// [`EngineError::Limit`], or [`EngineError::Gpu`] where the scene does not fit the adapter.
    pub async fn create(&self, id: Option<String>, scene: Scene) -> Result<Session, EngineError> {
        ask(&self.commands, |reply| Command::Create { id, scene: Box::new(scene), reply }).await
    }

    /// The session of this name.
    pub fn session(&self, id: &str) -> Option<Session> {
        self.sessions.borrow().iter().find(|session| &*session.id == id).cloned()
    }

    /// All sessions.
    pub fn list(&self) -> Vec<SessionInfo> {
        self.sessions.borrow().iter().map(|session| session.stats.borrow().clone()).collect()
    }

    /// Ends a session; its clients are told.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn remove(&self, id: &str) -> Result<(), EngineError> {
        let id = id.to_owned();
        ask(&self.commands, |reply| Command::Remove { id, reply }).await
    }

    /// Ends the engine thread and all sessions, and waits until it has given back what it held.
    pub async fn stop(&self) {
        let _ = self.commands.send(Command::Stop).await;
        let _ = self.ended().await;
    }

    /// Waits until the engine thread has ended.
    ///
    /// # Errors
    /// [`EngineError::Gpu`] where it was not asked to: the device is lost. [`EngineError::Gone`] where it broke.
    pub async fn ended(&self) -> Result<(), EngineError> {
        let mut ending = self.ending.clone();
        let ended = ending.wait_for(Option::is_some).await.map_err(|_| EngineError::Gone)?;
        match &*ended {
            Some(Ending::Failed(error)) => Err(error.clone().into()),
            _ => Ok(()),
        }
    }
}

impl Session {
    /// Name of the session.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The newest picture; the channel closes when the session ends.
    pub fn pictures(&self) -> watch::Receiver<Option<Arc<Picture>>> {
        self.pictures.clone()
    }

    /// The scene as it is now, and every change of it.
    pub fn scene(&self) -> watch::Receiver<SceneState> {
        self.scene.clone()
    }

    /// What happens from now on. A receiver that lags loses the oldest events and must read the scene again.
    pub fn events(&self) -> broadcast::Receiver<Event> {
        self.events.subscribe()
    }

    /// How the session fares.
    pub fn info(&self) -> SessionInfo {
        self.stats.borrow().clone()
    }

    /// Applies a merge patch; with `if_match`, only to that revision.
    ///
    /// # Errors
    /// [`EngineError::Refused`], [`EngineError::Stale`], [`EngineError::Gpu`]; the scene is then as before.
    pub async fn patch(
        &self,
        by: ClientId,
        patch: Value,
        gesture: Option<String>,
        commit: bool,
        if_match: Option<u32>,
    ) -> Result<Arc<Change>, EngineError> {
        self.order(|reply| Order::Patch { patch, gesture, commit, if_match, by, reply }).await
    }

    /// Puts another document in place of the scene.
    ///
    /// # Errors
    /// As [`Session::patch`].
    pub async fn put(&self, by: ClientId, document: Value, if_match: Option<u32>) -> Result<Arc<Change>, EngineError> {
        self.order(|reply| Order::Put { document, if_match, by, reply }).await
    }

    /// Moves the camera: newest wins, key by key. `seq` comes back in the first picture that shows it.
    ///
    /// # Errors
    /// A [`Refusal`] where a key is unknown or out of range.
    pub fn move_camera(&self, by: ClientId, seq: u32, keys: Map<String, Value>) -> Result<(), Refusal> {
        use crate::scene::param::{Fields, Place};
        crate::scene::Camera::read_fields(&keys, None, &Place::ROOT.key("camera"))?;
        if let Ok(mut slot) = self.camera.lock() {
            slot.keys.extend(keys);
            slot.seen.retain(|(client, _)| *client != by);
            slot.seen.push((by, seq));
        }
        // Where the channel is full the engine is awake, and looks into the slot before it sleeps.
        let _ = self.commands.try_send(Command::Wake);
        Ok(())
    }

    /// Plays, pauses, steps, resets, undoes, redoes.
    ///
    /// # Errors
    /// [`EngineError::Gone`], or [`EngineError::Gpu`] where a step failed.
    pub async fn control(&self, by: ClientId, control: Control) -> Result<(), EngineError> {
        self.order(|reply| Order::Control { control, by, reply }).await
    }

    /// Tells that a client looks at the pictures. Without one none are developed but the first and the final ones.
    pub async fn attach(&self, by: ClientId) {
        let _ = self.send(Order::Attach { by }).await;
    }

    /// Tells the size that a client shows pictures at, 16 to 8192 an edge; the newest word of any client counts. Who
    /// tells a size is attached.
    pub async fn resize(&self, by: ClientId, size: [u32; 2]) {
        let _ = self.send(Order::Resize { size, by }).await;
    }

    /// Tells that a client has left.
    pub async fn detach(&self, by: ClientId) {
        let _ = self.send(Order::Detach { by }).await;
    }

    /// Makes a picture by itself, beside the stream.
    ///
    /// # Errors
    /// [`EngineError::Gpu`] or [`EngineError::Gone`].
    pub async fn still(&self, request: StillRequest) -> Result<Still, EngineError> {
        self.order(|reply| Order::Still { request, reply }).await
    }

    /// Reads a volume's field as it is now.
    ///
    /// # Errors
    /// [`EngineError::NotFound`] where there is no such volume or field.
    pub async fn export(&self, volume: &str, field: &str) -> Result<Exported, EngineError> {
        let (volume, field) = (volume.to_owned(), field.to_owned());
        self.order(|reply| Order::Export { volume, field, reply }).await
    }

    async fn order<T>(&self, order: impl FnOnce(Reply<T>) -> Order) -> Result<T, EngineError> {
        let id = self.id.to_string();
        ask(&self.commands, |reply| Command::Session { id, order: order(reply) }).await
    }

    async fn send(&self, order: Order) -> Result<(), EngineError> {
        let command = Command::Session { id: self.id.to_string(), order };
        self.commands.send(command).await.map_err(|_| EngineError::Gone)
    }
}

async fn ask<T>(commands: &mpsc::Sender<Command>, command: impl FnOnce(Reply<T>) -> Command) -> Result<T, EngineError> {
    let (reply, answer) = oneshot::channel();
    commands.send(command(reply)).await.map_err(|_| EngineError::Gone)?;
    answer.await.map_err(|_| EngineError::Gone)?
}
