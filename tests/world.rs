//! The volumes of a scene: what a change keeps, and what it builds anew.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::cell::Cell;
use std::sync::LazyLock;

use serde_json::{Value, json};
use tyndall::gpu::{AdapterChoice, Gpu};
use tyndall::scene::{File, Scene};
use tyndall::volume::{Field, Samples};
use tyndall::world::{World, WorldError};

static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::open(&AdapterChoice::Cpu).unwrap());

fn scene(volumes: &Value) -> Scene {
    Scene::from_json(&json!({ "volumes": volumes })).unwrap()
}

fn physarum(changes: &Value) -> Value {
    let mut source = json!({"type": "physarum", "size": [8, 8, 8], "agents": 100});
    tyndall::scene::merge::merge_patch(&mut source, changes);
    json!({ "source": source })
}

fn file(dataset: &str) -> Value {
    json!({"source": {"type": "file", "dataset": dataset}})
}

fn field(samples: Samples) -> Field {
    Field { name: "ct".into(), unit: "HU".into(), size: [2, 2, 1], spacing: [1.0, 1.0, 2.0], samples }
}

fn nothing(_: &File) -> Result<Field, String> {
    Err("there are no files".into())
}

#[test]
fn what_a_scene_leaves_alone_is_kept() {
    let read = Cell::new(0);
    let reader = |_: &File| {
        read.set(read.get() + 1);
        Ok(field(Samples::F32(vec![0.0; 4])))
    };
    let one = scene(&json!({"a": physarum(&json!({})), "b": file("x")}));
    let mut world = World::new(&GPU, &one, &reader).unwrap();
    world.step().unwrap();
    let buffer = world.grids()["b"].words.clone();
    let two = scene(&json!({"a": physarum(&json!({})), "b": file("x"), "c": {"source": {"type": "homogeneous"}}}));
    world.update(&two, &reader).unwrap();
    assert_eq!((world.steps(), read.get()), (1, 1));
    assert!(world.grids()["b"].words == buffer);
    assert_eq!(world.grids().keys().collect::<Vec<_>>(), ["a", "b"]);
}

#[test]
fn a_simulation_is_tuned_in_flight_where_it_can_be_and_starts_over_where_it_cannot() {
    let mut world = World::new(&GPU, &scene(&json!({"a": physarum(&json!({}))})), &nothing).unwrap();
    world.step().unwrap();
    world.update(&scene(&json!({"a": physarum(&json!({"decay": 0.5}))})), &nothing).unwrap();
    assert_eq!(world.steps(), 1);
    world.update(&scene(&json!({"a": physarum(&json!({"decay": 0.5, "seed": 2}))})), &nothing).unwrap();
    assert_eq!(world.steps(), 0);
}

#[test]
fn a_refused_update_leaves_the_world_as_it_was() {
    let old = scene(&json!({"a": physarum(&json!({})), "b": {"source": {"type": "cloud", "size": 8}}}));
    let mut world = World::new(&GPU, &old, &nothing).unwrap();
    let mut twin = World::new(&GPU, &old, &nothing).unwrap();
    world.step().unwrap();
    twin.step().unwrap();
    // The volume a is tuned and b is gone before z is found missing.
    let new = scene(&json!({"a": physarum(&json!({"decay": 0.1})), "z": file("lost")}));
    let Err(WorldError::Refused(refusal)) = world.update(&new, &nothing) else { panic!("a lost file was found") };
    assert_eq!((refusal.path.as_str(), refusal.code), ("volumes.z.source.dataset", "unreadable_file"));
    world.step().unwrap();
    twin.step().unwrap();
    for volume in ["a", "b"] {
        let fields = [&mut world, &mut twin].map(|world| world.read(volume, "density").unwrap().unwrap());
        assert!(fields[0] == fields[1], "{volume}");
    }
    assert_eq!(world.memory(), twin.memory());
}

#[test]
fn an_update_can_be_taken_back() {
    let old = scene(&json!({"a": physarum(&json!({}))}));
    let mut world = World::new(&GPU, &old, &nothing).unwrap();
    world.step().unwrap();
    let before = world.update(&scene(&json!({"a": physarum(&json!({"seed": 3}))})), &nothing).unwrap();
    assert_eq!(world.steps(), 0);
    world.restore(before);
    assert_eq!(world.steps(), 1);
}

#[test]
fn a_file_is_read_back_in_its_own_type() {
    let all = [
        Samples::U8(vec![0, 1, 254, 255]),
        Samples::U16(vec![0, 1, 65_534, 65_535]),
        Samples::I16(vec![-32_768, -1, 0, 32_767]),
        Samples::U32(vec![0, 1, u32::MAX - 1, u32::MAX]),
        Samples::F32(vec![-1.5, 0.0, 1e-30, 3e38]),
    ];
    for samples in all {
        let given = field(samples);
        let mut world = World::new(&GPU, &scene(&json!({"a": file("x")})), &|_| Ok(given.clone())).unwrap();
        assert_eq!(world.read("a", "density").unwrap().unwrap(), given);
        assert_eq!(world.read("a", "ct").unwrap().unwrap(), given);
        assert_eq!(world.read("a", "velocity").unwrap(), None);
    }
}

#[test]
fn a_world_is_frozen_when_nothing_in_it_goes_on() {
    let plain = scene(&json!({"a": {"source": {"type": "homogeneous"}}}));
    assert!(World::new(&GPU, &plain, &nothing).unwrap().frozen());
    let two = scene(&json!({"a": physarum(&json!({"freeze_at": 1})), "b": physarum(&json!({"freeze_at": 2}))}));
    let mut world = World::new(&GPU, &two, &nothing).unwrap();
    let frozen: Vec<bool> = (0..3).map(|_| (world.frozen(), world.step().unwrap()).0).collect();
    assert_eq!(frozen, [false, false, true]);
    assert_eq!(world.steps(), 2);
    world.reset().unwrap();
    assert_eq!((world.steps(), world.frozen()), (0, false));
}
