//! The page of the server: files that npm made when this was built, embedded with their compressed forms.
//!
//! It knows the server by its public API alone. Where npm was not there, `/` says how to get the page.

use axum::Router;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use http::header::{
    ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG,
    IF_NONE_MATCH, VARY,
};

/// No inline script and no inline style; nothing from elsewhere.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// One file of the page.
pub(crate) struct Asset {
    path: &'static str,
    etag: &'static str,
    plain: &'static [u8],
    brotli: Option<&'static [u8]>,
    gzip: Option<&'static [u8]>,
}

include!(concat!(env!("OUT_DIR"), "/assets.rs"));

/// Whether the page is in this program.
pub fn is_embedded() -> bool {
    !ASSETS.is_empty()
}

/// The routes of the page: `/` and its files, and nothing else.
pub fn router() -> Router {
    if ASSETS.is_empty() {
        let page = ([(CONTENT_SECURITY_POLICY, POLICY)], Html(include_str!("without.html")));
        return Router::new().route("/", get(async || page));
    }
    let add = |router: Router, asset: &'static Asset| {
        router.route(asset.path, get(async |headers: HeaderMap| asset.answer(&headers)))
    };
    ASSETS.iter().fold(Router::new(), add)
}

impl Asset {
    fn answer(&self, headers: &HeaderMap) -> Response {
        let accepted = list(headers, &ACCEPT_ENCODING);
        let accepts = |name: &str| {
            accepted.split(',').map(str::trim).any(|offer| {
                let (offered, weight) = offer.split_once(';').unwrap_or((offer, ""));
                offered.trim() == name && !matches!(weight.trim(), "q=0" | "q=0.0" | "q=0.00" | "q=0.000")
            })
        };
        let (encoding, body) = match (self.brotli, self.gzip) {
            (Some(body), _) if accepts("br") => (Some("br"), body),
            (_, Some(body)) if accepts("gzip") => (Some("gzip"), body),
            _ => (None, self.plain),
        };
        // A strong tag names exact bytes, so each encoding has its own.
        let tag = format!("\"{}{}\"", self.etag, encoding.map_or(String::new(), |name| format!("-{name}")));
        let cache =
            if self.path.starts_with("/assets/") { "max-age=31536000, immutable" } else { "no-cache" };
        let common = [
            (CONTENT_TYPE, self.content_type()),
            (CONTENT_SECURITY_POLICY, POLICY),
            (CACHE_CONTROL, cache),
            (VARY, "accept-encoding"),
            (ETAG, &tag),
        ];
        let known = list(headers, &IF_NONE_MATCH);
        if known.split(',').map(|known| known.trim().trim_start_matches("W/")).any(|known| known == tag) {
            return (StatusCode::NOT_MODIFIED, common).into_response();
        }
        let mut response = (common, body).into_response();
        if let Some(encoding) = encoding {
            response.headers_mut().insert(CONTENT_ENCODING, http::HeaderValue::from_static(encoding));
        }
        response
    }

    fn content_type(&self) -> &'static str {
        match self.path.rsplit('.').next() {
            Some("js") => "text/javascript; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => "text/html; charset=utf-8",
        }
    }
}

fn list(headers: &HeaderMap, name: &http::HeaderName) -> String {
    let values = headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
    values.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASSET: Asset =
        Asset { path: "/assets/a.js", etag: "1", plain: b"plain", brotli: Some(b"br"), gzip: Some(b"gz") };

    fn ask(pairs: &[(http::HeaderName, &'static str)]) -> Response {
        let headers = pairs.iter().map(|(n, v)| (n.clone(), http::HeaderValue::from_static(v))).collect();
        ASSET.answer(&headers)
    }

    #[test]
    fn each_encoding_is_sent_where_it_is_taken() {
        let encoding =
            |accepted| ask(&[(ACCEPT_ENCODING, accepted)]).headers().get(CONTENT_ENCODING).cloned();
        assert_eq!(encoding("gzip, deflate, br").unwrap(), "br");
        assert_eq!(encoding("gzip, br;q=0").unwrap(), "gzip");
        assert_eq!(encoding("identity"), None);
    }

    #[test]
    fn a_known_tag_spares_the_body() {
        let tag = ask(&[]).headers()[ETAG].clone();
        assert_eq!(tag, "\"1\"");
        assert_eq!(ask(&[(IF_NONE_MATCH, "\"1\"")]).status(), StatusCode::NOT_MODIFIED);
        assert_eq!(ask(&[(IF_NONE_MATCH, "\"2\"")]).status(), StatusCode::OK);
    }
}
