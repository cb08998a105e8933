//! The volume contract: what every source yields, and all that the tracer knows of it.

pub mod cloud;
mod field;

pub use field::{Field, Samples};

use crate::scene::Window;

/// How a grid's words are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Unsigned counts.
    U32,
    /// Floats.
    F32,
}

/// What `window: auto` means for a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AutoWindow {
    /// From 0 to this many times the field's mean, which is computed on the GPU.
    Mean(f32),
    /// These two values.
    Fixed([f32; 2]),
}

/// A scalar field on the GPU: one 32-bit word a voxel, x fastest. Cloning shares the buffer.
#[derive(Debug, Clone)]
pub struct Grid {
    /// The words.
    pub words: wgpu::Buffer,
    /// How a word is read.
    pub format: Format,
    /// Voxels along x, y and z.
    pub size: [u32; 3],
    /// Edge of a voxel along x, y and z, in any one unit: the proportions of the box.
    pub spacing: [f32; 3],
    /// What `window: auto` means here.
    pub auto: AutoWindow,
    /// Differs whenever the words do.
    pub version: u64,
}

impl Grid {
    /// Edges of the box, the longest of which is 1.
    pub fn edges(&self) -> [f32; 3] {
        #[expect(clippy::cast_precision_loss, reason = "sizes are far below 2^24")]
        let lengths: [f32; 3] = std::array::from_fn(|axis| self.size[axis] as f32 * self.spacing[axis]);
        let longest = lengths.into_iter().fold(0.0, f32::max);
        lengths.map(|length| length / longest)
    }

    /// The window that stands in for `auto` where it needs no mean.
    pub fn fixed_window(&self, window: Window) -> Option<[f32; 2]> {
        match (window, self.auto) {
            (Window::Values(values), _) | (Window::Auto, AutoWindow::Fixed(values)) => Some(values),
            (Window::Auto, AutoWindow::Mean(_)) => None,
        }
    }
}
