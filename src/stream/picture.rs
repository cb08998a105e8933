//! A raw picture, and its encodings once somebody wanted them.

use crate::engine::ClientId;

/// A picture of a session as the engine made it.
#[derive(Debug)]
pub struct Picture {
    /// Size in pixels.
    pub size: [u32; 2],
    /// RGBA, 8 bits, sRGB, row 0 on top.
    pub pixels: Vec<u8>,
    /// Revision of the scene shown.
    pub revision: u32,
    /// Samples per pixel shown.
    pub spp: u32,
    /// Whether accumulation has ended: the picture is to be sent lossless.
    pub converged: bool,
    /// The newest camera message of each client that the picture shows.
    pub seen: Vec<(ClientId, u32)>,
    /// Server's monotonic clock when the picture was begun, in µs.
    pub begun_us: u64,
    /// Time spent on simulation and rendering, in µs.
    pub work_us: u32,
    /// Time spent on tone mapping and read-back, in µs.
    pub readback_us: u32,
}
