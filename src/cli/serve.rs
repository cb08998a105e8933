//! `tyndall serve`: GPU, engine and network put together, until the process is told to end.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tyndall::engine::{Engine, EngineError, Settings};
use tyndall::gpu::{AdapterChoice, Gpu};
use tyndall::import;
use tyndall::scene::presets;
use tyndall::server::{ServeConfig, ServeError, Server, random_token};
use tyndall::volume::Field;

use super::adapter::on_adapter;
use super::failure::Failure;
use super::print;
use super::scene::Chosen;

/// The session that exists from the start.
const SESSION: &str = "main";
/// Most sessions at once.
const MAX_SESSIONS: usize = 32;
/// Longest token read from a file, in bytes.
const MAX_TOKEN: usize = 4096;
/// How long the engine, and then the encoders, may take to end after the last client was told goodbye.
const END: Duration = Duration::from_millis(800);

/// Serve the web client, the HTTP API and the streams.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Address and port; port 0 lets the system choose.
    #[arg(long, default_value = "127.0.0.1:8080", value_parser = address)]
    listen: SocketAddr,
    /// The scene shown at first: a preset's name, or a scene file.
    #[arg(long, default_value = presets::DEFAULT)]
    scene: String,
    /// Folder of the volume files that scenes may name as datasets.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// File that holds the token every request must show; without it, an address that other machines reach gets a
    /// token of its own.
    #[arg(long, value_name = "F")]
    token_file: Option<PathBuf>,
    /// An origin whose pages may use the API beside the server's own: `https://example.org`. Can be given again.
    #[arg(long, value_name = "URL")]
    origin: Vec<String>,
    /// Ask nobody for a token, whoever can reach the address.
    #[arg(long, conflicts_with = "token_file")]
    no_auth: bool,
    /// The path under which a proxy shows the server.
    #[arg(long, default_value = "/")]
    base_path: String,
    /// Pictures a second while something moves; by default 30 on a GPU and 20 without.
    #[arg(long, value_name = "N", value_parser = frame_rate)]
    fps: Option<f32>,
    /// auto, gpu, cpu, or a part of an adapter's name.
    #[arg(long, default_value = "auto")]
    adapter: AdapterChoice,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let found = text.to_socket_addrs().map_err(|_| "an address is HOST:PORT")?.next();
    found.ok_or_else(|| "no such host".to_owned())
}

fn frame_rate(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|fps| (0.1..=240.0).contains(fps)).ok_or_else(|| "from 0.1 to 240".to_owned())
}

/// Runs the command, until a signal ends it.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let chosen = Chosen::read(&args.scene, None)?;
    let token = token(args)?;
    if let Some(data) = args.data.as_deref().filter(|data| !data.is_dir()) {
        return Err(Failure::input(data, "folder", "there is no such folder"));
    }
    on_adapter(&args.adapter, |gpu| with_engine(args, gpu, &token, &chosen))
}

fn with_engine(args: &Args, gpu: &Gpu, token: &Token, chosen: &Chosen) -> Result<(), Failure> {
    let software = gpu.is_software();
    let settings = Settings {
        fps: args.fps.unwrap_or(if software { 20.0 } else { 30.0 }),
        max_sessions: MAX_SESSIONS,
        // Of the machine's memory, or the GPU's: what a small one of its kind has.
        max_memory: if software { 4 << 30 } else { 16 << 30 },
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| Failure::broken(format!("the network's threads: {error}")))?;
    let files = reader(chosen.folder.clone(), args.data.clone());
    let engine =
        Engine::start(gpu.clone(), settings, files).map_err(|error| Failure::broken(format!("the engine's thread: {error}")))?;
    let served = runtime.block_on(async {
        let served = serve(args, token, chosen, &engine).await;
        // Also after a server that did not start: the engine's thread is at work by then.
        let ended = async {
            engine.stop().await;
            engine.ended().await
        };
        match tokio::time::timeout(END, ended).await {
            Ok(Err(error)) => served.and(Err(Failure::broken(error))),
            _ => served,
        }
    });
    // An encoder at work is not waited for.
    runtime.shutdown_timeout(END);
    served
}

async fn serve(args: &Args, token: &Token, chosen: &Chosen, engine: &Engine) -> Result<(), Failure> {
    // Before anything is said, so that a signal at any time after is heard.
    let shutdown = signal().map_err(|error| Failure::broken(format!("signals: {error}")))?;
    let config = ServeConfig {
        listen: args.listen,
        token: token.text().map(str::to_owned),
        no_auth: args.no_auth,
        origins: args.origin.clone(),
        base_path: args.base_path.clone(),
        data: args.data.clone(),
        ..ServeConfig::default()
    };
    let server = Server::bind(config, engine.clone()).await.map_err(|error| match error {
        ServeError::Listen(..) => Failure::broken(error),
        _ => Failure::usage(error),
    })?;
    engine.create(Some(SESSION.to_owned()), chosen.scene.clone()).await.map_err(|error| match error {
        EngineError::Refused(refusal) => chosen.refuse(&refusal),
        EngineError::Gpu(error) => error.into(),
        EngineError::Limit(words) => Failure::limit(words),
        other => Failure::broken(other),
    })?;
    let address = server.address();
    if args.no_auth && !address.ip().is_loopback() {
        tracing::warn!(%address, "everybody who reaches this address can use the server: --no-auth");
    }
    print::out(&format!("{}\n", to_open(address, &args.base_path, token)))?;
    tracing::info!(%address, adapter = engine.gpu().info().name, "listening");
    server
        .run(async {
            tokio::select! { () = shutdown => {}, _ = engine.ended() => {} }
        })
        .await;
    Ok(())
}

/// Ready at the first signal to end; a second one ends the process at once.
fn signal() -> std::io::Result<impl Future<Output = ()>> {
    use tokio::signal::unix::{SignalKind, signal};
    let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
    let mut told = async move || {
        tokio::select! { _ = terminate.recv() => {}, _ = interrupt.recv() => {} }
    };
    Ok(async move {
        told().await;
        tracing::info!("stopping");
        tokio::spawn(async move {
            told().await;
            std::process::exit(1);
        });
    })
}

/// What requests must show.
enum Token {
    Nothing,
    /// The operator knows it.
    Given(String),
    /// Nobody knows it yet: it is part of the address that is printed.
    Made(String),
}

impl Token {
    fn text(&self) -> Option<&str> {
        match self {
            Self::Nothing => None,
            Self::Given(text) | Self::Made(text) => Some(text),
        }
    }
}

fn token(args: &Args) -> Result<Token, Failure> {
    let Some(file) = &args.token_file else {
        if args.no_auth || args.listen.ip().is_loopback() {
            return Ok(Token::Nothing);
        }
        let token = random_token().map_err(|error| Failure::broken(format!("no randomness for a token: {error}")))?;
        return Ok(Token::Made(token));
    };
    let text = std::fs::read_to_string(file).map_err(|error| Failure::input(file, "file", error))?;
    let text = text.trim();
    let plain = text.bytes().all(|byte| byte.is_ascii_graphic());
    if text.is_empty() || text.len() > MAX_TOKEN || !plain {
        let reason = format!("a token is a line of 1 to {MAX_TOKEN} printable characters without spaces");
        return Err(Failure::input(file, "token", reason));
    }
    Ok(Token::Given(text.to_owned()))
}

/// The address to open in a browser of this machine.
fn to_open(address: SocketAddr, base_path: &str, token: &Token) -> String {
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => IpAddr::V4(Ipv4Addr::LOCALHOST),
        IpAddr::V6(ip) if ip.is_unspecified() => IpAddr::V6(Ipv6Addr::LOCALHOST),
        ip => ip,
    };
    let address = SocketAddr::new(ip, address.port());
    let base = base_path.trim_end_matches('/');
    match token {
        Token::Made(token) => format!("http://{address}{base}/?token={token}"),
        Token::Nothing | Token::Given(_) => format!("http://{address}{base}/"),
    }
}

/// Reads the files that scenes name: a path of the first scene, or a dataset.
fn reader(folder: PathBuf, data: Option<PathBuf>) -> tyndall::engine::FileReader {
    Box::new(move |file| read(&folder, data.as_deref(), file).map_err(|error| error.to_string()))
}

fn read(folder: &Path, data: Option<&Path>, file: &tyndall::scene::File) -> Result<Field, import::ImportError> {
    match (&file.path, &file.dataset, data) {
        (Some(path), _, _) => import::load(&folder.join(path)),
        (None, Some(dataset), Some(data)) => {
            let mut field = import::resolve(data, dataset).and_then(|path| import::load(&path));
            if let Err(error) = &mut field {
                // A client learns the name that it gave, not where it lies.
                error.file.clone_from(dataset);
            }
            field
        }
        (None, dataset, _) => Err(import::ImportError {
            file: dataset.clone().unwrap_or_default(),
            place: "dataset".into(),
            reason: "the server was started without --data".into(),
        }),
    }
}
