//! The engine thread: it takes commands, gives the sessions their turns, and sleeps when there is nothing to do.

use std::sync::{Arc, Weak};
use std::thread;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, watch};

use super::guard::guarded;
use super::handle::{Command, Ending, Engine, Life, Order, Reply};
use super::room::{Room, Tools};
use super::slice::Wants;
use super::{EngineError, Session, Settings};
use crate::gpu::{Gpu, GpuError};
use crate::render::Tracer;
use crate::scene::param::Place;
use crate::scene::{File, Scene};
use crate::volume::Field;

/// Reads the field that a scene names; the error is a sentence that names the file and the reason.
pub type FileReader = Box<dyn Fn(&File) -> Result<Field, String> + Send>;

/// Commands that may wait; who sends more waits himself.
const COMMANDS: usize = 256;

/// How long commands are taken before the sessions get a turn.
const COMMANDS_TIME: Duration = Duration::from_millis(5);

/// The session that is there from the start, and is started again when it fails.
const MAIN: &str = "main";

/// How often it is.
const MAIN_FAILURES: u32 = 3;

impl Engine {
    /// Starts the engine thread. There is no session yet.
    ///
    /// # Errors
    /// The system's, where it refuses a thread.
    pub fn start(gpu: Gpu, settings: Settings, files: FileReader) -> std::io::Result<Self> {
        let (sender, commands) = mpsc::channel(COMMANDS);
        let (listed, sessions) = watch::channel(Arc::default());
        let (ended, ending) = watch::channel(None);
        let alive = Arc::new(Life(sender.clone()));
        let keeper = Keeper {
            tracer: None,
            rooms: Vec::new(),
            next: 0,
            urgent_before: false,
            main_failures: 0,
            listed,
            commands,
            sender: sender.downgrade(),
            alive: Arc::downgrade(&alive),
            start: Instant::now(),
            gpu: gpu.clone(),
            settings,
            files,
        };
        thread::Builder::new().name("gpu".into()).spawn(move || {
            let ending = keeper.run();
            ended.send_replace(Some(ending));
        })?;
        Ok(Self { commands: sender, sessions, gpu, ending, _alive: alive })
    }
}

/// All that the engine thread owns.
struct Keeper {
    gpu: Gpu,
    settings: Settings,
    files: FileReader,
    /// Made anew after a panic inside it.
    tracer: Option<Tracer>,
    rooms: Vec<Room>,
    /// The session whose turn is next.
    next: usize,
    urgent_before: bool,
    main_failures: u32,
    listed: watch::Sender<Arc<Vec<Session>>>,
    commands: mpsc::Receiver<Command>,
    sender: mpsc::WeakSender<Command>,
    alive: Weak<Life>,
    start: Instant,
}

impl Keeper {
    fn run(mut self) -> Ending {
        let runtime = match tokio::runtime::Builder::new_current_thread().enable_time().build() {
            Ok(runtime) => runtime,
            Err(error) => return Ending::Failed(GpuError::Fault(format!("the engine has no clock: {error}"))),
        };
        loop {
            // Bounded, so that a flood of commands does not keep the sessions from their turns.
            let turn = Instant::now();
            while turn.elapsed() < COMMANDS_TIME {
                match self.commands.try_recv() {
                    Ok(Command::Stop) | Err(mpsc::error::TryRecvError::Disconnected) => return Ending::Stopped,
                    Ok(command) => self.take(command),
                    Err(mpsc::error::TryRecvError::Empty) => break,
                }
            }
            if self.alive.strong_count() == 0 {
                return Ending::Stopped;
            }
            if let Some(reason) = self.gpu.lost() {
                tracing::error!(%reason, "the GPU is lost; the engine ends");
                return Ending::Failed(GpuError::Fault(format!("the device is lost: {reason}")));
            }
            let now = Instant::now();
            if let Some(index) = self.pick(now) {
                self.turn(index);
                continue;
            }
            let due = self.rooms.iter().filter_map(|room| match room.wants(now, &self.settings) {
                Wants::At(due) => Some(due),
                Wants::Now => Some(now),
                Wants::Nothing => None,
            });
            let due = due.min();
            let command = runtime.block_on(async {
                match due {
                    Some(due) => tokio::time::timeout_at(due.into(), self.commands.recv()).await.ok(),
                    None => Some(self.commands.recv().await),
                }
            });
            match command {
                Some(None | Some(Command::Stop)) => return Ending::Stopped,
                Some(Some(command)) => self.take(command),
                None => {}
            }
        }
    }

    /// The next session with work. Every second turn goes to one that somebody waits for, if there is one.
    fn pick(&mut self, now: Instant) -> Option<usize> {
        let order = (0..self.rooms.len()).map(|step| (self.next + step) % self.rooms.len());
        let working = order.filter(|index| self.rooms[*index].wants(now, &self.settings) == Wants::Now);
        let urgent = || working.clone().find(|index| self.rooms[*index].urgent(now, &self.settings));
        let index = if self.urgent_before { working.clone().next() } else { urgent().or_else(|| working.clone().next()) }?;
        self.urgent_before = !self.urgent_before && self.rooms[index].urgent(now, &self.settings);
        self.next = (index + 1) % self.rooms.len();
        Some(index)
    }

    fn turn(&mut self, index: usize) {
        self.with(index, Room::slice);
    }

    fn take(&mut self, command: Command) {
        match command {
            Command::Create { id, scene, reply } => self.create(id, *scene, reply),
            Command::Remove { id, reply } => {
                let found = self.rooms.iter().position(|room| *room.id == id);
                let result = found.map(|index| {
                    self.rooms.remove(index);
                    self.list();
                });
                let _ = reply.send(result.ok_or_else(|| EngineError::NotFound(format!("session `{id}`"))));
            }
            // An order to a session that has ended drops its reply: the caller is told that it is gone.
            Command::Session { id, order } => self.order(&id, order),
            Command::Wake | Command::Stop => {}
        }
    }

    fn order(&mut self, id: &str, order: Order) {
        if let Some(index) = self.rooms.iter().position(|room| *room.id == *id) {
            self.with(index, |room, tools| room.obey(order, tools));
        }
    }

    fn create(&mut self, id: Option<String>, scene: Scene, reply: Reply<Session>) {
        let result = self.admit(id, scene);
        let _ = reply.send(result);
    }

    fn admit(&mut self, id: Option<String>, scene: Scene) -> Result<Session, EngineError> {
        if self.rooms.len() >= self.settings.max_sessions {
            return Err(EngineError::Limit(format!("{} sessions are the most there may be", self.settings.max_sessions)));
        }
        let id = match id {
            Some(id) => checked(id)?,
            None => unguessable()?,
        };
        if self.rooms.iter().any(|room| *room.id == *id) {
            return Err(EngineError::Limit(format!("there is a session `{id}` already")));
        }
        let room = self.build(id.into(), scene)?;
        let session = room.handle(self.sender.upgrade().ok_or(EngineError::Gone)?);
        self.rooms.push(room);
        self.list();
        Ok(session)
    }

    fn build(&mut self, id: Arc<str>, scene: Scene) -> Result<Room, EngineError> {
        let others = self.rooms.iter().map(Room::memory).sum();
        let mut result = Err(EngineError::Gone);
        let Self { gpu, settings, files, tracer, commands, start, .. } = self;
        let built = guarded(|| {
            let tracer = ready(tracer, gpu)?;
            let tools = Tools { gpu, tracer, settings, files, waiting: commands, start: *start, others };
            result = Room::new(id, scene, &tools);
            gpu.check()
        });
        match built {
            Ok(()) => result,
            Err(words) => Err(EngineError::Gpu(GpuError::Fault(words))),
        }
    }

    /// Lets a session work. Whatever breaks ends that session, and no other.
    fn with(&mut self, index: usize, work: impl FnOnce(&mut Room, &mut Tools<'_>) -> Result<(), GpuError>) {
        let others = self.rooms.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, room)| room.memory()).sum();
        let Self { gpu, settings, files, tracer, rooms, commands, start, .. } = self;
        let worked = guarded(|| {
            let tracer = ready(tracer, gpu)?;
            let mut tools = Tools { gpu, tracer, settings, files, waiting: commands, start: *start, others };
            work(&mut rooms[index], &mut tools)?;
            gpu.check()
        });
        if let Err(words) = worked {
            self.fail(index, &words);
        }
    }

    fn fail(&mut self, index: usize, words: &str) {
        let room = self.rooms.remove(index);
        tracing::error!(session = &*room.id, reason = words, "a session failed and has ended");
        room.notice("error", "session_failed", format!("the session has ended: {words}"));
        // What a panic has left behind in the kernels' state, or an error in the device's, is nobody else's.
        self.tracer = None;
        let _ = self.gpu.check();
        let (id, scene) = (Arc::clone(&room.id), room.history.scene().clone());
        drop(room);
        if &*id == MAIN && self.main_failures < MAIN_FAILURES && self.gpu.lost().is_none() {
            self.main_failures += 1;
            match self.build(id, scene) {
                Ok(mut room) => {
                    room.stand();
                    self.rooms.push(room);
                }
                Err(error) => tracing::error!(%error, "the session main could not be started again"),
            }
        }
        self.list();
    }

    fn list(&self) {
        let handles = self.sender.upgrade().map(|sender| self.rooms.iter().map(|room| room.handle(sender.clone())).collect());
        self.listed.send_replace(Arc::new(handles.unwrap_or_default()));
    }
}

/// The tracer, made if there is none.
fn ready<'a>(tracer: &'a mut Option<Tracer>, gpu: &Gpu) -> Result<&'a mut Tracer, GpuError> {
    let made = match tracer.take() {
        Some(tracer) => tracer,
        None => Tracer::new(gpu)?,
    };
    Ok(tracer.insert(made))
}

fn checked(id: String) -> Result<String, EngineError> {
    let letters = id.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-');
    if letters && (1..=64).contains(&id.len()) {
        return Ok(id);
    }
    Err(Place::ROOT.key("id").refuse("bad_name", "a name is 1 to 64 letters, digits, '_' or '-'").into())
}

/// 128 random bits in hexadecimal.
fn unguessable() -> Result<String, EngineError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| EngineError::Limit(format!("the system gives no random name: {error}")))?;
    Ok(format!("{:032x}", u128::from_be_bytes(bytes)))
}
