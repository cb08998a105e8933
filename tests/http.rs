//! The HTTP API from outside: what is where, and how it refuses.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use serde_json::{Value, json};
use support::{Request, Running, start, start_with, still_cloud};

async fn scene_of(server: &Running, id: &str) -> (String, Value) {
    let response = server.get(&format!("/api/v1/sessions/{id}/scene")).await;
    assert_eq!(response.status, 200);
    (response.header("etag").to_owned(), response.json())
}

#[tokio::test]
async fn the_page_comes_with_types_tags_and_a_policy_against_everything_foreign() {
    let server = start().await;
    let page = server.get("/").await;
    assert_eq!((page.status, page.header("content-type")), (200, "text/html; charset=utf-8"));
    assert_eq!(page.header("x-content-type-options"), "nosniff");
    assert_eq!(page.header("referrer-policy"), "no-referrer");
    let policy = page.header("content-security-policy");
    let socket = format!("connect-src 'self' ws://{0} wss://{0};", server.address);
    for part in ["default-src 'self';", "blob:", "object-src 'none'", "frame-ancestors 'self'", &socket] {
        assert!(policy.contains(part), "{part} in {policy}");
    }
    assert!(!policy.contains("unsafe"), "{policy}");
    let script = server.get("/socket.js").await;
    assert_eq!((script.status, script.header("content-type")), (200, "text/javascript; charset=utf-8"));
    let again = server.request("GET", "/socket.js").header("If-None-Match", script.header("etag")).send().await;
    assert_eq!((again.status, again.body.len()), (304, 0));
}

#[tokio::test]
async fn health_readiness_and_metrics_answer() {
    let server = start().await;
    assert_eq!(server.get("/healthz").await.status, 200);
    assert_eq!(server.get("/readyz").await.status, 200);
    let metrics = server.get("/metrics").await;
    assert!(metrics.header("content-type").starts_with("application/openmetrics-text"));
    let text = metrics.text();
    assert!(text.contains("tyndall_sessions ") && text.contains("tyndall_requests_total{code=\"2xx\"} 2"), "{text}");
}

#[tokio::test]
async fn the_server_says_what_it_is() {
    let server = start().await;
    let info = server.get("/api/v1/info").await.json();
    assert_eq!(info["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(info["adapter"]["type"], "software");
    for key in ["name", "backend", "driver"] {
        assert!(!info["adapter"][key].as_str().unwrap().is_empty(), "{key} in {info}");
    }
    assert_eq!(info["limits"]["message_bytes"], 65536);
    let schema = server.get("/api/v1/schema").await;
    assert_eq!(schema.json()["$schema"], "https://json-schema.org/draft/2020-12/schema");
    let presets = server.get("/api/v1/presets").await.json();
    let first = &presets[0];
    assert_eq!(first["name"], "tendrils");
    let document = server.get("/api/v1/presets/tendrils").await.json();
    assert_eq!((&document["about"]["title"], &document["about"]["best_step"]), (&first["title"], &first["best_step"]));
}

/// A request that is refused, and how.
type Slip = (Request, u16, &'static str);

fn slips(server: &Running, id: &str) -> Vec<Slip> {
    let of = |path: &str| format!("/api/v1/sessions/{id}/{path}");
    let ask = |method: &str, path: &str| server.request(method, path);
    let big = format!("{{\"about\":{{\"title\":\"{}\"}}}}", "x".repeat(1 << 20));
    let deep = format!("{}1{}", "[".repeat(10_000), "]".repeat(10_000));
    let patch = |body: &Value| ask("PATCH", &of("scene")).merge_patch(body);
    vec![
        (ask("GET", "/nowhere"), 404, "not_found"),
        (ask("GET", "/../Cargo.toml"), 404, "not_found"),
        (ask("GET", "/%2e%2e/Cargo.toml"), 404, "not_found"),
        (ask("GET", "/%ff"), 400, "bad_path"),
        (ask("GET", "/api/v1/sessions/%ff/scene"), 400, "bad_path"),
        (ask("GET", &of("frame?width=%ff")), 400, "out_of_range"),
        (ask("GET", "/api/v1/nowhere"), 404, "not_found"),
        (ask("GET", "/api/v1/presets/nothing"), 404, "not_found"),
        (ask("GET", "/api/v1/sessions/nobody/scene"), 404, "not_found"),
        (ask("DELETE", "/api/v1/sessions/nobody"), 404, "not_found"),
        (ask("DELETE", "/api/v1/sessions/main"), 409, "main_session"),
        (ask("DELETE", "/api/v1/info"), 405, "method_not_allowed"),
        (ask("POST", "/"), 405, "method_not_allowed"),
        (ask("PUT", &of("scene")).body("application/json", big), 413, "body_too_large"),
        (ask("PUT", &of("scene")).body("text/plain", "{}"), 415, "unsupported_media_type"),
        (ask("PATCH", &of("scene")).body("application/xml", "{}"), 415, "unsupported_media_type"),
        (ask("POST", "/api/v1/sessions").body("application/x-www-form-urlencoded", "scene=1"), 415, "unsupported_media_type"),
        (ask("PATCH", &of("scene")).body("application/merge-patch+json", "{\"a\":NaN}"), 400, "bad_json"),
        (ask("PATCH", &of("scene")).body("application/merge-patch+json", deep), 400, "bad_json"),
        (ask("PATCH", &of("scene")).body("application/merge-patch+json", ""), 400, "bad_json"),
        (patch(&json!({"camera": {"fov": 3}})), 422, "unknown_key"),
        (patch(&json!({"camera": {"fov_y": "wide"}})), 422, "wrong_type"),
        (patch(&json!({"camera": {"fov_y": 500}})), 422, "out_of_range"),
        (patch(&json!({"camera": {"fov_y": 1e39}})), 422, "not_finite"),
        (patch(&json!([1])), 422, "wrong_type"),
        (patch(&json!({})).header("If-Match", "12"), 400, "bad_if_match"),
        (patch(&json!({})).header("If-Match", "\"999\""), 412, "stale"),
        (ask("POST", "/api/v1/sessions").json(&json!({"scene": "nothing"})), 422, "unknown_preset"),
        (ask("POST", "/api/v1/sessions").json(&json!({"scen": "tendrils"})), 422, "unknown_key"),
        (ask("POST", "/api/v1/sessions").json(&json!({"seed": -1})), 422, "wrong_type"),
        (ask("POST", &of("control")).json(&json!({"cmd": "fly"})), 422, "unknown_choice"),
        (ask("POST", &of("control")).json(&json!({"steps": 3})), 422, "missing_key"),
        (ask("POST", &of("control")).json(&json!({"cmd": "take"})), 422, "not_allowed"),
        (ask("POST", &of("control")), 422, "wrong_type"),
        (ask("GET", &of("frame?width=1")), 400, "out_of_range"),
        (ask("GET", &of("frame?format=gif")), 400, "unknown_choice"),
        (ask("GET", &of("frame?size=3")), 400, "unknown_key"),
        (ask("GET", &of("export?volume=none")), 404, "not_found"),
        (ask("GET", &of("export?field=none")), 404, "not_found"),
        (ask("GET", &of("export?format=vdb")), 400, "unknown_choice"),
        (ask("GET", &of("ws")), 426, "bad_upgrade"),
    ]
}

#[tokio::test]
async fn every_error_is_a_problem_document() {
    let server = start().await;
    let session = server.session(&still_cloud(1)).await;
    for (index, (request, status, code)) in slips(&server, session.id()).into_iter().enumerate() {
        let response = request.send().await;
        assert_eq!(response.problem(), (status, code.to_owned()), "slip {index}: {}", response.text());
        assert_eq!(response.header("x-content-type-options"), "nosniff");
        if status == 405 {
            assert!(response.header("allow").contains("GET"));
        }
    }
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_refused_patch_names_its_key_and_changes_nothing() {
    let server = start().await;
    let session = server.session(&still_cloud(1)).await;
    let before = scene_of(&server, session.id()).await;
    let path = format!("/api/v1/sessions/{}/scene", session.id());
    let patch = json!({"display": {"exposure": 1}, "volumes": {"main": {"medium": {"sigma_t": -1}}}});
    let refused = server.request("PATCH", &path).merge_patch(&patch).send().await;
    assert_eq!(refused.problem(), (422, "out_of_range".to_owned()));
    assert_eq!(refused.json()["path"], "volumes.main.medium.sigma_t");
    assert_eq!(scene_of(&server, session.id()).await, before);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_session_is_made_listed_and_ended() {
    let server = start().await;
    let made = server.request("POST", "/api/v1/sessions").json(&json!({"scene": still_cloud(1), "seed": 7})).send().await;
    assert_eq!(made.status, 201, "{}", made.text());
    let body = made.json();
    let id = body["id"].as_str().unwrap();
    assert!(id.len() >= 22, "{id} can be guessed");
    assert_eq!(body["ws"], format!("/api/v1/sessions/{id}/ws"));
    assert_eq!(made.header("location"), format!("/api/v1/sessions/{id}"));
    assert_eq!(scene_of(&server, id).await.1["render"]["seed"], 7);
    let listed = |sessions: Value| sessions.as_array().unwrap().iter().filter(|session| session["id"] == id).count();
    assert_eq!(listed(server.get("/api/v1/sessions").await.json()), 1);
    assert_eq!(server.request("DELETE", &format!("/api/v1/sessions/{id}")).send().await.status, 204);
    assert_eq!(listed(server.get("/api/v1/sessions").await.json()), 0);
    assert_eq!(server.get(&format!("/api/v1/sessions/{id}/scene")).await.status, 404);
}

#[tokio::test]
async fn a_change_applies_to_the_revision_that_if_match_names_and_to_no_other() {
    let server = start().await;
    let session = server.session(&still_cloud(1)).await;
    let path = format!("/api/v1/sessions/{}/scene", session.id());
    let (first, _) = scene_of(&server, session.id()).await;
    let patch = json!({"display": {"exposure": 1}});
    let done = server.request("PATCH", &path).merge_patch(&patch).header("If-Match", &first).send().await;
    assert_eq!((done.status, done.json()["display"]["exposure"].as_f64()), (200, Some(1.0)));
    let second = done.header("etag").to_owned();
    assert_ne!(second, first);
    let other = json!({"display": {"exposure": 2}});
    for stale in [first.clone(), format!("W/{second}"), "\"abc\"".to_owned()] {
        let refused = server.request("PATCH", &path).merge_patch(&other).header("If-Match", &stale).send().await;
        assert_eq!(refused.problem(), (412, "stale".to_owned()), "{stale}");
    }
    assert_eq!(scene_of(&server, session.id()).await.1["display"]["exposure"], 1);
    let listed = format!("\"77\", {second}");
    for fresh in [listed.as_str(), "*"] {
        let done = server.request("PATCH", &path).merge_patch(&other).header("If-Match", fresh).send().await;
        assert_eq!(done.status, 200, "{fresh}: {}", done.text());
        let again = server.request("GET", &path).header("If-None-Match", done.header("etag")).send().await;
        assert_eq!(again.status, 304);
    }
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_merge_patch_follows_rfc_7396_and_a_put_replaces_all() {
    let server = start().await;
    let session = server.session(&still_cloud(1)).await;
    let path = format!("/api/v1/sessions/{}/scene", session.id());
    let patched = |body: Value| server.request("PATCH", &path).merge_patch(&body).send();
    let set = patched(json!({"volumes": {"main": {"medium": {"sigma_t": 7, "phase": {"type": "hg", "g": 0.5}}}}})).await.json();
    assert_eq!(set["volumes"]["main"]["medium"]["sigma_t"], 7);
    assert_eq!(set["volumes"]["main"]["source"]["type"], "cloud");
    let reset = patched(json!({"volumes": {"main": {"medium": {"sigma_t": null}}}})).await.json();
    assert_eq!(reset["volumes"]["main"]["medium"]["sigma_t"], 40);
    assert_eq!(reset["volumes"]["main"]["medium"]["phase"]["g"], 0.5);
    let drift = patched(json!({"volumes": {"main": {"medium": {"phase": {"type": "drift"}}}}})).await.json();
    assert_eq!(drift["volumes"]["main"]["medium"]["phase"]["g"], 0);
    let put = server.request("PUT", &path).json(&still_cloud(3)).send().await;
    assert_eq!(put.status, 200);
    assert_eq!(put.json()["render"]["spp"], 3);
    assert_eq!(put.json()["volumes"]["main"]["medium"]["phase"]["type"], "isotropic");
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_session_steps_and_undoes_as_it_is_told() {
    let server = start().await;
    let session = server.session(&support::growing()).await;
    let path = format!("/api/v1/sessions/{}/", session.id());
    let control = |body: Value| server.request("POST", &format!("{path}control")).json(&body).send();
    let paused = control(json!({"cmd": "pause"})).await.json();
    assert_eq!(paused["playing"], false);
    control(json!({"cmd": "reset"})).await;
    let stepped = control(json!({"cmd": "step", "steps": 5})).await;
    assert_eq!((stepped.status, stepped.json()["stats"]["steps"].as_u64()), (200, Some(5)));
    let patch = json!({"display": {"exposure": 3}});
    server.request("PATCH", &format!("{path}scene")).merge_patch(&patch).send().await;
    control(json!({"cmd": "undo"})).await;
    assert_eq!(scene_of(&server, session.id()).await.1["display"]["exposure"], 0);
    control(json!({"cmd": "redo"})).await;
    assert_eq!(scene_of(&server, session.id()).await.1["display"]["exposure"], 3);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_picture_comes_in_the_format_and_size_that_was_asked_for() {
    let server = start().await;
    let session = server.session(&still_cloud(1)).await;
    let picture = format!("/api/v1/sessions/{}/frame?width=48&height=32&spp=2", session.id());
    let frame = |query: &str| server.request("GET", &format!("{picture}{query}")).send();
    for (format, media_type) in [("png", "image/png"), ("jpg", "image/jpeg")] {
        let response = frame(&format!("&format={format}")).await;
        assert_eq!((response.status, response.header("content-type")), (200, media_type), "{}", response.text());
        let picture = image::load_from_memory(&response.body).unwrap();
        assert_eq!((picture.width(), picture.height()), (48, 32));
    }
    assert_eq!(frame("").await.body, frame("&format=png").await.body, "the same request makes the same picture");
    let exr = frame("&format=exr").await;
    assert_eq!((exr.status, exr.header("content-type")), (200, "image/x-exr"));
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &exr.body).unwrap();
    let read = exr::prelude::read_all_flat_layers_from_file(file.path()).unwrap();
    let layer = &read.layer_data[0];
    assert_eq!(layer.size, exr::prelude::Vec2(48, 32));
    let names: Vec<String> = layer.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "R"]);
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_field_comes_as_nrrd_and_as_npy() {
    let server = start().await;
    let session = server.session(&support::growing()).await;
    let export = |query: &str| server.request("GET", &format!("/api/v1/sessions/{}/export{query}", session.id())).send();
    let nrrd = export("").await;
    assert!(nrrd.body.starts_with(b"NRRD000"), "{}", nrrd.text());
    assert_eq!(nrrd.header("content-disposition"), "attachment; filename=\"main-density.nrrd\"");
    let npy = export("?volume=main&field=density&format=npy").await;
    assert!(npy.body.starts_with(b"\x93NUMPY"));
    assert!(npy.text().contains("(16, 16, 16)"));
    server.engine.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn the_description_lists_every_route_and_its_references_lead_somewhere() {
    let server = start().await;
    let document = server.get("/api/v1/openapi.json").await.json();
    assert!(document["openapi"].as_str().unwrap().starts_with("3."));
    let listed: Vec<String> = document["paths"]
        .as_object()
        .unwrap()
        .iter()
        .flat_map(|(path, item)| item.as_object().unwrap().keys().map(move |method| format!("{method} {path}")))
        .collect();
    let promised = "get /healthz, get /readyz, get /metrics, get /api/v1/openapi.json, get /api/v1/schema, get /api/v1/info, \
        get /api/v1/presets, get /api/v1/presets/{name}, post /api/v1/sessions, get /api/v1/sessions, \
        delete /api/v1/sessions/{id}, get /api/v1/sessions/{id}/scene, put /api/v1/sessions/{id}/scene, \
        patch /api/v1/sessions/{id}/scene, post /api/v1/sessions/{id}/control, get /api/v1/sessions/{id}/frame, \
        get /api/v1/sessions/{id}/export, get /api/v1/sessions/{id}/ws";
    for route in promised.split(", ") {
        assert!(listed.iter().any(|known| known == route), "{route} in {listed:?}");
    }
    let mut references = Vec::new();
    collect_references(&document, &mut references);
    assert!(references.iter().any(|reference| reference == "#/components/schemas/Scene"));
    for reference in references {
        assert!(document.pointer(reference.trim_start_matches('#')).is_some(), "{reference}");
    }
    let camera = document.pointer("/components/schemas/Scene/properties/camera/properties/fov_y/unit");
    assert_eq!(camera, Some(&json!("°")));
    let mut ids = std::collections::BTreeSet::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            assert!(operation["summary"].is_string(), "{method} {path}");
            assert!(ids.insert(operation["operationId"].as_str().unwrap()), "{method} {path} has another's id");
            for (status, response) in operation["responses"].as_object().unwrap() {
                assert!(response["description"].is_string(), "{method} {path} {status}");
            }
        }
    }
}

fn collect_references(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(object) => {
            found.extend(object.get("$ref").and_then(Value::as_str).map(str::to_owned));
            object.values().for_each(|value| collect_references(value, found));
        }
        Value::Array(items) => items.iter().for_each(|value| collect_references(value, found)),
        _ => {}
    }
}

#[tokio::test]
async fn under_a_base_path_everything_is_there_and_nothing_elsewhere() {
    let server = start_with(|config| config.base_path = "/user/me/".to_owned()).await;
    let folder = server.get("/user/me").await;
    assert_eq!((folder.status, folder.header("location")), (308, "/user/me/"));
    assert_eq!(server.get("/user/me/").await.header("content-type"), "text/html; charset=utf-8");
    assert_eq!(server.get("/user/me/socket.js").await.status, 200);
    assert_eq!(server.get("/user/me/api/v1/info").await.status, 200);
    assert_eq!(server.get("/user/me/healthz").await.status, 200);
    assert_eq!(server.get("/healthz").await.status, 200);
    assert_eq!(server.get("/api/v1/info").await.problem(), (404, "not_found".to_owned()));
    assert_eq!(server.get("/user/me/api/v1/openapi.json").await.json()["servers"][0]["url"], "/user/me");
    let made = server.request("POST", "/user/me/api/v1/sessions").json(&json!({"scene": still_cloud(1)})).send().await.json();
    let id = made["id"].as_str().unwrap();
    assert_eq!(made["ws"], format!("/user/me/api/v1/sessions/{id}/ws"));
    server.engine.remove(id).await.unwrap();
}
