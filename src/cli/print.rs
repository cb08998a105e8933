//! Commands that only print.

use std::io::{self, Write};

use tyndall::scene::{Scene, presets};

use super::failure::Failure;

/// Writes to stdout; a reader that has seen enough and left is no failure.
pub(crate) fn out(text: &str) -> Result<(), Failure> {
    match io::stdout().write_all(text.as_bytes()).and_then(|()| io::stdout().flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::broken(format!("stdout: {error}"))),
        _ => Ok(()),
    }
}

/// Prints the schema of a scene document.
pub(crate) fn schema() -> Result<(), Failure> {
    out(&format!("{:#}\n", Scene::json_schema()))
}

/// Prints a line for each preset: its name, then what it shows.
pub(crate) fn presets(names_only: bool) -> Result<(), Failure> {
    let width = presets::all().map(|(name, _)| name.len()).max().unwrap_or(0);
    let line = |(name, document): (&str, &serde_json::Value)| {
        let description = document["about"]["description"].as_str().unwrap_or_default();
        if names_only { format!("{name}\n") } else { format!("{name:width$}  {description}\n") }
    };
    out(&presets::all().map(line).collect::<String>())
}
