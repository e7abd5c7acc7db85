//! The page that a server has at `/`, made by npm when this is compiled and held in the program.
//!
//! It uses the public API and nothing else, so all that is here is files. What they are is in `src`, in TypeScript.

use std::sync::LazyLock;

use axum::Router;
use axum::middleware::map_response;
use axum::response::Response;
use http::HeaderValue;
use http::header::CONTENT_SECURITY_POLICY;
use memory_serve::CacheControl;

/// The page loads its own scripts, styles and pictures, and asks its own server; pictures of the view are made as blobs.
const PAGE_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);

/// What [`router`] gives, made once: it takes some time to compress the files for those who take gzip alone.
static ROUTER: LazyLock<Router> = LazyLock::new(|| {
    memory_serve::load!()
        .index_file(Some("/index.html"))
        .html_cache_control(CacheControl::NoCache)
        // Their names change with what is in them.
        .cache_control(CacheControl::Long)
        .into_router()
        .layer(map_response(async |mut response: Response| {
            response.headers_mut().insert(CONTENT_SECURITY_POLICY, PAGE_POLICY);
            response
        }))
});

/// The files of the page, the page itself at `/`; each with an entity tag, compressed for those who take that.
pub fn router() -> Router {
    ROUTER.clone()
}
