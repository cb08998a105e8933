//! The engine from outside: what a client of a session can rely on.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::{Arc, LazyLock};
use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::{broadcast, watch};
use tyndall::engine::{ClientId, Control, Engine, EngineError, Event, FileReader, Session, Settings, StillRequest};
use tyndall::gpu::{AdapterChoice, Gpu, GpuError};
use tyndall::scene::Scene;
use tyndall::stream::Picture;
use tyndall::volume::{Field, Samples};
use tyndall::world::World;

static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::open(&AdapterChoice::Cpu).unwrap());

/// The engine of all tests that need no settings of their own.
static ENGINE: LazyLock<Engine> = LazyLock::new(|| engine(settings()));

const CLIENT: ClientId = 5;
const SIZE: [u32; 2] = [64, 48];

fn settings() -> Settings {
    Settings { fps: 30.0, max_sessions: 64, max_memory: u64::MAX }
}

fn engine(settings: Settings) -> Engine {
    Engine::start(GPU.clone(), settings, files()).unwrap()
}

/// Files that the tests name: one that is read, one that cannot be, one at which the reader breaks.
fn files() -> FileReader {
    Box::new(|file| match file.dataset.as_deref() {
        Some("ramp") => Ok(ramp()),
        Some("broken") => panic!("the reader broke"),
        _ => Err("no such file".to_owned()),
    })
}

fn ramp() -> Field {
    let samples = Samples::U8((0..64).map(|i| i * 4).collect());
    Field { name: "ct".into(), unit: "HU".into(), size: [4, 4, 4], spacing: [1.0; 3], samples }
}

fn scene(document: &Value) -> Scene {
    Scene::from_json(document).unwrap()
}

fn cloud(spp: u32) -> Scene {
    scene(&json!({"volumes": {"main": {"source": {"type": "cloud", "size": 16}}}, "render": {"spp": spp}}))
}

fn physarum(freeze_at: Option<u32>) -> Scene {
    scene(&json!({
        "volumes": {"main": {"source": {"type": "physarum", "size": [16, 16, 16], "agents": 500, "freeze_at": freeze_at}}},
        "render": {"spp": 8}
    }))
}

/// A session with one client that looks at it.
async fn open(engine: &Engine, scene: Scene) -> Session {
    let session = engine.create(None, scene).await.unwrap();
    session.resize(CLIENT, SIZE).await;
    session
}

/// The first picture from now on of which this is true.
async fn picture(pictures: &mut watch::Receiver<Option<Arc<Picture>>>, wanted: impl Fn(&Picture) -> bool) -> Arc<Picture> {
    let found = pictures.wait_for(|picture| picture.as_ref().is_some_and(|picture| wanted(picture)));
    let found = tokio::time::timeout(Duration::from_secs(60), found).await.expect("the picture never came").unwrap();
    Arc::clone(found.as_ref().unwrap())
}

async fn event<T>(events: &mut broadcast::Receiver<Event>, wanted: impl Fn(Event) -> Option<T>) -> T {
    let found = async {
        loop {
            if let Some(found) = wanted(events.recv().await.unwrap()) {
                return found;
            }
        }
    };
    tokio::time::timeout(Duration::from_secs(60), found).await.expect("the event never came")
}

async fn patch(session: &Session, patch: Value) -> u32 {
    session.patch(CLIENT, patch, None, true, None).await.unwrap().revision
}

fn keys(object: &Value) -> serde_json::Map<String, Value> {
    object.as_object().unwrap().clone()
}

#[tokio::test]
async fn a_moved_camera_gets_a_fresh_picture_that_carries_its_seq() {
    let session = open(&ENGINE, cloud(8)).await;
    let mut pictures = session.pictures();
    let before = picture(&mut pictures, |picture| picture.converged).await;
    session.move_camera(CLIENT, 812, keys(&json!({"position": [0.2, 0.1, -1.5]}))).unwrap();
    let after = picture(&mut pictures, |picture| picture.seen.contains(&(CLIENT, 812))).await;
    assert_eq!(after.revision, before.revision + 1);
    let last = picture(&mut pictures, |picture| picture.converged && picture.revision > before.revision).await;
    assert!(last.pixels != before.pixels && last.seen == [(CLIENT, 812)]);
    assert_eq!(session.scene().borrow().document["camera"]["position"], json!([0.2, 0.1, -1.5]));
}

#[tokio::test]
async fn a_camera_message_that_changes_nothing_is_answered_with_the_samples_there_are() {
    let session = open(&ENGINE, cloud(8)).await;
    let mut pictures = session.pictures();
    let before = picture(&mut pictures, |picture| picture.converged).await;
    session.move_camera(CLIENT, 3, keys(&json!({}))).unwrap();
    let after = picture(&mut pictures, |picture| picture.seen == [(CLIENT, 3)]).await;
    assert_eq!(after.spp, 8);
    assert!(after.pixels == before.pixels);
}

#[tokio::test]
async fn the_display_changes_without_a_new_sample() {
    let session = open(&ENGINE, cloud(16)).await;
    let mut pictures = session.pictures();
    let before = picture(&mut pictures, |picture| picture.converged).await;
    let revision = patch(&session, json!({"display": {"exposure": 3}})).await;
    let after = picture(&mut pictures, |picture| picture.revision == revision).await;
    assert_eq!((after.spp, after.size), (16, SIZE));
    assert!(after.pixels != before.pixels);
    picture(&mut pictures, |picture| picture.revision == revision && picture.converged && picture.spp == 16).await;
}

#[tokio::test]
async fn a_patch_to_what_is_pictured_starts_the_samples_over() {
    let session = open(&ENGINE, cloud(64)).await;
    let mut pictures = session.pictures();
    let before = picture(&mut pictures, |picture| picture.converged).await;
    let revision = patch(&session, json!({"volumes": {"main": {"medium": {"sigma_t": 3}}}})).await;
    let first = picture(&mut pictures, |picture| picture.revision == revision).await;
    assert!(first.spp < 64 && !first.converged, "{} samples", first.spp);
    let last = picture(&mut pictures, |picture| picture.revision == revision && picture.converged).await;
    assert_eq!(last.spp, 64);
    assert!(last.pixels != before.pixels);
}

#[tokio::test]
async fn a_final_picture_comes_once_and_nothing_after_it() {
    let session = open(&ENGINE, cloud(4)).await;
    let mut pictures = session.pictures();
    let last = picture(&mut pictures, |picture| picture.converged).await;
    assert_eq!((last.spp, last.size), (4, SIZE));
    pictures.borrow_and_update();
    tokio::time::sleep(Duration::from_millis(400)).await;
    assert!(!pictures.has_changed().unwrap());
}

#[tokio::test]
async fn accumulation_ends_where_the_noise_is_low_enough() {
    let mut scene = cloud(1 << 20);
    scene.render.noise = Some(0.5);
    let session = open(&ENGINE, scene).await;
    let last = picture(&mut session.pictures(), |picture| picture.converged).await;
    assert!(last.spp >= 2 && last.spp < 1 << 20);
    let noise = session.info().stats.noise.unwrap();
    assert!(noise <= 0.5, "{noise}");
}

#[tokio::test]
async fn a_patch_without_effect_raises_the_revision_and_keeps_the_samples() {
    let session = open(&ENGINE, cloud(8)).await;
    let mut pictures = session.pictures();
    let before = picture(&mut pictures, |picture| picture.converged).await;
    assert_eq!(patch(&session, json!({"about": {"title": ""}})).await, before.revision + 1);
    let after = picture(&mut pictures, |picture| picture.revision > before.revision).await;
    assert_eq!(after.spp, 8);
    assert!(after.pixels == before.pixels);
}

#[tokio::test]
async fn a_paused_simulation_takes_as_many_steps_as_it_is_told() {
    let scene = physarum(None);
    let session = open(&ENGINE, scene.clone()).await;
    session.control(CLIENT, Control::Pause).await.unwrap();
    session.control(CLIENT, Control::Reset).await.unwrap();
    session.control(CLIENT, Control::Step(3)).await.unwrap();
    session.control(CLIENT, Control::Step(4)).await.unwrap();
    let mut world = World::new(&GPU, &scene, &|_| Err(String::new())).unwrap();
    for _ in 0..7 {
        world.step().unwrap();
    }
    let expected = world.read("main", "density").unwrap().unwrap();
    assert!(session.export("main", "density").await.unwrap() == expected);
    assert!(!session.scene().borrow().playing);
}

#[tokio::test]
async fn too_many_steps_are_refused() {
    let session = open(&ENGINE, physarum(None)).await;
    let refused = session.control(CLIENT, Control::Step(u32::MAX)).await;
    assert!(matches!(refused, Err(EngineError::Refused(refusal)) if refusal.path == "steps"));
}

#[tokio::test]
async fn a_frozen_simulation_comes_to_rest_while_it_plays() {
    let session = open(&ENGINE, physarum(Some(3))).await;
    picture(&mut session.pictures(), |picture| picture.converged && picture.size == SIZE).await;
    assert_eq!(session.info().stats.steps, 3);
    assert!(session.scene().borrow().playing);
}

#[tokio::test]
async fn a_running_simulation_has_no_final_picture() {
    let session = open(&ENGINE, physarum(None)).await;
    let mut pictures = session.pictures();
    let mut revision_of_last = None;
    for _ in 0..10 {
        pictures.changed().await.unwrap();
        let picture = pictures.borrow_and_update().clone().unwrap();
        assert!(!picture.converged);
        revision_of_last = Some(picture.revision);
    }
    assert_eq!(revision_of_last, Some(1));
    session.control(CLIENT, Control::Pause).await.unwrap();
    picture(&mut pictures, |picture| picture.converged).await;
    ENGINE.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn what_was_blended_while_a_simulation_ran_is_no_part_of_the_final_picture() {
    let session = open(&ENGINE, physarum(None)).await;
    let mut pictures = session.pictures();
    for _ in 0..6 {
        pictures.changed().await.unwrap();
        pictures.borrow_and_update();
    }
    session.control(CLIENT, Control::Pause).await.unwrap();
    let last = picture(&mut pictures, |picture| picture.converged && picture.size == SIZE).await;
    let alone = session.still(StillRequest { size: SIZE, spp: 8, radiance: false }).await.unwrap();
    assert!(last.pixels == alone.pixels, "the final picture is not the one of its own samples");
    ENGINE.remove(session.id()).await.unwrap();
}

#[tokio::test]
async fn a_camera_is_answered_while_the_simulation_cannot_keep_up() {
    let engine = engine(Settings { fps: 100.0, ..settings() });
    let mut dense = physarum(None);
    let Some(volume) = dense.volumes.get_mut("main") else { panic!() };
    (volume.medium.sigma_t, volume.medium.albedo) = (300.0, [1.0; 3]);
    let session = engine.create(None, dense).await.unwrap();
    session.resize(CLIENT, [1280, 720]).await;
    let mut pictures = session.pictures();
    for seq in 1..4 {
        pictures.borrow_and_update();
        session.move_camera(CLIENT, seq, keys(&json!({"fov_y": 20 + seq}))).unwrap();
        let mut without = 0;
        loop {
            pictures.changed().await.unwrap();
            if pictures.borrow_and_update().as_ref().unwrap().seen == [(CLIENT, seq)] {
                break;
            }
            without += 1;
        }
        // One that was under way, and one that was done between the two lines above.
        assert!(without <= 2, "{without} pictures without it");
    }
    engine.stop().await;
}

#[tokio::test]
async fn a_picture_comes_while_changes_come_faster_than_pictures() {
    let engine = engine(Settings { fps: 100.0, ..settings() });
    let mut dense = cloud(64);
    let Some(volume) = dense.volumes.get_mut("main") else { panic!() };
    (volume.medium.sigma_t, volume.medium.albedo) = (1000.0, [1.0; 3]);
    let session = engine.create(None, dense).await.unwrap();
    session.resize(CLIENT, [1280, 720]).await;
    let pictures = session.pictures();
    let shown = || pictures.borrow().as_ref().is_some_and(|picture| picture.revision > 1);
    let mut changes = 0;
    while !shown() {
        changes += 1;
        assert!(changes < 400, "no picture");
        patch(&session, json!({"render": {"seed": changes}})).await;
    }
    engine.stop().await;
}

#[tokio::test]
async fn another_simulation_starts_at_step_0_and_keeps_running() {
    let session = open(&ENGINE, physarum(None)).await;
    session.control(CLIENT, Control::Pause).await.unwrap();
    session.control(CLIENT, Control::Step(5)).await.unwrap();
    session.control(CLIENT, Control::Play).await.unwrap();
    let revision = patch(&session, json!({"volumes": {"main": {"source": {"seed": 9, "freeze_at": 2}}}})).await;
    picture(&mut session.pictures(), |picture| picture.revision == revision && picture.converged).await;
    assert_eq!(session.info().stats.steps, 2);
}

#[tokio::test]
async fn sessions_that_work_at_once_all_come_to_their_end() {
    let engine = engine(settings());
    let running = open(&engine, physarum(None)).await;
    let (a, b) = (open(&engine, cloud(32)).await, open(&engine, cloud(32)).await);
    for session in [&a, &b] {
        picture(&mut session.pictures(), |picture| picture.converged && picture.spp == 32).await;
    }
    assert!(running.pictures().borrow().is_some());
    assert_eq!(engine.list().len(), 3);
    engine.stop().await;
}

#[tokio::test]
async fn a_session_that_breaks_ends_alone_and_main_starts_again() {
    let engine = engine(settings());
    let other = open(&engine, cloud(8)).await;
    let broken = open(&engine, cloud(8)).await;
    let main = engine.create(Some("main".into()), cloud(8)).await.unwrap();
    let fatal = json!({"volumes": {"main": {"source": {"type": "file", "dataset": "broken"}}}});
    for session in [&broken, &main] {
        let (mut events, mut pictures) = (session.events(), session.pictures());
        let answer = session.patch(CLIENT, fatal.clone(), None, true, None).await;
        assert!(matches!(answer, Err(EngineError::Gone)));
        let text = event(&mut events, |event| match event {
            Event::Notice { code: "session_failed", text, .. } => Some(text),
            _ => None,
        });
        assert!(text.await.contains("the reader broke"));
        while pictures.changed().await.is_ok() {}
    }
    assert!(engine.session(broken.id()).is_none());
    // The list is renewed after the picture channel is closed.
    let again = tokio::time::timeout(Duration::from_secs(60), async {
        loop {
            match engine.session("main") {
                Some(session) if session.pictures().has_changed().is_ok() => return session,
                _ => tokio::time::sleep(Duration::from_millis(5)).await,
            }
        }
    });
    let again = again.await.unwrap();
    assert!(!again.scene().borrow().playing);
    assert_eq!(again.scene().borrow().document["volumes"]["main"]["source"]["type"], "cloud");
    picture(&mut other.pictures(), |picture| picture.converged).await;
    let revision = patch(&other, json!({"light": {"sun": {"irradiance": [1, 1, 1]}}})).await;
    picture(&mut other.pictures(), |picture| picture.revision == revision && picture.converged).await;
    engine.stop().await;
}

#[tokio::test]
async fn what_does_not_fit_is_refused_with_numbers_and_the_old_picture_goes_on() {
    let session = open(&ENGINE, cloud(8)).await;
    let mut pictures = session.pictures();
    let before = picture(&mut pictures, |picture| picture.converged).await;
    let huge = json!({"volumes": {"main": {"source": {"type": "physarum", "size": [2048, 2048, 2048]}}}});
    let Err(EngineError::Gpu(GpuError::TooLarge { needed, allowed, .. })) = session.patch(CLIENT, huge, None, true, None).await
    else {
        panic!("eight thousand million voxels were taken")
    };
    assert!(needed > allowed);
    let state = session.scene().borrow().clone();
    assert_eq!((state.revision, &state.document["volumes"]["main"]["source"]["type"]), (before.revision, &json!("cloud")));
    session.move_camera(CLIENT, 1, keys(&json!({}))).unwrap();
    let after = picture(&mut pictures, |picture| picture.seen == [(CLIENT, 1)]).await;
    assert!(after.pixels == before.pixels);
}

#[tokio::test]
async fn sessions_and_bytes_are_bounded() {
    let engine = engine(Settings { max_sessions: 2, max_memory: 300_000_000, ..settings() });
    let session = open(&engine, cloud(1)).await;
    let large = json!({"volumes": {"main": {"source": {"type": "cloud", "size": 480}}}});
    let refused = session.patch(CLIENT, large, None, true, None).await;
    assert!(matches!(&refused, Err(EngineError::Limit(text)) if text.contains("300000000")), "{refused:?}");
    engine.create(None, cloud(1)).await.unwrap();
    assert!(matches!(engine.create(None, cloud(1)).await, Err(EngineError::Limit(_))));
    assert_eq!(engine.list().len(), 2);
    engine.stop().await;
    assert!(matches!(engine.create(None, cloud(1)).await, Err(EngineError::Gone)));
}

#[tokio::test]
async fn a_picture_by_itself_has_the_size_and_samples_asked_for() {
    let session = open(&ENGINE, physarum(Some(2))).await;
    let still = session.still(StillRequest { size: [40, 24], spp: 3, radiance: true }).await.unwrap();
    assert_eq!((still.size, still.pixels.len(), still.radiance.len()), ([40, 24], 40 * 24 * 4, 40 * 24));
    assert!(still.radiance.iter().all(|[r, g, b, _]| r.is_finite() && g.is_finite() && b.is_finite()));
    let live = picture(&mut session.pictures(), |picture| picture.converged).await;
    assert_eq!(live.size, SIZE);
}

#[tokio::test]
async fn a_third_picture_by_itself_is_refused_while_two_are_in_the_making() {
    let session = open(&ENGINE, cloud(4)).await;
    let still = || session.still(StillRequest { size: [64, 64], spp: 64, radiance: false });
    let (a, b, c) = tokio::join!(still(), still(), still());
    assert!(a.is_ok() && b.is_ok());
    assert!(matches!(c, Err(EngineError::Limit(_))));
}

#[tokio::test]
async fn the_same_scene_gives_the_same_bytes_in_two_engines() {
    let mut bytes = Vec::new();
    for _ in 0..2 {
        let engine = engine(settings());
        let session = open(&engine, physarum(Some(4))).await;
        let last = picture(&mut session.pictures(), |picture| picture.converged && picture.size == SIZE).await;
        bytes.push(last.pixels.clone());
        engine.stop().await;
    }
    assert!(bytes[0] == bytes[1]);
}

#[tokio::test]
async fn with_nobody_looking_the_first_and_the_final_picture_are_all() {
    let engine = engine(settings());
    let session = engine.create(None, cloud(64)).await.unwrap();
    session.resize(CLIENT, SIZE).await;
    session.detach(CLIENT).await;
    let mut events = session.events();
    let revision = patch(&session, json!({"light": {"sun": {"irradiance": [1, 1, 1]}}})).await;
    let last = picture(&mut session.pictures(), |picture| picture.converged && picture.revision == revision).await;
    assert_eq!(last.spp, 64);
    // Pictures in the last second, of which one client would have seen at least seven.
    let fps = event(&mut events, |event| match event {
        Event::Stats(stats) if stats.spp == 64 => Some(stats.fps),
        _ => None,
    });
    assert!(fps.await <= 4.0);
    let mut pictures = session.pictures();
    pictures.borrow_and_update();
    session.attach(CLIENT).await;
    pictures.changed().await.unwrap();
    assert_eq!(pictures.borrow().as_ref().unwrap().spp, 64);
    engine.stop().await;
}

#[tokio::test]
async fn pictures_that_blend_go_on_and_come_to_rest() {
    let mut scene = cloud(8);
    scene.render.blend = Some(0.25);
    let session = open(&ENGINE, scene).await;
    let mut pictures = session.pictures();
    picture(&mut pictures, |picture| picture.converged && picture.size == SIZE).await;
    for seq in 1..5 {
        let target = json!({"target": [0.0, 0.02 * f64::from(seq), 0.0]});
        session.move_camera(CLIENT, seq, keys(&target)).unwrap();
        picture(&mut pictures, |picture| picture.seen == [(CLIENT, seq)]).await;
    }
    let last = picture(&mut pictures, |picture| picture.converged && picture.seen == [(CLIENT, 4)]).await;
    assert_eq!(last.spp, 8);
}

#[tokio::test]
async fn a_lost_device_ends_the_engine_and_says_so() {
    let gpu = Gpu::open(&AdapterChoice::Cpu).unwrap();
    let engine = Engine::start(gpu.clone(), settings(), files()).unwrap();
    let session = open(&engine, cloud(4)).await;
    picture(&mut session.pictures(), |picture| picture.converged).await;
    gpu.device().destroy();
    session.move_camera(CLIENT, 1, keys(&json!({"fov_y": 50}))).unwrap();
    let ended = tokio::time::timeout(Duration::from_secs(60), engine.ended()).await.unwrap();
    assert!(matches!(&ended, Err(EngineError::Gpu(GpuError::Fault(words))) if words.contains("lost")), "{ended:?}");
}

#[tokio::test]
async fn undo_gives_the_old_scene_and_picture_back_and_redo_the_new_one() {
    let session = open(&ENGINE, cloud(8)).await;
    let mut pictures = session.pictures();
    let before = picture(&mut pictures, |picture| picture.converged).await;
    let old = session.scene().borrow().document.clone();
    let revision = patch(&session, json!({"volumes": {"main": {"medium": {"sigma_t": 2}}}})).await;
    let new = session.scene().borrow().document.clone();
    let mut events = session.events();
    session.control(CLIENT, Control::Undo).await.unwrap();
    let change = event(&mut events, |event| match event {
        Event::Patched { change, by: CLIENT, camera: false } => Some(change),
        _ => None,
    });
    assert_eq!(change.await.revision, revision + 1);
    assert_eq!(session.scene().borrow().document, old);
    let after = picture(&mut pictures, |picture| picture.converged && picture.revision == revision + 1).await;
    assert!(after.pixels == before.pixels);
    session.control(CLIENT, Control::Redo).await.unwrap();
    assert_eq!(session.scene().borrow().document, new);
}

#[tokio::test]
async fn pictures_are_smaller_while_something_moves_and_whole_at_rest() {
    let engine = engine(Settings { fps: 1000.0, ..settings() });
    let session = engine.create(None, cloud(2)).await.unwrap();
    let full = [640, 480];
    session.resize(CLIENT, full).await;
    let mut pictures = session.pictures();
    picture(&mut pictures, |picture| picture.converged && picture.size == full).await;
    let revision = patch(&session, json!({"camera": {"fov_y": 50}})).await;
    let moving = picture(&mut pictures, |picture| picture.revision == revision).await;
    assert!(moving.size[0] < full[0] && moving.size[1] < full[1] && !moving.converged, "{:?}", moving.size);
    let rest = picture(&mut pictures, |picture| picture.revision == revision && picture.converged).await;
    assert_eq!((rest.size, rest.spp), (full, 2));
    engine.stop().await;
}

#[tokio::test]
async fn a_refused_change_leaves_everything_as_it_was() {
    let session = open(&ENGINE, cloud(4)).await;
    let before = session.scene().borrow().clone();
    let unreadable = json!({"volumes": {"main": {"source": {"type": "file", "dataset": "nothing"}}}});
    let Err(EngineError::Refused(refusal)) = session.patch(CLIENT, unreadable, None, true, None).await else { panic!() };
    assert_eq!((refusal.path.as_str(), refusal.text.as_str()), ("volumes.main.source.dataset", "no such file"));
    let late = session.patch(CLIENT, json!({}), None, true, Some(before.revision + 1)).await;
    assert!(matches!(late, Err(EngineError::Stale(revision)) if revision == before.revision));
    let mut events = session.events();
    let position = before.document["camera"]["target"].clone();
    session.move_camera(CLIENT, 9, keys(&json!({"position": position}))).unwrap();
    let refusal = event(&mut events, |event| match event {
        Event::Refused(CLIENT, refusal) => Some(refusal),
        _ => None,
    });
    assert_eq!(refusal.await.path, "camera.target");
    let after = session.scene().borrow().clone();
    assert_eq!((after.revision, after.document), (before.revision, before.document));
}

#[tokio::test]
async fn a_file_s_field_is_given_back_as_it_was_read() {
    let document = json!({"volumes": {"head": {"source": {"type": "file", "dataset": "ramp"}}}, "render": {"spp": 1}});
    let session = open(&ENGINE, scene(&document)).await;
    assert_eq!(session.export("head", "density").await.unwrap(), ramp());
    for (volume, field) in [("head", "velocity"), ("tail", "density")] {
        assert!(matches!(session.export(volume, field).await, Err(EngineError::NotFound(_))));
    }
}

#[tokio::test]
async fn a_removed_session_closes_its_channels() {
    let session = open(&ENGINE, physarum(None)).await;
    let mut pictures = session.pictures();
    ENGINE.remove(session.id()).await.unwrap();
    while pictures.changed().await.is_ok() {}
    assert!(ENGINE.session(session.id()).is_none());
    assert!(matches!(session.control(CLIENT, Control::Play).await, Err(EngineError::Gone)));
    assert!(matches!(ENGINE.remove(session.id()).await, Err(EngineError::NotFound(_))));
}

#[tokio::test]
async fn an_engine_that_nobody_holds_ends() {
    let engine = engine(settings());
    let session = engine.create(None, cloud(1)).await.unwrap();
    let mut pictures = session.pictures();
    drop(engine);
    while pictures.changed().await.is_ok() {}
    assert!(matches!(session.control(CLIENT, Control::Play).await, Err(EngineError::Gone)));
}
