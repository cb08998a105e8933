//! The token: asked for on every path under `/api` once there is one.

use axum::http::{HeaderMap, StatusCode, Uri, header};
use subtle::ConstantTimeEq;

use super::problem::Problem;
use super::query;

/// A token of 128 random bits in hexadecimal.
///
/// # Errors
/// The system's, where it has no random numbers.
pub fn random_token() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(format!("{:032x}", u128::from_be_bytes(bytes)))
}

/// Checks that a request carries the token, as `Authorization: Bearer T` or `?token=T`.
pub(super) fn check(token: &str, headers: &HeaderMap, uri: &Uri) -> Result<(), Problem> {
    let bearer = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok()).and_then(|value| {
        let (scheme, token) = value.split_once(' ')?;
        scheme.eq_ignore_ascii_case("bearer").then(|| token.trim().to_owned())
    });
    let asked = query::pairs(uri).ok().and_then(|pairs| pairs.into_iter().find(|(key, _)| key == "token"));
    let sent: Vec<String> = bearer.into_iter().chain(asked.map(|(_, value)| value)).collect();
    // The comparison takes the same time wherever the first wrong byte is.
    if sent.iter().any(|sent| bool::from(sent.as_bytes().ct_eq(token.as_bytes()))) {
        return Ok(());
    }
    let (detail, challenge) = if sent.is_empty() {
        ("this path needs `Authorization: Bearer TOKEN` or `?token=TOKEN`", r#"Bearer realm="tyndall""#)
    } else {
        ("this is not the token", r#"Bearer realm="tyndall", error="invalid_token""#)
    };
    Err(Problem::new(StatusCode::UNAUTHORIZED, "unauthorized", detail).with_header(header::WWW_AUTHENTICATE, challenge))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(authorization: Option<&str>, uri: &str) -> bool {
        let mut headers = HeaderMap::new();
        if let Some(value) = authorization {
            headers.insert(header::AUTHORIZATION, value.parse().unwrap());
        }
        check("s3cret&", &headers, &uri.parse().unwrap()).is_ok()
    }

    #[test]
    fn the_token_is_taken_from_the_header_or_the_query() {
        assert!(checked(Some("Bearer s3cret&"), "/api"));
        assert!(checked(Some("bearer s3cret&"), "/api"));
        assert!(checked(None, "/api?a=1&token=s3cret%26"));
        assert!(checked(Some("Bearer old"), "/api?token=s3cret%26"));
    }

    #[test]
    fn anything_else_is_refused() {
        for header in ["Bearer", "Bearer ", "Basic s3cret&", "Bearer s3cret", "Bearer s3cret&&", "s3cret&"] {
            assert!(!checked(Some(header), "/api"), "{header}");
        }
        for uri in ["/api", "/api?token=", "/api?token=s3cret", "/api?xtoken=s3cret%26"] {
            assert!(!checked(None, uri), "{uri}");
        }
    }

    #[test]
    fn random_tokens_have_128_bits_and_differ() {
        let (a, b) = (random_token().unwrap(), random_token().unwrap());
        assert_eq!((a.len(), b.len()), (32, 32));
        assert_ne!(a, b);
    }
}
