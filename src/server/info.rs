//! What the server is, can and offers; whether it is well.

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::body::MAX_BODY;
use super::query::Named;
use super::{App, Problem, metrics, openapi, socket, still};
use crate::scene::{Param, Scene, presets};
use crate::stream::WINDOW;

/// The server: its version, its adapter, its limits.
#[derive(Serialize, ToSchema)]
pub(super) struct Info {
    /// Version of the program.
    version: &'static str,
    adapter: Adapter,
    limits: Limits,
}

/// What computes.
#[derive(Serialize, ToSchema)]
struct Adapter {
    /// The adapter's own name.
    name: String,
    /// `vulkan`, `metal`, `dx12` or `gl`.
    backend: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    #[serde(rename = "type")]
    kind: &'static str,
    /// Driver and its version.
    driver: String,
}

/// What the server refuses to go beyond.
#[derive(Serialize, ToSchema)]
struct Limits {
    /// Bytes of one buffer on the adapter.
    buffer_bytes: u64,
    /// Bytes that a kernel can see of one buffer; a simulation's field must fit.
    binding_bytes: u64,
    /// Voxels along an edge of a 3D texture.
    texture_3d: u32,
    /// Bytes of a request's body.
    body_bytes: usize,
    /// Bytes of a message over a WebSocket.
    message_bytes: usize,
    /// Pixels along an edge of a picture, least and most.
    picture_edge: [u32; 2],
    /// Pixels of a picture made by itself.
    picture_pixels: u64,
    /// Samples per pixel of a picture made by itself.
    picture_spp: u32,
    /// Samples of a picture made by itself, over all pixels.
    picture_samples: u64,
    /// Frames that a client may have unacknowledged.
    window: usize,
    /// Connections open at once.
    connections: usize,
}

/// The server, its adapter and its limits.
#[utoipa::path(
    get, operation_id = "get_info", path = "/api/v1/info", tag = "server",
    responses((status = 200, body = Info))
)]
pub(super) async fn info(State(app): State<App>) -> Json<Info> {
    let gpu = app.engine.gpu();
    let adapter = gpu.info();
    let kind = match adapter.device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    };
    Json(Info {
        version: env!("CARGO_PKG_VERSION"),
        adapter: Adapter {
            name: adapter.name.clone(),
            backend: adapter.backend.to_string(),
            kind,
            driver: format!("{} {}", adapter.driver, adapter.driver_info).trim().to_owned(),
        },
        limits: Limits {
            buffer_bytes: gpu.limits().max_buffer_size,
            binding_bytes: gpu.largest_binding(),
            texture_3d: gpu.limits().max_texture_dimension_3d,
            body_bytes: MAX_BODY,
            message_bytes: socket::MAX_MESSAGE,
            picture_edge: [still::MIN_EDGE, still::MAX_EDGE],
            picture_pixels: still::MAX_PIXELS,
            picture_spp: still::MAX_SPP,
            picture_samples: still::MAX_SAMPLES,
            window: WINDOW,
            connections: app.config.max_connections,
        },
    })
}

/// JSON Schema (2020-12) of the scene document.
#[utoipa::path(
    get, operation_id = "get_schema", path = "/api/v1/schema", tag = "server",
    responses((status = 200, content_type = "application/schema+json"))
)]
pub(super) async fn schema() -> Response {
    ([(header::CONTENT_TYPE, "application/schema+json")], Scene::json_schema().to_string()).into_response()
}

/// This description of the HTTP API.
#[utoipa::path(
    get, operation_id = "get_openapi", path = "/api/v1/openapi.json", tag = "server",
    responses((status = 200, content_type = "application/json"))
)]
pub(super) async fn openapi(State(app): State<App>) -> Json<Value> {
    Json(openapi::under(&app.base))
}

/// A scene that the server brings along.
#[derive(Serialize, ToSchema)]
pub(super) struct PresetInfo {
    /// The name that stands for the scene in requests.
    name: &'static str,
    /// A name to show.
    title: String,
    /// A sentence on the look.
    description: String,
    /// Simulation step at which the scene is at its best; null: it does not matter.
    best_step: Option<u32>,
}

/// The scenes that the server brings along.
#[utoipa::path(
    get, operation_id = "list_presets", path = "/api/v1/presets", tag = "server",
    responses((status = 200, body = [PresetInfo]))
)]
pub(super) async fn preset_list() -> Json<Vec<PresetInfo>> {
    let about = |document: &Value, key: &str| document.get("about").and_then(|about| about.get(key)).cloned().unwrap_or_default();
    let text = |value: Value| value.as_str().unwrap_or_default().to_owned();
    let preset = |(name, document): (&'static str, &Value)| PresetInfo {
        name,
        title: text(about(document, "title")),
        description: text(about(document, "description")),
        best_step: about(document, "best_step").as_u64().and_then(|step| u32::try_from(step).ok()),
    };
    Json(presets::all().map(preset).collect())
}

/// The scene document of a preset, every key written out.
#[utoipa::path(
    get, operation_id = "get_preset", path = "/api/v1/presets/{name}", tag = "server",
    params(("name" = String, Path, description = "Name of the preset")),
    responses((status = 200, body = openapi::Scene), (status = 404))
)]
pub(super) async fn preset(Named(name): Named) -> Result<Json<Value>, Problem> {
    let document = presets::get(&name).ok_or_else(|| Problem::not_found("preset of this name"))?;
    Ok(Json(Scene::from_json(document)?.write()))
}

/// Whether the process answers.
#[utoipa::path(get, path = "/healthz", tag = "health", responses((status = 200, body = String)))]
pub(super) async fn healthz() -> &'static str {
    "ok\n"
}

/// Whether the engine runs and the session `main` is there.
#[utoipa::path(
    get, path = "/readyz", tag = "health",
    responses((status = 200, body = String), (status = 503))
)]
pub(super) async fn readyz(State(app): State<App>) -> Result<&'static str, Problem> {
    let wait = |detail: &'static str| Problem::new(StatusCode::SERVICE_UNAVAILABLE, "not_ready", detail);
    if *app.stopping.borrow() || !app.engine.is_running() {
        return Err(wait("the engine has stopped"));
    }
    app.engine.session("main").map(|_| "ready\n").ok_or_else(|| wait("the session main is not there yet"))
}

/// Counters and gauges in the Prometheus text format (`OpenMetrics`).
#[utoipa::path(
    get, operation_id = "get_metrics", path = "/metrics", tag = "health",
    responses((status = 200, body = String, content_type = "application/openmetrics-text"))
)]
pub(super) async fn metrics(State(app): State<App>) -> Result<Response, Problem> {
    let failed = |_| Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "internal", "the metrics could not be written");
    let text = app.metrics.text(&app.engine.list()).map_err(failed)?;
    Ok(([(header::CONTENT_TYPE, metrics::CONTENT_TYPE)], text).into_response())
}

/// What is nowhere.
pub(super) async fn unknown_path() -> Problem {
    Problem::not_found("such path")
}

/// What is somewhere, but not with this method; the router adds `Allow`.
pub(super) async fn unknown_method() -> Problem {
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, "method_not_allowed", "this path has no such method; `Allow` names those it has")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[tokio::test]
    async fn each_preset_is_listed_with_a_title_and_reads_as_a_scene() {
        let presets = preset_list().await.0;
        assert_eq!(presets[0].name, presets::DEFAULT);
        for listed in presets {
            assert!(!listed.title.is_empty(), "{}", listed.name);
            let document = preset(Named(listed.name.to_owned())).await.unwrap().0;
            assert_eq!(document["about"]["best_step"], json!(listed.best_step));
        }
    }
}
