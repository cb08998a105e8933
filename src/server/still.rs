//! A picture made by itself, beside the stream.

use axum::extract::State;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use serde_json::Value;

use super::query::{Named, Params};
use super::{App, Problem};
use crate::engine::{Still, StillRequest};
use crate::export::{Provenance, write_exr, write_png};
use crate::stream::encode_jpeg;

/// Pixels along an edge of a picture, at least.
pub(super) const MIN_EDGE: u32 = 16;
/// Pixels along an edge of a picture, at most.
pub(super) const MAX_EDGE: u32 = 8192;
/// Pixels of a picture made by itself: 7680×4320 fits.
pub(super) const MAX_PIXELS: u64 = 1 << 25;
/// Samples per pixel of a picture made by itself.
pub(super) const MAX_SPP: u32 = 4096;
/// Samples over all pixels: 3840×2160 with 512 each fits.
pub(super) const MAX_SAMPLES: u64 = 1 << 32;
/// Pictures made at once; they take their time from the streams.
pub(super) const AT_ONCE: usize = 2;
/// JPEG quality of a picture that is kept.
const QUALITY: u8 = 92;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Png,
    Jpeg,
    Exr,
}

/// A picture of the session as it is now, with as many samples as asked for.
///
/// `exr` is linear radiance in float32 RGBA, untouched by exposure and tone mapping.
#[utoipa::path(
    get, operation_id = "get_frame", path = "/api/v1/sessions/{id}/frame", tag = "pictures",
    params(
        ("id" = String, Path, description = "Name of the session"),
        ("width" = Option<u32>, Query, description = "Pixels, 16 to 8192; 640 if absent"),
        ("height" = Option<u32>, Query, description = "Pixels, 16 to 8192; 360 if absent"),
        ("spp" = Option<u32>, Query, description = "Samples per pixel, 1 to 4096; 64 if absent"),
        ("format" = Option<String>, Query, description = "png, jpg or exr; png if absent"),
    ),
    responses(
        (status = 200, content((Vec<u8> = "image/png"), (Vec<u8> = "image/jpeg"), (Vec<u8> = "image/x-exr"))),
        (status = 400, description = "A size or number out of range"),
        (status = 404),
        (status = 429, description = "As many pictures are being made as the server makes at once"),
    )
)]
pub(super) async fn frame(State(app): State<App>, Named(id): Named, uri: Uri) -> Result<Response, Problem> {
    let session = app.session(&id)?;
    let (request, format) = wanted(&uri)?;
    let Ok(_permit) = app.stills.try_acquire() else {
        let detail = "other pictures are being made; ask again in a moment";
        return Err(Problem::new(StatusCode::TOO_MANY_REQUESTS, "busy", detail).with_header(header::RETRY_AFTER, "2"));
    };
    let scene = session.scene().borrow().document.clone();
    let still = session.still(request).await?;
    let revision = still.revision.to_string();
    let failed = |error: String| {
        tracing::error!(%error, "a picture could not be encoded");
        Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "internal", "the picture could not be encoded")
    };
    let adapter = app.engine.gpu().info().name.clone();
    let encoded = tokio::task::spawn_blocking(move || encode(&still, request.spp, &scene, &adapter, format)).await;
    let bytes = encoded.map_err(|panic| failed(panic.to_string()))?.map_err(failed)?;
    let media_type = match format {
        Format::Png => "image/png",
        Format::Jpeg => "image/jpeg",
        Format::Exr => "image/x-exr",
    };
    let head = [
        (header::CONTENT_TYPE, media_type.to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::HeaderName::from_static("tyndall-revision"), revision),
    ];
    Ok((head, bytes).into_response())
}

fn wanted(uri: &Uri) -> Result<(StillRequest, Format), Problem> {
    let params = Params::of(uri, &["width", "height", "spp", "format"])?;
    let size = [params.number("width", 640, MIN_EDGE, MAX_EDGE)?, params.number("height", 360, MIN_EDGE, MAX_EDGE)?];
    let spp = params.number("spp", 64, 1, MAX_SPP)?;
    let format = match params.text("format") {
        None | Some("png") => Format::Png,
        Some("jpg" | "jpeg") => Format::Jpeg,
        Some("exr") => Format::Exr,
        Some(other) => {
            let detail = format!("`format` must be png, jpg or exr, not `{other}`");
            return Err(Problem::bad_request("unknown_choice", detail).at("format"));
        }
    };
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    if pixels > MAX_PIXELS {
        let detail = format!("{}×{} are {pixels} pixels; {MAX_PIXELS} may be asked for", size[0], size[1]);
        return Err(Problem::bad_request("out_of_range", detail).at("width"));
    }
    if pixels * u64::from(spp) > MAX_SAMPLES {
        let detail = format!("{pixels} pixels with {spp} samples each are more than {MAX_SAMPLES} samples");
        return Err(Problem::bad_request("out_of_range", detail).at("spp"));
    }
    Ok((StillRequest { size, spp, radiance: format == Format::Exr }, format))
}

fn encode(still: &Still, spp: u32, scene: &Value, adapter: &str, format: Format) -> Result<Vec<u8>, String> {
    let seed = scene.pointer("/render/seed").and_then(Value::as_u64).and_then(|seed| u32::try_from(seed).ok()).unwrap_or(0);
    let about = Provenance { scene, spp, seed, adapter };
    match format {
        Format::Png => write_png(still.size, &still.pixels, &about).map_err(|error| error.to_string()),
        Format::Jpeg => encode_jpeg(still.size, &still.pixels, QUALITY).map_err(|error| error.to_string()),
        Format::Exr => write_exr(still.size, &still.radiance, &about).map_err(|error| error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(query: &str) -> Result<([u32; 2], u32), u16> {
        let uri = format!("/frame?{query}").parse().unwrap();
        wanted(&uri).map(|(request, _)| (request.size, request.spp)).map_err(|problem| problem.status().as_u16())
    }

    #[test]
    fn sizes_and_samples_are_bounded_each_and_together() {
        assert_eq!(asked(""), Ok(([640, 360], 64)));
        assert_eq!(asked("width=3840&height=2160&spp=512&format=exr"), Ok(([3840, 2160], 512)));
        for query in [
            "width=15",
            "height=8193",
            "spp=0",
            "spp=4097",
            "width=8192&height=8192",
            "width=7680&height=4320&spp=4096",
            "format=gif",
            "size=3",
            "width=9e9",
        ] {
            assert_eq!(asked(query), Err(400), "{query}");
        }
    }
}
