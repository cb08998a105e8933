//! The web client, inside the binary.

use std::hash::{DefaultHasher, Hash, Hasher};

use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use include_dir::{Dir, include_dir};

use super::Problem;
use super::query::Named;

static FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/static");

/// The page.
pub(super) async fn page(headers: HeaderMap) -> Response {
    file("index.html", &headers)
}

/// What the page loads.
pub(super) async fn asset(Named(path): Named, headers: HeaderMap) -> Response {
    file(&path, &headers)
}

fn file(path: &str, request: &HeaderMap) -> Response {
    let Some(file) = FILES.get_file(path) else { return Problem::not_found("such path").into_response() };
    let mut hasher = DefaultHasher::new();
    file.contents().hash(&mut hasher);
    let etag = format!("\"{:016x}\"", hasher.finish());
    // Asked for again each time, answered 304: a new binary is never met by an old page.
    let head = [(header::ETAG, etag.clone()), (header::CACHE_CONTROL, "no-cache".to_owned())];
    if matches_etag(request, &etag) {
        return (StatusCode::NOT_MODIFIED, head).into_response();
    }
    (head, [(header::CONTENT_TYPE, content_type(path))], file.contents()).into_response()
}

/// Whether `If-None-Match` names this tag. The comparison is weak (RFC 9110, 13.1.2).
pub(super) fn matches_etag(request: &HeaderMap, etag: &str) -> bool {
    let values = request.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    values.flat_map(|value| value.split(',')).map(str::trim).any(|tag| tag == "*" || tag.trim_start_matches("W/") == etag)
}

fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "txt" | "ts" => "text/plain; charset=utf-8",
        "json" => "application/json",
        "webmanifest" => "application/manifest+json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "wasm" => "application/wasm",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_its_type_and_a_tag_that_saves_sending_it_again() {
        let first = file("robots.txt", &HeaderMap::new());
        assert_eq!(first.status(), 200);
        assert_eq!(first.headers()[header::CONTENT_TYPE], "text/plain; charset=utf-8");
        let mut again = HeaderMap::new();
        again.insert(header::IF_NONE_MATCH, first.headers()[header::ETAG].clone());
        assert_eq!(file("robots.txt", &again).status(), 304);
    }

    #[test]
    fn no_path_leads_out_of_the_folder() {
        for path in ["../Cargo.toml", "/etc/passwd", "..", "", "robots.txt/.."] {
            assert_eq!(file(path, &HeaderMap::new()).status(), 404, "{path:?}");
        }
    }
}
