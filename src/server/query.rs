//! What an address says: the part of the path that stands for something, and what follows the question mark.

use axum::extract::{FromRequestParts, Path, Query};
use axum::http::Uri;
use axum::http::request::Parts;

use super::{App, Problem};

/// The part of the path that a route leaves open, decoded.
pub(super) struct Named(pub(super) String);

impl FromRequestParts<App> for Named {
    type Rejection = Problem;
    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, Problem> {
        let path = Path::<String>::from_request_parts(parts, app).await;
        path.map(|Path(name)| Self(name)).map_err(|error| Problem::bad_request("bad_path", error.body_text()))
    }
}

/// The decoded pairs of a query.
pub(super) fn pairs(uri: &Uri) -> Result<Vec<(String, String)>, Problem> {
    Query::<Vec<(String, String)>>::try_from_uri(uri)
        .map(|query| query.0)
        .map_err(|error| Problem::bad_request("bad_query", error.body_text()))
}

/// A query that has none but the known keys; `token` is known everywhere.
pub(super) struct Params(Vec<(String, String)>);

impl Params {
    /// Reads the query of an address.
    pub(super) fn of(uri: &Uri, known: &[&str]) -> Result<Self, Problem> {
        let pairs = pairs(uri)?;
        match pairs.iter().find(|(key, _)| key != "token" && !known.contains(&key.as_str())) {
            Some((key, _)) => {
                let detail = format!("unknown key `{key}` in the query; here stand: {}", known.join(", "));
                Err(Problem::bad_request("unknown_key", detail).at(key))
            }
            None => Ok(Self(pairs)),
        }
    }

    /// The value of a key; the last one, where it is given more than once.
    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.0.iter().rev().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }

    /// The value of a key as a number within `low..=high`.
    pub(super) fn number(&self, key: &str, usual: u32, low: u32, high: u32) -> Result<u32, Problem> {
        let Some(text) = self.text(key) else { return Ok(usual) };
        text.parse().ok().filter(|number| (low..=high).contains(number)).ok_or_else(|| {
            let detail = format!("`{key}` must be a whole number from {low} to {high}, not `{text}`");
            Problem::bad_request("out_of_range", detail).at(key)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_is_read_by_key_and_refused_by_key() {
        let uri: Uri = "/x?width=640&token=t&format=png".parse().unwrap();
        let params = Params::of(&uri, &["width", "height", "format"]).unwrap();
        assert_eq!(params.number("width", 1, 16, 8192).unwrap(), 640);
        assert_eq!(params.number("height", 360, 16, 8192).unwrap(), 360);
        assert_eq!(params.text("format"), Some("png"));
        assert!(params.number("width", 1, 16, 512).is_err());
        assert!(Params::of(&uri, &["width"]).is_err());
        for bad in ["-1", "1.5", "", "4294967296", "NaN"] {
            let uri: Uri = format!("/x?width={bad}").parse().unwrap();
            assert!(Params::of(&uri, &["width"]).unwrap().number("width", 1, 0, u32::MAX).is_err(), "{bad}");
        }
    }
}
