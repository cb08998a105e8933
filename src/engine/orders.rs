//! What clients ask of a session: changes of the scene, play control, sizes, cameras.

use std::sync::Arc;
use std::time::Instant;

use serde_json::Value;

use super::films::{Films, largest};
use super::handle::{CameraSlot, Order, Reply};
use super::room::{Room, Stepping, Tools, afford};
use super::{ClientId, Control, EngineError, Event};
use crate::gpu::GpuError;
use crate::render::Film;
use crate::scene::history::Change;
use crate::scene::param::Place;
use crate::scene::{History, Refusal, Scene};
use crate::world::{World, WorldError};

/// Shortest and longest edge of a picture.
const EDGES: [u32; 2] = [16, 8192];

/// Most steps that one message may ask for, and most that may wait.
const MAX_STEPS: u32 = 100_000;

/// Most clients whose camera messages a picture names.
const MAX_SEEN: usize = 1024;

/// Most step messages that may wait.
const MAX_WAITING: usize = 16;

impl Room {
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

    /// Lets the simulations run or stand.
    pub(super) fn play(&mut self, playing: bool) {
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
                // A message that comes after its client's farewell would stay for ever.
                self.seen.drain(..self.seen.len().saturating_sub(MAX_SEEN));
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
}

impl From<WorldError> for EngineError {
    fn from(error: WorldError) -> Self {
        match error {
            WorldError::Refused(refusal) => Self::Refused(refusal),
            WorldError::Gpu(error) => Self::Gpu(error),
        }
    }
}
