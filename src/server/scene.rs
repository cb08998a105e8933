//! A session's scene as a resource: read, replaced, patched, with its revision as `ETag`.

use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::assets::matches_etag;
use super::body::{Json, MergePatch};
use super::query::Named;
use super::sessions::API;
use super::{App, Problem, openapi, sources};
use crate::engine::{SceneState, Session};
use crate::scene::history::Change;

/// The scene, every key written out.
#[utoipa::path(
    get, operation_id = "get_scene", path = "/api/v1/sessions/{id}/scene", tag = "scene",
    params(("id" = String, Path, description = "Name of the session")),
    responses(
        (status = 200, body = openapi::Scene, headers(("ETag" = String, description = "The revision, in quotes"))),
        (status = 304, description = "If-None-Match names the revision"),
        (status = 404),
    )
)]
pub(super) async fn read(State(app): State<App>, Named(id): Named, headers: HeaderMap) -> Result<Response, Problem> {
    let state = app.session(&id)?.scene().borrow().clone();
    if matches_etag(&headers, &etag(state.revision)) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, etag(state.revision))]).into_response());
    }
    Ok(document(&state))
}

/// Puts another document in place of the scene; a key that it does not name has its default.
#[utoipa::path(
    put, operation_id = "put_scene", path = "/api/v1/sessions/{id}/scene", tag = "scene",
    params(
        ("id" = String, Path, description = "Name of the session"),
        ("If-Match" = Option<String>, Header, description = "Only to this revision"),
    ),
    request_body = openapi::Scene,
    responses(
        (status = 200, description = "The scene as it is now", body = openapi::Scene),
        (status = 412, description = "The scene is at another revision"),
        (status = 422, description = "The document is refused"),
    )
)]
pub(super) async fn replace(
    State(app): State<App>,
    Named(id): Named,
    headers: HeaderMap,
    Json(body): Json,
) -> Result<Response, Problem> {
    let session = app.session(&id)?;
    let if_match = precondition(&headers, &session)?;
    check_sources(&app, &session, &body)?;
    let change = session.put(API, body, if_match).await?;
    Ok(document(&after(&session, &change).await))
}

/// Applies a merge patch (RFC 7396): `null` restores a default, and a `type` that changes drops the old type's keys.
#[utoipa::path(
    patch, operation_id = "patch_scene", path = "/api/v1/sessions/{id}/scene", tag = "scene",
    params(
        ("id" = String, Path, description = "Name of the session"),
        ("If-Match" = Option<String>, Header, description = "Only to this revision"),
    ),
    request_body(content = serde_json::Value, content_type = "application/merge-patch+json"),
    responses(
        (status = 200, description = "The scene as it is now", body = openapi::Scene),
        (status = 412, description = "The scene is at another revision"),
        (status = 415),
        (status = 422, description = "The patch is refused"),
    )
)]
pub(super) async fn patch(
    State(app): State<App>,
    Named(id): Named,
    headers: HeaderMap,
    MergePatch(body): MergePatch,
) -> Result<Response, Problem> {
    let session = app.session(&id)?;
    let if_match = precondition(&headers, &session)?;
    check_sources(&app, &session, &body)?;
    let change = session.patch(API, body, None, true, if_match).await?;
    Ok(document(&after(&session, &change).await))
}

/// Refuses files that the network may not name.
fn check_sources(app: &App, session: &Session, body: &serde_json::Value) -> Result<(), Problem> {
    let current = session.scene().borrow().document.clone();
    Ok(sources::check(body, Some(&current), app.config.data.as_deref())?)
}

fn etag(revision: u32) -> String {
    format!("\"{revision}\"")
}

fn document(state: &SceneState) -> Response {
    let head = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::ETAG, etag(state.revision)),
        (header::CACHE_CONTROL, "no-cache".to_owned()),
        (HeaderName::from_static("accept-patch"), "application/merge-patch+json".to_owned()),
    ];
    (head, state.document.to_string()).into_response()
}

/// The scene once it shows a change; it may show later ones as well.
async fn after(session: &Session, change: &Change) -> SceneState {
    let mut scene = session.scene();
    let shown = scene.wait_for(|state| state.revision.wrapping_sub(change.revision) < u32::MAX / 2);
    // The engine shows a change before it answers; waiting without an end would lend a fault there to the client.
    let state = match tokio::time::timeout(Duration::from_secs(2), shown).await {
        Ok(Ok(state)) => Some(state.clone()),
        _ => None,
    };
    state.unwrap_or_else(|| session.scene().borrow().clone())
}

/// The one revision that `If-Match` lets a change apply to; `None`: any.
fn precondition(headers: &HeaderMap, session: &Session) -> Result<Option<u32>, Problem> {
    let current = session.scene().borrow().revision;
    let stale = || Problem::new(StatusCode::PRECONDITION_FAILED, "stale", format!("the scene is at revision {current}"));
    match if_match(headers)? {
        None => Ok(None),
        Some(revisions) => revisions.into_iter().find(|revision| *revision == current).map(Some).ok_or_else(stale),
    }
}

/// The revisions that `If-Match` names (RFC 9110, 13.1.1: the comparison is strong, so a weak tag names none);
/// `None` where there is no such header, or it is `*`.
fn if_match(headers: &HeaderMap) -> Result<Option<Vec<u32>>, Problem> {
    let malformed = || {
        let detail = "If-Match must be `*` or revisions in quotes, such as \"12\"";
        Problem::bad_request("bad_if_match", detail)
    };
    let values: Vec<&str> = headers
        .get_all(header::IF_MATCH)
        .iter()
        .map(|value| value.to_str().map_err(|_| malformed()))
        .collect::<Result<_, _>>()?;
    if values.is_empty() || values.iter().any(|value| value.trim() == "*") {
        return Ok(None);
    }
    let mut revisions = Vec::new();
    for tag in values.iter().flat_map(|value| value.split(',')).map(str::trim) {
        let opaque = tag.strip_prefix("W/").unwrap_or(tag);
        let inner = opaque.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).filter(|inner| !inner.contains('"'));
        let inner = inner.ok_or_else(malformed)?;
        if opaque.len() == tag.len() {
            revisions.extend(inner.parse::<u32>().ok().filter(|revision| revision.to_string() == inner));
        }
    }
    Ok(Some(revisions))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(value: &str) -> Result<Option<Vec<u32>>, u16> {
        let mut headers = HeaderMap::new();
        headers.insert(header::IF_MATCH, value.parse().unwrap());
        if_match(&headers).map_err(|problem| problem.status().as_u16())
    }

    #[test]
    fn if_match_names_revisions_or_is_malformed() {
        assert!(if_match(&HeaderMap::new()).unwrap().is_none());
        assert_eq!(parsed("*"), Ok(None));
        assert_eq!(parsed("\"12\""), Ok(Some(vec![12])));
        assert_eq!(parsed("\"1\", \"2\""), Ok(Some(vec![1, 2])));
        assert_eq!(parsed("\"abc\", \"007\", W/\"3\""), Ok(Some(vec![])));
        for bad in ["", "12", "\"12", "12\"", "\"", "\"1\" \"2\"", "w/\"1\"", "\"1\",", "'1'"] {
            assert_eq!(parsed(bad), Err(400), "{bad:?}");
        }
    }
}
