//! Rendering: a [`Stage`] is put before the camera, a [`Tracer`] adds samples to a [`Film`], and develops it.

mod film;
mod majorants;
mod stage;
mod subject;
mod tracer;

pub use film::Film;
pub use stage::Stage;
pub use subject::Subject;
pub use tracer::Tracer;
