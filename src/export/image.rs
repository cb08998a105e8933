//! Pictures: PNG and JPEG as shown, EXR as linear radiance. PNG and EXR tell what they were made of.

use std::io::Cursor;

use exr::prelude::{AttributeValue, Encoding, Image, Layer, LayerAttributes, SpecificChannels, Text, Vec2, WritableImage as _};
use serde_json::{Value, json};

/// Quality of a JPEG, of 100.
const JPEG_QUALITY: u8 = 85;

/// What a picture was made of; it goes into the file.
#[derive(Debug, Clone, Copy)]
pub struct Provenance<'a> {
    /// The scene, every key written out.
    pub scene: &'a Value,
    /// Samples per pixel.
    pub spp: u32,
    /// Seed of the samples.
    pub seed: u32,
    /// Name of the adapter.
    pub adapter: &'a str,
}

impl Provenance<'_> {
    fn json(&self) -> String {
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "adapter": self.adapter,
            "seed": self.seed,
            "spp": self.spp,
            "scene": self.scene,
        })
        .to_string()
    }
}

/// A picture that could not be written: no pixels, or more than the format holds.
#[derive(Debug, thiserror::Error)]
#[error("a picture of {0}×{1} pixels cannot be written: {2}")]
pub struct ImageError(u32, u32, String);

/// An RGBA picture of 8 bits in sRGB, row 0 on top, as a PNG whose text chunk `tyndall` holds the provenance.
///
/// # Errors
/// An [`ImageError`] where there are no pixels, or not as many as the size says.
pub fn write_png(size: [u32; 2], rgba: &[u8], about: &Provenance<'_>) -> Result<Vec<u8>, ImageError> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, size[0], size[1]);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let written = encoder
        .add_itxt_chunk("tyndall".into(), about.json())
        .and_then(|()| encoder.write_header())
        .and_then(|mut writer| writer.write_image_data(rgba).and_then(|()| writer.finish()));
    written.map_err(|error| ImageError(size[0], size[1], error.to_string()))?;
    Ok(out)
}

/// An RGBA picture of 8 bits in sRGB, row 0 on top, as a JPEG without its alpha: small, for pages and thumbnails.
///
/// # Errors
/// An [`ImageError`] where there are no pixels, not as many as the size says, or an edge is above 65535.
pub fn write_jpg(size: [u32; 2], rgba: &[u8]) -> Result<Vec<u8>, ImageError> {
    let fault = |reason: String| ImageError(size[0], size[1], reason);
    let [width, height] = size.map(u16::try_from);
    let (Ok(width), Ok(height)) = (width, height) else { return Err(fault("an edge is above 65535".to_owned())) };
    let mut out = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut out, JPEG_QUALITY);
    encoder.encode(rgba, width, height, jpeg_encoder::ColorType::Rgba).map_err(|error| fault(error.to_string()))?;
    Ok(out)
}

/// Linear RGBA as float32 EXR, row 0 on top, not touched in any way; the attribute `tyndall` holds the provenance.
///
/// # Errors
/// An [`ImageError`] where there are no pixels, or not as many as the size says.
pub fn write_exr(size: [u32; 2], rgba: &[[f32; 4]], about: &Provenance<'_>) -> Result<Vec<u8>, ImageError> {
    let [width, height] = size.map(|edge| edge as usize);
    let fault = |reason: String| ImageError(size[0], size[1], reason);
    if width * height != rgba.len() || rgba.is_empty() {
        return Err(fault(format!("there are {} pixels", rgba.len())));
    }
    let mut attributes =
        LayerAttributes { software_name: Some(Text::from(concat!("tyndall ", env!("CARGO_PKG_VERSION")))), ..Default::default() };
    // One attribute: their order in the file is that of a hash map, and the same picture is the same bytes.
    attributes.other.insert(Text::from("tyndall"), AttributeValue::Text(Text::from(about.json().as_str())));
    let pixel = |at: Vec2<usize>| {
        let [r, g, b, a] = rgba[at.y() * width + at.x()];
        (r, g, b, a)
    };
    let layer = Layer::new((width, height), attributes, Encoding::SMALL_LOSSLESS, SpecificChannels::rgba(pixel));
    let mut out = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut out).map_err(|error| fault(error.to_string()))?;
    Ok(out.into_inner())
}
