//! Pictures and simulations without a server.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::{folder, prints, small_scene, tyndall};

fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn render(folder: &Path, out: &str, more: &[&str]) {
    let size = if more.contains(&"--size") { &[][..] } else { &["--size", "24x16"] };
    let args = [&["render", "scene.json", "--adapter", "cpu", "-o", out], size, more].concat();
    assert!(prints(folder, &args).is_empty());
}

/// Channels of an EXR by name, all of which must be float32.
fn channels(folder: &Path, name: &str) -> BTreeMap<String, Vec<f32>> {
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

#[test]
fn a_picture_too_large_for_one_film_is_taken_in_bands_without_a_seam() {
    let folder = folder();
    let sky = json!({"type": "gradient", "radiance": [0.8, 0.8, 0.8], "horizon": [0.5, 0.5, 0.5], "ground": [0.1, 0.1, 0.1]});
    // Level, so that a row of the picture is brighter than all below it.
    let camera = json!({"position": [0, 0, -2], "fov_y": 120});
    let scene = json!({"volumes": {}, "light": {"sky": sky}, "camera": camera, "display": {"tonemap": "none"}});
    std::fs::write(folder.path().join("scene.json"), scene.to_string()).unwrap();
    // 141 MB of film; a binding of the software adapter holds 128 MiB.
    render(folder.path(), "wide.png", &["--size", "16384x270", "--spp", "1"]);
    let bytes = bytes(folder.path(), "wide.png");
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; 16_384 * 270 * 4];
    reader.next_frame(&mut pixels).unwrap();
    // The middle column, where no direction is steeper than another for being at the side.
    let column: Vec<u8> = pixels.chunks_exact(16_384 * 4).map(|row| row[8192 * 4]).collect();
    assert!(column.is_sorted_by(|above, below| above >= below), "{column:?}");
    assert!(column[0] > column[135] && column[135] > column[269], "{column:?}");
}
