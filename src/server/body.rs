//! JSON bodies: bounded in size and time, refused as problems.

use std::time::Duration;

use axum::body::Body;
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use futures_util::StreamExt;
use serde_json::Value;

use super::{App, Problem};

/// Most bytes of a body: a scene document with room to spare.
pub(super) const MAX_BODY: usize = 1 << 20;
/// Bytes of a body beyond the limit that are read and thrown away, so that the refusal arrives before the connection closes.
const MAX_DRAIN: usize = 16 << 20;
/// A body of `application/json`; an empty one is null.
pub(super) struct Json(pub(super) Value);

/// A body of `application/merge-patch+json` or `application/json`.
pub(super) struct MergePatch(pub(super) Value);

impl FromRequest<App> for Json {
    type Rejection = Problem;
    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        let (parts, body) = request.into_parts();
        let bytes = read(&parts.headers, body, app.config.timing.body).await?;
        if bytes.is_empty() && !parts.headers.contains_key(header::CONTENT_TYPE) {
            return Ok(Self(Value::Null));
        }
        accept(&parts.headers, &["application/json"], header::ACCEPT)?;
        parse(&bytes).map(Self)
    }
}

impl FromRequest<App> for MergePatch {
    type Rejection = Problem;
    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        let (parts, body) = request.into_parts();
        let bytes = read(&parts.headers, body, app.config.timing.body).await?;
        let accept_patch = HeaderName::from_static("accept-patch");
        accept(&parts.headers, &["application/merge-patch+json", "application/json"], accept_patch)?;
        parse(&bytes).map(Self)
    }
}

/// Refuses a media type that is none of `known`. A page of another origin can send only form and text types without being
/// asked about, so this keeps it out even where a browser leaves `Origin` away.
fn accept(headers: &HeaderMap, known: &[&'static str], answer: HeaderName) -> Result<(), Problem> {
    let sent = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let media_type = sent.split(';').next().unwrap_or_default().trim();
    if known.iter().any(|known| media_type.eq_ignore_ascii_case(known)) {
        return Ok(());
    }
    let detail = format!("the content type must be {}", known.join(" or "));
    Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", detail).with_header(answer, known[0]))
}

async fn read(headers: &HeaderMap, body: Body, patience: Duration) -> Result<Vec<u8>, Problem> {
    let declared = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse::<usize>().ok());
    let gather = async {
        let mut bytes = Vec::with_capacity(declared.unwrap_or(0).min(MAX_BODY));
        let mut total = 0;
        let mut chunks = body.into_data_stream();
        while let Some(chunk) = chunks.next().await {
            let chunk = chunk.map_err(|error| Problem::bad_request("bad_body", format!("the body broke off: {error}")))?;
            total += chunk.len();
            if total <= MAX_BODY {
                bytes.extend_from_slice(&chunk);
            } else if total > MAX_DRAIN || declared.is_some_and(|length| length > MAX_DRAIN) {
                break;
            }
        }
        if total <= MAX_BODY {
            return Ok(bytes);
        }
        let detail = format!("a body may have {MAX_BODY} bytes");
        Err(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "body_too_large", detail))
    };
    let late = || Problem::new(StatusCode::REQUEST_TIMEOUT, "late_body", "the body took too long to arrive");
    tokio::time::timeout(patience, gather).await.map_err(|_| late())?
}

fn parse(bytes: &[u8]) -> Result<Value, Problem> {
    serde_json::from_slice(bytes).map_err(|error| Problem::bad_request("bad_json", format!("the body is not JSON: {error}")))
}
