//! Who may ask from a browser: the page that this server sent, and origins that the operator named.
//!
//! A loopback address protects from other machines and not from web pages: a page of any site can open a WebSocket
//! to 127.0.0.1, and by rebinding its own name to 127.0.0.1 it can read plain responses too. So each upgrade and each
//! request that changes something has its `Origin` checked, and where no token is asked for, the `Host` as well.

use std::net::IpAddr;

use axum::http::{HeaderMap, HeaderName, Method, header};

/// Origins that may speak to the server beside its own.
#[derive(Debug, Clone, Default)]
pub(super) struct Origins(Vec<Origin>);

/// `scheme://host:port` in lower case, the scheme's usual port left out.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Origin {
    scheme: &'static str,
    authority: String,
}

impl Origin {
    fn parse(text: &str) -> Option<Self> {
        let (scheme, rest) = text.split_once("://")?;
        let scheme = ["http", "https"].into_iter().find(|known| scheme.eq_ignore_ascii_case(known))?;
        let good = |b: u8| b.is_ascii_alphanumeric() || b".-_:[]".contains(&b);
        (!rest.is_empty() && rest.bytes().all(good)).then(|| Self { scheme, authority: authority(scheme, rest) })
    }

    fn host(&self) -> &str {
        host_of(&self.authority)
    }
}

/// Host and port in lower case, without the port that the scheme implies.
fn authority(scheme: &str, text: &str) -> String {
    let usual = if scheme == "https" { ":443" } else { ":80" };
    let text = text.to_ascii_lowercase();
    text.strip_suffix(usual).map_or(text.clone(), str::to_owned)
}

/// The host of `host:port`, without the brackets of an IPv6 address.
fn host_of(authority: &str) -> &str {
    if let Some(rest) = authority.strip_prefix('[') {
        return rest.split_once(']').map_or("", |(host, _)| host);
    }
    authority.split_once(':').map_or(authority, |(host, _)| host)
}

impl Origins {
    /// The origins named on the command line; the first that is none comes back as the error.
    pub(super) fn parse(texts: &[String]) -> Result<Self, String> {
        let parse = |text: &String| Origin::parse(text.trim_end_matches('/')).ok_or_else(|| text.clone());
        texts.iter().map(parse).collect::<Result<_, _>>().map(Self)
    }

    /// The origins as a browser writes them.
    pub(super) fn names(&self) -> impl Iterator<Item = String> + '_ {
        self.0.iter().map(|origin| format!("{}://{}", origin.scheme, origin.authority))
    }

    /// Whether the `Origin` of a request, if it has one, is its own host or one of the named. `null` is neither.
    pub(super) fn admit(&self, headers: &HeaderMap) -> bool {
        let mut sent = headers.get_all(header::ORIGIN).iter();
        let (Some(origin), None) = (sent.next(), sent.next()) else { return headers.get(header::ORIGIN).is_none() };
        let Some(origin) = origin.to_str().ok().and_then(Origin::parse) else { return false };
        let own = host_header(headers).is_some_and(|host| authority(origin.scheme, host) == origin.authority);
        own || self.0.contains(&origin)
    }

    /// The request's `Origin` where it is one of the named ones, to be echoed for CORS.
    pub(super) fn named(&self, headers: &HeaderMap) -> Option<axum::http::HeaderValue> {
        let sent = headers.get(header::ORIGIN)?;
        let origin = Origin::parse(sent.to_str().ok()?)?;
        self.0.contains(&origin).then(|| sent.clone())
    }

    /// Whether the `Host` of a request names this machine, or a host that was named. A name of any other kind, though it
    /// led to a loopback address, has been rebound.
    pub(super) fn admit_host(&self, headers: &HeaderMap) -> bool {
        let mut sent = headers.get_all(header::HOST).iter();
        let (Some(host), None) = (sent.next(), sent.next()) else { return headers.get(header::HOST).is_none() };
        let Ok(host) = host.to_str() else { return false };
        let host = host_of(host).to_ascii_lowercase();
        let loopback = host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
        loopback || host == "localhost" || host.ends_with(".localhost") || self.0.iter().any(|origin| origin.host() == host)
    }
}

fn host_header(headers: &HeaderMap) -> Option<&str> {
    headers.get(header::HOST)?.to_str().ok()
}

/// Whether a request may change something.
pub(super) fn is_unsafe(method: &Method) -> bool {
    !matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS)
}

/// Whether a browser says that the page of another site embeds or fetches this; a link that a person follows is not meant.
pub(super) fn is_cross_site_subresource(headers: &HeaderMap) -> bool {
    let is = |name: &'static str, value: &str| headers.get(HeaderName::from_static(name)).is_some_and(|v| v == value);
    is("sec-fetch-site", "cross-site") && !is("sec-fetch-mode", "navigate")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().unwrap());
        }
        headers
    }

    #[test]
    fn the_own_host_and_named_origins_are_admitted_and_nothing_else() {
        let origins = Origins::parse(&["https://lab.example.org/".to_owned()]).unwrap();
        let cases = [
            ("localhost:8080", None, true),
            ("localhost:8080", Some("http://localhost:8080"), true),
            ("LocalHost:8080", Some("http://localhost:8080"), true),
            ("example.org", Some("https://example.org"), true),
            ("example.org:443", Some("https://example.org"), true),
            ("[::1]:8080", Some("http://[::1]:8080"), true),
            ("localhost:8080", Some("https://lab.example.org"), true),
            ("localhost:8080", Some("http://lab.example.org"), false),
            ("localhost:8080", Some("http://localhost:9999"), false),
            ("localhost:8080", Some("http://localhost"), false),
            ("localhost:8080", Some("https://evil.example"), false),
            ("localhost:8080", Some("https://lab.example.org.evil.example"), false),
            ("localhost:8080", Some("null"), false),
            ("localhost:8080", Some(""), false),
            ("null", Some("null"), false),
            ("localhost:8080", Some("file://localhost:8080"), false),
            ("localhost:8080", Some("http://evil@localhost:8080"), false),
        ];
        for (host, origin, admitted) in cases {
            assert_eq!(origins.admit(&headers(host, origin)), admitted, "{host} {origin:?}");
        }
    }

    #[test]
    fn two_origins_in_one_request_are_refused() {
        let mut headers = headers("localhost:8080", Some("http://localhost:8080"));
        headers.append(header::ORIGIN, "http://localhost:8080".parse().unwrap());
        assert!(!Origins::default().admit(&headers));
    }

    #[test]
    fn a_rebound_name_is_no_host_of_this_machine() {
        let origins = Origins::parse(&["https://lab.example.org".to_owned()]).unwrap();
        let admitted =
            ["localhost", "localhost:22", "127.0.0.1:8080", "127.8.9.1", "[::1]:8080", "app.localhost", "lab.example.org"];
        let refused =
            ["evil.example:8080", "localhost.evil.example", "192.168.1.4:8080", "0.0.0.0", "", "127.0.0.1.evil.example"];
        for host in admitted {
            assert!(origins.admit_host(&headers(host, None)), "{host}");
        }
        for host in refused {
            assert!(!origins.admit_host(&headers(host, None)), "{host}");
        }
    }

    #[test]
    fn what_is_no_origin_is_named() {
        assert_eq!(Origins::parse(&["example.org".to_owned()]).unwrap_err(), "example.org");
    }
}
