//! Particles with all their attributes: NPZ, CSV, PLY and VTK.
//!
//! - NPZ: one array of shape [particles, parts] an attribute, as `numpy.savez` writes it
//! - CSV: a line of names, a line for each particle
//! - PLY: `vertex` elements of floats, binary, little-endian
//! - VTK: the legacy format, poly data of points with fields, binary

use std::fmt::Write;

use flate2::Crc;

use super::npy::array_header;

/// An attribute of particles. The first of a file is the position.
#[derive(Debug, Clone, Copy)]
pub struct Attribute<'a> {
    /// `position`, `velocity`, …
    pub name: &'a str,
    /// How many numbers each particle has: 1 for a scalar, 3 for a vector, 4 for a quaternion.
    pub parts: usize,
    /// The numbers, those of a particle one after the other.
    pub values: &'a [f32],
}

/// Particles that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ParticlesError(&'static str);

impl Attribute<'_> {
    fn count(&self) -> usize {
        self.values.len() / self.parts
    }

    fn of(&self, particle: usize) -> &[f32] {
        &self.values[particle * self.parts..][..self.parts]
    }

    /// `heading_x`, `heading_y`, `heading_z`; a scalar keeps its name.
    fn part_names(&self) -> Vec<String> {
        match self.parts {
            1 => vec![self.name.to_owned()],
            parts => ["x", "y", "z", "w"].iter().take(parts).map(|part| format!("{}_{part}", self.name)).collect(),
        }
    }
}

/// How many particles there are; all attributes must agree.
fn count(attributes: &[Attribute<'_>]) -> Result<usize, ParticlesError> {
    let fits =
        |attribute: &Attribute<'_>| (1..=4).contains(&attribute.parts) && attribute.values.len().is_multiple_of(attribute.parts);
    if attributes.first().is_none_or(|first| first.parts != 3) || !attributes.iter().all(fits) {
        return Err(ParticlesError("particles have a position of three numbers, and attributes of one to four"));
    }
    let count = attributes[0].count();
    if attributes.iter().any(|attribute| attribute.count() != count) {
        return Err(ParticlesError("every particle has every attribute"));
    }
    Ok(count)
}

/// The particles as CSV: `position_x,position_y,position_z,…`.
///
/// # Errors
/// A [`ParticlesError`] where attributes do not agree.
pub fn write_csv(attributes: &[Attribute<'_>]) -> Result<Vec<u8>, ParticlesError> {
    let count = count(attributes)?;
    let names: Vec<String> = attributes.iter().flat_map(Attribute::part_names).collect();
    let mut out = names.join(",");
    out.push('\n');
    for particle in 0..count {
        for (i, value) in attributes.iter().flat_map(|attribute| attribute.of(particle)).enumerate() {
            let _ = write!(out, "{}{value}", if i == 0 { "" } else { "," });
        }
        out.push('\n');
    }
    Ok(out.into_bytes())
}

/// The particles as PLY. The position's parts are `x`, `y` and `z`, as viewers expect.
///
/// # Errors
/// A [`ParticlesError`] where attributes do not agree.
pub fn write_ply(attributes: &[Attribute<'_>]) -> Result<Vec<u8>, ParticlesError> {
    let count = count(attributes)?;
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n");
    let position = ["x", "y", "z"].map(str::to_owned).into_iter();
    for name in position.chain(attributes[1..].iter().flat_map(Attribute::part_names)) {
        let _ = writeln!(header, "property float {name}");
    }
    header.push_str("end_header\n");
    let mut out = header.into_bytes();
    for particle in 0..count {
        out.extend(attributes.iter().flat_map(|attribute| attribute.of(particle)).flat_map(|value| value.to_le_bytes()));
    }
    Ok(out)
}

/// The particles as a legacy VTK file.
///
/// # Errors
/// A [`ParticlesError`] where attributes do not agree, or there are 2³¹ particles.
pub fn write_vtk(attributes: &[Attribute<'_>]) -> Result<Vec<u8>, ParticlesError> {
    let count = count(attributes)?;
    let last = i32::try_from(count).map_err(|_| ParticlesError("a VTK file holds fewer than 2^31 particles"))?;
    let floats = |values: &[f32], out: &mut Vec<u8>| out.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    let mut out = format!("# vtk DataFile Version 3.0\nparticles\nBINARY\nDATASET POLYDATA\nPOINTS {count} float\n").into_bytes();
    floats(attributes[0].values, &mut out);
    out.extend(format!("\nVERTICES {count} {}\n", 2 * count).bytes());
    out.extend((0..last).flat_map(|i| [1, i]).flat_map(i32::to_be_bytes));
    out.extend(format!("\nPOINT_DATA {count}\nFIELD attributes {}\n", attributes.len() - 1).bytes());
    for attribute in &attributes[1..] {
        out.extend(format!("{} {} {count} float\n", attribute.name, attribute.parts).bytes());
        floats(attribute.values, &mut out);
        out.push(b'\n');
    }
    Ok(out)
}

/// The particles as NPZ: an archive of one `name.npy` an attribute, stored.
///
/// # Errors
/// A [`ParticlesError`] where attributes do not agree, or the file would pass 4 GiB.
pub fn write_npz(attributes: &[Attribute<'_>]) -> Result<Vec<u8>, ParticlesError> {
    const TOO_LARGE: ParticlesError = ParticlesError("an NPZ file holds less than 4 GiB");
    /// Version 2.0, no flags, stored, 1980-01-01 00:00.
    const COMMON: [u8; 10] = [20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
    let count = count(attributes)?;
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for attribute in attributes {
        let shape = if attribute.parts == 1 { format!("({count},)") } else { format!("({count}, {})", attribute.parts) };
        let mut array = array_header("<f4", &shape);
        array.extend(attribute.values.iter().flat_map(|value| value.to_le_bytes()));
        let name = format!("{}.npy", attribute.name);
        let offset = u32::try_from(out.len()).map_err(|_| TOO_LARGE)?;
        let length = u32::try_from(array.len()).map_err(|_| TOO_LARGE)?;
        let mut crc = Crc::new();
        crc.update(&array);
        // What the local header and the directory have in common: checksum, both sizes, length of the name, no extras.
        let mut facts = [crc.sum(), length, length].map(u32::to_le_bytes).concat();
        facts.extend(u16::try_from(name.len()).map_err(|_| TOO_LARGE)?.to_le_bytes());
        facts.extend([0; 2]);
        out.extend([&b"PK\x03\x04"[..], &COMMON, &facts, name.as_bytes()].concat());
        out.append(&mut array);
        directory
            .extend([&b"PK\x01\x02\x14\x00"[..], &COMMON, &facts, &[0; 10], &offset.to_le_bytes(), name.as_bytes()].concat());
    }
    let start = u32::try_from(out.len()).map_err(|_| TOO_LARGE)?;
    let length = u32::try_from(directory.len()).map_err(|_| TOO_LARGE)?;
    let entries = u16::try_from(attributes.len()).map_err(|_| TOO_LARGE)?.to_le_bytes();
    out.append(&mut directory);
    let end = [&b"PK\x05\x06\0\0\0\0"[..], &entries, &entries, &length.to_le_bytes(), &start.to_le_bytes(), &[0; 2]];
    out.extend(end.concat());
    Ok(out)
}
