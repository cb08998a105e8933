//! Files that Tyndall writes: fields as NRRD and NPY, particles as NPZ, CSV, PLY and VTK, pictures as PNG, JPEG and EXR.

mod file;
mod image;
mod npy;
mod nrrd;
mod particles;

pub use file::write_file;
pub use image::{ImageError, Provenance, write_exr, write_jpg, write_png};
pub use npy::write_npy;
pub use nrrd::write_nrrd;
pub use particles::{Attribute, ParticlesError, write_csv, write_npz, write_ply, write_vtk};

use crate::volume::Samples;

/// The values as little-endian bytes, appended to `out`.
fn append_samples(samples: &Samples, out: &mut Vec<u8>) {
    match samples {
        Samples::U8(values) => out.extend_from_slice(values),
        Samples::U16(values) => out.extend(values.iter().flat_map(|value| value.to_le_bytes())),
        Samples::U32(values) => out.extend(values.iter().flat_map(|value| value.to_le_bytes())),
        Samples::I16(values) => out.extend(values.iter().flat_map(|value| value.to_le_bytes())),
        Samples::F32(values) => out.extend(values.iter().flat_map(|value| value.to_le_bytes())),
    }
}
