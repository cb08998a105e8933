//! The scene: one document that holds the whole state of a picture.
//!
//! Each parameter is declared once, in [`document`] and [`volumes`]; [`param`] makes reader, writer, checks and schema
//! of the declaration. [`merge`] applies RFC 7396 patches, [`history`] numbers revisions and undoes
//! them, [`presets`] are the documents inside the binary.

pub(crate) mod declare;
pub mod document;
pub mod history;
pub mod merge;
pub mod param;
pub mod presets;
pub mod volumes;

pub use document::{About, Background, Camera, Display, Integrator, Lamp, Light, Render, Scene, Sky, Sun, Tonemap};
pub use history::History;
pub use param::{Param, Refusal};
pub use volumes::{
    Boundary, Clip, ClipShape, Cloud, Color, Edge, File, Filter, Homogeneous, Law, Medium, Phase, PhaseType, Physarum, Reorient,
    Source, Transform, Volume, Window,
};
