//! `/v1/simulations`: a bounded number of simulated robots that whoever may call the server can start.
//!
//! A part of the program and not of the server, which knows no simulator: each robot calls over the wire like any other.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::extract::rejection::JsonRejection;
use axum::extract::{Path, State};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{delete, get};
use axum::{Json, Router};
use clap::Parser;
use http::header::{AUTHORIZATION, CONTENT_TYPE};
use http::{HeaderMap, StatusCode};
use palpate_client::Client;
use palpate_client::proto::v1::{MeshFormat, SetReferenceRequest};
use palpate_core::geometry::TriangleMesh;
use palpate_server::access::{Scope, require};
use palpate_simulator::robot::{Attempt, Robot};
use palpate_simulator::shapes;
use serde::{Deserialize, Serialize};
use serde_json::json;
use tokio_util::sync::CancellationToken;

use super::robot::{SensorArgs, SessionArgs, attempts, plan};

/// The most that one server can be allowed.
pub(super) const MOST: i64 = 16;
const LONGEST_PAUSE_MS: u64 = 60_000;

/// The robots of one server.
struct Simulations {
    url: String,
    most: usize,
    running: Mutex<BTreeMap<String, Running>>,
    /// Robots that are being started count, too.
    places: Arc<tokio::sync::Semaphore>,
    shutdown: CancellationToken,
}

#[derive(Clone, Serialize)]
struct Running {
    session_id: String,
    object: String,
    attempts: u32,
    attempts_made: u32,
    #[serde(skip)]
    stop: CancellationToken,
}

/// What is to be simulated; every field has a default.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Request {
    object: String,
    seed: u64,
    attempts: u32,
    experiment: String,
    /// How long the robot waits before each touch.
    pause_ms: u64,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            object: "bottle".to_owned(),
            seed: 1,
            attempts: 50,
            experiment: "simulation".to_owned(),
            pause_ms: 500,
        }
    }
}

/// The arguments of the command line, for their defaults.
#[derive(Parser)]
#[command(mut_arg("pad", |pad| pad.default_value("flat")))]
struct Defaults {
    #[command(flatten)]
    session: SessionArgs,
    #[command(flatten)]
    sensors: SensorArgs,
}

/// The routes of a server that listens on `address` and allows `most` robots; none where it allows none.
pub(super) fn router(address: SocketAddr, most: usize, shutdown: CancellationToken) -> Router {
    if most == 0 {
        return Router::new();
    }
    let host = if address.ip().is_unspecified() { "127.0.0.1".to_owned() } else { host(address) };
    let simulations = Simulations {
        url: format!("http://{host}:{}", address.port()),
        most,
        running: Mutex::default(),
        places: Arc::new(tokio::sync::Semaphore::new(most)),
        shutdown,
    };
    Router::new()
        .route("/v1/simulations", get(list).post(start))
        .route("/v1/simulations/{session_id}", delete(stop))
        .with_state(Arc::new(simulations))
        .route_layer(from_fn_with_state(Scope::Robot, require))
}

fn host(address: SocketAddr) -> String {
    if address.is_ipv6() { format!("[{}]", address.ip()) } else { address.ip().to_string() }
}

impl Simulations {
    fn running(&self) -> MutexGuard<'_, BTreeMap<String, Running>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

async fn list(State(simulations): State<Arc<Simulations>>) -> Response {
    let running: Vec<Running> = simulations.running().values().cloned().collect();
    let objects = shapes::OBJECTS.map(|object| object.name);
    Json(json!({ "objects": objects, "most_at_once": simulations.most, "running": running })).into_response()
}

async fn start(
    State(simulations): State<Arc<Simulations>>,
    headers: HeaderMap,
    body: Result<Json<Request>, JsonRejection>,
) -> Response {
    let Json(request) = match body {
        Ok(request) => request,
        Err(rejection) => return problem(rejection.status(), "BODY_INVALID", "", &rejection.body_text()),
    };
    match begin(simulations, request, token(&headers)).await {
        Ok(running) => {
            let place = format!("/v1/sessions/{}", running.session_id);
            (StatusCode::CREATED, [("location", place)], Json(running)).into_response()
        }
        Err(refused) => refused,
    }
}

/// The token that whoever starts a robot has shown; the robot calls with the same.
fn token(headers: &HeaderMap) -> Option<String> {
    let (_, token) = headers.get(AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    Some(token.trim().to_owned())
}

async fn begin(
    simulations: Arc<Simulations>,
    request: Request,
    token: Option<String>,
) -> Result<Running, Response> {
    let invalid =
        |field: &str, text: &str| problem(StatusCode::UNPROCESSABLE_ENTITY, "FIELD_INVALID", field, text);
    let body = shapes::generate(&request.object).map_err(|error| invalid("object", &error.to_string()))?;
    attempts(&request.attempts.to_string()).map_err(|error| invalid("attempts", &error))?;
    if request.pause_ms > LONGEST_PAUSE_MS {
        return Err(invalid("pause_ms", "must be at most 60000, which is a minute"));
    }
    let Ok(place) = Arc::clone(&simulations.places).try_acquire_owned() else {
        let text = format!(
            "{} simulated robots run already, as many as --simulated-robots allows: stop one or wait",
            simulations.most
        );
        return Err(problem(StatusCode::TOO_MANY_REQUESTS, "TOO_MANY_SIMULATIONS", "", &text));
    };
    let failed = |error: &dyn std::fmt::Display| {
        problem(
            StatusCode::BAD_GATEWAY,
            "SIMULATION_FAILED",
            "",
            &format!("the robot could not begin: {error}"),
        )
    };
    let Defaults { mut session, sensors } = Defaults::parse_from(["robot"]);
    session.seed = request.seed;
    session.attempts = request.attempts;
    let plan = plan(&request.object, &request.experiment, &session, &sensors);
    let client = Client::builder(&simulations.url);
    let client = if let Some(token) = token { client.token(&token) } else { client };
    let client = client.connect().await.map_err(|error| failed(&error))?;
    let (begun, first) = tokio::sync::oneshot::channel();
    let stop = simulations.shutdown.child_token();
    let known = Arc::clone(&simulations);
    tokio::spawn(async move {
        let _place = place;
        let mut robot = match Robot::begin(client.clone(), &body, plan).await {
            Ok(robot) => robot,
            Err(error) => {
                // Whoever asked may be gone, and is owed nothing then.
                let _ = begun.send(Err(error));
                return;
            }
        };
        let session_id = robot.session().session_id.clone();
        let running = Running {
            session_id: session_id.clone(),
            object: request.object,
            attempts: request.attempts,
            attempts_made: 0,
            stop: stop.clone(),
        };
        known.running().insert(session_id.clone(), running.clone());
        let reference = SetReferenceRequest {
            session_id: session_id.clone(),
            mesh: obj(body.mesh()).into_bytes().into(),
            format: MeshFormat::Obj.into(),
            metres_per_unit: 0.0,
        };
        if let Err(error) = client.set_reference(reference).await {
            tracing::warn!(session_id, %error, "the simulated robot's session keeps no reference mesh");
        }
        let _ = begun.send(Ok(running));
        loop {
            let step = async {
                tokio::time::sleep(Duration::from_millis(request.pause_ms)).await;
                robot.step().await
            };
            let step = tokio::select! {
                () = stop.cancelled() => break,
                step = step => step,
            };
            match step {
                Ok(Some(Attempt { number, .. })) => {
                    if let Some(running) = known.running().get_mut(&session_id) {
                        running.attempts_made = number;
                    }
                }
                Ok(None) => break,
                Err(error) => {
                    tracing::warn!(session_id, %error, "a simulated robot ended early");
                    break;
                }
            }
        }
        known.running().remove(&session_id);
    });
    match first.await {
        Ok(Ok(running)) => Ok(running),
        Ok(Err(error)) => Err(failed(&error)),
        Err(_) => Err(failed(&"it ended at once")),
    }
}

async fn stop(State(simulations): State<Arc<Simulations>>, Path(session_id): Path<String>) -> Response {
    match simulations.running().get(&session_id) {
        Some(running) => {
            running.stop.cancel();
            StatusCode::NO_CONTENT.into_response()
        }
        None => problem(
            StatusCode::NOT_FOUND,
            "NO_SUCH_SIMULATION",
            "",
            "no simulated robot explores this session: GET /v1/simulations lists those that run",
        ),
    }
}

/// A problem document as the server's (RFC 9457).
pub(super) fn problem(status: StatusCode, reason: &str, field: &str, detail: &str) -> Response {
    let fields: Vec<_> =
        (!field.is_empty()).then(|| json!({ "field": field, "description": detail })).into_iter().collect();
    let title = status.canonical_reason();
    let code = status.as_u16();
    let detail = if field.is_empty() { detail.to_owned() } else { format!("{field}: {detail}") };
    let body = json!({
        "type": "about:blank", "title": title, "status": code, "detail": detail, "reason": reason, "fields": fields,
    });
    (status, [(CONTENT_TYPE, "application/problem+json")], body.to_string()).into_response()
}

fn obj(mesh: &TriangleMesh) -> String {
    let mut text = String::new();
    for vertex in &mesh.vertices {
        writeln!(text, "v {} {} {}", vertex.x, vertex.y, vertex.z).expect("a string grows");
    }
    for [a, b, c] in &mesh.faces {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("a string grows");
    }
    text
}
