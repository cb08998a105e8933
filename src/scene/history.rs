//! A scene with a revision number, and the way back.

use std::collections::VecDeque;

use serde_json::{Value, json};

use super::merge::{diff, merge_patch};
use super::{Refusal, Scene};

/// Most steps that can be undone.
const DEPTH: usize = 200;

/// A scene document with its revision and its undo and redo steps.
///
/// A step is the merge patch that leads back, so that undoing leaves alone what was changed by other
/// means since: camera messages are not steps.
#[derive(Debug, Clone)]
pub struct History {
    scene: Scene,
    document: Value,
    revision: u32,
    undo: VecDeque<Value>,
    redo: Vec<Value>,
    gesture: Option<Gesture>,
}

/// Uncommitted patches that will be one undo step.
#[derive(Debug, Clone)]
struct Gesture {
    name: String,
    before: Value,
}

/// A change that took place: the revision it made, and the patch that made it.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Revision after the change.
    pub revision: u32,
    /// The patch that leads from the last revision to this one.
    pub patch: Value,
}

impl History {
    /// A scene at revision 1 with nothing to undo.
    pub fn new(scene: Scene) -> Self {
        let document = scene.to_json();
        Self { scene, document, revision: 1, undo: VecDeque::new(), redo: Vec::new(), gesture: None }
    }

    /// The scene as it is now.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene as a document, every key written out.
    pub fn document(&self) -> &Value {
        &self.document
    }

    /// Rises with every change.
    pub fn revision(&self) -> u32 {
        self.revision
    }

    /// Applies a merge patch. Patches of one `gesture` that are not committed make one undo step.
    ///
    /// # Errors
    /// A [`Refusal`] that names the key at fault; the scene is then as before.
    pub fn patch(&mut self, patch: &Value, gesture: Option<&str>, commit: bool) -> Result<Change, Refusal> {
        let mut document = self.document.clone();
        merge_patch(&mut document, patch);
        let before = self.document.clone();
        self.replace(&document)?;
        if self.gesture.as_ref().is_some_and(|open| Some(open.name.as_str()) != gesture) {
            self.close_gesture();
        }
        match (gesture, &self.gesture) {
            (Some(name), None) => self.gesture = Some(Gesture { name: name.to_owned(), before }),
            (None, _) => self.remember(&before),
            _ => {}
        }
        if commit {
            self.close_gesture();
        }
        Ok(Change { revision: self.revision, patch: patch.clone() })
    }

    /// Puts another document in place of this one.
    ///
    /// # Errors
    /// A [`Refusal`] that names the key at fault; the scene is then as before.
    pub fn put(&mut self, document: &Value) -> Result<Change, Refusal> {
        self.close_gesture();
        let before = self.document.clone();
        self.replace(document)?;
        self.remember(&before);
        let patch = diff(&before, &self.document).unwrap_or_else(|| json!({}));
        Ok(Change { revision: self.revision, patch })
    }

    /// Moves the camera: any subset of its keys. This is no undo step.
    ///
    /// # Errors
    /// A [`Refusal`] that names the key at fault; the scene is then as before.
    pub fn move_camera(&mut self, camera: &Value) -> Result<Change, Refusal> {
        let patch = json!({"camera": camera});
        let mut document = self.document.clone();
        merge_patch(&mut document, &patch);
        self.replace(&document)?;
        Ok(Change { revision: self.revision, patch })
    }

    /// Takes the last step back; `None` if there is none.
    pub fn undo(&mut self) -> Option<Change> {
        self.close_gesture();
        let step = self.undo.pop_back()?;
        let (change, back) = self.travel(step)?;
        self.redo.push(back);
        Some(change)
    }

    /// Takes the last undone step again; `None` if there is none.
    pub fn redo(&mut self) -> Option<Change> {
        self.close_gesture();
        let step = self.redo.pop()?;
        let (change, back) = self.travel(step)?;
        self.undo.push_back(back);
        Some(change)
    }

    /// Applies a step and gives the one that leads back.
    fn travel(&mut self, step: Value) -> Option<(Change, Value)> {
        let before = self.document.clone();
        let mut document = before.clone();
        merge_patch(&mut document, &step);
        self.replace(&document).ok()?;
        let back = diff(&self.document, &before).unwrap_or_else(|| json!({}));
        Some((Change { revision: self.revision, patch: step }, back))
    }

    fn replace(&mut self, document: &Value) -> Result<(), Refusal> {
        let scene = Scene::from_json(document)?;
        self.document = scene.to_json();
        self.scene = scene;
        self.revision = self.revision.wrapping_add(1);
        Ok(())
    }

    fn close_gesture(&mut self) {
        if let Some(gesture) = self.gesture.take() {
            self.remember(&gesture.before);
        }
    }

    fn remember(&mut self, before: &Value) {
        let Some(back) = diff(&self.document, before) else { return };
        if self.undo.len() == DEPTH {
            self.undo.pop_front();
        }
        self.undo.push_back(back);
        self.redo.clear();
    }
}
