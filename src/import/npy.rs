//! NPY, the format of `numpy.save`: versions 1 to 3, three axes, C or Fortran order.
//! <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>

use std::io::Read;

use super::Fault;
use super::values::{self, Kind};
use crate::volume::Field;

/// The first bytes of every NPY file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest header read, in bytes. `numpy` writes 118 for three axes.
const MAX_HEADER: u32 = 1 << 16;

/// What a header says.
#[derive(Debug, PartialEq)]
struct Header {
    kind: Kind,
    big_endian: bool,
    fortran_order: bool,
    /// z, y, x.
    shape: [u64; 3],
}

/// Reads a file of `length` bytes from its start.
pub(super) fn read(input: &mut dyn Read, length: u64) -> Result<Field, Fault> {
    let (text, start) = header_text(input)?;
    let header = parse(&text)?;
    let [z, y, x] = header.shape;
    let (size, count) = values::check_size([x, y, z], "shape")?;
    values::check_length(count * header.kind.bytes(), length.saturating_sub(start))?;
    let mut samples = values::read(input, header.kind, header.big_endian, count)?;
    if header.fortran_order {
        samples = values::x_fastest(samples, size);
    }
    values::check_finite(&samples, size)?;
    Ok(Field { name: "density".into(), unit: String::new(), size, spacing: [1.0; 3], samples })
}

/// The header's text and the offset of the data.
fn header_text(input: &mut dyn Read) -> Result<(String, u64), Fault> {
    let fault = |_| Fault::new("header", "the file ends inside");
    let mut fixed = [0; 8];
    input.read_exact(&mut fixed).map_err(fault)?;
    let (length, prefix) = match fixed[6] {
        1 => {
            let mut length = [0; 2];
            input.read_exact(&mut length).map_err(fault)?;
            (u32::from(u16::from_le_bytes(length)), 10)
        }
        2 | 3 => {
            let mut length = [0; 4];
            input.read_exact(&mut length).map_err(fault)?;
            (u32::from_le_bytes(length), 12)
        }
        other => return Err(Fault::new("header", format!("version {other} is not read; 1, 2 and 3 are"))),
    };
    if length > MAX_HEADER {
        return Err(Fault::new("header", format!("{length} bytes; at most {MAX_HEADER} are read")));
    }
    let mut text = vec![0; length as usize];
    input.read_exact(&mut text).map_err(fault)?;
    let text = String::from_utf8(text).map_err(|_| Fault::new("header", "not text"))?;
    Ok((text, prefix + u64::from(length)))
}

fn parse(text: &str) -> Result<Header, Fault> {
    let broken = || Fault::new("header", "not a dictionary of `descr`, `fortran_order` and `shape`");
    let mut scanner = Scanner(text);
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    if !scanner.eat('{') {
        return Err(broken());
    }
    while !scanner.eat('}') {
        let key = scanner.string().ok_or_else(broken)?;
        if !scanner.eat(':') {
            return Err(broken());
        }
        match key {
            "descr" => {
                let word = scanner.string().ok_or_else(|| Fault::new("descr", "records are not read; a scalar type is"))?;
                descr = Some(kind(word)?);
            }
            "fortran_order" => fortran_order = Some(scanner.boolean().ok_or_else(broken)?),
            "shape" => shape = Some(scanner.tuple().ok_or_else(broken)?),
            _ => return Err(broken()),
        }
        if !scanner.eat(',') && !scanner.peek('}') {
            return Err(broken());
        }
    }
    let (Some((kind, big_endian)), Some(fortran_order), Some(shape)) = (descr, fortran_order, shape) else {
        return Err(broken());
    };
    let shape = <[u64; 3]>::try_from(shape)
        .map_err(|shape| Fault::new("shape", format!("{} axes; a volume has three, indexed [z][y][x]", shape.len())))?;
    Ok(Header { kind, big_endian, fortran_order, shape })
}

/// A type and whether its bytes are big-endian.
fn kind(word: &str) -> Result<(Kind, bool), Fault> {
    let (order, name) = word.split_at_checked(1).unwrap_or(("", word));
    let kind = match name {
        "u1" => Kind::U8,
        "u2" => Kind::U16,
        "u4" => Kind::U32,
        "i2" => Kind::I16,
        "f4" => Kind::F32,
        "f8" => Kind::F64,
        _ => return Err(Fault::new("descr", format!("`{word}` is not read; u1, u2, u4, i2, f4 and f8 are"))),
    };
    match order {
        "<" | "|" => Ok((kind, false)),
        ">" => Ok((kind, true)),
        "=" => Ok((kind, cfg!(target_endian = "big"))),
        _ => Err(Fault::new("descr", format!("`{word}` names no byte order"))),
    }
}

/// Reads the few Python literals of a header; nothing nests, so that nothing recurses.
struct Scanner<'a>(&'a str);

impl<'a> Scanner<'a> {
    fn peek(&mut self, mark: char) -> bool {
        self.0 = self.0.trim_start();
        self.0.starts_with(mark)
    }

    fn eat(&mut self, mark: char) -> bool {
        let found = self.peek(mark);
        if found {
            self.0 = &self.0[mark.len_utf8()..];
        }
        found
    }

    fn string(&mut self) -> Option<&'a str> {
        let quote = ['\'', '"'].into_iter().find(|quote| self.eat(*quote))?;
        let (text, rest) = self.0.split_once(quote)?;
        self.0 = rest;
        Some(text)
    }

    fn boolean(&mut self) -> Option<bool> {
        self.0 = self.0.trim_start();
        [("True", true), ("False", false)].into_iter().find_map(|(word, value)| {
            self.0 = self.0.strip_prefix(word)?;
            Some(value)
        })
    }

    /// A tuple of at most 32 whole numbers, as many axes as `numpy` allows.
    fn tuple(&mut self) -> Option<Vec<u64>> {
        let mut numbers = Vec::new();
        if !self.eat('(') {
            return None;
        }
        while !self.eat(')') {
            self.0 = self.0.trim_start();
            let digits = self.0.bytes().take_while(u8::is_ascii_digit).count();
            let (number, rest) = self.0.split_at(digits);
            self.0 = rest;
            numbers.push(number.parse().ok()?);
            if numbers.len() > 32 || (!self.eat(',') && !self.peek(')')) {
                return None;
            }
        }
        Some(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_read_in_any_order_and_spacing() {
        let text = "{\"shape\":(2,3 , 4,),'fortran_order' : True,'descr':'>f8'}   \n";
        let expected = Header { kind: Kind::F64, big_endian: true, fortran_order: true, shape: [2, 3, 4] };
        assert_eq!(parse(text).unwrap(), expected);
    }

    #[test]
    fn a_nested_header_is_refused_and_does_not_recurse() {
        let deep = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {}", "(".repeat(60_000));
        assert!(parse(&deep).is_err());
        assert!(parse(&"{".repeat(60_000)).is_err());
    }
}
