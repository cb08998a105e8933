//! What stands behind a session's handle, on the engine thread: its scene, world, stage and films.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::Value;
use tokio::sync::{broadcast, mpsc, watch};

use super::films::{Films, largest};
use super::handle::{CameraSlot, Command, Order, Reply};
use super::pace::Pace;
use super::still::Job;
use super::thread::FileReader;
use super::{ClientId, Control, EngineError, Event, SceneState, Session, SessionInfo, Settings, Stats, Still};
use crate::gpu::{Gpu, GpuError};
use crate::render::{Film, Stage, Subject, Tracer};
use crate::scene::history::Change;
use crate::scene::param::Place;
use crate::scene::{History, Refusal, Scene};
use crate::stream::Picture;
use crate::world::{World, WorldError};

/// Size of a picture until a client tells its own.
const SIZE: [u32; 2] = [1280, 720];

/// Shortest and longest edge of a picture.
const EDGES: [u32; 2] = [16, 8192];

/// Most steps that one message may ask for, and most that may wait.
const MAX_STEPS: u32 = 100_000;

/// Most step messages that may wait.
const MAX_WAITING: usize = 16;

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
    events: broadcast::Sender<Event>,
    pub(super) info: watch::Sender<SessionInfo>,

    pub(super) history: History,
    pub(super) world: World,
    pub(super) stage: Stage,
    pub(super) subject: Subject,
    pub(super) films: Films,
    /// Whether scene or grids have changed since the stage was set.
    pub(super) stale: bool,
    broken: Option<GpuError>,

    pub(super) playing: bool,
    pub(super) stepping: VecDeque<Stepping>,
    pub(super) next_step: Instant,
    /// Whether a picture was made for a camera message alone since the last step.
    pub(super) answered: bool,

    clients: Vec<ClientId>,
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
    /// When the next picture was begun, and the time spent on it.
    pub(super) begun: Option<Instant>,
    pub(super) work: Duration,

    pub(super) pace: Pace,
    pub(super) jobs: VecDeque<(Job, Reply<Still>)>,
    pub(super) job_next: bool,
    pub(super) stats: Stats,
    pub(super) stats_at: Instant,
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
            begun: None,
            work: Duration::ZERO,
            pace: Pace::new(tools.gpu.is_software()),
            jobs: VecDeque::new(),
            job_next: false,
            stats: Stats { playing: true, ..Stats::default() },
            stats_at: now,
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

    /// Does what a command asks, or begins it.
    ///
    /// # Errors
    /// A [`GpuError`] that the session does not survive.
    pub(super) fn obey(&mut self, order: Order, tools: &Tools<'_>) -> Result<(), GpuError> {
        match order {
            Order::Patch { patch, gesture, commit, if_match, by, reply } => {
                let patch = |history: &mut History| history.patch(&patch, gesture.as_deref(), commit).map(Some);
                let result = self.at(if_match).and_then(|()| self.change(by, tools, patch));
                let _ = reply.send(result.and_then(|change| change.ok_or(EngineError::Gone)));
            }
            Order::Put { document, if_match, by, reply } => {
                let put = |history: &mut History| history.put(&document).map(Some);
                let result = self.at(if_match).and_then(|()| self.change(by, tools, put));
                let _ = reply.send(result.and_then(|change| change.ok_or(EngineError::Gone)));
            }
            Order::Control { control, by, reply } => self.control(control, by, reply, tools)?,
            Order::Attach { by } => self.attach(by),
            Order::Resize { size, by } => {
                self.attach(by);
                if let Err(error) = self.resize(size, tools) {
                    self.notice("warning", "size_refused", format!("pictures keep their size: {error}"));
                }
            }
            Order::Detach { by } => {
                self.clients.retain(|client| *client != by);
                self.seen.retain(|(client, _)| *client != by);
                self.tell();
            }
            Order::Still { request, reply } => self.begin_still(request, reply, tools),
            Order::Export { volume, field, reply } => {
                let field = self.world.read(&volume, &field).map_err(EngineError::from).and_then(|found| {
                    found.ok_or_else(|| EngineError::NotFound(format!("field `{field}` in a volume `{volume}`")))
                });
                let _ = reply.send(field);
            }
        }
        self.broken.take().map_or(Ok(()), Err)
    }

    fn at(&self, if_match: Option<u32>) -> Result<(), EngineError> {
        let revision = self.history.revision();
        if if_match.is_none_or(|wanted| wanted == revision) { Ok(()) } else { Err(EngineError::Stale(revision)) }
    }

    fn attach(&mut self, by: ClientId) {
        if !self.clients.contains(&by) {
            self.clients.push(by);
            self.owed = true;
            self.tell();
        }
    }

    fn resize(&mut self, size: [u32; 2], tools: &Tools<'_>) -> Result<(), EngineError> {
        let size = largest(tools.gpu, size.map(|edge| edge.clamp(EDGES[0], EDGES[1])));
        if size == self.films.size() {
            return Ok(());
        }
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        afford(self.memory() - self.films.memory() + pixels * Film::BYTES_PER_PIXEL, tools)?;
        self.films = Films::new(tools.gpu, size)?;
        self.aim = None;
        self.touch();
        Ok(())
    }

    fn control(&mut self, control: Control, by: ClientId, reply: Reply<()>, tools: &Tools<'_>) -> Result<(), GpuError> {
        if matches!(control, Control::Play | Control::Pause | Control::Reset) {
            for stepping in self.stepping.drain(..) {
                let text = "another control message came before the last step";
                let _ = stepping.reply.send(Err(EngineError::Limit(text.to_owned())));
            }
        }
        let result = match control {
            Control::Play => {
                self.next_step = Instant::now();
                self.play(true);
                Ok(())
            }
            Control::Pause => {
                self.play(false);
                Ok(())
            }
            Control::Step(count) => {
                self.play(false);
                self.step_by(count, reply);
                return Ok(());
            }
            Control::Reset => {
                self.world.reset()?;
                self.next_step = Instant::now();
                self.stale = true;
                self.touch();
                self.tell();
                Ok(())
            }
            Control::Undo => self.change(by, tools, |history| Ok(history.undo())).map(|_| ()),
            Control::Redo => self.change(by, tools, |history| Ok(history.redo())).map(|_| ()),
        };
        let _ = reply.send(result);
        Ok(())
    }

    fn step_by(&mut self, count: u32, reply: Reply<()>) {
        let waiting: u32 = self.stepping.iter().map(|stepping| stepping.left).sum();
        let result = if count.saturating_add(waiting) > MAX_STEPS {
            let text = format!("{count} steps where {waiting} wait; at most {MAX_STEPS} may");
            Err(Place::ROOT.key("steps").refuse("out_of_range", text).into())
        } else if self.stepping.len() >= MAX_WAITING {
            Err(EngineError::Limit(format!("{MAX_WAITING} step messages wait already")))
        } else {
            self.stepping.push_back(Stepping { left: count, reply });
            return;
        };
        let _ = reply.send(result);
    }

    fn play(&mut self, playing: bool) {
        if self.playing != playing {
            self.playing = playing;
            self.stats.playing = playing;
            self.publish_scene();
            self.publish_stats();
        }
    }

    /// Applies a change to the scene, and what follows from it to world and stage; on any error all is as before.
    fn change(
        &mut self,
        by: ClientId,
        tools: &Tools<'_>,
        apply: impl FnOnce(&mut History) -> Result<Option<Change>, Refusal>,
    ) -> Result<Option<Arc<Change>>, EngineError> {
        let mut next = self.history.clone();
        let Some(change) = apply(&mut next)? else { return Ok(None) };
        self.follow(next.scene(), tools)?;
        self.history = next;
        let change = Arc::new(change);
        self.touch();
        self.publish_scene();
        let _ = self.events.send(Event::Patched { change: Arc::clone(&change), by, camera: false });
        Ok(Some(change))
    }

    fn follow(&mut self, scene: &Scene, tools: &Tools<'_>) -> Result<(), EngineError> {
        let old = self.history.scene();
        if World::estimate(scene) > World::estimate(old) {
            afford(World::estimate(scene).saturating_add(self.memory() - self.world.memory()), tools)?;
        }
        let before = self.world.update(scene, &tools.files)?;
        let staged = self.stage.update(scene, self.world.grids()).map_err(EngineError::from);
        if let Err(error) = staged.and_then(|()| afford(self.memory(), tools)) {
            self.world.restore(before);
            // The stage held the old scene a moment ago: if it cannot now, the device is at fault.
            self.broken = self.stage.update(old, self.world.grids()).err();
            return Err(error);
        }
        self.stale = true;
        Ok(())
    }

    /// Takes the camera message that waits; false if there is none, or it was refused.
    pub(super) fn take_camera(&mut self) -> bool {
        let CameraSlot { keys, seen } = self.camera.lock().map(|mut slot| std::mem::take(&mut *slot)).unwrap_or_default();
        if seen.is_empty() {
            return false;
        }
        match self.history.move_camera(&Value::Object(keys)) {
            Ok(change) => {
                self.seen.retain(|(client, _)| seen.iter().all(|(newer, _)| newer != client));
                // What two clients moved at once must reach both.
                let by = if let [(client, _)] = seen[..] { client } else { 0 };
                self.seen.extend(seen);
                self.stale = true;
                self.touch();
                self.publish_scene();
                let _ = self.events.send(Event::Patched { change: Arc::new(change), by, camera: true });
                true
            }
            Err(refusal) => {
                for (client, _) in seen {
                    let _ = self.events.send(Event::Refused(client, refusal.clone()));
                }
                false
            }
        }
    }

    /// Whether a camera message waits.
    pub(super) fn camera_waits(&self) -> bool {
        camera_in(&self.camera)
    }

    /// Something that a picture shows, or says of itself, has changed.
    fn touch(&mut self) {
        self.moved_at = Instant::now();
        self.owed = true;
        self.settled = false;
        self.news = false;
    }

    fn publish_scene(&self) {
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

impl From<WorldError> for EngineError {
    fn from(error: WorldError) -> Self {
        match error {
            WorldError::Refused(refusal) => Self::Refused(refusal),
            WorldError::Gpu(error) => Self::Gpu(error),
        }
    }
}
