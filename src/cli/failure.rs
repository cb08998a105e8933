//! Why a command ends without having done its work, in one line and one exit code.

use std::fmt;
use std::path::Path;

use tyndall::export::ImageError;
use tyndall::gpu::GpuError;
use tyndall::import::ImportError;

/// One line for people, one number for programs.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) code: u8,
    words: String,
}

impl Failure {
    /// Something broke that the caller could not have known.
    pub(crate) fn broken(words: impl fmt::Display) -> Self {
        Self { code: 1, words: words.to_string() }
    }

    /// The command line asks for what cannot be.
    pub(crate) fn usage(words: impl fmt::Display) -> Self {
        Self { code: 2, words: words.to_string() }
    }

    /// There is no adapter to work on.
    pub(crate) fn no_adapter(words: impl fmt::Display) -> Self {
        Self { code: 3, words: words.to_string() }
    }

    /// A file is not what it should be.
    pub(crate) fn input(file: &Path, place: &str, reason: impl fmt::Display) -> Self {
        Self { code: 4, words: format!("{}: {place}: {reason}", file.display()) }
    }

    /// The work is larger than what this machine or the program allows.
    pub(crate) fn limit(words: impl fmt::Display) -> Self {
        Self { code: 5, words: words.to_string() }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // One line, whatever a driver or a file name brings along.
        for (i, line) in self.words.lines().map(str::trim).filter(|line| !line.is_empty()).enumerate() {
            write!(f, "{}{line}", if i == 0 { "" } else { "; " })?;
        }
        Ok(())
    }
}

impl From<ImportError> for Failure {
    fn from(error: ImportError) -> Self {
        Self { code: 4, words: error.to_string() }
    }
}

impl From<GpuError> for Failure {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::NoAdapter { .. } | GpuError::Device { .. } => Self::no_adapter(error),
            GpuError::TooLarge { .. } => Self::limit(error),
            GpuError::Fault(_) => Self::broken(error),
        }
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        Self::broken(error)
    }
}
