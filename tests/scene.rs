//! The scene document: what it takes, what it refuses and where, how it is patched, undone and described.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "a test that panics has failed; numbers come back as they were given")]

use serde_json::{Value, json};
use tyndall::scene::{History, Refusal, Scene, presets};

fn read(document: &Value) -> Result<Scene, Refusal> {
    Scene::from_json(document)
}

fn refusal(document: &Value) -> (String, &'static str) {
    let refusal = read(document).unwrap_err();
    (refusal.path, refusal.code)
}

fn cube() -> Value {
    json!({"volumes": {"main": {"source": {"type": "homogeneous"}}}})
}

#[test]
fn a_document_written_out_reads_back_the_same() {
    for (name, document) in presets::all() {
        let scene = read(document).unwrap();
        assert_eq!(read(&scene.to_json()).unwrap(), scene, "{name}");
    }
}

#[test]
fn a_document_without_volumes_is_the_default_preset_with_its_own_keys_on_top() {
    let default = read(presets::get(presets::DEFAULT).unwrap()).unwrap();
    assert_eq!(read(&json!({})).unwrap(), default);
    let wide = read(&json!({"camera": {"fov_y": 77}})).unwrap();
    assert_eq!(wide.camera.fov_y, 77.0);
    assert_eq!(wide.volumes, default.volumes);
    assert_eq!(wide.camera.position, default.camera.position);
}

#[test]
fn a_document_with_volumes_inherits_nothing_from_a_preset() {
    let scene = read(&cube()).unwrap();
    assert_eq!(scene.to_json()["light"]["sky"], json!({"type": "constant", "radiance": [0.6, 0.6, 0.6]}));
    assert_eq!(scene.to_json()["volumes"]["main"]["medium"]["emission"], json!([0, 0, 0]));
    assert_eq!(scene.to_json()["render"]["blend"], Value::Null);
}

#[test]
fn what_is_wrong_is_refused_by_its_path() {
    let medium = |medium: Value| json!({"volumes": {"main": {"medium": medium}}});
    let source = |source: Value| json!({"volumes": {"main": {"source": source}}});
    let at = |key: &str| format!("volumes.main.{key}");
    for (document, path, code) in [
        (json!([]), String::new(), "wrong_type"),
        (json!({"camara": {}}), "camara".into(), "unknown_key"),
        (json!({"volumes": {"a b": {}}}), "volumes.a b".into(), "bad_name"),
        (medium(json!({"sigma": 1})), at("medium.sigma"), "unknown_key"),
        (medium(json!({"sigma_t": -1})), at("medium.sigma_t"), "out_of_range"),
        (medium(json!({"sigma_t": 1e39})), at("medium.sigma_t"), "not_finite"),
        (medium(json!({"sigma_t": "40"})), at("medium.sigma_t"), "wrong_type"),
        (medium(json!({"albedo": [1, 1]})), at("medium.albedo"), "wrong_type"),
        (medium(json!({"albedo": [1, 1, 1.5]})), at("medium.albedo"), "out_of_range"),
        (medium(json!({"law": "linear"})), at("medium.law"), "unknown_choice"),
        (medium(json!({"phase": {"g": 1}})), at("medium.phase.g"), "out_of_range"),
        (medium(json!({"window": [3, 3]})), at("medium.window"), "out_of_range"),
        (medium(json!({"window": "all"})), at("medium.window"), "unknown_choice"),
        (source(json!({"type": "smoke"})), at("source.type"), "unknown_choice"),
        (source(json!({"type": "file"})), at("source.path"), "missing_key"),
        (source(json!({"type": "physarum", "agents": 1.5})), at("source.agents"), "wrong_type"),
        (source(json!({"type": "physarum", "agents": -1})), at("source.agents"), "wrong_type"),
        (source(json!({"type": "physarum", "size": [128, 2, 128]})), at("source.size"), "out_of_range"),
        (json!({"volumes": {"main": {"transform": {"scale": [1, 0, 1]}}}}), at("transform.scale"), "out_of_range"),
        (json!({"camera": {"position": [0, 0, 0], "target": [0, 0, 0]}}), "camera.target".into(), "out_of_range"),
        (json!({"camera": {"position": [0, 5, 0], "target": [0, 0, 0]}}), "camera.up".into(), "out_of_range"),
        (json!({"light": {"sun": {"direction": [0, 0, 0]}}}), "light.sun.direction".into(), "out_of_range"),
        (json!({"render": {"spp": 0}}), "render.spp".into(), "out_of_range"),
    ] {
        assert_eq!(refusal(&document), (path, code), "{document}");
    }
}

#[test]
fn the_number_of_entries_is_bounded() {
    let volumes: serde_json::Map<_, _> = (0..17).map(|i| (format!("v{i}"), json!({}))).collect();
    assert_eq!(refusal(&json!({"volumes": volumes})), ("volumes".to_owned(), "out_of_range"));
}

#[test]
fn a_patch_changes_what_it_names_and_nothing_else() {
    let mut history = History::new(read(&cube()).unwrap());
    let before = history.document().clone();
    history.patch(&json!({"volumes": {"main": {"medium": {"sigma_t": 80}}}}), None, true).unwrap();
    let mut expected = before;
    expected["volumes"]["main"]["medium"]["sigma_t"] = json!(80);
    assert_eq!(*history.document(), expected);
    assert_eq!(history.revision(), 2);
}

#[test]
fn null_gives_a_key_its_default_back() {
    let mut history = History::new(read(&cube()).unwrap());
    history.patch(&json!({"volumes": {"main": {"medium": {"sigma_t": 80}}}}), None, true).unwrap();
    history.patch(&json!({"volumes": {"main": {"medium": {"sigma_t": null}}}}), None, true).unwrap();
    assert_eq!(history.scene().volumes["main"].medium.sigma_t, 40.0);
}

#[test]
fn another_type_drops_the_keys_of_the_old_one() {
    let mut history = History::new(read(&json!({"volumes": {"main": {"source": {"type": "cloud", "frequency": 9}}}})).unwrap());
    history.patch(&json!({"volumes": {"main": {"source": {"type": "physarum", "agents": 5}}}}), None, true).unwrap();
    let source = &history.document()["volumes"]["main"]["source"];
    assert_eq!((&source["agents"], source.get("frequency")), (&json!(5), None));
}

#[test]
fn a_refused_patch_leaves_the_scene_as_it_was() {
    let mut history = History::new(read(&cube()).unwrap());
    let before = history.document().clone();
    history.patch(&json!({"camera": {"fov_y": 50, "aperture": -1}}), None, true).unwrap_err();
    assert_eq!((history.document(), history.revision()), (&before, 1));
}

#[test]
fn a_gesture_is_one_step_to_undo() {
    let mut history = History::new(read(&cube()).unwrap());
    let start = history.document().clone();
    let exposure = |ev: f64| json!({"display": {"exposure": ev}});
    for ev in [0.5, 1.0, 1.5] {
        history.patch(&exposure(ev), Some("g1"), false).unwrap();
    }
    history.patch(&exposure(2.0), Some("g1"), true).unwrap();
    history.patch(&json!({"render": {"spp": 7}}), None, true).unwrap();
    history.undo().unwrap();
    assert_eq!(history.scene().display.exposure, 2.0);
    history.undo().unwrap();
    assert_eq!(*history.document(), start);
    assert!(history.undo().is_none());
    history.redo().unwrap();
    history.redo().unwrap();
    assert_eq!((history.scene().display.exposure, history.scene().render.spp), (2.0, 7));
    assert!(history.redo().is_none());
}

#[test]
fn undoing_leaves_the_camera_where_it_went_since() {
    let mut history = History::new(read(&cube()).unwrap());
    history.patch(&json!({"display": {"exposure": 1}}), None, true).unwrap();
    history.move_camera(&json!({"position": [3, 1, 2]})).unwrap();
    history.undo().unwrap();
    assert_eq!((history.scene().display.exposure, history.scene().camera.position), (0.0, [3.0, 1.0, 2.0]));
}

#[test]
fn one_seed_fixes_every_simulation_and_the_samples() {
    let mut scene =
        read(&json!({"volumes": {"a": {"source": {"type": "physarum"}}, "b": {"source": {"type": "cloud"}}}})).unwrap();
    scene.reseed(99);
    let document = scene.to_json();
    assert_eq!((&document["render"]["seed"], &document["volumes"]["a"]["source"]["seed"]), (&json!(99), &json!(99)));
    assert_eq!(document["volumes"]["b"]["source"]["seed"], json!(1), "a cloud's seed is its shape");
}

/// Calls `visit` for each schema of a single value below `schema`.
fn values(schema: &Value, path: &str, visit: &mut dyn FnMut(&str, &Value)) {
    if let Some(properties) = schema["properties"].as_object() {
        for (key, property) in properties {
            if property.get("const").is_none() {
                visit(&format!("{path}.{key}"), property);
                values(property, &format!("{path}.{key}"), visit);
            }
        }
    }
    for variant in schema["oneOf"].as_array().into_iter().flatten() {
        values(variant, path, visit);
    }
    if schema["additionalProperties"].is_object() {
        values(&schema["additionalProperties"], &format!("{path}.*"), visit);
    }
}

#[test]
fn the_schema_tells_title_meaning_and_default_of_every_parameter() {
    let schema = Scene::json_schema();
    let mut count = 0;
    values(&schema, "", &mut |path, value| {
        count += 1;
        assert!(value["title"].as_str().is_some_and(|title| !title.is_empty()), "{path} has no title");
        assert!(value["description"].as_str().is_some_and(|text| !text.is_empty()), "{path} has no description");
        assert!(value.get("default").is_some(), "{path} has no default");
    });
    assert!(count > 60, "only {count} parameters found");
}

#[test]
fn every_number_of_the_schema_has_a_range_and_a_default_inside_it() {
    values(&Scene::json_schema(), "", &mut |path, value| {
        let number = value["anyOf"].as_array().map_or(value, |choices| &choices[0]);
        let item = number.get("items").unwrap_or(number);
        if !matches!(item["type"].as_str(), Some("number" | "integer")) || path.ends_with("window") {
            return;
        }
        let (min, max) = (item["minimum"].as_f64(), item["maximum"].as_f64());
        let (Some(min), Some(max)) = (min, max) else { panic!("{path} has no range: {item}") };
        let default = &value["default"];
        let numbers = default.as_array().cloned().unwrap_or_else(|| vec![default.clone()]);
        for number in numbers.iter().filter_map(Value::as_f64) {
            assert!((min..=max).contains(&number), "{path}: default {number} is outside {min}…{max}");
        }
    });
}
