//! The description of the HTTP API, made from the handlers themselves, with the scene's own schema inside.

use axum::http::StatusCode;
use serde_json::{Value, json};
use utoipa::{OpenApi, ToSchema};

use super::routes;
use crate::scene::Scene as SceneDocument;

/// Why a request was not done (RFC 9457).
#[derive(ToSchema)]
#[expect(dead_code, reason = "describes what `problem` writes")]
pub(super) struct Problem {
    /// A URI that stands for the kind of problem.
    r#type: String,
    /// The kind in words.
    title: String,
    /// The HTTP status.
    status: u16,
    /// What happened, in a sentence.
    detail: String,
    /// The kind in one word: `unknown_key`, `out_of_range`, …
    code: String,
    /// The key at fault, joined by dots: `volumes.main.medium.sigma_t`.
    path: Option<String>,
}

/// Stands for the scene document, whose schema the scene itself gives.
#[derive(ToSchema)]
#[schema(value_type = Object)]
#[expect(dead_code, reason = "describes what the scene reads and writes")]
pub(super) struct Scene(Value);

/// What a new session starts from.
#[derive(ToSchema)]
#[expect(dead_code, reason = "describes what `sessions` reads")]
pub(super) struct NewSessionRequest {
    /// Name of a preset, or a scene document; the default preset if absent.
    scene: Option<Value>,
    /// Fixes the sampling and all simulations.
    seed: Option<u32>,
}

/// What a session is told to do.
#[derive(ToSchema)]
#[expect(dead_code, reason = "describes what `sessions` reads")]
pub(super) struct ControlRequest {
    /// `play`, `pause`, `step`, `reset`, `undo` or `redo`.
    cmd: String,
    /// How many steps `step` takes; 1 if absent.
    #[schema(minimum = 1, maximum = 100_000)]
    steps: Option<u32>,
}

/// What no route brings along by itself.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Tyndall",
        description = "Grows living volumes, path traces them and streams the converging picture. On an address that other \
                       machines reach, or with a token, every path under /api asks for it."
    ),
    components(schemas(Problem, Scene))
)]
pub(super) struct Description;

/// The description of a server that is shown under `/`.
pub fn document() -> Value {
    under("")
}

/// The description of a server that is shown under a base path.
pub(super) fn under(base: &str) -> Value {
    let (_, api) = routes::api().split_for_parts();
    let mut document = serde_json::to_value(&api).unwrap_or_default();
    document["servers"] = json!([{"url": if base.is_empty() { "/" } else { base }}]);
    document["components"]["schemas"]["Scene"] = scene_schema();
    document["components"]["securitySchemes"] = json!({
        "bearer": {"type": "http", "scheme": "bearer"},
        "query": {"type": "apiKey", "in": "query", "name": "token"},
    });
    document["security"] = json!([{}, {"bearer": []}, {"query": []}]);
    for operation in operations(&mut document) {
        describe_responses(operation);
    }
    document
}

/// All operations of a description.
fn operations(document: &mut Value) -> impl Iterator<Item = &mut Value> {
    let paths = document["paths"].as_object_mut().into_iter().flat_map(serde_json::Map::values_mut);
    paths.filter_map(Value::as_object_mut).flat_map(serde_json::Map::values_mut)
}

/// Says of every error, those that an operation names and those that any can end in, that it is a problem, and of every
/// response what its status means, where it says nothing itself.
fn describe_responses(operation: &mut Value) {
    let content = json!({"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}});
    let Some(responses) = operation["responses"].as_object_mut() else { return };
    for (status, response) in responses.iter_mut() {
        if status.starts_with(['4', '5']) {
            response["content"] = content.clone();
        }
        let meaning = status.parse::<StatusCode>().ok().and_then(|status| status.canonical_reason());
        if response["description"].is_null() {
            response["description"] = meaning.unwrap_or(status).into();
        }
    }
    responses.insert("default".into(), json!({"description": "The request was not done", "content": content}));
}

/// The scene's schema as a component: what a component may not say of itself is left out.
fn scene_schema() -> Value {
    let mut schema = SceneDocument::json_schema();
    if let Some(object) = schema.as_object_mut() {
        object.shift_remove("$schema");
    }
    schema
}
