//! `SCENE` on the command line: a preset's name, or a scene file.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tyndall::import;
use tyndall::scene::{self, Refusal, Scene, Source, Volume, presets};
use tyndall::volume::Field;

use super::failure::Failure;

/// Largest scene file read, in bytes.
const MAX_BYTES: u64 = 16 << 20;

/// A scene with the fields that it names.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) scene: Scene,
    name: PathBuf,
    /// Where the paths in the scene start from.
    pub(crate) folder: PathBuf,
    fields: RefCell<BTreeMap<PathBuf, Field>>,
}

impl Chosen {
    /// Reads the preset or file of this name, and gives its simulations and samples the seed, if there is one.
    pub(crate) fn read(name: &str, seed: Option<u32>) -> Result<Self, Failure> {
        let file = Path::new(name);
        let (document, folder) = match presets::get(name) {
            Some(document) => (document.clone(), PathBuf::new()),
            None => (document(file)?, file.parent().unwrap_or(Path::new("")).to_owned()),
        };
        let mut scene = Scene::from_json(&document).map_err(|refusal| refused(file, &refusal))?;
        if let Some(seed) = seed {
            scene.reseed(seed);
        }
        Ok(Self { scene, name: file.to_owned(), folder, fields: RefCell::default() })
    }

    /// Reads the volume files, so that what is wrong with them is said before an adapter is looked for.
    pub(crate) fn read_fields(self) -> Result<Self, Failure> {
        for (name, volume) in &self.scene.volumes {
            let Source::File(file) = &volume.source else { continue };
            let Some(path) = &file.path else {
                let reason = "only a server that was started with --data knows datasets; give a `path`";
                return Err(Failure::input(&self.name, &format!("volumes.{name}.source.dataset"), reason));
            };
            let path = self.folder.join(path);
            if !self.fields.borrow().contains_key(&path) {
                let field = import::load(&path)
                    .map_err(|error| Failure::input(&self.name, &format!("volumes.{name}.source.path"), error))?;
                self.fields.borrow_mut().insert(path, field);
            }
        }
        Ok(self)
    }

    /// Hands out the field of a volume file; a second volume of the same file reads it again.
    pub(crate) fn take(&self, file: &scene::File) -> Result<Field, String> {
        let path = self.folder.join(file.path.as_deref().unwrap_or_default());
        let read = self.fields.borrow_mut().remove(&path);
        read.map_or_else(|| import::load(&path).map_err(|error| error.to_string()), Ok)
    }

    /// Refuses a key of this scene.
    pub(crate) fn refuse(&self, refusal: &Refusal) -> Failure {
        refused(&self.name, refusal)
    }

    /// Simulation steps before the first sample: those asked for, or those at which the scene is at its best.
    pub(crate) fn steps(&self, asked: Option<u32>) -> u32 {
        let best = self.scene.about.best_step.filter(|_| self.scene.volumes.values().any(lives));
        asked.or(best).unwrap_or(0)
    }
}

/// Whether a volume changes with the steps.
pub(crate) fn lives(volume: &Volume) -> bool {
    match volume.source {
        Source::Physarum(_) => true,
        Source::Homogeneous(_) | Source::Cloud(_) | Source::File(_) => false,
    }
}

fn refused(file: &Path, refusal: &Refusal) -> Failure {
    let place = if refusal.path.is_empty() { "document" } else { &refusal.path };
    Failure::input(file, place, &refusal.text)
}

fn document(file: &Path) -> Result<Value, Failure> {
    let metadata = std::fs::metadata(file).map_err(|error| {
        let names = presets::all().map(|(name, _)| name).collect::<Vec<_>>().join(", ");
        let reason = if error.kind() == std::io::ErrorKind::NotFound {
            format!("no such file, nor a preset of this name ({names})")
        } else {
            error.to_string()
        };
        Failure::input(file, "file", reason)
    })?;
    if !metadata.is_file() {
        return Err(Failure::input(file, "file", "not a regular file"));
    }
    if metadata.len() > MAX_BYTES {
        return Err(Failure::input(file, "file", format!("{} bytes; a scene has at most {MAX_BYTES}", metadata.len())));
    }
    let text = std::fs::read(file).map_err(|error| Failure::input(file, "file", error))?;
    serde_json::from_slice(&text).map_err(|error| {
        let words = error.to_string();
        let reason = words.split(" at line ").next().unwrap_or(&words);
        Failure::input(file, &format!("line {} column {}", error.line(), error.column()), reason)
    })
}
