//! NRRD, versions 1 to 5: raw and gzip data, attached or in one file of the same folder.
//! <https://teem.sourceforge.net/nrrd/format.html>

use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use super::values::{self, Kind};
use super::{Fault, dataset, open, reason_of};
use crate::volume::Field;

/// The first bytes of every NRRD file.
pub(super) const MAGIC: &[u8] = b"NRRD000";

/// Longest header read, in bytes.
const MAX_HEADER: u64 = 1 << 18;

/// Most bytes that a byte of deflated data can stand for.
const MAX_INFLATION: u64 = 1032;

/// Reads a file of `length` bytes from its start; a detached file of data is looked for beside `path`.
pub(super) fn read(input: &mut dyn BufRead, length: u64, path: &Path) -> Result<Field, Fault> {
    let mut read = 0;
    let header = Header { fields: fields(input, &mut read)? };
    let (size, spacing) = header.axes()?;
    let (_, count) = values::check_size(size.map(u64::from), "sizes")?;
    let kind = header.kind()?;
    let samples = match header.get("datafile") {
        None => header.data(input, length.saturating_sub(read), kind, count),
        Some(name) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let named = |fault: Fault| Fault::new("data file", format!("`{name}`: {}", fault.reason));
            if name.starts_with("LIST") || name.contains(' ') {
                return Err(Fault::new("data file", "data in several files are not read"));
            }
            let (mut data, length) = dataset::beside(folder, name).and_then(|file| open(&file)).map_err(named)?;
            header.data(&mut data, length, kind, count)
        }
    }?;
    values::check_finite(&samples, size)?;
    let text = |key: &str| header.get(key).map(|text| text.trim_matches('"').to_owned()).filter(|text| !text.is_empty());
    Ok(Field {
        name: text("content").unwrap_or_else(|| "density".into()),
        unit: text("sampleunits").unwrap_or_default(),
        size,
        spacing,
        samples,
    })
}

/// The header's `field: value` lines up to the blank line that ends it. Names lose their case and spaces, which
/// writers disagree on.
fn fields(input: &mut dyn BufRead, read: &mut u64) -> Result<BTreeMap<String, String>, Fault> {
    let mut fields = BTreeMap::new();
    let mut number = 0;
    loop {
        let mut line = Vec::new();
        let place = |number: u32| format!("line {number}");
        number += 1;
        let left = MAX_HEADER - *read;
        *read += input.take(left).read_until(b'\n', &mut line).map_err(|error| Fault::file(&error))? as u64;
        let ended = line.pop_if(|byte| *byte == b'\n').is_some();
        if !ended && *read == MAX_HEADER {
            return Err(Fault::new(place(number), format!("the header is longer than {MAX_HEADER} bytes")));
        }
        line.pop_if(|byte| *byte == b'\r');
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end();
        if number > 1 && !line.is_empty() && !line.starts_with('#') {
            // `key:=value` is for people and other programs.
            let pair = line.split_once(':').filter(|(_, value)| !value.starts_with('='));
            if let Some((key, value)) = pair {
                let key = key.replace(' ', "").to_lowercase();
                if fields.insert(key, value.trim().to_owned()).is_some() {
                    return Err(Fault::new(place(number), "a field that stands here for the second time"));
                }
            } else if !line.contains(":=") {
                return Err(Fault::new(place(number), "neither `field: value` nor `key:=value`"));
            }
        }
        // A header without data may end with the file.
        if !ended || (number > 1 && line.is_empty()) {
            return Ok(fields);
        }
    }
}

struct Header {
    fields: BTreeMap<String, String>,
}

impl Header {
    fn get(&self, key: &str) -> Option<&str> {
        self.fields.get(key).map(String::as_str)
    }

    fn need(&self, key: &str) -> Result<&str, Fault> {
        self.get(key).ok_or_else(|| Fault::new(key, "missing from the header"))
    }

    fn kind(&self) -> Result<Kind, Fault> {
        let name = self.need("type")?;
        Ok(match name.to_lowercase().as_str() {
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Kind::U8,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Kind::U16,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Kind::U32,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Kind::I16,
            "float" => Kind::F32,
            "double" => Kind::F64,
            _ => {
                let known = "uint8, uint16, uint32, int16, float and double are";
                return Err(Fault::new("type", format!("`{name}` is not read; {known}")));
            }
        })
    }

    /// Voxels and voxel edges along x, y and z.
    fn axes(&self) -> Result<([u32; 3], [f32; 3]), Fault> {
        let dimension = self.number("dimension")?;
        let sizes = self
            .need("sizes")?
            .split_whitespace()
            .map(|word| word.parse::<u64>().map_err(|_| Fault::new("sizes", format!("`{word}` is not a whole number"))))
            .collect::<Result<Vec<_>, _>>()?;
        if !(3..=16).contains(&dimension) {
            return Err(Fault::new("dimension", format!("{dimension}; a volume has 3")));
        }
        if i64::try_from(sizes.len()) != Ok(dimension) {
            return Err(Fault::new("sizes", format!("{} numbers for {dimension} axes", sizes.len())));
        }
        // An axis of one value, first for the parts of a vector or last for the moments in time, holds nothing.
        let first = sizes.iter().take(sizes.len() - 3).take_while(|size| **size == 1).count();
        let three = sizes.get(first..first + 3).and_then(|three| <[u64; 3]>::try_from(three).ok());
        let (Some(three), true) = (three, sizes.iter().skip(first + 3).all(|size| *size == 1)) else {
            return Err(Fault::new("sizes", "more than three axes; a volume holds one value a voxel"));
        };
        let spacing = self.spacings(sizes.len())?;
        let mut edges = [1.0; 3];
        edges.copy_from_slice(&spacing[first..first + 3]);
        Ok((values::check_size(three, "sizes")?.0, edges))
    }

    /// The length of a voxel along each axis; 1 where the header does not say.
    fn spacings(&self, axes: usize) -> Result<Vec<f32>, Fault> {
        let (place, lengths) = if let Some(text) = self.get("spacedirections") {
            ("space directions", directions(text)?)
        } else if let Some(text) = self.get("spacings") {
            let number = |word: &str| word.parse().map_err(|_| Fault::new("spacings", format!("`{word}` is not a number")));
            ("spacings", text.split_whitespace().map(number).collect::<Result<Vec<f64>, _>>()?)
        } else {
            return Ok(vec![1.0; axes]);
        };
        if lengths.len() != axes {
            return Err(Fault::new(place, format!("{} for {axes} axes", lengths.len())));
        }
        let edge = |length: f64| match length.abs() {
            unknown if unknown.is_nan() => Ok(1.0),
            #[expect(clippy::cast_possible_truncation, reason = "checked to be in range")]
            edge if (1e-30..1e30).contains(&edge) => Ok(edge as f32),
            _ => Err(Fault::new(place, format!("{length} is no length of a voxel"))),
        };
        lengths.into_iter().map(edge).collect()
    }

    fn number(&self, key: &str) -> Result<i64, Fault> {
        let text = self.need(key)?;
        text.parse().map_err(|_| Fault::new(key, format!("`{text}` is not a whole number")))
    }

    fn big_endian(&self, kind: Kind) -> Result<bool, Fault> {
        match self.get("endian") {
            Some("big") => Ok(true),
            Some("little") => Ok(false),
            None if kind.bytes() == 1 => Ok(false),
            None => Err(Fault::new("endian", "missing from the header")),
            Some(other) => Err(Fault::new("endian", format!("`{other}` is neither little nor big"))),
        }
    }

    /// Reads the values from `input`, which holds `there` bytes more.
    fn data(&self, input: &mut dyn BufRead, mut there: u64, kind: Kind, count: u64) -> Result<crate::volume::Samples, Fault> {
        let big_endian = self.big_endian(kind)?;
        let needed = count * kind.bytes();
        for _ in 0..self.get("lineskip").map_or(Ok(0), |_| self.number("lineskip"))? {
            let skipped = input.skip_until(b'\n').map_err(|error| Fault::new("data", reason_of(&error)))?;
            if skipped == 0 {
                return Err(Fault::new("line skip", "the file has fewer lines"));
            }
            there = there.saturating_sub(skipped as u64);
        }
        let skip = self.get("byteskip").map_or(Ok(0), |_| self.number("byteskip"))?;
        match self.need("encoding")?.to_lowercase().as_str() {
            "raw" => {
                // -1: the data are the end of the file, whatever comes before.
                let skip = if skip == -1 { there.saturating_sub(needed) } else { count_of(skip)? };
                values::check_length(needed, there.saturating_sub(skip))?;
                discard(input, skip)?;
                values::read(input, kind, big_endian, count)
            }
            "gzip" | "gz" => {
                values::check_length(needed / MAX_INFLATION, there)?;
                let mut inflated = MultiGzDecoder::new(input);
                discard(&mut inflated, count_of(skip)?)?;
                let samples = values::read(&mut inflated, kind, big_endian, count)?;
                // The checksum stands behind the last value.
                inflated.read(&mut [0]).map_err(|error| Fault::new("data", reason_of(&error)))?;
                Ok(samples)
            }
            other => Err(Fault::new("encoding", format!("`{other}` is not read; raw and gzip are"))),
        }
    }
}

fn count_of(skip: i64) -> Result<u64, Fault> {
    u64::try_from(skip).map_err(|_| Fault::new("byte skip", format!("{skip} is no number of bytes here")))
}

fn discard(input: &mut dyn Read, bytes: u64) -> Result<(), Fault> {
    let skipped = std::io::copy(&mut input.take(bytes), &mut std::io::sink());
    if skipped.map_err(|error| Fault::new("data", reason_of(&error)))? < bytes {
        return Err(Fault::new("byte skip", "the file is shorter"));
    }
    Ok(())
}

/// Lengths of `(a,b,c)` vectors, NaN for `none`. The box keeps its own axes, so that turned ones are lengths all the
/// same; slanted ones are no box.
fn directions(text: &str) -> Result<Vec<f64>, Fault> {
    let fault = |reason: &str| Fault::new("space directions", reason);
    let mut vectors: Vec<[f64; 3]> = Vec::new();
    let mut lengths = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            lengths.push(f64::NAN);
            rest = after.trim_start();
            continue;
        }
        let Some((inside, after)) = rest.strip_prefix('(').and_then(|rest| rest.split_once(')')) else {
            return Err(fault("neither `(a,b,c)` nor `none`"));
        };
        let numbers: Vec<f64> = inside.split(',').map_while(|word| word.trim().parse().ok()).collect();
        let vector: [f64; 3] = numbers.try_into().map_err(|_| fault("a direction has three numbers"))?;
        lengths.push(vector.iter().map(|x| x * x).sum::<f64>().sqrt());
        vectors.push(vector);
        if lengths.len() > 16 {
            return Err(fault("more than 16 axes"));
        }
        rest = after.trim_start();
    }
    for (i, a) in vectors.iter().enumerate() {
        for b in &vectors[..i] {
            let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            let lengths: f64 = [a, b].map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt()).iter().product();
            if dot.abs() > 1e-3 * lengths {
                return Err(fault("the axes are not at right angles"));
            }
        }
    }
    Ok(lengths)
}
