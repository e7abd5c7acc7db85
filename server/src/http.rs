//! The service as HTTP with JSON, files and server-sent events.
//!
//! JSON is the wire contract's, by its descriptors, with the names of the `.proto` files; nothing is
//! declared twice. Handlers read a request, ask [`Api`] and write the answer; they decide nothing.
//! Every answer that is not a success is a problem document (RFC 9457).

mod archives;
mod compression;
mod csv;
pub(crate) mod dry_run;
mod evaluation;
mod events;
mod examples;
mod experiments;
mod exploration;
mod extract;
mod history;
mod json;
mod json_points;
mod mesh;
mod negotiation;
mod openapi;
mod operations;
mod problem;
mod proto_json;
mod reference;
mod schema;
mod series;
mod sessions;
mod tickets;
mod view_file;

use std::any::Any;
use std::sync::LazyLock;

use axum::Router;
use axum::extract::{Request, State};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use http::header::{CONTENT_TYPE, ETAG};
use http::{Extensions, HeaderMap, Method, StatusCode, Uri, Version};
use tower_http::CompressionLevel;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{Predicate, SizeAbove};
use tower_http::decompression::RequestDecompressionLayer;
use tower_http::request_id::{MakeRequestUuid, PropagateRequestIdLayer, SetRequestIdLayer};
use tower_http::trace::TraceLayer;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::access::guard::Guard;
use crate::api::Api;
use crate::error::Error;
use crate::serve::bodies::{Bodies, Kind};
use problem::Problem;

/// Smaller bodies gain nothing by compression, in bytes.
const LEAST_COMPRESSED_BYTES: u64 = 1024;

/// All routes with their layers.
pub(crate) fn router(api: Api, guard: &Guard, bodies: Bodies, additional_routes: Router) -> Router {
    // The document never changes, so every server of a process shares one.
    static DOCUMENT: LazyLock<String> = LazyLock::new(|| openapi::document(described()));
    let document = async || ([(CONTENT_TYPE, "application/json")], DOCUMENT.as_str());
    // The service logs each call and each failure; this adds to those lines where the call came from.
    let trace = TraceLayer::new_for_http().make_span_with(span).on_failure(());
    let (routes, _) = documented().split_for_parts();
    let (probes, _) = probes().split_for_parts();
    // What is the same for everybody is open: a page has to be there before anybody can say who they are.
    let open = probes
        .route("/openapi.json", axum::routing::get(document))
        .with_state(api.clone())
        .merge(openapi::documentation_page())
        .merge(palpate_dashboard::router());
    routes
        .with_state(api)
        .merge(tickets::router(guard.clone()))
        .merge(additional_routes)
        .route_layer(from_fn_with_state(guard.clone(), Guard::admit))
        .merge(open)
        .fallback(no_such_path)
        .method_not_allowed_fallback(method_not_allowed)
        // Inside of what decompresses, so that it counts what is held and not what was sent.
        .layer(from_fn_with_state(bodies, receive))
        // What it does not know stays marked as encoded, and is refused where a body is read. It decompresses as the
        // body is read, so the bound on what is read is one on what was decompressed.
        .layer(RequestDecompressionLayer::new().pass_through_unaccepted(true))
        .layer(CatchPanicLayer::custom(answer_panic))
        .layer(from_fn(compression::compress_large))
        .layer(
            CompressionLayer::new()
                // It is done where calls are answered, so it has to be short.
                .quality(CompressionLevel::Fastest)
                .compress_when(SizeAbove::new(LEAST_COMPRESSED_BYTES).and(is_compressible)),
        )
        .layer(PropagateRequestIdLayer::x_request_id())
        .layer(trace)
        .layer(SetRequestIdLayer::x_request_id(MakeRequestUuid))
}

/// A refusal that comes before any route.
pub(crate) fn refusal(error: &Error) -> Response {
    Problem::from(error.clone()).into_response()
}

async fn receive(State(bodies): State<Bodies>, request: Request, next: Next) -> Response {
    let kind = if request.uri().path() == archives::IMPORTS { Kind::Pieces } else { Kind::Whole(None) };
    bodies.run(request, kind, next, refusal).await
}

/// All that the document describes.
fn described() -> utoipa::openapi::OpenApi {
    let tickets = OpenApiRouter::new().routes(routes!(tickets::issue));
    documented().into_openapi().merge_from(tickets.into_openapi()).merge_from(probes().into_openapi())
}

/// The routes that the OpenAPI document describes: each is declared once, beside its handler.
fn documented() -> OpenApiRouter<Api> {
    OpenApiRouter::with_openapi(openapi::introduction())
        .routes(routes!(sessions::create, sessions::list))
        .routes(routes!(sessions::get, sessions::delete, history::update))
        .routes(routes!(history::finish))
        .routes(routes!(history::fork))
        .routes(routes!(history::retract))
        .routes(routes!(history::replay))
        .routes(routes!(archives::export))
        .routes(routes!(archives::import))
        .routes(routes!(exploration::add_prior))
        .routes(routes!(exploration::propose))
        .routes(routes!(exploration::report))
        .routes(routes!(mesh::get))
        .routes(routes!(events::get))
        .routes(routes!(evaluation::evaluate))
        .routes(routes!(reference::set, reference::get, reference::delete))
        .routes(routes!(series::get))
        .routes(routes!(experiments::list))
        .routes(routes!(experiments::summary))
        .routes(routes!(operations::metrics))
        .routes(routes!(operations::version))
}

/// The routes that answer whoever asks.
fn probes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(operations::healthz))
        .routes(routes!(operations::livez))
        .routes(routes!(operations::readyz))
}

async fn no_such_path(uri: Uri) -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "NO_SUCH_PATH",
        format!("there is nothing at {}: /docs lists all paths", uri.path()),
    )
}

async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    Problem::new(
        StatusCode::METHOD_NOT_ALLOWED,
        "METHOD_NOT_ALLOWED",
        format!("{} does not answer {method}: the Allow header says what it answers", uri.path()),
    )
}

#[expect(clippy::needless_pass_by_value, reason = "the layer hands the panic over")]
fn answer_panic(panic: Box<dyn Any + Send>) -> Response {
    Problem::panicked(panic.as_ref()).into_response()
}

fn span(request: &Request) -> tracing::Span {
    let request_id = request.headers().get("x-request-id").and_then(|id| id.to_str().ok());
    tracing::info_span!("http", method = %request.method(), path = request.uri().path(), request_id)
}

/// JSON compresses well. What carries an entity tag stays as it is, because a strong tag names exact bytes.
fn is_compressible(_: StatusCode, _: Version, headers: &HeaderMap, _: &Extensions) -> bool {
    compression::is_compressible(headers)
}

/// Answers with `body` unless the caller's `If-None-Match` names `etag`, which is quoted here and not before.
fn tagged(headers: &HeaderMap, etag: &str, body: impl IntoResponse) -> Response {
    let tag = format!("\"{etag}\"");
    let known = headers.get_all(http::header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let is_known = known
        .flat_map(|value| value.split(','))
        .map(|value| value.trim().trim_start_matches("W/"))
        .any(|value| value == "*" || value == tag);
    if is_known {
        ([(ETAG, tag)], StatusCode::NOT_MODIFIED).into_response()
    } else {
        ([(ETAG, tag)], body).into_response()
    }
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use http::{HeaderName, HeaderValue};
    use tower::ServiceExt;

    use super::*;

    #[test]
    fn a_known_tag_spares_the_body_and_an_unknown_one_does_not() {
        let mut headers = HeaderMap::new();
        assert_eq!(tagged(&headers, "a-1", "body").status(), StatusCode::OK);
        headers.insert(http::header::IF_NONE_MATCH, HeaderValue::from_static("\"b\", W/\"a-1\""));
        let response = tagged(&headers, "a-1", "body");
        assert_eq!(response.status(), StatusCode::NOT_MODIFIED);
        assert_eq!(response.headers()[ETAG], "\"a-1\"");
        assert_eq!(tagged(&headers, "a-2", "body").status(), StatusCode::OK);
    }

    #[tokio::test]
    async fn a_handler_that_panics_answers_with_a_problem() {
        async fn broken() -> &'static str {
            panic!("index 7 of 3")
        }
        let router =
            Router::new().route("/", axum::routing::get(broken)).layer(CatchPanicLayer::custom(answer_panic));
        let response = router.oneshot(Request::get("/").body(Body::empty()).unwrap()).await.unwrap();
        assert_eq!(response.status(), StatusCode::INTERNAL_SERVER_ERROR);
        assert_eq!(response.headers()[CONTENT_TYPE], "application/problem+json");
        let body = axum::body::to_bytes(response.into_body(), 10_000).await.unwrap();
        let text = String::from_utf8(body.to_vec()).unwrap();
        assert!(text.contains("INTERNAL") && !text.contains("index 7"), "{text}");
    }

    #[test]
    fn only_plain_json_is_compressed() {
        let check = |pairs: &[(HeaderName, &'static str)]| {
            let headers = pairs.iter().map(|(n, v)| (n.clone(), HeaderValue::from_static(v))).collect();
            is_compressible(StatusCode::OK, Version::HTTP_11, &headers, &Extensions::new())
        };
        assert!(check(&[(CONTENT_TYPE, "application/json")]));
        assert!(!check(&[(CONTENT_TYPE, "text/event-stream")]));
        assert!(!check(&[(CONTENT_TYPE, "application/json"), (ETAG, "\"1\"")]));
    }
}
