//! The accept loop: bounded connections, a deadline for request heads, small buffers, an orderly end.

use std::convert::Infallible;
use std::future::Future;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::http::Uri;
use axum::http::uri::PathAndQuery;
use axum::response::{IntoResponse, Redirect, Response};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tower::ServiceExt;

use super::{App, Problem, ServeConfig, ServeError, Shared, guard, routes};
use crate::engine::Engine;

/// Bytes that a connection buffers while it reads; a request's head must fit.
const READ_BUFFER: usize = 16 << 10;

/// A connection's place among those open; a socket holds on to it after the upgrade.
#[derive(Clone)]
pub(super) struct Slot(#[expect(dead_code, reason = "held for its drop")] Arc<OwnedSemaphorePermit>);

/// A server that listens and does not serve yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    app: App,
    stop: watch::Sender<bool>,
}

impl Server {
    /// Checks the configuration and listens.
    ///
    /// # Errors
    /// [`ServeError`].
    pub async fn bind(config: ServeConfig, engine: Engine) -> Result<Self, ServeError> {
        let wanted = config.listen;
        let (stop, stopping) = watch::channel(false);
        let app = Arc::new(Shared::new(config, engine, stopping)?);
        let listen = async {
            let listener = TcpListener::bind(wanted).await?;
            let address = listener.local_addr()?;
            Ok((listener, address))
        };
        let (listener, address) = listen.await.map_err(|error| ServeError::Listen(wanted, error))?;
        Ok(Self { listener, address, app, stop })
    }

    /// The address listened on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until `shutdown` is ready; then closes every stream with 1012 and waits a little for requests under way.
    pub async fn run(self, shutdown: impl Future<Output = ()>) {
        let Self { listener, app, stop, .. } = self;
        let most = app.config.max_connections;
        let slots = Arc::new(Semaphore::new(most));
        let router = routes::router(&app);
        tokio::select! {
            () = accept(&listener, &app, &router, &slots) => {}
            () = shutdown => {}
        }
        drop(listener);
        stop.send_replace(true);
        let all = u32::try_from(most).unwrap_or(u32::MAX);
        if tokio::time::timeout(app.config.timing.goodbye, slots.acquire_many(all)).await.is_err() {
            tracing::warn!(connections = app.metrics.connections.get(), "connections were cut off");
        }
    }
}

async fn accept(listener: &TcpListener, app: &App, router: &Router, slots: &Arc<Semaphore>) {
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                // Out of file descriptors, most often: accepting again at once would only burn the processor.
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let Ok(permit) = Arc::clone(slots).try_acquire_owned() else {
            app.metrics.connections_refused.inc();
            refuse(&stream);
            continue;
        };
        // A frame must not wait for the acknowledgement of the last one.
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "no TCP_NODELAY");
        }
        tokio::spawn(connection(stream, Arc::clone(app), router.clone(), Slot(Arc::new(permit))));
    }
}

/// Answers 503 as far as the socket takes it without waiting.
fn refuse(stream: &TcpStream) {
    let answer = "HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 5\r\nConnection: close\r\n\r\n";
    if let Err(error) = stream.try_write(answer.as_bytes()) {
        tracing::debug!(%error, "a connection was refused without a word");
    }
}

async fn connection(stream: TcpStream, app: App, router: Router, slot: Slot) {
    app.metrics.connections.inc();
    let service = service_fn(|request: hyper::Request<Incoming>| {
        let mut request = request.map(Body::new);
        request.extensions_mut().insert(slot.clone());
        answer(&app, router.clone(), request)
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(app.config.timing.header).max_buf_size(READ_BUFFER);
    let mut connection = pin!(http.serve_connection(TokioIo::new(stream), service).with_upgrades());
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        () = app.stopped() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "a connection ended in an error");
    }
    app.metrics.connections.dec();
}

async fn answer(app: &App, router: Router, request: Request) -> Result<Response, Infallible> {
    let request = match under_base(&app.base, request) {
        Ok(request) => request,
        Err(Elsewhere::Folder(target)) => return Ok(Redirect::permanent(&target).into_response()),
        Err(Elsewhere::Unknown(request)) => {
            let problem = Problem::not_found("such path").into_response();
            return Ok(guard::dress(app, request.headers(), problem));
        }
    };
    match router.oneshot(request).await {
        Ok(response) => Ok(response),
        Err(never) => match never {},
    }
}

/// Where a request leads that is not under the base path.
enum Elsewhere {
    /// To the base path without its slash, from which relative addresses would go astray.
    Folder(String),
    Unknown(Box<Request>),
}

/// Takes the base path off a request's address. What a probe on this machine asks for is known without it, too.
fn under_base(base: &str, mut request: Request) -> Result<Request, Elsewhere> {
    let path = request.uri().path();
    if base.is_empty() || matches!(path, "/healthz" | "/readyz" | "/metrics") {
        return Ok(request);
    }
    let query = request.uri().query().map(|query| format!("?{query}")).unwrap_or_default();
    match path.strip_prefix(base) {
        Some("") => Err(Elsewhere::Folder(format!("{base}/{query}"))),
        None if path == "/" => Err(Elsewhere::Folder(format!("{base}/{query}"))),
        Some(rest) if rest.starts_with('/') => {
            let Ok(rest) = PathAndQuery::try_from(format!("{rest}{query}")) else {
                return Err(Elsewhere::Unknown(Box::new(request)));
            };
            let mut parts = request.uri().clone().into_parts();
            parts.path_and_query = Some(rest);
            match Uri::from_parts(parts) {
                Ok(uri) => *request.uri_mut() = uri,
                Err(_) => return Err(Elsewhere::Unknown(Box::new(request))),
            }
            Ok(request)
        }
        _ => Err(Elsewhere::Unknown(Box::new(request))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(base: &str, uri: &str) -> String {
        let request = Request::builder().uri(uri).body(Body::empty()).unwrap();
        match under_base(base, request) {
            Ok(request) => request.uri().to_string(),
            Err(Elsewhere::Folder(target)) => format!("-> {target}"),
            Err(Elsewhere::Unknown(_)) => "unknown".to_owned(),
        }
    }

    #[test]
    fn the_base_path_is_taken_off_and_other_paths_are_unknown() {
        let cases = [
            ("", "/api/v1/info?a=b", "/api/v1/info?a=b"),
            ("/user/me", "/user/me/api/v1/info?a=b", "/api/v1/info?a=b"),
            ("/user/me", "/user/me/", "/"),
            ("/user/me", "/user/me?token=t", "-> /user/me/?token=t"),
            ("/user/me", "/", "-> /user/me/"),
            ("/user/me", "/user/meow/", "unknown"),
            ("/user/me", "/api/v1/info", "unknown"),
            ("/user/me", "/healthz", "/healthz"),
        ];
        for (base, uri, expected) in cases {
            assert_eq!(asked(base, uri), expected, "{uri} under {base:?}");
        }
    }
}
