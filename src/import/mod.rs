//! Volume files: one format a module, one error for all that can be wrong with a file.
//!
//! A file is outside input. Its header is bounded, its sizes are multiplied with care and held against
//! the bytes that are there before anything is allocated, and every value is finite.

mod dataset;
mod npy;
mod nrrd;
mod values;

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use crate::volume::Field;

pub use dataset::resolve;

/// Why a file is not a volume, in one line: file, place, reason.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {place}: {reason}")]
pub struct ImportError {
    /// The file, as it was named.
    pub file: String,
    /// Where in it: a header's field, `data`, `voxel 3,0,7`; `file` where it could not be read at all.
    pub place: String,
    /// What is wrong there.
    pub reason: String,
}

/// What is wrong with a file, before its name is known.
#[derive(Debug)]
pub(crate) struct Fault {
    place: String,
    reason: String,
}

impl Fault {
    pub(crate) fn new(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { place: place.into(), reason: reason.into() }
    }

    fn file(error: &std::io::Error) -> Self {
        Self::new("file", reason_of(error))
    }

    fn of(self, file: &Path) -> ImportError {
        ImportError { file: file.display().to_string(), place: self.place, reason: self.reason }
    }
}

/// The words of an I/O error, without the number that the standard library appends.
fn reason_of(error: &std::io::Error) -> String {
    let words = error.to_string();
    words.split(" (os error").next().unwrap_or(&words).to_lowercase()
}

/// Reads a volume file. The first bytes decide on the format, not the name.
///
/// # Errors
/// An [`ImportError`] where the file cannot be read, is of no known format, or breaks it.
pub fn load(path: &Path) -> Result<Field, ImportError> {
    open(path).and_then(|(mut input, length)| read(&mut input, length, path)).map_err(|fault| fault.of(path))
}

fn open(path: &Path) -> Result<(BufReader<File>, u64), Fault> {
    let file = File::open(path).map_err(|error| Fault::file(&error))?;
    let metadata = file.metadata().map_err(|error| Fault::file(&error))?;
    if !metadata.is_file() {
        return Err(Fault::new("file", "not a regular file"));
    }
    Ok((BufReader::new(file), metadata.len()))
}

fn read(input: &mut BufReader<File>, length: u64, path: &Path) -> Result<Field, Fault> {
    let head = input.fill_buf().map_err(|error| Fault::file(&error))?;
    if head.starts_with(nrrd::MAGIC) {
        nrrd::read(input, length, path)
    } else if head.starts_with(npy::MAGIC) {
        npy::read(input, length)
    } else {
        Err(Fault::new("start", "neither an NRRD nor an NPY file"))
    }
}
