//! NRRD, version 5: attached header, raw data, little-endian, x fastest.
//! <https://teem.sourceforge.net/nrrd/format.html>

use std::fmt::Write;

use super::append_samples;
use crate::volume::{Field, Samples};

/// The field as an NRRD file, in its own type.
pub fn write_nrrd(field: &Field) -> Vec<u8> {
    let kind = match field.samples {
        Samples::U8(_) => "uint8",
        Samples::U16(_) => "uint16",
        Samples::U32(_) => "uint32",
        Samples::I16(_) => "int16",
        Samples::F32(_) => "float",
    };
    let ([nx, ny, nz], [sx, sy, sz]) = (field.size, field.spacing);
    let mut header = format!(
        "NRRD0005\n# Written by tyndall {}\ntype: {kind}\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: {sx} {sy} {sz}\n\
         centers: cell cell cell\nendian: little\nencoding: raw\n",
        env!("CARGO_PKG_VERSION")
    );
    for (key, text) in [("content", &field.name), ("sample units", &field.unit)] {
        // A line break would end the field, and two of them the header.
        let text: String = text.chars().filter(|c| !c.is_control()).collect();
        if !text.is_empty() {
            let _ = writeln!(header, "{key}: {text}");
        }
    }
    header.push('\n');
    let mut out = header.into_bytes();
    append_samples(&field.samples, &mut out);
    out
}
