//! A field on the CPU, as files hold it.

use super::{AutoWindow, Format, Grid};
use crate::gpu::{Gpu, GpuError};

/// The values of a field, in its own type.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// Unsigned bytes.
    U8(Vec<u8>),
    /// Unsigned 16-bit integers.
    U16(Vec<u16>),
    /// Unsigned 32-bit integers.
    U32(Vec<u32>),
    /// Signed 16-bit integers.
    I16(Vec<i16>),
    /// 32-bit floats.
    F32(Vec<f32>),
}

/// A scalar field on a grid, x fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// What it is: `density`.
    pub name: String,
    /// Unit of the values; empty: none.
    pub unit: String,
    /// Voxels along x, y and z.
    pub size: [u32; 3],
    /// Edge of a voxel along x, y and z.
    pub spacing: [f32; 3],
    /// The values.
    pub samples: Samples,
}

impl Field {
    /// Puts the field on the GPU. Integers up to 16 bits become floats, exactly.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the adapter cannot hold it.
    pub fn upload(&self, gpu: &Gpu) -> Result<Grid, GpuError> {
        let what = format!("the field {} of {}×{}×{} voxels", self.name, self.size[0], self.size[1], self.size[2]);
        let floats = |values: Vec<f32>, auto| gpu.storage_of(&what, &values).map(|words| (words, Format::F32, auto));
        let (words, format, auto) = match &self.samples {
            Samples::U8(v) => floats(v.iter().map(|&x| f32::from(x)).collect(), AutoWindow::Fixed([0.0, 255.0])),
            Samples::U16(v) => floats(v.iter().map(|&x| f32::from(x)).collect(), AutoWindow::Fixed([0.0, 65_535.0])),
            Samples::I16(v) => floats(v.iter().map(|&x| f32::from(x)).collect(), AutoWindow::Fixed([-32_768.0, 32_767.0])),
            Samples::U32(v) => {
                gpu.storage_of(&what, v).map(|words| (words, Format::U32, AutoWindow::Fixed([0.0, 4_294_967_295.0])))
            }
            Samples::F32(v) => gpu.storage_of(&what, v).map(|words| (words, Format::F32, AutoWindow::Fixed([0.0, 1.0]))),
        }?;
        Ok(Grid { words, format, size: self.size, spacing: self.spacing, auto, version: 0 })
    }
}
