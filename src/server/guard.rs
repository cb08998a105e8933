//! What every request passes: host, origin and token on the way in, protective headers on the way out, and a panic
//! that ends in a 500 instead of a cut connection.

use std::panic::AssertUnwindSafe;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::FutureExt;

use super::metrics::CodeLabel;
use super::{App, Problem, auth, origin};

/// The outermost layer.
pub(super) async fn guard(State(app): State<App>, request: Request, next: Next) -> Response {
    let headers = request.headers().clone();
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let response = match admit(&app, &request) {
        Err(problem) => problem.into_response(),
        Ok(()) if is_preflight(&app, &request) => StatusCode::NO_CONTENT.into_response(),
        Ok(()) => caught(next.run(request)).await,
    };
    let class = match response.status().as_u16() {
        100..=199 => "1xx",
        200..=299 => "2xx",
        300..=399 => "3xx",
        400..=499 => "4xx",
        _ => "5xx",
    };
    app.metrics.requests.get_or_create(&CodeLabel { code: class }).inc();
    // The query stays out of the log: it may hold the token.
    tracing::debug!(%method, path, status = response.status().as_u16(), "answered");
    dress(&app, &headers, response)
}

/// A panic in a handler is a bug, and must not be more than that one request's.
async fn caught(handler: impl Future<Output = Response>) -> Response {
    AssertUnwindSafe(handler).catch_unwind().await.unwrap_or_else(|_| {
        tracing::error!("a handler panicked");
        Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "internal", "the server made a mistake; its log says more")
            .into_response()
    })
}

/// Whether the request may be answered at all; only paths under `/api` are guarded.
fn admit(app: &App, request: &Request) -> Result<(), Problem> {
    let rest = request.uri().path().strip_prefix("/api");
    if !rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/')) {
        return Ok(());
    }
    let headers = request.headers();
    let forbidden = |code, detail: &'static str| Problem::new(StatusCode::FORBIDDEN, code, detail);
    // Without a token, being on this machine is what admits; a browser on this machine must not lend that to other sites.
    if app.config.token.is_none() && app.config.listen.ip().is_loopback() {
        if !app.origins.admit_host(headers) {
            return Err(forbidden("foreign_host", "the Host is no name of this machine; allow it with --origin"));
        }
        if origin::is_cross_site_subresource(headers) && app.origins.named(headers).is_none() {
            return Err(forbidden("foreign_origin", "the page of another site may not use this server; allow it with --origin"));
        }
    }
    if origin::is_unsafe(request.method()) && !app.origins.admit(headers) {
        return Err(forbidden("foreign_origin", "the Origin is neither this server nor allowed with --origin"));
    }
    match &app.config.token {
        Some(token) if !is_preflight(app, request) => auth::check(token, headers, request.uri()),
        _ => Ok(()),
    }
}

/// Whether a browser asks, for the page of an allowed origin, what that page may send. It never sends a token with this.
fn is_preflight(app: &App, request: &Request) -> bool {
    request.method() == Method::OPTIONS
        && request.headers().contains_key(header::ACCESS_CONTROL_REQUEST_METHOD)
        && app.origins.named(request.headers()).is_some()
}

/// Adds the headers that every response has.
pub(super) fn dress(app: &App, request: &HeaderMap, mut response: Response) -> Response {
    let headers = response.headers_mut();
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    if let Ok(policy) = HeaderValue::try_from(content_policy(app, request)) {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    if app.origins.names().next().is_none() {
        headers.insert(HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static("same-origin"));
    } else {
        headers.append(header::VARY, HeaderValue::from_static("Origin"));
    }
    if let Some(origin) = app.origins.named(request) {
        let list = |names: &'static str| HeaderValue::from_static(names);
        headers.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, origin);
        headers.insert(header::ACCESS_CONTROL_ALLOW_METHODS, list("GET, POST, PUT, PATCH, DELETE"));
        headers.insert(header::ACCESS_CONTROL_ALLOW_HEADERS, list("Authorization, Content-Type, If-Match, If-None-Match"));
        headers.insert(header::ACCESS_CONTROL_EXPOSE_HEADERS, list("ETag, Location"));
    }
    response
}

/// Nothing from elsewhere. Some browsers do not count a WebSocket to the same host as `'self'`, so it is named.
fn content_policy(app: &App, request: &HeaderMap) -> String {
    let plain = |host: &&str| !host.is_empty() && host.bytes().all(|b| b.is_ascii_alphanumeric() || b".-_:[]".contains(&b));
    let host = request.get(header::HOST).and_then(|host| host.to_str().ok()).filter(plain);
    let sockets = host.map(|host| format!(" ws://{host} wss://{host}")).unwrap_or_default();
    let frames = app.origins.names().fold(String::new(), |frames, origin| frames + " " + &origin);
    format!(
        "default-src 'self'; img-src 'self' blob: data:; worker-src 'self' blob:; connect-src 'self'{sockets}; \
         object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'self'{frames}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_handler_that_panics_answers_500() {
        let response = caught(async { panic!("a bug") }).await;
        assert_eq!(response.status(), 500);
        assert_eq!(response.headers()[header::CONTENT_TYPE], "application/problem+json");
    }
}
