//! Sessions: made, listed, told what to do, ended.

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::body::Json as JsonBody;
use super::fields::{Fields, within};
use super::query::Named;
use super::{App, Problem, openapi, sources};
use crate::engine::{ClientId, Control, SessionInfo, Stats};
use crate::scene::{Refusal, Scene, presets};

/// Who changes a scene over HTTP.
pub(super) const API: ClientId = 0;

/// Most simulation steps in one request; more are asked for in several.
pub(super) const MAX_STEPS: u32 = 100_000;

/// A session that was made.
#[derive(Serialize, ToSchema)]
pub(super) struct NewSession {
    /// Its name, which cannot be guessed.
    id: String,
    /// Path of its WebSocket.
    ws: String,
}

/// Makes a session with a scene of its own.
#[utoipa::path(
    post, operation_id = "create_session", path = "/api/v1/sessions", tag = "sessions", request_body = openapi::NewSessionRequest,
    responses(
        (status = 201, body = NewSession, headers(("Location" = String, description = "Path of the session"))),
        (status = 422, description = "The scene is refused, or does not fit the adapter"),
        (status = 429, description = "There are as many sessions as the server runs"),
    )
)]
pub(super) async fn create(State(app): State<App>, JsonBody(body): JsonBody) -> Result<Response, Problem> {
    let scene = new_scene(&app, &body)?;
    let session = app.engine.create(None, scene).await?;
    let path = format!("{}/api/v1/sessions/{}", app.base, session.id());
    let new = NewSession { id: session.id().to_owned(), ws: format!("{path}/ws") };
    Ok((StatusCode::CREATED, [(header::LOCATION, path)], Json(new)).into_response())
}

fn new_scene(app: &App, body: &Value) -> Result<Scene, Problem> {
    let empty = json!({});
    let fields = Fields::of(if body.is_null() { &empty } else { body }, &["scene", "seed"])?;
    let document = match fields.raw("scene") {
        None => presets::default_document(),
        Some(Value::String(name)) => presets::get(name).cloned().ok_or_else(|| Refusal {
            code: "unknown_preset",
            path: "scene".to_owned(),
            text: format!("there is no preset {name:?}"),
        })?,
        Some(document) => document.clone(),
    };
    sources::check(&document, None, app.config.data.as_deref())?;
    let mut scene = Scene::from_json(&document)?;
    if let Some(seed) = fields.get("seed")? {
        scene.reseed(seed);
    }
    Ok(scene)
}

/// All sessions and how they fare.
#[utoipa::path(
    get, operation_id = "list_sessions", path = "/api/v1/sessions", tag = "sessions",
    responses((status = 200, body = [SessionInfo]))
)]
pub(super) async fn list(State(app): State<App>) -> Json<Vec<SessionInfo>> {
    let mut sessions = app.engine.list();
    for session in &mut sessions {
        session.clients = app.rooms.count(&session.id);
    }
    Json(sessions)
}

/// Ends a session; its clients are told. `main` cannot be ended.
#[utoipa::path(
    delete, operation_id = "delete_session", path = "/api/v1/sessions/{id}", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session")),
    responses(
        (status = 204),
        (status = 404),
        (status = 409, description = "The session is `main`"),
    )
)]
pub(super) async fn remove(State(app): State<App>, Named(id): Named) -> Result<StatusCode, Problem> {
    if id == "main" {
        return Err(Problem::new(StatusCode::CONFLICT, "main_session", "the session main lasts as long as the server"));
    }
    app.session(&id)?;
    app.engine.remove(&id).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Where a session stands after it was told something.
#[derive(Serialize, ToSchema)]
pub(super) struct ControlState {
    /// Revision of the scene.
    rev: u32,
    /// Whether the simulations run.
    playing: bool,
    stats: Stats,
}

/// Plays, pauses, steps, resets, undoes or redoes.
#[utoipa::path(
    post, operation_id = "control_session", path = "/api/v1/sessions/{id}/control", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session")),
    request_body = openapi::ControlRequest,
    responses(
        (status = 200, body = ControlState),
        (status = 404),
        (status = 422),
    )
)]
pub(super) async fn control(
    State(app): State<App>,
    Named(id): Named,
    JsonBody(body): JsonBody,
) -> Result<Json<ControlState>, Problem> {
    let session = app.session(&id)?;
    let fields = Fields::of(&body, &["cmd", "steps"])?;
    let Some(command) = command(&fields)? else {
        let text = "take and release are for clients of a stream".to_owned();
        return Err(Refusal { code: "not_allowed", path: "cmd".to_owned(), text }.into());
    };
    session.control(API, command).await?;
    let (rev, playing) = {
        let scene = session.scene();
        let scene = scene.borrow();
        (scene.revision, scene.playing)
    };
    Ok(Json(ControlState { rev, playing, stats: session.info().stats }))
}

/// The command under `cmd`, with its `steps`; `None` for `take` and `release`.
pub(super) fn command(fields: &Fields<'_>) -> Result<Option<Control>, Refusal> {
    let word: String = fields.need("cmd")?;
    let steps = fields.get("steps")?.map(|steps| within("steps", steps, 1, MAX_STEPS)).transpose()?;
    let command = match word.as_str() {
        "play" => Control::Play,
        "pause" => Control::Pause,
        "step" => Control::Step(steps.unwrap_or(1)),
        "reset" => Control::Reset,
        "undo" => Control::Undo,
        "redo" => Control::Redo,
        "take" | "release" => return Ok(None),
        _ => {
            let text = format!("{word:?} is not one of: play, pause, step, reset, undo, redo, take, release");
            return Err(Refusal { code: "unknown_choice", path: "cmd".to_owned(), text });
        }
    };
    Ok(Some(command))
}
