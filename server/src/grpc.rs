//! The service over gRPC and gRPC-Web: three thin services, and errors as rich statuses.
//!
//! Handlers translate and delegate; whatever they decide about is decided in [`Api`].

mod exploration;
mod reconstruction;
mod sessions;
mod status;

use axum::body::Body;
use axum::extract::State;
use axum::middleware::{Next, from_fn_with_state};
use http::header::CONTENT_TYPE;
use http::{HeaderMap, HeaderValue};
use palpate_proto::v1::exploration_service_server::ExplorationServiceServer;
use palpate_proto::v1::reconstruction_service_server::ReconstructionServiceServer;
use palpate_proto::v1::session_service_server::SessionServiceServer;
use std::pin::Pin;
use std::time::Duration;
use tokio::time::Instant;
use tokio_stream::{Stream, StreamExt};
use tonic::service::Routes;
use tonic::{Request, Response, Status};
use tonic_health::server::HealthReporter;
use tonic_web::GrpcWebLayer;
use tower::Layer;

use crate::access::Caller;
use crate::access::guard::Guard;
use crate::api::{Api, Call, min_revision};
use crate::error::Error;
use crate::peer;
use crate::serve::bodies::{Bodies, Kind};
use status::status;

/// A reply leaves this much before the caller's deadline, so that it says DEADLINE_EXCEEDED in time.
const MARGIN: Duration = Duration::from_millis(20);

/// The three services behind one router, with gRPC-Web, health and reflection.
///
/// # Errors
/// The embedded descriptors cannot be read, which is a fault of the build.
pub(crate) fn router(
    api: &Api,
    guard: Guard,
    bodies: Bodies,
) -> Result<(axum::Router, HealthReporter), tonic_reflection::server::Error> {
    let limit = api.limits().message_bytes;
    // Replies carry whole meshes and clouds, which the limits on a session bound.
    let service = Handlers { api: api.clone() };
    let web = GrpcWebLayer::new();
    let (health_reporter, health) = tonic_health::server::health_reporter();
    let routes =
        Routes::new(web.layer(SessionServiceServer::new(service.clone()).max_decoding_message_size(limit)))
            .add_service(
                web.layer(ExplorationServiceServer::new(service.clone()).max_decoding_message_size(limit)),
            )
            .add_service(
                web.layer(ReconstructionServiceServer::new(service).max_decoding_message_size(limit)),
            )
            .add_service(web.layer(health))
            .add_service(reflection().build_v1()?)
            .add_service(reflection().build_v1alpha()?);
    let reading = axum::middleware::map_response(move |response| status::explain_reading(response, limit));
    let router = routes.into_axum_router().reset_fallback();
    let router = router.layer(from_fn_with_state(bodies, receive)).layer(reading);
    Ok((router.layer(from_fn_with_state(guard, Guard::admit)), health_reporter))
}

/// A refusal that comes before any handler, in the kind of gRPC that was asked for.
pub(crate) fn refusal(error: &Error, content_type: &HeaderValue) -> http::Response<Body> {
    let mut response = status(error).into_http::<Body>();
    response.headers_mut().insert(CONTENT_TYPE, content_type.clone());
    response
}

/// Calls that send as many messages as they like.
const MESSAGES: [&str; 3] = ["/Explore", "/ImportSession", "/ServerReflectionInfo"];

async fn receive(
    State(bodies): State<Bodies>,
    request: http::Request<Body>,
    next: Next,
) -> http::Response<Body> {
    let content_type = request.headers().get(CONTENT_TYPE).cloned();
    let content_type = content_type.unwrap_or(HeaderValue::from_static("application/grpc"));
    let kind = match request.uri().path() {
        path if MESSAGES.iter().any(|call| path.ends_with(call)) => Kind::Messages,
        _ => Kind::Whole(timeout(request.headers())),
    };
    bodies.run(request, kind, next, |error| refusal(error, &content_type)).await
}

/// Tells health checks whether the three services serve.
pub(crate) async fn report_health(reporter: HealthReporter, serving: bool) {
    if serving {
        reporter.set_serving::<SessionServiceServer<Handlers>>().await;
        reporter.set_serving::<ExplorationServiceServer<Handlers>>().await;
        reporter.set_serving::<ReconstructionServiceServer<Handlers>>().await;
    } else {
        reporter.set_not_serving::<SessionServiceServer<Handlers>>().await;
        reporter.set_not_serving::<ExplorationServiceServer<Handlers>>().await;
        reporter.set_not_serving::<ReconstructionServiceServer<Handlers>>().await;
        // The empty name stands for the server as a whole.
        reporter.set_service_status("", tonic_health::ServingStatus::NotServing).await;
    }
}

fn reflection() -> tonic_reflection::server::Builder<'static> {
    tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(palpate_proto::FILE_DESCRIPTOR_SET)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
}

/// Handles the calls of all three services.
#[derive(Clone, Debug)]
pub(crate) struct Handlers {
    api: Api,
}

/// A stream of replies as tonic wants it.
type Replies<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send + 'static>>;

fn reply<T>(outcome: Result<T, Error>) -> Result<Response<T>, Status> {
    outcome.map(Response::new).map_err(|error| status(&error))
}

fn replies<T: 'static>(
    outcome: Result<impl Stream<Item = Result<T, Error>> + Send + 'static, Error>,
) -> Result<Response<Replies<T>>, Status> {
    let stream = outcome.map_err(|error| status(&error))?;
    Ok(Response::new(Box::pin(stream.map(|item| item.map_err(|error| status(&error))))))
}

/// Who calls, and until when.
fn call<T>(request: &Request<T>) -> Result<Call, Status> {
    let caller = Caller::of(request.extensions()).map_err(|error| status(&error))?;
    let peer = peer::address(request.extensions());
    let at_least = min_revision(request.metadata().as_ref()).map_err(|error| status(&error))?;
    Ok(Call {
        at_least,
        deadline: timeout(request.metadata().as_ref())
            .and_then(|timeout| Instant::now().checked_add(timeout.saturating_sub(MARGIN.min(timeout / 4)))),
        caller,
        peer,
    })
}

fn timeout(headers: &HeaderMap) -> Option<Duration> {
    headers.get("grpc-timeout").and_then(|value| value.to_str().ok()).and_then(parse_timeout)
}

/// `grpc-timeout`: up to eight digits and a unit.
fn parse_timeout(text: &str) -> Option<Duration> {
    let (digits, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    let amount: u64 = digits.parse().ok().filter(|_| digits.len() <= 8)?;
    match unit {
        "H" => Some(Duration::from_secs(amount * 3600)),
        "M" => Some(Duration::from_secs(amount * 60)),
        "S" => Some(Duration::from_secs(amount)),
        "m" => Some(Duration::from_millis(amount)),
        "u" => Some(Duration::from_micros(amount)),
        "n" => Some(Duration::from_nanos(amount)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeouts_are_read_in_every_unit_and_nonsense_is_none() {
        assert_eq!(parse_timeout("2S"), Some(Duration::from_secs(2)));
        assert_eq!(parse_timeout("250m"), Some(Duration::from_millis(250)));
        assert_eq!(parse_timeout("1H"), Some(Duration::from_secs(3600)));
        for nonsense in ["", "S", "2", "2x", "-1S", "999999999S", "2\u{b5}"] {
            assert_eq!(parse_timeout(nonsense), None, "{nonsense}");
        }
    }
}
