//! The network: one port for the page, the HTTP API and the streams.
//!
//! [`listener`] accepts connections, [`routes`] says what is where, [`guard`] who may, [`socket`] streams. The server
//! holds no state of a scene; it speaks to the engine through [`Engine`] and [`Session`], whose channels are bounded.

mod assets;
mod auth;
mod body;
mod export;
mod fields;
mod guard;
mod info;
mod listener;
mod metrics;
mod openapi;
mod origin;
mod problem;
mod query;
mod rooms;
mod routes;
mod scene;
mod sessions;
mod socket;
mod sources;
mod still;

use std::future::Future;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use tokio::sync::{Semaphore, watch};

pub use auth::random_token;
pub use listener::Server;
pub use openapi::document as openapi_document;
pub use problem::Problem;

use crate::engine::{ClientId, Engine, Session};
use metrics::Metrics;
use origin::Origins;
use rooms::Rooms;

/// How the server runs.
#[derive(Debug, Clone)]
pub struct ServeConfig {
    /// Address and port; port 0 lets the system choose.
    pub listen: SocketAddr,
    /// What every path under `/api` asks for; none: nothing.
    pub token: Option<String>,
    /// Whether an address that other machines reach may be served without a token.
    pub no_auth: bool,
    /// Origins (`https://host:port`) whose pages may use the API beside the server's own.
    pub origins: Vec<String>,
    /// The path under which a proxy shows the server: `/`, or `/user/name`.
    pub base_path: String,
    /// The folder of the datasets that scenes may name.
    pub data: Option<PathBuf>,
    /// Connections open at once; more are answered 503.
    pub max_connections: usize,
    /// How long the server waits for a client.
    pub timing: Timing,
}

impl Default for ServeConfig {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            token: None,
            no_auth: false,
            origins: Vec::new(),
            base_path: "/".to_owned(),
            data: None,
            max_connections: 512,
            timing: Timing::default(),
        }
    }
}

/// How long the server waits for a client.
#[derive(Debug, Clone, Copy)]
pub struct Timing {
    /// For the head of a request.
    pub header: Duration,
    /// For the body of a request.
    pub body: Duration,
    /// For a socket's first message, its `hello`.
    pub hello: Duration,
    /// Between two pings; a client that has sent nothing for two of them is gone.
    pub ping: Duration,
    /// For a message to be taken by a client, and beside it 1 s for each 64 KiB of the message.
    pub send: Duration,
    /// For clients to say goodbye when the server stops.
    pub goodbye: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            header: Duration::from_secs(5),
            body: Duration::from_secs(15),
            hello: Duration::from_secs(10),
            ping: Duration::from_secs(20),
            send: Duration::from_secs(10),
            goodbye: Duration::from_secs(3),
        }
    }
}

/// Why the server does not start.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be listened on.
    #[error("cannot listen on {0}: {1}")]
    Listen(SocketAddr, std::io::Error),
    /// Other machines reach the address, and nothing would keep them out.
    #[error("{0} can be reached from other machines: set a token, or say that none is wanted")]
    TokenNeeded(SocketAddr),
    /// The token is empty.
    #[error("the token is empty")]
    EmptyToken,
    /// An allowed origin is none.
    #[error("`{0}` is no origin; one looks like https://example.org or http://localhost:8888")]
    Origin(String),
    /// The base path is none.
    #[error("`{0}` is no base path; one looks like / or /user/name")]
    BasePath(String),
}

/// What all handlers share.
struct Shared {
    engine: Engine,
    config: ServeConfig,
    /// Without the slash at the end; empty for `/`.
    base: String,
    origins: Origins,
    metrics: Metrics,
    rooms: Arc<Rooms>,
    /// Pictures beside the streams that may be made at once.
    stills: Semaphore,
    clients: AtomicU64,
    /// True once the server stops.
    stopping: watch::Receiver<bool>,
}

type App = Arc<Shared>;

impl Shared {
    fn new(config: ServeConfig, engine: Engine, stopping: watch::Receiver<bool>) -> Result<Self, ServeError> {
        if config.token.as_ref().is_some_and(String::is_empty) {
            return Err(ServeError::EmptyToken);
        }
        if config.token.is_none() && !config.no_auth && !config.listen.ip().is_loopback() {
            return Err(ServeError::TokenNeeded(config.listen));
        }
        Ok(Self {
            engine,
            base: base_of(&config.base_path)?,
            origins: Origins::parse(&config.origins).map_err(ServeError::Origin)?,
            metrics: Metrics::new(),
            rooms: Arc::default(),
            stills: Semaphore::new(still::AT_ONCE),
            clients: AtomicU64::new(0),
            stopping,
            config,
        })
    }

    /// A number for a new client; 0 is the HTTP API.
    fn next_client(&self) -> ClientId {
        self.clients.fetch_add(1, Ordering::Relaxed) + 1
    }

    /// Ready once the server stops.
    async fn stopped(&self) {
        let mut stopping = self.stopping.clone();
        // A server that was dropped has stopped as well.
        let _ = stopping.wait_for(|stopping| *stopping).await;
    }

    fn session(&self, id: &str) -> Result<Session, Problem> {
        self.engine.session(id).ok_or_else(|| Problem::not_found("session of this name"))
    }
}

/// The base path without the slash at its end.
fn base_of(path: &str) -> Result<String, ServeError> {
    let base = path.trim_end_matches('/');
    let good = |b: u8| b.is_ascii_alphanumeric() || b"-._~@/".contains(&b);
    let plain = base.is_empty() || base.starts_with('/') && !base.contains("//") && base.bytes().all(good);
    if plain && !path.is_empty() { Ok(base.to_owned()) } else { Err(ServeError::BasePath(path.to_owned())) }
}

/// Listens and serves until `shutdown` is ready; then tells all clients and waits a little for their goodbyes.
///
/// # Errors
/// [`ServeError`] where the server cannot start.
pub async fn serve(config: ServeConfig, engine: Engine, shutdown: impl Future<Output = ()>) -> Result<(), ServeError> {
    Server::bind(config, engine).await?.run(shutdown).await;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_base_path_is_a_path() {
        for (path, base) in [("/", ""), ("/a", "/a"), ("/a/", "/a"), ("/user/me@lab/", "/user/me@lab")] {
            assert_eq!(base_of(path).unwrap(), base);
        }
        for path in ["", "a", "/a//b", "/a?b", "/a b", "http://x/"] {
            assert!(base_of(path).is_err(), "{path:?}");
        }
    }
}
