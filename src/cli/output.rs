//! Names of files to write, and sequences of them.

use std::path::{Path, PathBuf};

use super::failure::Failure;

/// Where to write, checked before any work is done.
#[derive(Debug, Clone)]
pub(crate) struct Output {
    path: PathBuf,
    /// What stands before and behind the number in the file's name, and how many digits it has.
    numbered: Option<(String, String, usize)>,
}

impl Output {
    /// Reads a file name, in which `%04d` stands for a number.
    pub(crate) fn new(path: &Path) -> Result<Self, Failure> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return Err(Failure::input(path, "folder", "there is no such folder"));
        }
        if path.is_dir() {
            return Err(Failure::input(path, "file", "a folder stands there"));
        }
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        Ok(Self { path: path.to_owned(), numbered: pattern(name) })
    }

    /// Whether the name holds a number.
    pub(crate) fn is_sequence(&self) -> bool {
        self.numbered.is_some()
    }

    /// The file of this number; the file itself where its name holds none.
    pub(crate) fn file(&self, number: u32) -> PathBuf {
        match &self.numbered {
            Some((before, behind, digits)) => self.path.with_file_name(format!("{before}{number:0digits$}{behind}")),
            None => self.path.clone(),
        }
    }

    /// Writes a file of the sequence, or the only one.
    pub(crate) fn write(&self, number: u32, bytes: &[u8]) -> Result<(), Failure> {
        write(&self.file(number), bytes)
    }
}

/// Writes a whole file.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    tyndall::export::write_file(path, bytes).map_err(|error| Failure::input(path, "file", error))
}

/// `before%04dbehind`
fn pattern(name: &str) -> Option<(String, String, usize)> {
    let (before, rest) = name.split_once('%')?;
    let (digits, behind) = rest.split_once('d')?;
    let digits = if digits.is_empty() { 1 } else { digits.parse().ok().filter(|digits| (1..=9).contains(digits))? };
    Some((before.to_owned(), behind.to_owned(), digits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_takes_the_place_of_the_pattern() {
        let file = |name: &str, number| Output::new(Path::new(name)).unwrap().file(number).display().to_string();
        assert_eq!(file("a_%04d.png", 7), "a_0007.png");
        assert_eq!(file("a%d.png", 12), "a12.png");
        assert_eq!(file("100%.png", 12), "100%.png");
    }
}
