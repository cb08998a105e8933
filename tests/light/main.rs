//! Light transport against closed forms, against another renderer, and against itself.
#![expect(clippy::unwrap_used, reason = "a test that panics has failed")]
#![expect(clippy::float_cmp, reason = "what is claimed to be equal is equal to the bit")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "a test's counts and sizes are small"
)]

mod harness;
mod phase;
mod reference;

use harness::{assert_same_picture, gpu, mean_z, render, render_with};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tyndall::render::{Film, Stage, Subject, Tracer};
use tyndall::scene::Scene;
use tyndall::volume::{AutoWindow, Field, Grid, Samples};

/// A camera far out on −z that looks along +z through a tiny angle: all its rays are parallel within 1e-4.
fn along_z() -> Value {
    json!({"position": [0, 0, -20], "target": [0, 0, 0], "fov_y": 0.2})
}

fn homogeneous(medium: &Value) -> Value {
    json!({"main": {"source": {"type": "homogeneous"}, "medium": medium}})
}

fn sky(radiance: f64) -> Value {
    json!({"type": "constant", "radiance": [radiance, radiance, radiance]})
}

fn no_sun() -> Value {
    json!({"irradiance": [0, 0, 0]})
}

/// A lumpy grid with empty stretches and peaks.
fn lumps(n: u32) -> Grid {
    let values = (0..n * n * n)
        .map(|i| {
            let [x, y, z] = [i % n, i / n % n, i / (n * n)].map(|a| f64::from(a) / f64::from(n));
            let wave = (9.0 * x + 1.3 * (7.0 * y).sin()).sin() * (8.0 * y + (6.0 * z).sin()).sin() * (10.0 * z).sin();
            (2.0 * wave).max(0.0) as f32
        })
        .collect();
    let field =
        Field { name: "density".into(), unit: String::new(), size: [n; 3], spacing: [1.0; 3], samples: Samples::F32(values) };
    field.upload(gpu()).unwrap()
}

fn file() -> Value {
    json!({"type": "file", "path": "lumps"})
}

#[test]
fn a_white_furnace_is_white() {
    for filter in ["nearest", "trilinear"] {
        for phase in [json!({"type": "isotropic"}), json!({"type": "hg", "g": 0.7}), json!({"type": "drift", "weight": -0.8})] {
            let scene = json!({
                "camera": {"position": [1.4, 0.9, -1.2], "fov_y": 40},
                "volumes": {"main": {"source": file(), "transform": {"rotate": [20, 30, 40], "scale": [1, 0.7, 1.2]},
                    "medium": {"sigma_t": 20, "albedo": [1, 1, 1], "filter": filter, "phase": phase}}},
                "light": {"sky": sky(0.6), "sun": no_sun()},
                "render": {"max_bounces": 65536}
            });
            let picture = render_with(&scene, [32, 32], 8, &BTreeMap::from([("main".to_owned(), lumps(16))]));
            for pixel in &picture.radiance {
                assert!(pixel[..3].iter().all(|x| (x - 0.6).abs() < 1e-6), "{filter} {phase}: {pixel:?}");
            }
        }
    }
}

#[test]
fn light_fades_by_beer_lambert() {
    for sigma_t in [0.5f64, 2.0, 5.0] {
        let scene = json!({
            "camera": along_z(), "volumes": homogeneous(&json!({"sigma_t": sigma_t, "albedo": [0, 0, 0]})),
            "light": {"sky": sky(1.0), "sun": no_sun()}
        });
        let picture = render(&scene, [64, 64], 64);
        let z = mean_z(&picture, (-sigma_t).exp());
        assert!(z.abs() < 3.5, "sigma_t {sigma_t}: z = {z}");
    }
}

#[test]
fn optical_depth_grows_with_scale() {
    let scene = json!({
        "camera": along_z(),
        "volumes": {"main": {"source": {"type": "homogeneous"}, "transform": {"scale": [1, 1, 2], "translate": [0, 0, 3]},
            "medium": {"sigma_t": 1, "albedo": [0, 0, 0]}}},
        "light": {"sky": sky(1.0), "sun": no_sun()}
    });
    let z = mean_z(&render(&scene, [64, 64], 64), (-2.0f64).exp());
    assert!(z.abs() < 3.5, "z = {z}");
}

#[test]
fn a_ball_is_clipped_from_its_box() {
    for (x, softness) in [(0.0f64, 0.0), (0.3, 0.0), (0.0, 0.4), (0.2, 1.0)] {
        let scene = json!({
            "camera": {"position": [x, 0, -20], "target": [x, 0, 0], "fov_y": 0.001},
            "volumes": {"main": {"source": {"type": "homogeneous"}, "clip": {"shape": "ball", "softness": softness},
                "medium": {"sigma_t": 3, "albedo": [0, 0, 0]}}},
            "light": {"sky": sky(1.0), "sun": no_sun()}
        });
        // Optical depth along z by the midpoint rule: density 1 − smoothstep(1 − softness, 1, r) at r = |p| / ½.
        let steps = 20_000;
        let density = |z: f64| {
            let r = 2.0 * x.hypot(z);
            let s = ((r - 1.0 + softness) / softness.max(1e-4)).clamp(0.0, 1.0);
            if r < 1.0 { 1.0 - s * s * (3.0 - 2.0 * s) } else { 0.0 }
        };
        let depth: f64 =
            (0..steps).map(|i| density((f64::from(i) + 0.5) / f64::from(steps) - 0.5)).sum::<f64>() / f64::from(steps);
        let z = mean_z(&render(&scene, [64, 64], 64), (-3.0 * depth).exp());
        assert!(z.abs() < 3.5, "x {x} softness {softness}: z = {z}");
    }
}

#[test]
fn the_threshold_law_draws_once_a_voxel() {
    // 12 voxels along the ray, density 1: each stops light with probability p = sigma_t·h, h = 1/12.
    let n = 12;
    let grid = Field {
        name: "density".into(),
        unit: String::new(),
        size: [n; 3],
        spacing: [1.0; 3],
        samples: Samples::F32(vec![1.0; (n * n * n) as usize]),
    }
    .upload(gpu())
    .unwrap();
    for p in [0.03f64, 0.2] {
        let scene = json!({
            "camera": {"position": [0.04, 0.04, -20], "target": [0.04, 0.04, 0], "fov_y": 0.05},
            "volumes": {"main": {"source": file(), "medium": {"law": "threshold", "sigma_t": p * f64::from(n), "albedo": [0, 0, 0]}}},
            "light": {"sky": sky(1.0), "sun": no_sun()}
        });
        let picture = render_with(&scene, [64, 64], 64, &BTreeMap::from([("main".to_owned(), grid.clone())]));
        let z = mean_z(&picture, (1.0 - p).powi(12));
        assert!(z.abs() < 3.5, "p {p}: z = {z}");
    }
}

#[test]
fn a_glowing_cube_has_the_radiance_of_its_depth() {
    for (sigma_t, expected) in [(0.0f64, 2.0), (3.0, 2.0 * (1.0 - (-3.0f64).exp()) / 3.0)] {
        let scene = json!({
            "camera": along_z(),
            "volumes": homogeneous(&json!({"sigma_t": sigma_t, "albedo": [0, 0, 0], "emission": [2, 2, 2]})),
            "light": {"sky": sky(0.0), "sun": no_sun()}
        });
        let z = mean_z(&render(&scene, [64, 64], 64), expected);
        assert!(z.abs() < 3.5, "sigma_t {sigma_t}: z = {z}");
    }
}

#[test]
fn single_scattering_of_the_sun_has_its_closed_form() {
    // Seen along z, lit along −y: at depth t in the cube light has come through half its height.
    let (sigma_t, albedo) = (2.0f64, 0.8);
    for (phase, value) in [
        (json!({"type": "isotropic"}), 1.0 / (4.0 * std::f64::consts::PI)),
        // hg at right angles: (1 − g²)/(1 + g²)^1.5 / 4π.
        (json!({"type": "hg", "g": 0.5}), 0.75 / 1.25f64.powf(1.5) / (4.0 * std::f64::consts::PI)),
        // drift at right angles: s = sqrt(1 − w²), s/4π.
        (json!({"type": "drift", "weight": 0.6}), 0.8 / (4.0 * std::f64::consts::PI)),
    ] {
        let scene = json!({
            "camera": along_z(), "volumes": homogeneous(&json!({"sigma_t": sigma_t, "albedo": [albedo, albedo, albedo], "phase": phase})),
            "light": {"sky": sky(0.0), "sun": {"direction": [0, -1, 0], "irradiance": [5, 5, 5]}},
            "render": {"max_bounces": 1}
        });
        let expected = albedo * (1.0 - (-sigma_t).exp()) * value * 5.0 * (-sigma_t / 2.0).exp();
        let z = mean_z(&render(&scene, [64, 64], 64), expected);
        assert!(z.abs() < 3.5, "{phase}: z = {z}");
    }
}

#[test]
fn a_lamp_shines_by_the_inverse_square() {
    // A thin, faint slab 2 away from the lamp: single scattering of I/r², hardly weakened on the way.
    let scene = json!({
        "camera": along_z(),
        "volumes": {"main": {"source": {"type": "homogeneous"}, "transform": {"scale": [0.2, 0.2, 0.001]}, "medium": {"sigma_t": 10, "albedo": [1, 1, 1]}}},
        "light": {"sky": sky(0.0), "sun": no_sun(), "lamps": {"a": {"position": [0, 2, 0], "intensity": [8, 8, 8]}, "b": {"position": [0, -1, 0], "intensity": [1, 1, 1]}}},
        "render": {"max_bounces": 1}
    });
    let optical_depth: f64 = 10.0 * 0.001;
    // On its way from the lamps, in the plane of the slab, light passes half the slab's height of 0.2.
    let through = (-10.0f64 * 0.1).exp();
    let expected = (1.0 - (-optical_depth).exp()) / (4.0 * std::f64::consts::PI) * (8.0 / 4.0 + 1.0) * through;
    let z = mean_z(&render(&scene, [64, 64], 512), expected);
    assert!(z.abs() < 3.5, "z = {z}");
}

#[test]
fn two_volumes_in_one_place_are_as_dense_as_their_sum() {
    let light = json!({"sky": sky(0.5), "sun": {"direction": [0.3, -0.8, 0.4], "irradiance": [3, 3, 3]}});
    let camera = json!({"position": [1.2, 0.8, -1.9], "fov_y": 22});
    let medium = |sigma_t: f64| json!({"sigma_t": sigma_t, "albedo": [0.9, 0.8, 0.7]});
    let volume = |sigma_t: f64| json!({"source": file(), "medium": medium(sigma_t)});
    let one = json!({"camera": camera, "light": light, "volumes": {"a": volume(12.0)}});
    let two = json!({"camera": camera, "light": light, "volumes": {"a": volume(8.0), "b": volume(4.0)}});
    let grid = lumps(16);
    let grids = |names: &[&str]| names.iter().map(|name| ((*name).to_owned(), grid.clone())).collect::<BTreeMap<_, _>>();
    let one = render_with(&one, [48, 48], 128, &grids(&["a"]));
    let two = render_with(&two, [48, 48], 128, &grids(&["a", "b"]));
    for channel in 0..3 {
        let (a, se_a) = one.mean(channel);
        let (b, se_b) = two.mean(channel);
        let z = (a - b) / se_a.hypot(se_b);
        assert!(z.abs() < 3.5, "channel {channel}: {a} and {b}, z = {z}");
    }
    assert_same_picture(&one, &two);
}

#[test]
fn trilinear_and_nearest_agree_where_the_field_is_flat() {
    let light = json!({"sky": sky(0.5), "sun": {"direction": [0.3, -0.8, 0.4], "irradiance": [3, 3, 3]}});
    let field = Field {
        name: "density".into(),
        unit: String::new(),
        size: [9, 5, 7],
        spacing: [1.0; 3],
        samples: Samples::F32(vec![0.7; 9 * 5 * 7]),
    };
    let scene = |filter: &str| {
        json!({"camera": {"position": [1.2, 0.8, -1.9], "fov_y": 12}, "light": light,
            "volumes": {"a": {"source": file(), "medium": {"sigma_t": 6, "filter": filter}}}})
    };
    let grids = || BTreeMap::from([("a".to_owned(), field.upload(gpu()).unwrap())]);
    assert_same_picture(
        &render_with(&scene("nearest"), [32, 32], 128, &grids()),
        &render_with(&scene("trilinear"), [32, 32], 128, &grids()),
    );
}

#[test]
fn trilinear_interpolates_between_voxel_centres() {
    // Two voxels along x, 0 and 1: density rises linearly between their centres at −0.25 and 0.25. Rays along z.
    let field = Field {
        name: "density".into(),
        unit: String::new(),
        size: [2, 2, 2],
        spacing: [1.0; 3],
        samples: Samples::F32(vec![0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]),
    };
    for x in [-0.4f64, -0.15, 0.0, 0.1, 0.3] {
        let scene = json!({
            "camera": {"position": [x, 0, -20], "target": [x, 0, 0], "fov_y": 0.001},
            "volumes": {"a": {"source": file(), "medium": {"sigma_t": 2, "albedo": [0, 0, 0], "filter": "trilinear"}}},
            "light": {"sky": sky(1.0), "sun": no_sun()}
        });
        let picture = render_with(&scene, [64, 64], 64, &BTreeMap::from([("a".to_owned(), field.upload(gpu()).unwrap())]));
        let density = ((x + 0.25) * 2.0).clamp(0.0, 1.0);
        let z = mean_z(&picture, (-2.0 * density).exp());
        assert!(z.abs() < 3.5, "x = {x}: z = {z}");
    }
}

#[test]
fn a_camera_inside_sees_the_sky_through_what_is_before_it() {
    let scene = json!({
        "camera": {"position": [0, 0, 0.1], "target": [0, 0, 1], "fov_y": 0.2},
        "volumes": homogeneous(&json!({"sigma_t": 3, "albedo": [0, 0, 0]})), "light": {"sky": sky(1.0), "sun": no_sun()}
    });
    let z = mean_z(&render(&scene, [64, 64], 64), (-1.2f64).exp());
    assert!(z.abs() < 3.5, "z = {z}");
}

#[test]
fn the_background_can_be_black_or_nothing_and_lights_all_the_same() {
    let scene = |background: &str| {
        json!({"camera": {"position": [0, 0, -4], "fov_y": 40}, "volumes": homogeneous(&json!({"sigma_t": 50, "albedo": [1, 1, 1]})),
            "light": {"sky": sky(1.0), "sun": no_sun()}, "render": {"background": background, "max_bounces": 65536}})
    };
    let corner_and_middle = |background| {
        let picture = render(&scene(background), [17, 17], 16);
        (picture.radiance[0], picture.radiance[8 * 17 + 8])
    };
    let (corner, middle) = corner_and_middle("sky");
    assert_eq!((corner, middle[3]), ([1.0, 1.0, 1.0, 1.0], 1.0));
    let (corner, middle) = corner_and_middle("black");
    assert_eq!(corner, [0.0, 0.0, 0.0, 1.0]);
    assert!((middle[0] - 1.0).abs() < 1e-5, "{middle:?}");
    let (corner, middle) = corner_and_middle("transparent");
    assert_eq!(corner, [0.0; 4]);
    assert_eq!(middle[3], 1.0);
}

#[test]
fn scatter_loss_dims_by_the_local_density() {
    // Density 0.5 in one voxel that stops every ray; the furnace then gives 1 − loss·0.5 for a single scattering out.
    let field = Field {
        name: "density".into(),
        unit: String::new(),
        size: [1, 1, 1],
        spacing: [1.0; 3],
        samples: Samples::F32(vec![0.5]),
    };
    let scene = json!({
        "camera": along_z(),
        "volumes": {"a": {"source": file(), "medium": {"law": "threshold", "sigma_t": 1e5, "albedo": [1, 1, 1], "scatter_loss": 0.4}}},
        "light": {"sky": sky(1.0), "sun": no_sun()}
    });
    // No lot is drawn again in the voxel of a scattering, so that the path leaves after one.
    let picture = render_with(&scene, [16, 16], 16, &BTreeMap::from([("a".to_owned(), field.upload(gpu()).unwrap())]));
    for pixel in &picture.radiance {
        assert!((pixel[0] - 0.8).abs() < 1e-6, "{pixel:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let scene = |seed: u32| json!({"volumes": {"a": {"source": file()}}, "render": {"seed": seed}});
    let once = |seed| render_with(&scene(seed), [40, 24], 5, &BTreeMap::from([("a".to_owned(), lumps(16))])).radiance;
    assert_eq!(once(7), once(7));
    assert_ne!(once(7), once(8));
}

#[test]
fn sampling_that_was_stopped_ends_in_the_same_bits() {
    let scene = Scene::from_json(&json!({"volumes": {"a": {"source": file()}}})).unwrap();
    let grids = BTreeMap::from([("a".to_owned(), lumps(16))]);
    let mut tracer = Tracer::new(gpu()).unwrap();
    let stage = Stage::new(gpu(), &scene, &grids).unwrap();
    let film = || Film::new(gpu(), [200, 120], 0..120).unwrap();
    let mut whole = film();
    assert!(tracer.sample(&mut whole, &stage, 9, &mut || true).unwrap());
    let mut pieces = film();
    let mut stops = 0;
    let mut turn = 0;
    while !tracer
        .sample(&mut pieces, &stage, 9, &mut || {
            turn += 1;
            turn % 3 != 0
        })
        .unwrap()
    {
        stops += 1;
    }
    assert!(stops > 1, "the test must stop the sampling");
    assert_eq!(tracer.radiance(&whole).unwrap(), tracer.radiance(&pieces).unwrap());
    assert_eq!(tracer.error(&whole).unwrap(), tracer.error(&pieces).unwrap());
}

#[test]
fn bands_of_a_picture_are_its_rows() {
    let scene = Scene::from_json(&json!({"volumes": {"a": {"source": file()}}})).unwrap();
    let grids = BTreeMap::from([("a".to_owned(), lumps(16))]);
    let mut tracer = Tracer::new(gpu()).unwrap();
    let stage = Stage::new(gpu(), &scene, &grids).unwrap();
    let mut rows = |rows: std::ops::Range<u32>| {
        let mut film = Film::new(gpu(), [40, 30], rows).unwrap();
        tracer.sample(&mut film, &stage, 3, &mut || true).unwrap();
        tracer.radiance(&film).unwrap()
    };
    let whole = rows(0..30);
    assert_eq!([rows(0..11), rows(11..30)].concat(), whole);
}

#[test]
fn a_path_that_is_not_finite_is_dropped_and_counted() {
    let scene = Scene::from_json(&json!({
        "camera": along_z(), "volumes": homogeneous(&json!({"sigma_t": 0, "emission": [1, 1, 1]})),
        "light": {"sky": sky(0.0), "sun": no_sun()}
    }))
    .unwrap();
    let mut scene = scene;
    // Nothing from outside can be infinite; a bug could.
    scene.volumes.get_mut("main").unwrap().medium.emission = [f32::INFINITY, 1.0, 1.0];
    let mut tracer = Tracer::new(gpu()).unwrap();
    let stage = Stage::new(gpu(), &scene, &BTreeMap::new()).unwrap();
    let mut film = Film::new(gpu(), [8, 8], 0..8).unwrap();
    tracer.sample(&mut film, &stage, 16, &mut || true).unwrap();
    assert!(tracer.dropped(&film).unwrap() > 0);
    assert!(tracer.radiance(&film).unwrap().iter().flatten().all(|x| x.is_finite()));
}

#[test]
fn a_majorant_out_of_proportion_ends_the_path_and_not_the_server() {
    // A peak in every macrocell, none of them where the rays pass (y = 4 in voxels).
    let values = (0..512).map(|i| if i / 8 % 4 == 1 { 1e30 } else { 1e-6f32 }).collect();
    let field =
        Field { name: "density".into(), unit: String::new(), size: [8; 3], spacing: [1.0; 3], samples: Samples::F32(values) };
    let scene = Scene::from_json(
        &json!({"camera": along_z(), "volumes": {"a": {"source": file(), "medium": {"sigma_t": 1, "filter": "nearest"}}}}),
    )
    .unwrap();
    let grids = BTreeMap::from([("a".to_owned(), field.upload(gpu()).unwrap())]);
    let mut tracer = Tracer::new(gpu()).unwrap();
    let stage = Stage::new(gpu(), &scene, &grids).unwrap();
    let mut film = Film::new(gpu(), [8, 1], 0..1).unwrap();
    assert!(tracer.sample(&mut film, &stage, 1, &mut || true).unwrap());
    assert_eq!(tracer.dropped(&film).unwrap(), 8, "{:?}", tracer.radiance(&film).unwrap());
}

#[test]
fn the_film_starts_over_when_its_subject_changes_and_not_else() {
    let scene = |text: Value| Scene::from_json(&text).unwrap();
    let base = json!({"volumes": {"a": {"source": {"type": "homogeneous"}}}});
    let grids = BTreeMap::new();
    let mut film = Film::new(gpu(), [16, 16], 0..16).unwrap();
    assert!(film.depict(&Subject::of(&scene(base.clone()), &grids)), "a new film takes on any subject");
    let with = |path: &str, value: Value| {
        let mut document = scene(base.clone()).to_json();
        *document.pointer_mut(path).unwrap() = value;
        Subject::of(&scene(document), &grids)
    };
    for (path, value) in
        [("/display/exposure", json!(2)), ("/render/spp", json!(9)), ("/render/noise", json!(0.1)), ("/about/title", json!("x"))]
    {
        assert!(!film.depict(&with(path, value)), "{path}");
    }
    for (path, value) in [
        ("/camera/fov_y", json!(50)),
        ("/volumes/a/medium/sigma_t", json!(3)),
        ("/light/sun/irradiance", json!([1, 2, 3])),
        ("/render/max_bounces", json!(3)),
        ("/render/seed", json!(3)),
    ] {
        assert!(film.depict(&with(path, value)), "{path}");
    }
}

#[test]
fn a_film_follows_what_grows_and_nothing_else() {
    let scene = |fov: f64| Scene::from_json(&json!({"camera": {"fov_y": fov}, "volumes": {"a": {"source": file()}}})).unwrap();
    let grid = lumps(16);
    let subject =
        |fov: f64, version: u64| Subject::of(&scene(fov), &BTreeMap::from([("a".to_owned(), Grid { version, ..grid.clone() })]));
    let mut film = Film::new(gpu(), [16, 16], 0..16).unwrap();
    assert!(!film.follow(&subject(30.0, 1), 0.2), "a blank film has nothing to follow");
    film.depict(&subject(30.0, 1));
    assert!(film.follow(&subject(30.0, 2), 0.2));
    assert!(!film.follow(&subject(31.0, 2), 0.2), "the camera moved");
    assert!(!film.depict(&subject(30.0, 2)), "the film is of the step that it followed");
    assert!(film.depict(&subject(30.0, 3)));
}

#[test]
fn the_mean_of_equal_samples_has_no_error() {
    let scene =
        json!({"camera": along_z(), "volumes": homogeneous(&json!({"sigma_t": 0})), "light": {"sky": sky(0.3), "sun": no_sun()}});
    let picture = render(&scene, [8, 8], 100);
    assert!(picture.error.iter().all(|e| e[..3] == [0.0; 3]));
    assert!(picture.radiance.iter().all(|p| p[..3] == [0.3; 3]));
}

#[test]
fn a_thin_lens_is_sharp_in_its_plane_and_blurs_by_its_circle_of_confusion() {
    // An opaque slab's edge at distance 4, focus at 2, lens radius 0.1: light from the lens point (r, φ) meets
    // the plane at 4 shifted by r·(1 − 4/2) = −r, so that the edge is smeared over ±0.1 there.
    let scene = |focus: f64| {
        json!({
            "camera": {"position": [0, 0, -4], "target": [0, 0, 0], "fov_y": 10, "aperture": 0.1, "focus_distance": focus},
            "volumes": {"main": {"source": {"type": "homogeneous"}, "transform": {"translate": [-0.5, 0, 0], "scale": [1, 4, 0.0001]},
                "medium": {"sigma_t": 1e6, "albedo": [0, 0, 0]}}},
            "light": {"sky": sky(1.0), "sun": no_sun()}
        })
    };
    let width = 129;
    // The picture's row is 2·4·tan 5° wide at the slab for a square picture.
    // Looking along +z with y up, right is −x.
    let world_of = |column: usize| -((column as f64 + 0.5) / f64::from(width) * 2.0 - 1.0) * 4.0 * 5f64.to_radians().tan();
    let row = |focus: f64| {
        let picture = render(&scene(focus), [width, width], 256);
        (0..width as usize).map(|x| f64::from(picture.radiance[64 * width as usize + x][0])).collect::<Vec<_>>()
    };
    for (x, value) in row(4.0).iter().enumerate() {
        let expected = f64::from(u8::from(world_of(x) > 0.0));
        assert!(world_of(x).abs() < 0.006 || (value - expected).abs() < 1e-6, "column {x} in focus: {value}");
    }
    for (x, value) in row(2.0).iter().enumerate() {
        // Share of a disc of radius 0.1 beyond a chord at −world: the edge's blur.
        let d = (world_of(x) / 0.1).clamp(-1.0, 1.0);
        let expected = 1.0 - (d.acos() - d * (1.0 - d * d).sqrt()) / std::f64::consts::PI;
        // 256 samples of a Bernoulli variable, and half a pixel's slope.
        let slack = 4.5 * (0.25f64 / 256.0).sqrt();
        assert!((value - expected).abs() < slack, "column {x} out of focus: {value}, expected {expected}");
    }
}

#[test]
fn pictures_agree_with_mitsuba() {
    for name in ["cloud_iso_nearest", "absorb_cloud_nearest"] {
        let reference = reference::read(name);
        let picture = render_with(&reference.scene, [128, 128], 64, &BTreeMap::from([("main".to_owned(), reference::cloud())]));
        reference.check(&picture);
    }
}

#[test]
fn an_automatic_window_follows_the_mean() {
    // Half of the voxels hold 10, half 0: mean 5; density 1 stands at twice the mean, so that light fades by e^(−sigma_t/2)
    // along a ray through as many full voxels as empty ones.
    let n = 8u32;
    let values: Vec<u32> = (0..n * n * n).map(|i| if (i / (n * n)).is_multiple_of(2) { 10 } else { 0 }).collect();
    let field =
        Field { name: "trail".into(), unit: "counts".into(), size: [n; 3], spacing: [1.0; 3], samples: Samples::U32(values) };
    let grid = Grid { auto: AutoWindow::Mean(2.0), ..field.upload(gpu()).unwrap() };
    let scene = json!({
        "camera": along_z(), "volumes": {"a": {"source": file(), "medium": {"sigma_t": 2, "albedo": [0, 0, 0], "filter": "nearest"}}},
        "light": {"sky": sky(1.0), "sun": no_sun()}
    });
    let z = mean_z(&render_with(&scene, [64, 64], 64, &BTreeMap::from([("a".to_owned(), grid)])), (-1.0f64).exp());
    assert!(z.abs() < 3.5, "z = {z}");
}
