//! NPY, version 1: indexed `[z][y][x]` in C order, which is x fastest.
//! <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>

use super::append_samples;
use crate::volume::{Field, Samples};

/// The field as an NPY file, in its own type.
pub fn write_npy(field: &Field) -> Vec<u8> {
    let descr = match field.samples {
        Samples::U8(_) => "|u1",
        Samples::U16(_) => "<u2",
        Samples::U32(_) => "<u4",
        Samples::I16(_) => "<i2",
        Samples::F32(_) => "<f4",
    };
    let [nx, ny, nz] = field.size;
    let mut out = array_header(descr, &format!("({nz}, {ny}, {nx})"));
    append_samples(&field.samples, &mut out);
    out
}

/// Magic, version and header of an array in C order; `shape` is a Python tuple.
pub(super) fn array_header(descr: &str, shape: &str) -> Vec<u8> {
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    // Spaces and a line feed bring the data to a multiple of 64 bytes.
    let end = (10 + text.len() + 1).next_multiple_of(64);
    text.extend(std::iter::repeat_n(' ', end - 10 - text.len() - 1));
    text.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    let length = u16::try_from(text.len()).unwrap_or_else(|_| panic!("a header of {} bytes", text.len()));
    out.extend(length.to_le_bytes());
    out.extend(text.bytes());
    out
}
