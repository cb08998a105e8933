//! The engine: one named thread that owns the GPU, and the handles by which everything else speaks to it.

mod handle;

pub use handle::{
    ClientId, Control, Engine, EngineError, Event, Exported, SceneState, Session, SessionInfo, Settings, Stats, Still,
    StillRequest,
};
