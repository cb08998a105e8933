//! How far the work has come, on stderr: a bar for people, lines of JSON for programs, or nothing.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

/// Shortest time between two lines of JSON.
const PERIOD: Duration = Duration::from_millis(200);

/// What is wanted on stderr.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Style {
    /// A bar.
    Bar,
    /// A line of JSON now and then: {"phase","done","of"}.
    Json,
    /// Nothing.
    None,
}

/// The progress of one phase of the work.
pub(crate) struct Progress {
    phase: &'static str,
    of: u64,
    bar: Option<ProgressBar>,
    json: bool,
    told: Option<Instant>,
}

impl Progress {
    /// Begins a phase of `of` parts. Without a choice, a terminal gets a bar and a pipe nothing.
    pub(crate) fn new(style: Option<Style>, phase: &'static str, of: u64) -> Self {
        let terminal = if std::io::stderr().is_terminal() { Style::Bar } else { Style::None };
        let style = style.unwrap_or(terminal);
        let bar = (style == Style::Bar).then(|| {
            let template = "{prefix:>9} {wide_bar} {pos}/{len}  {elapsed} (eta {eta})";
            let look = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(of).with_style(look).with_prefix(phase)
        });
        Self { phase, of, bar, json: style == Style::Json, told: None }
    }

    /// Tells that `done` parts are done.
    pub(crate) fn at(&mut self, done: u64) {
        if let Some(bar) = &self.bar {
            bar.set_position(done);
        }
        let due = self.told.is_none_or(|told| told.elapsed() >= PERIOD) || done == self.of;
        if self.json && due {
            self.told = Some(Instant::now());
            eprintln!("{}", json!({"phase": self.phase, "done": done, "of": self.of}));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
