//! The command line as a caller sees it: exit codes, one line for what is wrong, files that are whole or absent.
#![expect(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::{Value, json};
use tempfile::TempDir;

/// Runs the program in `folder`.
fn tyndall(folder: &Path, args: &[&str]) -> Output {
    // As on a server without a desktop, of which Mesa would complain.
    let mut command = Command::new(env!("CARGO_BIN_EXE_tyndall"));
    command.env_remove("XDG_RUNTIME_DIR").env_remove("NODEVICE_SELECT");
    command.args(args).current_dir(folder).output().unwrap()
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn fixture(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name).display().to_string()
}

/// Runs the program, which must end with `code`, one line on stderr and nothing on stdout; gives the line.
fn refused(folder: &Path, args: &[&str], code: i32) -> String {
    let files = || std::fs::read_dir(folder).unwrap().count();
    let before = files();
    let output = tyndall(folder, args);
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {words}");
    assert!(output.stdout.is_empty(), "{args:?}");
    assert_eq!(files(), before, "{args:?} left a file behind");
    // Usage errors found by the parser of the command line come with a hint.
    assert!(code == 2 || words.trim_end().lines().count() == 1, "{args:?}: {words}");
    words
}

fn prints(folder: &Path, args: &[&str]) -> String {
    let output = tyndall(folder, args);
    assert!(output.status.success() && output.stderr.is_empty(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_parameter_of_the_schema_has_title_description_and_default() {
    fn check(schema: &Value, path: &str, seen: &mut usize) {
        for variants in ["oneOf", "anyOf"] {
            for variant in schema[variants].as_array().into_iter().flatten() {
                check(variant, path, seen);
            }
        }
        check_properties(schema, path, seen);
        if schema["additionalProperties"].is_object() {
            check(&schema["additionalProperties"], &format!("{path}.*"), seen);
        }
    }
    fn check_properties(schema: &Value, path: &str, seen: &mut usize) {
        for (key, parameter) in schema["properties"].as_object().into_iter().flatten() {
            let path = format!("{path}.{key}");
            if parameter.get("const").is_none() {
                for note in ["title", "description", "default"] {
                    assert!(parameter.get(note).is_some(), "{path} has no {note}");
                }
                *seen += 1;
            }
            check(parameter, &path, seen);
        }
    }
    let schema: Value = serde_json::from_str(&prints(folder().path(), &["schema"])).unwrap();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    let mut seen = 0;
    check(&schema, "", &mut seen);
    assert!(seen > 50, "only {seen} parameters were found");
}

#[test]
fn presets_are_listed_by_name_the_default_first() {
    let folder = folder();
    let names = prints(folder.path(), &["presets", "--names"]);
    let expected: Vec<_> = tyndall::scene::presets::all().map(|(name, _)| name).collect();
    assert_eq!(names.lines().collect::<Vec<_>>(), expected);
    let lines = prints(folder.path(), &["presets"]);
    assert!(lines.lines().zip(expected).all(|(line, name)| line.split_whitespace().next() == Some(name)), "{lines}");
}

#[test]
fn every_preset_is_a_scene_that_says_what_it_is() {
    for (name, document) in tyndall::scene::presets::all() {
        let scene = tyndall::scene::Scene::from_json(document).unwrap_or_else(|refusal| panic!("{name}: {refusal}"));
        assert!(!scene.about.title.is_empty() && !scene.about.description.is_empty(), "{name}");
    }
}

#[test]
fn info_tells_type_size_spacing_and_statistics() {
    let text = prints(folder().path(), &["info", &fixture("gzip_u1.nrrd")]);
    let facts: Vec<_> = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    let expected = ["name engine", "unit -", "type uint8", "size 4 3 2", "spacing 1 1 2.5", "min 0", "max 123", "mean 61.5"];
    assert_eq!(facts, expected);
}

#[test]
fn a_volume_survives_conversion() {
    let folder = folder();
    prints(folder.path(), &["convert", &fixture("big_endian_u2.npy"), "a.nrrd"]);
    prints(folder.path(), &["convert", "a.nrrd", "b.npy"]);
    let read = |path: PathBuf| tyndall::import::load(&path).unwrap();
    assert_eq!(read(folder.path().join("b.npy")), read(fixture("big_endian_u2.npy").into()));
}

#[test]
fn what_the_command_line_cannot_ask_for_is_a_usage_error() {
    let folder = folder();
    let cases: [(&[&str], &str); 20] = [
        (&["frobnicate"], "frobnicate"),
        (&["render", "tendrils"], "--output"),
        (&["render", "tendrils", "-o", "a.gif"], "a.gif: pictures are written as"),
        (&["render", "tendrils", "-o", "a.mp4"], "a.mp4: films are not written yet"),
        (&["render", "tendrils", "-o", "a.png", "--size", "0x5"], "--size"),
        (&["render", "tendrils", "-o", "a.png", "--size", "100000x5"], "--size"),
        (&["render", "tendrils", "-o", "a.png", "--size", "100"], "--size"),
        (&["render", "tendrils", "-o", "a.png", "--spp", "0"], "--spp"),
        (&["render", "tendrils", "-o", "a.png", "--spp", "1", "--noise", "0.1"], "cannot be used with"),
        (&["render", "tendrils", "-o", "a.png", "--noise", "nan"], "--noise"),
        (&["render", "tendrils", "-o", "a.png", "--seconds", "-1"], "--seconds"),
        (&["render", "tendrils", "-o", "a.png", "--frames", "2"], "%04d"),
        (&["render", "tendrils", "-o", "a_%04d.png"], "--frames"),
        (
            &["render", "tendrils", "-o", "a.png", "--spp", "15", "--error", "e.exr"],
            "at least 16 samples a pixel; 15 are too few",
        ),
        (
            &["render", "tendrils", "-o", "a.png", "--spp", "16", "--error", "e.png"],
            "e.png: the standard error is written as .exr",
        ),
        (&["simulate", "tendrils", "-o", "a.txt"], "a.txt: fields are written as .nrrd and .npy, particles as"),
        (&["simulate", "tendrils", "-o", "a.npy", "--every", "2"], "%04d"),
        (&["simulate", "tendrils", "-o", "a.npy", "--time", "2"], "--time"),
        (&["simulate", "tendrils", "-o", "a.npy", "--volume", "no"], "--volume: the scene has no volume `no`, but main"),
        (&["convert", "a.npy", "a.txt"], "a.txt: volumes are written as .nrrd and .npy"),
    ];
    for (args, words) in cases {
        let line = refused(folder.path(), args, 2);
        assert!(line.contains(words), "{args:?}: {line:?} lacks {words:?}");
    }
}

#[test]
fn bad_input_is_refused_by_file_place_and_reason() {
    let folder = folder();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("broken.json", "{\"camera\":\n {\"fov_y\": NaN}}");
    write("unknown.json", "{\"camera\": {\"fovy\": 3}}");
    write("infinite.json", "{\"volumes\": {\"main\": {\"medium\": {\"sigma_t\": 1e39}}}}");
    write("range.json", "{\"camera\": {\"fov_y\": 200}}");
    write("list.json", "[]");
    write("gone.json", "{\"volumes\": {\"main\": {\"source\": {\"type\": \"file\", \"path\": \"gone.nrrd\"}}}}");
    write("served.json", "{\"volumes\": {\"main\": {\"source\": {\"type\": \"file\", \"dataset\": \"a.nrrd\"}}}}");
    write("bad.json", "{\"volumes\": {\"main\": {\"source\": {\"type\": \"file\", \"path\": \"bad.nrrd\"}}}}");
    write("bad.nrrd", "NRRD0004\ntype: block\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\n");
    let cases = [
        ("nothing.json", "nothing.json: file: no such file, nor a preset of this name (tendrils"),
        (".", ".: file: not a regular file"),
        ("broken.json", "broken.json: line 2 column"),
        ("unknown.json", "unknown.json: camera.fovy: unknown key"),
        ("infinite.json", "infinite.json: volumes.main.medium.sigma_t: 1e+39 does not fit"),
        ("range.json", "range.json: camera.fov_y: 200 is above the maximum 179"),
        ("list.json", "list.json: document: expected an object, found an array"),
        ("gone.json", "gone.json: volumes.main.source.path: gone.nrrd: file: no such file"),
        ("served.json", "served.json: volumes.main.source.dataset: only a server"),
        ("bad.json", "bad.json: volumes.main.source.path: bad.nrrd: type: `block` is not read"),
    ];
    for (scene, words) in cases {
        for command in [["render", scene, "-o", "out.png"], ["simulate", scene, "-o", "out.npy"]] {
            let line = refused(folder.path(), &command, 4);
            assert!(line.contains(words), "{line:?} lacks {words:?}");
        }
    }
    for command in [&["info", "gone.npy"][..], &["convert", "gone.npy", "a.nrrd"]] {
        assert!(refused(folder.path(), command, 4).contains("gone.npy: file: no such file"));
    }
    assert!(refused(folder.path(), &["render", "tendrils", "-o", "no/such/a.png"], 4).contains("no/such/a.png: folder: "));
}

#[test]
fn an_adapter_that_is_not_there_has_its_own_exit_code() {
    let line = refused(folder().path(), &["render", "tendrils", "-o", "a.png", "--adapter", "no such adapter"], 3);
    assert!(line.contains("no adapter matches `no such adapter`") && line.contains("tyndall doctor"), "{line}");
}

#[test]
fn a_server_that_does_not_answer_is_not_well() {
    let line = refused(folder().path(), &["healthcheck", "--url", "http://127.0.0.1:1"], 1);
    assert!(line.contains("http://127.0.0.1:1: "), "{line}");
}

/// A scene of a few voxels that a software adapter renders in no time.
fn small_scene(folder: &Path, display: &Value) -> String {
    let scene = json!({
        "volumes": {"main": {"source": {"type": "physarum", "size": [16, 16, 16], "agents": 512}, "medium": {"sigma_t": 20}}},
        "display": display,
    });
    std::fs::write(folder.join("scene.json"), scene.to_string()).unwrap();
    "scene.json".to_owned()
}

fn render(folder: &Path, out: &str, more: &[&str]) {
    let mut args = vec!["render", "scene.json", "--size", "24x16", "--adapter", "cpu", "-o", out];
    args.extend(more);
    assert!(prints(folder, &args).is_empty());
}

fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Channels of an EXR by name, all of which must be float32.
fn channels(folder: &Path, name: &str) -> std::collections::BTreeMap<String, Vec<f32>> {
    let image = exr::prelude::read_first_flat_layer_from_file(folder.join(name)).unwrap();
    let channels = image.layer_data.channel_data.list.into_iter().map(|channel| {
        let exr::prelude::FlatSamples::F32(values) = channel.sample_data else { panic!("{} is not float32", channel.name) };
        (channel.name.to_string(), values)
    });
    channels.collect()
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    for (out, seed) in [("a.exr", "7"), ("b.exr", "7"), ("c.exr", "8"), ("a.png", "7"), ("b.png", "7")] {
        render(folder.path(), out, &["--spp", "4", "--steps", "3", "--seed", seed]);
    }
    assert!(bytes(folder.path(), "a.exr") == bytes(folder.path(), "b.exr"));
    assert!(bytes(folder.path(), "a.png") == bytes(folder.path(), "b.png"));
    assert!(channels(folder.path(), "a.exr") != channels(folder.path(), "c.exr"));
}

#[test]
fn an_exr_is_untouched_by_exposure_and_tone_map() {
    let folder = folder();
    small_scene(folder.path(), &json!({"exposure": 0, "tonemap": "none"}));
    render(folder.path(), "a.exr", &["--spp", "4", "--steps", "3"]);
    render(folder.path(), "a.png", &["--spp", "4", "--steps", "3"]);
    small_scene(folder.path(), &json!({"exposure": 3, "tonemap": "reinhard"}));
    render(folder.path(), "b.exr", &["--spp", "4", "--steps", "3"]);
    render(folder.path(), "b.png", &["--spp", "4", "--steps", "3"]);
    let names: Vec<_> = channels(folder.path(), "a.exr").into_keys().collect();
    assert_eq!(names, ["A", "B", "G", "R"]);
    assert_eq!(channels(folder.path(), "a.exr"), channels(folder.path(), "b.exr"));
    assert!(bytes(folder.path(), "a.png") != bytes(folder.path(), "b.png"));
}

#[test]
fn stats_tell_the_mean_of_the_picture_and_its_error() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    render(folder.path(), "a.exr", &["--spp", "16", "--steps", "3", "--stats", "s.json", "--error", "e.exr"]);
    let stats: Value = serde_json::from_slice(&bytes(folder.path(), "s.json")).unwrap();
    let keys: Vec<_> = stats.as_object().unwrap().keys().map(String::as_str).collect();
    let expected =
        ["adapter", "backend", "width", "height", "spp", "paths", "simulate_s", "render_s", "paths_per_s", "mean", "se_of_mean"];
    assert_eq!(keys, expected);
    assert_eq!(
        (&stats["width"], &stats["height"], &stats["spp"], &stats["paths"]),
        (&json!(24), &json!(16), &json!(16), &json!(24 * 16 * 16))
    );
    let (radiance, error) = (channels(folder.path(), "a.exr"), channels(folder.path(), "e.exr"));
    for (part, name) in ["R", "G", "B"].into_iter().enumerate() {
        let mean = radiance[name].iter().map(|x| f64::from(*x)).sum::<f64>() / 384.0;
        let se = error[name].iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt() / 384.0;
        assert!((stats["mean"][part].as_f64().unwrap() - mean).abs() < 1e-9);
        assert!((stats["se_of_mean"][part].as_f64().unwrap() - se).abs() < 1e-9);
        assert!(se > 0.0 && mean > 0.0);
    }
}

#[test]
fn a_frame_of_a_sequence_is_the_still_after_as_many_steps() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    render(folder.path(), "f_%04d.png", &["--spp", "2", "--steps", "3", "--frames", "3"]);
    for (frame, steps) in [("f_0000.png", "3"), ("f_0001.png", "4"), ("f_0002.png", "5")] {
        render(folder.path(), "still.png", &["--spp", "2", "--steps", steps]);
        assert!(bytes(folder.path(), frame) == bytes(folder.path(), "still.png"), "{frame}");
    }
    assert!(!folder.path().join("f_0003.png").exists());
}

#[test]
fn a_picture_stops_at_the_noise_asked_for() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    render(folder.path(), "a.exr", &["--noise", "0.2", "--steps", "3", "--stats", "s.json"]);
    let stats: Value = serde_json::from_slice(&bytes(folder.path(), "s.json")).unwrap();
    let spp = stats["spp"].as_u64().unwrap();
    assert!((2..1000).contains(&spp), "{spp} samples");
}

#[test]
fn a_simulation_writes_its_field_in_its_own_type_every_so_often() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    let simulate = |more: &[&str]| {
        let mut args = vec!["simulate", "scene.json", "--adapter", "cpu"];
        args.extend(more);
        assert!(prints(folder.path(), &args).is_empty());
    };
    simulate(&["--steps", "6", "--every", "3", "-o", "f_%04d.npy"]);
    simulate(&["--steps", "6", "-o", "six.npy"]);
    simulate(&["--steps", "6", "-o", "six.nrrd"]);
    assert!(bytes(folder.path(), "f_0006.npy") == bytes(folder.path(), "six.npy"));
    assert!(bytes(folder.path(), "f_0003.npy") != bytes(folder.path(), "six.npy"));
    let field = tyndall::import::load(&folder.path().join("six.nrrd")).unwrap();
    assert_eq!(field.size, [16, 16, 16]);
    assert!(matches!(field.samples, tyndall::volume::Samples::U32(_)));
    simulate(&["--steps", "2", "-o", "agents.csv"]);
    let table = String::from_utf8(bytes(folder.path(), "agents.csv")).unwrap();
    assert_eq!(table.lines().count(), 513, "a line for each agent, and one of names");
    assert!(table.starts_with("position_x,position_y,position_z,heading_x,"), "{}", &table[..80]);
    let inside = |number: &str| (0.0..16.0).contains(&number.parse::<f32>().unwrap());
    assert!(table.lines().skip(1).all(|line| line.split(',').take(3).all(inside)), "an agent left the box");
}

#[test]
fn progress_goes_to_stderr_as_json_when_asked_for() {
    let folder = folder();
    small_scene(folder.path(), &json!({}));
    let args = ["render", "scene.json", "--size", "16x16", "--spp", "3", "--steps", "2", "-o", "a.png", "--progress", "json"];
    let output = tyndall(folder.path(), &args);
    assert!(output.status.success());
    let lines: Vec<Value> =
        String::from_utf8(output.stderr).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.contains(&json!({"phase": "simulate", "done": 2, "of": 2})), "{lines:?}");
    assert!(lines.contains(&json!({"phase": "render", "done": 3, "of": 3})), "{lines:?}");
}
