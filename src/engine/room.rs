//! What stands behind a session's handle, on the engine thread: its scene, world, stage and films.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::sync::{broadcast, mpsc, watch};

use super::films::Films;
use super::handle::{CameraSlot, Command, Reply};
use super::pace::Pace;
use super::still::Job;
use super::thread::FileReader;
use super::{ClientId, EngineError, Event, SceneState, Session, SessionInfo, Settings, Stats, Still};
use crate::gpu::{Gpu, GpuError};
use crate::render::{Film, Stage, Subject, Tracer};
use crate::scene::{History, Scene};
use crate::stream::Picture;
use crate::world::World;

/// Size of a picture until a client tells its own.
const SIZE: [u32; 2] = [1280, 720];

/// Events that a client may lag behind.
const EVENTS: usize = 256;

/// What a session works with when it is its turn.
pub(super) struct Tools<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) tracer: &'a mut Tracer,
    pub(super) settings: &'a Settings,
    pub(super) files: &'a FileReader,
    /// Commands that wait: whether there are any.
    pub(super) waiting: &'a mpsc::Receiver<Command>,
    /// Zero of the clock that pictures are stamped with.
    pub(super) start: Instant,
    /// Bytes on the GPU that the other sessions take.
    pub(super) others: u64,
}

/// A session on the engine thread.
#[expect(clippy::struct_excessive_bools, reason = "each is a question of its own; no two exclude each other")]
pub(super) struct Room {
    pub(super) id: Arc<str>,
    pub(super) camera: Arc<Mutex<CameraSlot>>,
    pub(super) pictures: watch::Sender<Option<Arc<Picture>>>,
    scene_out: watch::Sender<SceneState>,
    pub(super) events: broadcast::Sender<Event>,
    pub(super) info: watch::Sender<SessionInfo>,

    pub(super) history: History,
    pub(super) world: World,
    pub(super) stage: Stage,
    pub(super) subject: Subject,
    pub(super) films: Films,
    /// Whether scene or grids have changed since the stage was set.
    pub(super) stale: bool,
    /// What the session does not survive, found where no error could be passed on.
    pub(super) broken: Option<GpuError>,

    pub(super) playing: bool,
    pub(super) stepping: VecDeque<Stepping>,
    pub(super) next_step: Instant,
    /// Whether a picture was made for a camera message alone since the last step.
    pub(super) answered: bool,

    pub(super) clients: Vec<ClientId>,
    /// The newest camera message of each client that was taken.
    pub(super) seen: Vec<(ClientId, u32)>,
    pub(super) moved_at: Instant,

    /// Whether something changed that no picture shows yet.
    pub(super) owed: bool,
    /// Whether the full film has a picture that is due once nothing moves.
    pub(super) news: bool,
    /// Whether the final picture has been made.
    pub(super) settled: bool,
    /// Size and samples of the moving picture that is under way.
    pub(super) aim: Option<([u32; 2], u32)>,
    /// Moving pictures that were begun and not finished, because the scene changed, since the last that was.
    pub(super) overtaken: u32,
    /// Size of the picture at rest that is under way before a whole one.
    pub(super) rung: Option<[u32; 2]>,
    /// When the next picture was begun, and the time spent on it.
    pub(super) begun: Option<Instant>,
    pub(super) work: Duration,

    pub(super) pace: Pace,
    pub(super) jobs: VecDeque<(Job, Reply<Still>)>,
    pub(super) job_next: bool,
    pub(super) stats: Stats,
    pub(super) stats_at: Instant,
    pub(super) shown_at: Instant,
    pub(super) pictured_at: VecDeque<Instant>,
    /// Notices that were given, each of which is given once.
    pub(super) noticed: Vec<&'static str>,
}

/// Steps that were asked for one by one.
pub(super) struct Stepping {
    pub(super) left: u32,
    pub(super) reply: Reply<()>,
}

impl Room {
    /// Builds all that a scene needs; simulations play.
    pub(super) fn new(id: Arc<str>, scene: Scene, tools: &Tools<'_>) -> Result<Self, EngineError> {
        let films_bytes = u64::from(SIZE[0]) * u64::from(SIZE[1]) * Film::BYTES_PER_PIXEL;
        afford(World::estimate(&scene).saturating_add(films_bytes), tools)?;
        let world = World::new(tools.gpu, &scene, &tools.files)?;
        let stage = Stage::new(tools.gpu, &scene, world.grids())?;
        let subject = Subject::of(&scene, world.grids());
        let films = Films::new(tools.gpu, SIZE)?;
        let history = History::new(scene);
        let now = Instant::now();
        let state = SceneState { revision: history.revision(), document: Arc::new(history.document().clone()), playing: true };
        let info = SessionInfo { id: id.to_string(), clients: 0, stats: Stats::default(), memory: 0 };
        let mut room = Self {
            id,
            camera: Arc::default(),
            pictures: watch::Sender::new(None),
            scene_out: watch::Sender::new(state),
            events: broadcast::Sender::new(EVENTS),
            info: watch::Sender::new(info),
            history,
            world,
            stage,
            subject,
            films,
            stale: false,
            broken: None,
            playing: true,
            stepping: VecDeque::new(),
            next_step: now,
            answered: false,
            clients: Vec::new(),
            seen: Vec::new(),
            moved_at: now,
            owed: true,
            news: false,
            settled: false,
            aim: None,
            overtaken: 0,
            rung: None,
            begun: None,
            work: Duration::ZERO,
            pace: Pace::new(tools.gpu.is_software()),
            jobs: VecDeque::new(),
            job_next: false,
            stats: Stats { playing: true, ..Stats::default() },
            stats_at: now,
            shown_at: now,
            pictured_at: VecDeque::new(),
            noticed: Vec::new(),
        };
        afford(room.memory(), tools)?;
        room.tell();
        Ok(room)
    }

    /// The handle to this session.
    pub(super) fn handle(&self, commands: mpsc::Sender<Command>) -> Session {
        Session {
            id: Arc::clone(&self.id),
            commands,
            camera: Arc::clone(&self.camera),
            pictures: self.pictures.subscribe(),
            scene: self.scene_out.subscribe(),
            events: self.events.clone(),
            stats: self.info.subscribe(),
        }
    }

    /// Bytes on the GPU.
    pub(super) fn memory(&self) -> u64 {
        let jobs: u64 = self.jobs.iter().map(|(job, _)| job.memory()).sum();
        self.world.memory() + self.stage.memory() + self.films.memory() + jobs
    }

    /// Lets the simulations of a new session stand.
    pub(super) fn stand(&mut self) {
        self.play(false);
    }

    /// Whether a client looks at the pictures.
    pub(super) fn watched(&self) -> bool {
        !self.clients.is_empty()
    }

    /// Whether a camera message waits.
    pub(super) fn camera_waits(&self) -> bool {
        camera_in(&self.camera)
    }

    /// Something that a picture shows, or says of itself, has changed.
    pub(super) fn touch(&mut self) {
        self.moved_at = Instant::now();
        self.owe();
    }

    /// A picture is owed of what has changed.
    pub(super) fn owe(&mut self) {
        self.owed = true;
        self.settled = false;
        self.news = false;
        self.rung = None;
    }

    /// Gives the scene to all who hold a handle.
    pub(super) fn publish_scene(&self) {
        self.scene_out.send_replace(SceneState {
            revision: self.history.revision(),
            document: Arc::new(self.history.document().clone()),
            playing: self.playing,
        });
    }

    /// Tells all clients something.
    pub(super) fn notice(&self, level: &'static str, code: &'static str, text: String) {
        let _ = self.events.send(Event::Notice { level, code, text });
    }

    /// Tells all clients how the session fares.
    pub(super) fn publish_stats(&mut self) {
        self.tell();
        let _ = self.events.send(Event::Stats(self.stats));
    }

    /// Renews the line in the list of sessions.
    pub(super) fn tell(&mut self) {
        self.stats.steps = self.world.steps();
        self.info.send_replace(SessionInfo {
            id: self.id.to_string(),
            clients: self.clients.len(),
            stats: self.stats,
            memory: self.memory(),
        });
    }
}

/// Whether a camera message waits in this slot.
pub(super) fn camera_in(slot: &Mutex<CameraSlot>) -> bool {
    slot.lock().is_ok_and(|slot| !slot.seen.is_empty())
}

/// Whether a session may take `needed` bytes in all.
pub(super) fn afford(needed: u64, tools: &Tools<'_>) -> Result<(), EngineError> {
    let (allowed, others) = (tools.settings.max_memory, tools.others);
    if needed.saturating_add(others) <= allowed {
        return Ok(());
    }
    Err(EngineError::Limit(format!(
        "{needed} bytes are needed on the GPU; all sessions together may take {allowed}, and the others take {others}"
    )))
}
