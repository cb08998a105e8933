//! A volume's field as a file.

use axum::extract::State;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use super::query::{Named, Params};
use super::{App, Problem};
use crate::export::{write_npy, write_nrrd};

/// A volume's field as it is now, indexed `[z][y][x]`, in its own type.
#[utoipa::path(
    get, operation_id = "export_field", path = "/api/v1/sessions/{id}/export", tag = "pictures",
    params(
        ("id" = String, Path, description = "Name of the session"),
        ("volume" = Option<String>, Query, description = "Name of the volume; main if absent"),
        ("field" = Option<String>, Query, description = "Name of the field; density if absent"),
        ("format" = Option<String>, Query, description = "nrrd or npy; nrrd if absent"),
    ),
    responses(
        (status = 200, body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 400),
        (status = 404, description = "There is no such session, volume or field"),
    )
)]
pub(super) async fn field(State(app): State<App>, Named(id): Named, uri: Uri) -> Result<Response, Problem> {
    let session = app.session(&id)?;
    let params = Params::of(&uri, &["volume", "field", "format"])?;
    let volume = params.text("volume").unwrap_or("main");
    let name = params.text("field").unwrap_or("density");
    let (format, write): (_, fn(&_) -> _) = match params.text("format") {
        None | Some("nrrd") => ("nrrd", write_nrrd),
        Some("npy") => ("npy", write_npy),
        Some(other) => {
            let detail = format!("`format` must be nrrd or npy, not `{other}`");
            return Err(Problem::bad_request("unknown_choice", detail).at("format"));
        }
    };
    let field = session.export(volume, name).await?;
    let file = format!("attachment; filename=\"{}-{}.{format}\"", plain(volume), plain(name));
    let bytes = tokio::task::spawn_blocking(move || write(&field)).await.map_err(|panic| {
        tracing::error!(%panic, "a field could not be written");
        Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "internal", "the field could not be written")
    })?;
    let head = [(header::CONTENT_TYPE, "application/octet-stream"), (header::CONTENT_DISPOSITION, file.as_str())];
    Ok((head, bytes).into_response())
}

/// What may stand in a file's name.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-')).collect()
}
