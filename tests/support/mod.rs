//! A real server on a port of its own, over one engine on the software adapter, and the clients that speak to it.
#![allow(dead_code, unused_imports, clippy::unwrap_used, reason = "each test binary uses its part; a test may panic")]

pub mod http;
pub mod stream;

use std::net::SocketAddr;
use std::sync::LazyLock;
use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tyndall::engine::{Engine, Session, Settings};
use tyndall::gpu::{AdapterChoice, Gpu};
use tyndall::scene::Scene;
use tyndall::server::{ServeConfig, Server};

pub use http::{Request, Response};
pub use stream::Client;

/// Time after which a test that waits for something has failed. Nothing is measured by it.
pub const PATIENCE: Duration = Duration::from_secs(30);

/// The engine of a test binary, with its session `main`.
pub static ENGINE: LazyLock<Engine> = LazyLock::new(|| {
    let gpu = Gpu::open(&AdapterChoice::Cpu).unwrap();
    let settings = Settings { fps: 30.0, max_sessions: 40, max_memory: u64::MAX };
    let engine = Engine::start(gpu, settings, Box::new(|_| Err("there are no files in this test".to_owned()))).unwrap();
    let start = engine.create(Some("main".to_owned()), scene(&still_cloud(2)));
    // A test's own runtime may be waiting for this, so it cannot be asked to wait here.
    std::thread::scope(|scope| {
        let wait = std::thread::Builder::new().name("main session".into());
        wait.spawn_scoped(scope, || pollster::block_on(start).unwrap()).unwrap().join().unwrap();
    });
    engine
});

/// A scene document that is cheap to render: a cloud of 8³ voxels.
pub fn still_cloud(spp: u32) -> Value {
    json!({
        "volumes": {"main": {"source": {"type": "cloud", "size": 8}}},
        "render": {"spp": spp, "max_bounces": 4},
    })
}

/// A scene document in which something moves as long as it plays.
pub fn growing() -> Value {
    json!({
        "volumes": {"main": {"source": {"type": "physarum", "size": [16, 16, 16], "agents": 200}}},
        "render": {"spp": 4, "max_bounces": 4},
    })
}

pub fn scene(document: &Value) -> Scene {
    Scene::from_json(document).unwrap()
}

/// A server that runs until the end of its test.
pub struct Running {
    pub address: SocketAddr,
    pub engine: Engine,
    stop: Option<oneshot::Sender<()>>,
    done: Option<JoinHandle<()>>,
}

/// Starts a server with the usual settings.
pub async fn start() -> Running {
    start_with(|_| {}).await
}

/// Starts a server with other settings.
pub async fn start_with(change: impl FnOnce(&mut ServeConfig)) -> Running {
    let mut config = ServeConfig { listen: SocketAddr::from(([127, 0, 0, 1], 0)), ..ServeConfig::default() };
    change(&mut config);
    let engine = ENGINE.clone();
    let server = Server::bind(config, engine.clone()).await.unwrap();
    let address = server.address();
    let (stop, stopped) = oneshot::channel::<()>();
    let done = tokio::spawn(server.run(async {
        let _ = stopped.await;
    }));
    Running { address, engine, stop: Some(stop), done: Some(done) }
}

impl Running {
    /// A session of the test's own.
    pub async fn session(&self, document: &Value) -> Session {
        self.engine.create(None, scene(document)).await.unwrap()
    }

    /// A request to this server.
    pub fn request(&self, method: &str, path: &str) -> Request {
        Request::new(self.address, method, path)
    }

    /// The answer to a plain GET.
    pub async fn get(&self, path: &str) -> Response {
        self.request("GET", path).send().await
    }

    /// Tells the server to stop, and waits until it has.
    pub async fn stop(&mut self) {
        drop(self.stop.take());
        let done = self.done.take().unwrap();
        tokio::time::timeout(PATIENCE, done).await.unwrap().unwrap();
    }
}
