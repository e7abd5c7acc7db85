//! Which web pages may call from a browser: those of allowed origins, over gRPC-Web as over HTTP, and no others.

use std::time::Duration;

use http::header::{CONTENT_DISPOSITION, ETAG, LOCATION, RETRY_AFTER};
use http::{HeaderName, HeaderValue, Method};
use tower_http::cors::{AllowHeaders, CorsLayer};

/// How long a browser may remember what it is allowed, without asking again.
const MAX_AGE: Duration = Duration::from_secs(3600);

/// Answers preflights and marks replies for pages of `allowed_origins`; `None` where there are none.
pub(crate) fn layer(allowed_origins: Vec<HeaderValue>) -> Option<CorsLayer> {
    if allowed_origins.is_empty() {
        return None;
    }
    // A refusal over gRPC is in headers, which a page reads only where they are exposed by name.
    let exposed = [
        HeaderName::from_static("grpc-status"),
        HeaderName::from_static("grpc-message"),
        HeaderName::from_static("grpc-status-details-bin"),
        HeaderName::from_static("x-request-id"),
        CONTENT_DISPOSITION,
        ETAG,
        LOCATION,
        RETRY_AFTER,
    ];
    let layer = CorsLayer::new()
        .allow_origin(allowed_origins)
        .allow_methods([Method::GET, Method::POST, Method::PUT, Method::PATCH, Method::DELETE])
        .allow_headers(AllowHeaders::mirror_request())
        .expose_headers(exposed)
        .max_age(MAX_AGE);
    Some(layer)
}
