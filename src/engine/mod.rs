//! The engine: one named thread that owns the GPU, and the handles by which everything else speaks to it.
//!
//! [`Engine::start`] starts the thread. It takes the commands that wait, gives the next session that has work one
//! slice of it, never much longer than a picture may take, and sleeps when nobody has any. A slice takes the
//! newest camera message, lets the simulation step if one is due, brings the stage up to date, and adds samples to
//! a film until a picture is due, which it puts in the session's one-picture slot.

mod films;
mod guard;
mod handle;
mod orders;
mod pace;
mod report;
mod room;
mod slice;
mod still;
mod thread;

pub use handle::{
    ClientId, Control, Engine, EngineError, Event, Exported, SceneState, Session, SessionInfo, Settings, Stats, Still,
    StillRequest,
};
pub use thread::FileReader;
