//! What a viewer gets: a real server and one client on a socket of this machine.
//!
//! Prints the time to the first picture, how soon a camera message comes back as a picture, and pictures a second
//! while the camera orbits and while it stands; each with the simulation paused and running. `SIZE=1280x720` and
//! `SCENE=preset` choose another picture, `ADAPTER=cpu` another adapter.

use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream};
use tyndall::engine::{Control, Engine, Session, Settings};
use tyndall::gpu::{AdapterChoice, Gpu};
use tyndall::scene::{Scene, presets};
use tyndall::server::{ServeConfig, Server};
use tyndall::stream::FrameHeader;

/// Camera messages of one measurement.
const MOVES: u32 = 40;
/// How long pictures are counted.
const COUNT: Duration = Duration::from_secs(5);

/// A client that takes every frame and acknowledges it.
struct Client {
    socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
    seq: u32,
}

/// What came in over a while.
#[derive(Default)]
struct Tally {
    frames: u32,
    bytes: usize,
    widths: Vec<u32>,
}

impl Client {
    async fn connect(address: &str, size: [u32; 2]) -> Result<Self> {
        let mut request = format!("ws://{address}/api/v1/sessions/main/ws").into_client_request()?;
        request.headers_mut().insert("Sec-WebSocket-Protocol", "tyndall.v1".parse()?);
        let (mut socket, _) = tokio_tungstenite::connect_async(request).await?;
        let hello = json!({"type": "hello", "codecs": ["jpeg", "png"], "size": size, "role": "control"});
        socket.send(Message::text(hello.to_string())).await?;
        Ok(Self { socket, seq: 0 })
    }

    /// The next frame's header and length.
    async fn frame(&mut self) -> Result<(FrameHeader, usize)> {
        loop {
            let message = self.socket.next().await.context("the server closed the socket")??;
            if let Message::Binary(bytes) = message {
                let (header, _) = FrameHeader::split(&bytes).context("a frame without a header")?;
                let ack = json!({"type": "ack", "frame": header.frame, "decode_ms": 0});
                self.socket.send(Message::text(ack.to_string())).await?;
                return Ok((header, bytes.len()));
            }
        }
    }

    /// Turns the camera a little further around the scene.
    async fn orbit(&mut self) -> Result<u32> {
        self.seq += 1;
        let angle = f64::from(self.seq) * 0.02;
        let position = [2.2 * angle.sin(), 0.8, -2.2 * angle.cos()];
        let message = json!({"type": "camera", "seq": self.seq, "position": position});
        self.socket.send(Message::text(message.to_string())).await?;
        Ok(self.seq)
    }

    /// Takes frames for a while; with `orbit`, sends a camera message 60 times a second.
    async fn watch(&mut self, time: Duration, orbit: bool) -> Result<Tally> {
        let mut tally = Tally::default();
        let end = tokio::time::Instant::now() + time;
        let mut tick = tokio::time::interval(Duration::from_micros(16_667));
        loop {
            tokio::select! {
                () = tokio::time::sleep_until(end) => return Ok(tally),
                _ = tick.tick(), if orbit => { self.orbit().await?; }
                frame = self.frame() => {
                    let (header, bytes) = frame?;
                    tally.frames += 1;
                    tally.bytes += bytes;
                    tally.widths.push(header.size[0].into());
                }
            }
        }
    }

    /// Milliseconds from a camera message to the picture that shows it, one message at a time.
    async fn latencies(&mut self) -> Result<Vec<f64>> {
        let mut all = Vec::new();
        for _ in 0..MOVES {
            let sent = Instant::now();
            let seq = self.orbit().await?;
            while self.frame().await?.0.seq < seq {}
            all.push(sent.elapsed().as_secs_f64() * 1e3);
            self.watch(Duration::from_millis(30), false).await?;
        }
        all.sort_by(f64::total_cmp);
        Ok(all)
    }
}

async fn measure(client: &mut Client, session: &Session, running: bool) -> Result<()> {
    let control = if running { Control::Play } else { Control::Pause };
    session.control(0, control).await?;
    client.watch(Duration::from_secs(1), true).await?;
    let state = if running { "running" } else { "paused" };
    let latency = client.latencies().await?;
    let at = |share: usize| latency[(latency.len() - 1) * share / 100];
    println!("{state}: camera to picture {:.1} ms (p50), {:.1} ms (p95), {:.1} ms (worst)", at(50), at(95), at(100));
    for orbit in [true, false] {
        let tally = client.watch(COUNT, orbit).await?;
        let fps = f64::from(tally.frames) / COUNT.as_secs_f64();
        let widths = [tally.widths.iter().min(), tally.widths.iter().max()].map(|width| width.copied().unwrap_or(0));
        let what = if orbit { "orbiting" } else { "still" };
        println!(
            "{state}, {what}: {fps:.1} pictures/s, {} to {} pixels wide, {} kB each",
            widths[0],
            widths[1],
            tally.bytes / 1000 / tally.frames.max(1) as usize
        );
    }
    Ok(())
}

/// Megabytes of this process in memory.
fn resident_mb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kb| kb / 1024)
}

#[tokio::main]
async fn main() -> Result<()> {
    let variable = |name: &str, default: &str| std::env::var(name).unwrap_or_else(|_| default.to_owned());
    let size = variable("SIZE", "1280x720");
    let Some((width, height)) = size.split_once('x') else { bail!("SIZE is WIDTHxHEIGHT") };
    let size = [width.parse()?, height.parse()?];
    let preset = variable("SCENE", presets::DEFAULT);
    let scene = Scene::from_json(presets::get(&preset).context("there is no such preset")?)?;
    let gpu = Gpu::open(&variable("ADAPTER", "auto").parse::<AdapterChoice>()?)?;
    println!("{}, {}, {}×{}", gpu.info().name, preset, size[0], size[1]);

    let begun = Instant::now();
    let settings = Settings { fps: variable("FPS", "30").parse()?, max_sessions: 8, max_memory: u64::MAX };
    let engine = Engine::start(gpu, settings, Box::new(|_| Err("there are no files".to_owned())))?;
    let session = engine.create(Some("main".to_owned()), scene).await?;
    let config = ServeConfig { listen: ([127, 0, 0, 1], 0).into(), ..ServeConfig::default() };
    let server = Server::bind(config, engine.clone()).await?;
    let address = server.address().to_string();
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let serving = tokio::spawn(server.run(async move {
        let _ = stopped.await;
    }));
    let mut client = Client::connect(&address, size).await?;
    client.frame().await?;
    println!("first picture after {:.0} ms", begun.elapsed().as_secs_f64() * 1e3);

    for running in [true, false] {
        measure(&mut client, &session, running).await?;
    }
    let (resident, device) = (resident_mb().unwrap_or(0), session.info().memory / 1_000_000);
    println!("memory: {resident} MB resident, {device} MB on the GPU");
    let _ = stop.send(());
    serving.await?;
    engine.stop().await;
    Ok(())
}
