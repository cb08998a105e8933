//! From a raw picture to the bytes of a payload.

use std::io::Cursor;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};

/// JPEG quality of a picture in the stream; with 4:2:0 some 50 to 100 kB at 1280×720.
const STREAM_QUALITY: u8 = 80;

/// How a frame's payload is encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Codec {
    /// Lossless, for the final picture.
    Png,
    /// JPEG with 4:2:0 chroma.
    Jpeg,
}

impl Codec {
    /// Every codec this server writes, in the order of preference for a moving picture.
    pub const ALL: [Self; 2] = [Self::Jpeg, Self::Png];

    /// The codec's name in `hello` and `welcome`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpeg",
        }
    }

    /// The codec of this name; `None` where this server does not write it.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|codec| codec.name() == name)
    }

    /// The codec's number in a frame header.
    pub fn wire(self) -> u8 {
        match self {
            Self::Png => 0,
            Self::Jpeg => 1,
        }
    }

    /// The codec of this number in a frame header.
    pub fn from_wire(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|codec| codec.wire() == number)
    }

    /// Whether a decoded payload equals the picture.
    pub fn is_lossless(self) -> bool {
        self == Self::Png
    }
}

/// A picture as it goes over the wire.
#[derive(Debug)]
pub struct Encoded {
    /// How the payload is encoded.
    pub codec: Codec,
    /// The payload.
    pub bytes: Vec<u8>,
    /// Time that the encoder took, in µs.
    pub encode_us: u32,
}

/// Why a picture could not be encoded.
#[derive(Debug, Clone, thiserror::Error)]
#[error("the picture of {}×{} could not be encoded as {}: {reason}", size[0], size[1], codec.name())]
pub struct EncodeError {
    /// Size of the picture in pixels.
    pub size: [u32; 2],
    /// The codec wanted.
    pub codec: Codec,
    /// The encoder's words.
    pub reason: String,
}

/// Encodes RGBA (8 bits, row 0 on top) with the settings of the stream.
///
/// # Errors
/// [`EncodeError`] where the size is not that of the pixels, or beyond the codec.
pub fn encode(codec: Codec, size: [u32; 2], pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    match codec {
        Codec::Png => encode_png(size, pixels),
        Codec::Jpeg => encode_jpeg(size, pixels, STREAM_QUALITY),
    }
}

/// Encodes RGBA (8 bits, row 0 on top) as JPEG; alpha is left out.
///
/// # Errors
/// As [`encode`]; JPEG ends at 65535 pixels an edge.
pub fn encode_jpeg(size: [u32; 2], pixels: &[u8], quality: u8) -> Result<Vec<u8>, EncodeError> {
    let refuse = |reason: String| EncodeError { size, codec: Codec::Jpeg, reason };
    let (Ok(width), Ok(height)) = (u16::try_from(size[0]), u16::try_from(size[1])) else {
        return Err(refuse("an edge is longer than 65535 pixels".to_owned()));
    };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    encoder.encode(pixels, width, height, ColorType::Rgba).map_err(|error| refuse(error.to_string()))?;
    Ok(bytes)
}

/// Encodes RGBA (8 bits, row 0 on top) as PNG, fast; an alpha that is opaque everywhere is left out.
///
/// # Errors
/// As [`encode`].
pub fn encode_png(size: [u32; 2], pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    let refuse = |reason: String| EncodeError { size, codec: Codec::Png, reason };
    if pixels.len() as u64 != u64::from(size[0]) * u64::from(size[1]) * 4 {
        return Err(refuse(format!("{} bytes are not 4 a pixel", pixels.len())));
    }
    let mut bytes = Cursor::new(Vec::new());
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive);
    let (pixels, texels) = pixels.as_chunks::<4>();
    debug_assert!(texels.is_empty());
    let written = if pixels.iter().all(|pixel| pixel[3] == 255) {
        let rgb: Vec<u8> = pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
        encoder.write_image(&rgb, size[0], size[1], ExtendedColorType::Rgb8)
    } else {
        encoder.write_image(pixels.as_flattened(), size[0], size[1], ExtendedColorType::Rgba8)
    };
    written.map_err(|error| refuse(error.to_string()))?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture with smooth gradients, which JPEG can hold well.
    fn gradient(size: [u32; 2], alpha: u8) -> Vec<u8> {
        let byte = |x: u32, edge: u32| u8::try_from(x * 255 / edge).unwrap();
        (0..size[1]).flat_map(|y| (0..size[0]).flat_map(move |x| [byte(x, size[0]), byte(y, size[1]), 90, alpha])).collect()
    }

    #[test]
    fn a_png_decodes_to_the_same_bytes() {
        for alpha in [255, 7] {
            let pixels = gradient([33, 17], alpha);
            let decoded = image::load_from_memory(&encode_png([33, 17], &pixels).unwrap()).unwrap().to_rgba8();
            assert_eq!((decoded.dimensions(), decoded.as_raw()), ((33, 17), &pixels));
        }
    }

    #[test]
    fn a_jpeg_decodes_to_nearly_the_same_picture() {
        let pixels = gradient([64, 48], 255);
        let decoded = image::load_from_memory(&encode_jpeg([64, 48], &pixels, 80).unwrap()).unwrap().to_rgba8();
        assert_eq!(decoded.dimensions(), (64, 48));
        let squares: u32 = decoded.iter().zip(&pixels).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum();
        let psnr = 10.0 * (255.0 * 255.0 * 64.0 * 48.0 * 4.0 / f64::from(squares)).log10();
        assert!(psnr > 35.0, "{psnr} dB");
    }

    #[test]
    fn pixels_of_another_size_are_refused() {
        assert!(encode_png([4, 4], &[0; 60]).is_err());
        assert!(encode_jpeg([4, 4], &[0; 60], 80).is_err());
        assert!(encode_jpeg([70_000, 1], &vec![0; 280_000], 80).is_err());
    }
}
