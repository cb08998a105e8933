//! What every scene inside the binary promises to whoever opens it.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use tyndall::scene::{Physarum, Reorient, Scene, Source, presets};

/// Name, sense angle, turn angle, sense distance, step and decay of the sets whose structure is verified.
const VERIFIED: [(&str, [f32; 5]); 14] = [
    ("tendrils", [31.0, 32.0, 2.2, 0.6, 0.88]),
    ("worms", [39.0, 52.0, 2.0, 0.95, 0.48]),
    ("threads", [42.0, 92.0, 2.9, 1.25, 0.66]),
    ("hairs", [19.0, 9.0, 4.9, 1.15, 0.44]),
    ("cosmic", [32.0, 65.0, 6.0, 1.0, 0.47]),
    ("mesh", [35.0, 26.0, 7.0, 0.6, 0.33]),
    ("foam", [54.0, 8.0, 6.4, 2.2, 0.76]),
    ("cells", [75.0, 60.0, 11.5, 3.5, 0.77]),
    ("fibres", [9.0, 31.0, 7.8, 1.4, 0.66]),
    ("fatworms", [34.0, 107.0, 3.7, 3.8, 0.87]),
    ("tangle", [31.0, 32.0, 2.2, 1.9, 0.88]),
    ("trunks", [27.0, 64.0, 5.8, 2.2, 0.93]),
    ("loops", [106.0, 60.0, 5.6, 1.35, 0.455]),
    ("strands", [14.0, 97.0, 6.5, 1.3, 0.5]),
];

fn scenes() -> Vec<(&'static str, Scene)> {
    presets::all()
        .map(|(name, document)| (name, Scene::from_json(document).unwrap_or_else(|refusal| panic!("{name}: {refusal}"))))
        .collect()
}

fn physarums(scene: &Scene) -> impl Iterator<Item = &Physarum> {
    scene.volumes.values().filter_map(|volume| match &volume.source {
        Source::Physarum(physarum) => Some(physarum),
        _ => None,
    })
}

#[test]
fn every_preset_is_a_scene_that_says_what_it_is() {
    let scenes = scenes();
    assert!(scenes.len() >= 16);
    for (name, scene) in &scenes {
        assert!(!scene.volumes.is_empty(), "{name} shows nothing");
        assert!(!scene.about.title.is_empty(), "{name} has no title");
        let description = &scene.about.description;
        assert!(description.len() > 20 && description.ends_with('.'), "{name} is not described by a sentence: {description:?}");
    }
    let titles: BTreeSet<_> = scenes.iter().map(|(_, scene)| &scene.about.title).collect();
    assert_eq!(titles.len(), scenes.len(), "two presets share a title");
}

#[test]
fn a_preset_that_grows_says_when_it_is_at_its_best_and_does_not_freeze_before_step_1000() {
    for (name, scene) in scenes() {
        for physarum in physarums(&scene) {
            let best = scene.about.best_step.unwrap_or_else(|| panic!("{name} has no best_step"));
            assert!((40..=400).contains(&best), "{name} is at its best at step {best}");
            assert!(physarum.freeze_at.is_none_or(|step| step >= 1000), "{name} freezes at {:?}", physarum.freeze_at);
        }
    }
}

#[test]
fn the_verified_sets_are_offered_as_they_were_verified() {
    for (name, [sense_angle, turn_angle, sense_distance, step, decay]) in VERIFIED {
        let scene = Scene::from_json(presets::get(name).unwrap_or_else(|| panic!("there is no preset {name}"))).unwrap();
        let [physarum] = physarums(&scene).collect::<Vec<_>>()[..] else { panic!("{name} is not one physarum") };
        let verified = Physarum {
            size: [128; 3],
            agents: 156_000,
            sense_angle,
            turn_angle,
            sense_distance,
            step,
            decay,
            deposit: 4096,
            reorient_by: Reorient::Sense,
            ..Physarum::default()
        };
        assert_eq!(physarum, &verified, "{name}");
    }
}

#[test]
fn every_preset_has_a_small_picture_for_the_page_and_no_picture_lacks_its_preset() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("static/thumbs");
    for (name, _) in presets::all() {
        let bytes = std::fs::read(folder.join(format!("{name}.jpg"))).unwrap_or_else(|error| panic!("{name}.jpg: {error}"));
        assert!(bytes.len() <= 12 * 1024, "{name}.jpg has {} bytes", bytes.len());
        let picture = image::load_from_memory(&bytes).unwrap();
        assert_eq!((picture.width(), picture.height()), (240, 150), "{name}.jpg");
    }
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(presets::get(name).is_some(), "{} is no preset's picture", path.display());
    }
}

#[test]
fn the_default_preset_at_its_best_is_neither_black_nor_blown_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("default.png");
    let mut render = Command::new(env!("CARGO_BIN_EXE_tyndall"));
    render.args(["render", presets::DEFAULT, "--size", "48x27", "--spp", "4", "--adapter", "cpu", "-o"]).arg(&path);
    let done = render.output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let picture = image::open(path).unwrap().to_luma8();
    let share = |of: fn(u8) -> bool| picture.iter().filter(|level| of(**level)).count() * 100 / picture.len();
    assert!(share(|level| level >= 64) >= 15, "only {} % of the picture is lit", share(|level| level >= 64));
    assert!(share(|level| level >= 250) <= 2, "{} % of the picture is white", share(|level| level >= 250));
    assert!(share(|level| level < 64) >= 20, "only {} % of the picture is dark", share(|level| level < 64));
}
