//! The scene: one document that holds the whole state of a picture.
//!
//! Each parameter is declared once, in [`document`]; [`param`] makes reader, writer, checks and schema
//! of the declaration. [`merge`] applies RFC 7396 patches, [`history`] numbers revisions and undoes
//! them, [`presets`] are the documents inside the binary.

pub mod document;
pub mod history;
pub mod merge;
pub mod param;
pub mod presets;

pub use document::{
    About, Background, Boundary, Camera, Clip, ClipShape, Cloud, Color, Display, Edge, File, Filter, Homogeneous, Integrator,
    Lamp, Law, Light, Medium, Phase, PhaseType, Physarum, Render, Reorient, Scene, Sky, Source, Sun, Tonemap, Transform, Volume,
    Window,
};
pub use history::History;
pub use param::{Param, Refusal};
