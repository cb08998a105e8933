//! The command line as a caller sees it: exit codes, one line for what is wrong, files that are whole or absent.
#![expect(clippy::unwrap_used, reason = "a test that panics has failed")]

mod render;
mod serve;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::{Value, json};
use tempfile::TempDir;

/// Runs the program in `folder`.
fn tyndall(folder: &Path, args: &[&str]) -> Output {
    command(folder, args).output().unwrap()
}

fn command(folder: &Path, args: &[&str]) -> Command {
    // As on a server without a desktop, of which Mesa would complain.
    let mut command = Command::new(env!("CARGO_BIN_EXE_tyndall"));
    command.env_remove("XDG_RUNTIME_DIR").env_remove("NODEVICE_SELECT");
    command.args(args).current_dir(folder);
    command
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

/// A scene of a few voxels that a software adapter renders in no time.
fn small_scene(folder: &Path, display: &Value) -> String {
    let scene = json!({
        "volumes": {"main": {"source": {"type": "physarum", "size": [16, 16, 16], "agents": 512}, "medium": {"sigma_t": 20}}},
        "display": display,
    });
    std::fs::write(folder.join("scene.json"), scene.to_string()).unwrap();
    "scene.json".to_owned()
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
fn what_does_not_fit_the_adapter_is_a_limit_told_in_numbers() {
    let folder = folder();
    let scene = json!({"volumes": {"main": {"source": {"type": "physarum", "size": [2048, 2048, 2048], "agents": 1}}}});
    std::fs::write(folder.path().join("scene.json"), scene.to_string()).unwrap();
    for out in ["out.png", "out.npy"] {
        let command = if out == "out.png" { "render" } else { "simulate" };
        let line = refused(folder.path(), &[command, "scene.json", "--adapter", "cpu", "-o", out], 5);
        assert!(line.contains("bytes") && line.contains("allows"), "{line}");
    }
}

#[test]
fn a_server_that_does_not_answer_is_not_well() {
    let line = refused(folder().path(), &["healthcheck", "--url", "http://127.0.0.1:1"], 1);
    assert!(line.contains("http://127.0.0.1:1: "), "{line}");
}
