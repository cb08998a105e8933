//! Errors over HTTP: `application/problem+json` (RFC 9457), all of them.

use std::borrow::Cow;

use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde_json::json;

use crate::engine::EngineError;
use crate::gpu::GpuError;
use crate::scene::Refusal;

/// Why a request was not done, for programs (`status`, `code`, `path`) and for people (`detail`).
#[derive(Debug, Clone)]
pub struct Problem {
    status: StatusCode,
    code: &'static str,
    detail: Cow<'static, str>,
    path: Option<String>,
    headers: Vec<(HeaderName, &'static str)>,
}

impl Problem {
    /// A problem of a kind, in words; `code` is one stable word for programs.
    pub fn new(status: StatusCode, code: &'static str, detail: impl Into<Cow<'static, str>>) -> Self {
        Self { status, code, detail: detail.into(), path: None, headers: Vec::new() }
    }

    /// There is no such thing.
    pub fn not_found(what: impl std::fmt::Display) -> Self {
        Self::new(StatusCode::NOT_FOUND, "not_found", format!("there is no {what}"))
    }

    /// A request that does not make sense, whatever the state of the server.
    pub fn bad_request(code: &'static str, detail: impl Into<Cow<'static, str>>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, code, detail)
    }

    /// The same problem under another status.
    #[must_use]
    pub fn with_status(mut self, status: StatusCode) -> Self {
        self.status = status;
        self
    }

    /// Names the key at fault.
    #[must_use]
    pub fn at(mut self, path: impl Into<String>) -> Self {
        self.path = Some(path.into());
        self
    }

    /// Adds a header to the response.
    #[must_use]
    pub fn with_header(mut self, name: HeaderName, value: &'static str) -> Self {
        self.headers.push((name, value));
        self
    }

    /// The status that goes with the problem.
    pub fn status(&self) -> StatusCode {
        self.status
    }

    /// The body: `type`, `title`, `status`, `detail`, `code` and, for refusals, the key's `path`.
    pub fn body(&self) -> serde_json::Value {
        let mut title = self.code.replace('_', " ");
        if let Some(first) = title.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        let mut body = json!({
            "type": format!("urn:tyndall:problem:{}", self.code),
            "title": title,
            "status": self.status.as_u16(),
            "detail": self.detail,
            "code": self.code,
        });
        if let Some(path) = &self.path {
            body["path"] = path.as_str().into();
        }
        body
    }
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, refusal.code, refusal.to_string()).at(refusal.path)
    }
}

impl From<EngineError> for Problem {
    fn from(error: EngineError) -> Self {
        let detail = error.to_string();
        match error {
            EngineError::Refused(refusal) => refusal.into(),
            EngineError::Stale(_) => Self::new(StatusCode::PRECONDITION_FAILED, "stale", detail),
            EngineError::Gpu(GpuError::TooLarge { .. }) => Self::new(StatusCode::UNPROCESSABLE_ENTITY, "too_large", detail),
            EngineError::Gpu(_) => Self::new(StatusCode::INTERNAL_SERVER_ERROR, "gpu", detail),
            EngineError::NotFound(_) => Self::new(StatusCode::NOT_FOUND, "not_found", detail),
            EngineError::Limit(_) => Self::new(StatusCode::TOO_MANY_REQUESTS, "limit", detail),
            EngineError::Gone => Self::new(StatusCode::SERVICE_UNAVAILABLE, "gone", detail),
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let body = self.body().to_string();
        let mut response = (self.status, body).into_response();
        let own = [(CONTENT_TYPE, "application/problem+json"), (CACHE_CONTROL, "no-store")];
        for (name, value) in own.into_iter().chain(self.headers) {
            response.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_names_the_key_and_the_kind() {
        let refusal = Refusal { code: "out_of_range", path: "camera.fov_y".into(), text: "500 is above the maximum 179".into() };
        let problem = Problem::from(refusal);
        assert_eq!(problem.status(), StatusCode::UNPROCESSABLE_ENTITY);
        let expected = json!({
            "type": "urn:tyndall:problem:out_of_range", "title": "Out of range", "status": 422,
            "detail": "camera.fov_y: 500 is above the maximum 179", "code": "out_of_range", "path": "camera.fov_y",
        });
        assert_eq!(problem.body(), expected);
    }

    #[test]
    fn each_engine_error_has_its_status() {
        let too_large = GpuError::TooLarge { what: "a film".into(), needed: 2, allowed: 1, adapter: "x".into() };
        let cases = [
            (EngineError::Stale(4), 412),
            (EngineError::Gpu(too_large), 422),
            (EngineError::Gpu(GpuError::Fault("lost".into())), 500),
            (EngineError::NotFound("volume x".into()), 404),
            (EngineError::Limit("8 sessions run; no more fit".into()), 429),
            (EngineError::Gone, 503),
        ];
        for (error, status) in cases {
            assert_eq!(Problem::from(error).status().as_u16(), status);
        }
    }
}
