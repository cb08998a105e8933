//! From a file's bytes to values: type, byte order, size, finiteness.

use std::io::{ErrorKind, Read};

use super::{Fault, reason_of};
use crate::volume::Samples;

/// Most voxels of one field: 8 GiB of floats.
const MAX_VOXELS: u64 = 1 << 31;

/// Bytes that are decoded at a time; a multiple of every value's size.
const BLOCK: usize = 1 << 16;

/// The type of a value in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    U8,
    U16,
    U32,
    I16,
    F32,
    F64,
}

impl Kind {
    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// Checks the voxels along x, y and z, and gives them with their number.
pub(super) fn check_size(sizes: [u64; 3], place: &str) -> Result<([u32; 3], u64), Fault> {
    let [x, y, z] = sizes;
    let count = x.checked_mul(y).and_then(|xy| xy.checked_mul(z)).filter(|count| *count <= MAX_VOXELS);
    let size = (u32::try_from(x), u32::try_from(y), u32::try_from(z));
    let (Some(count), (Ok(a), Ok(b), Ok(c))) = (count, size) else {
        return Err(Fault::new(place, format!("{x}×{y}×{z} is more than {MAX_VOXELS} voxels")));
    };
    if count == 0 {
        return Err(Fault::new(place, format!("{x}×{y}×{z} holds no voxel")));
    }
    Ok(([a, b, c], count))
}

/// Refuses a file that holds fewer than `needed` bytes of data.
pub(super) fn check_length(needed: u64, there: u64) -> Result<(), Fault> {
    if needed > there {
        return Err(Fault::new("data", format!("{needed} bytes are needed, {there} are there")));
    }
    Ok(())
}

/// Reads `count` values in the order of the file. Memory grows with what is read, not with what a header claims.
pub(super) fn read(input: &mut dyn Read, kind: Kind, big_endian: bool, count: u64) -> Result<Samples, Fault> {
    let count = usize::try_from(count).map_err(|_| Fault::new("data", "more values than this machine can address"))?;
    macro_rules! decode {
        ($type:ty) => {
            if big_endian { collect(input, count, <$type>::from_be_bytes) } else { collect(input, count, <$type>::from_le_bytes) }
        };
    }
    Ok(match kind {
        Kind::U8 => Samples::U8(collect(input, count, |[byte]: [u8; 1]| byte)?),
        Kind::U16 => Samples::U16(decode!(u16)?),
        Kind::U32 => Samples::U32(decode!(u32)?),
        Kind::I16 => Samples::I16(decode!(i16)?),
        Kind::F32 => Samples::F32(decode!(f32)?),
        #[expect(clippy::cast_possible_truncation, reason = "a value too large becomes infinite, and is refused as such")]
        Kind::F64 => Samples::F32(if big_endian {
            collect(input, count, |bytes| f64::from_be_bytes(bytes) as f32)?
        } else {
            collect(input, count, |bytes| f64::from_le_bytes(bytes) as f32)?
        }),
    })
}

fn collect<T, const N: usize>(input: &mut dyn Read, count: usize, decode: impl Fn([u8; N]) -> T) -> Result<Vec<T>, Fault> {
    let mut values = Vec::new();
    let mut block = vec![0; BLOCK];
    while values.len() < count {
        let bytes = (count - values.len()).saturating_mul(N).min(BLOCK);
        let part = &mut block[..bytes];
        input.read_exact(part).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => Fault::new("data", format!("they end before value {count}")),
            _ => Fault::new("data", reason_of(&error)),
        })?;
        values.extend(part.as_chunks::<N>().0.iter().map(|bytes| decode(*bytes)));
    }
    Ok(values)
}

/// Refuses the first value that is not a finite 32-bit float, by its voxel.
pub(super) fn check_finite(samples: &Samples, size: [u32; 3]) -> Result<(), Fault> {
    let Samples::F32(values) = samples else { return Ok(()) };
    let Some(at) = values.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let [nx, ny, _] = size.map(|n| n as usize);
    let voxel = format!("voxel {},{},{}", at % nx, at / nx % ny, at / nx / ny);
    Err(Fault::new(voxel, format!("{} is not a finite 32-bit float", values[at])))
}

/// Turns values whose z runs fastest, x slowest, into values whose x runs fastest.
pub(super) fn x_fastest(samples: Samples, size: [u32; 3]) -> Samples {
    fn turned<T: Copy>(values: &[T], size: [u32; 3]) -> Vec<T> {
        let [nx, ny, nz] = size.map(|n| n as usize);
        let mut out = Vec::with_capacity(values.len());
        for z in 0..nz {
            for y in 0..ny {
                out.extend((0..nx).map(|x| values[z + nz * (y + ny * x)]));
            }
        }
        out
    }
    match samples {
        Samples::U8(values) => Samples::U8(turned(&values, size)),
        Samples::U16(values) => Samples::U16(turned(&values, size)),
        Samples::U32(values) => Samples::U32(turned(&values, size)),
        Samples::I16(values) => Samples::I16(turned(&values, size)),
        Samples::F32(values) => Samples::F32(turned(&values, size)),
    }
}
