//! Large answers are compressed off the threads that answer calls, which small ones do not hold up.

use std::io::Write;

use axum::body::{Body, HttpBody, to_bytes};
use axum::extract::Request;
use axum::middleware::Next;
use axum::response::Response;
use flate2::Compression;
use flate2::write::GzEncoder;
use http::header::{ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_TYPE, ETAG, VARY};
use http::{HeaderMap, HeaderValue};

/// Bodies from this size on take long enough for the way to another thread, in bytes.
const LARGE: u64 = 64 << 10;

/// Compresses a large answer whose whole body is there; all others are left to the layer around this one.
pub(super) async fn compress_large(request: Request, next: Next) -> Response {
    let is_accepted = accepts_gzip(request.headers());
    let response = next.run(request).await;
    let is_large = response.body().size_hint().exact().is_some_and(|bytes| bytes >= LARGE);
    if !is_accepted || !is_large || !is_compressible(response.headers()) {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    // A body whose length is known is in memory, and is handed over as it is.
    let Ok(bytes) = to_bytes(body, usize::MAX).await else {
        return super::refusal(&crate::error::Error::internal("a body in memory could not be read"));
    };
    let original = bytes.clone();
    match tokio::task::spawn_blocking(move || gzip(&bytes)).await {
        Ok(compressed) => {
            parts.headers.remove(CONTENT_LENGTH);
            parts.headers.insert(CONTENT_ENCODING, HeaderValue::from_static("gzip"));
            parts.headers.append(VARY, HeaderValue::from_static("accept-encoding"));
            Response::from_parts(parts, Body::from(compressed))
        }
        Err(_) => Response::from_parts(parts, Body::from(original)),
    }
}

/// Whether an answer gains by compression, and is no other one by it: what has a tag is that of its bytes.
pub(super) fn is_compressible(headers: &HeaderMap) -> bool {
    let content_type = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes).unwrap_or_default();
    content_type.starts_with(b"application/json")
        && !headers.contains_key(ETAG)
        && !headers.contains_key(CONTENT_ENCODING)
}

/// Whether the caller names gzip among the encodings that it takes, and not with a weight of zero.
fn accepts_gzip(headers: &HeaderMap) -> bool {
    let named = headers.get_all(ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    named.flat_map(|value| value.split(',')).any(|one| {
        let (name, weight) = one.split_once(';').unwrap_or((one, ""));
        let weight = weight.trim().strip_prefix("q=").map_or(Ok(1.0), str::parse::<f64>);
        name.trim().eq_ignore_ascii_case("gzip") && weight.is_ok_and(|weight| weight > 0.0)
    })
}

/// A fifth of the time of the best level for 3 % more bytes.
fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.expect("a vector takes all that is written")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gzip_is_taken_where_it_is_named_and_not_refused() {
        let accepts = |value: &'static str| {
            accepts_gzip(&HeaderMap::from_iter([(ACCEPT_ENCODING, HeaderValue::from_static(value))]))
        };
        for yes in ["gzip", "br, gzip", "GZIP;q=0.5", "deflate, gzip ; q=1.0"] {
            assert!(accepts(yes), "{yes}");
        }
        for no in ["", "br", "gzip;q=0", "gzip;q=0.0, br", "x-gzip", "gzip;q=much"] {
            assert!(!accepts(no), "{no}");
        }
    }
}
