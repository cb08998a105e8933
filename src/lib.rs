//! Tyndall grows living volumes, path traces them on the GPU, and streams the converging picture to any browser.
//!
//! # The data path
//!
//! ```text
//! JSON (HTTP or socket) ─ checked, merged ─▶ Scene (one document, one revision number)
//!                                              │ commands (bounded), camera (newest wins)
//!                                              ▼
//! engine thread (owns the GPU) ── for each session: simulation step → grid → majorants → tracer adds samples to
//!                                              │     the film → tone map → read-back
//!                                              ▼ newest raw picture (slot)
//! encoding (only when a client has credit) ─▶ frame ─▶ socket ─▶ worker decodes ─▶ canvas
//! ```
//!
//! `tyndall render` drives the same parts without engine and network; tests drive each of them alone.
//!
//! # The modules, in the order of the data
//!
//! - [`scene`]: the document. Every parameter is declared once, in [`scene::document`]; reader, writer, checks and
//!   JSON Schema follow from the declaration ([`scene::param`]). Patches, revisions, undo, presets.
//! - [`gpu`]: the device, its limits, and kernels whose resources are bound by their WGSL names.
//! - [`sim`]: what grows. A simulation is its source, its seed and its number of steps, to the bit.
//! - [`volume`]: the contract between every source and the tracer: a [`volume::Grid`] of words, its proportions and
//!   what its automatic window means. [`import`] and [`export`] read and write fields, one file a format.
//! - [`world`]: the simulations and grids of one scene, rebuilt only where the scene changed.
//! - [`render`]: a [`render::Stage`] holds what stands before the camera, a [`render::Tracer`] adds samples to a
//!   [`render::Film`] and develops it, a [`render::Subject`] says when the film must start over.
//! - [`engine`]: the one thread that owns all GPU state, and the handles by which everything else speaks to it.
//! - [`stream`]: frame header, codecs, and the credit that keeps a slow client from growing memory.
//! - [`server`]: routes, sockets, tokens, origins, errors, metrics, and the page.
//!
//! # Decisions that hold everywhere
//!
//! - **Unbiased first.** Free flights are drawn by delta tracking through a grid of majorants, light from sun and lamps by
//!   ratio tracking, light from the sky by the paths that escape. What is biased (`render.blend`, the threshold law) has a name.
//! - **Integer deposits, and a barrier between sensing and depositing**: the same simulation gives the same bits.
//! - **Nobody sets a "needs reset" flag**: what a picture depends on is one comparable value.
//! - **Everything is bounded**: channels, messages, sessions, volumes, the length of a dispatch.
//! - **Software Vulkan counts.** Two of its limits shaped the kernels: a loop ends without a word after 65535 iterations, and
//!   control flow that depends on uniforms compiles a variant for each value (see [`gpu::Gpu::uniform`]).
#![forbid(unsafe_code)]

pub mod engine;
pub mod export;
pub mod gpu;
pub mod import;
pub mod render;
pub mod scene;
pub mod server;
pub mod sim;
pub mod stream;
pub mod volume;
pub mod world;
