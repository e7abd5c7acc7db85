//! The server as one piece, over real sockets; the workspace's `tests` package goes further.

use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::exploration_service_client::ExplorationServiceClient;
use palpate_proto::v1::reconstruction_service_client::ReconstructionServiceClient;
use palpate_proto::v1::session_service_client::SessionServiceClient;
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinHandle;
use tokio_stream::StreamExt;
use tonic::Code;
use tonic::transport::Channel;
use tonic_types::StatusExt;

use super::*;

struct Running {
    address: SocketAddr,
    shutdown: CancellationToken,
    server: JoinHandle<Result<(), ServeError>>,
    sessions: SessionServiceClient<Channel>,
    exploration: ExplorationServiceClient<Channel>,
    reconstruction: ReconstructionServiceClient<Channel>,
}

async fn start(folder: &TempDir) -> Running {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let shutdown = CancellationToken::new();
    let options = ServeOptions { database: folder.path().join("log.db").into(), ..ServeOptions::default() };
    let server = tokio::spawn(serve(listener, options, shutdown.clone()));
    let channel = Channel::from_shared(format!("http://{address}")).unwrap().connect().await.unwrap();
    Running {
        address,
        shutdown,
        server,
        sessions: SessionServiceClient::new(channel.clone()),
        exploration: ExplorationServiceClient::new(channel.clone()).max_encoding_message_size(64 << 20),
        reconstruction: ReconstructionServiceClient::new(channel),
    }
}

impl Running {
    async fn stop(self) {
        self.shutdown.cancel();
        tokio::time::timeout(Duration::from_secs(20), self.server).await.unwrap().unwrap().unwrap();
    }

    async fn create(&mut self, session_id: &str) -> v1::Session {
        let request = v1::CreateSessionRequest {
            session_id: session_id.into(),
            request_id: format!("create-{session_id}"),
            ..Default::default()
        };
        self.sessions.create_session(request).await.unwrap().into_inner()
    }

    async fn session(&mut self, session_id: &str) -> v1::Session {
        let request = v1::GetSessionRequest { session_id: session_id.into() };
        self.sessions.get_session(request).await.unwrap().into_inner()
    }
}

/// A patch of a sphere of 50 mm about (0, 0, 0.3), seen from the side of positive x.
fn cap() -> v1::VisualPrior {
    let spiral = (0..120).map(|i| {
        let (around, up) = (2.4 * f64::from(i), 1.0 - 0.35 * f64::from(i) / 120.0);
        let across = (1.0 - up * up).sqrt();
        [0.05 * up, 0.05 * across * around.cos(), 0.3 + 0.05 * across * around.sin()]
    });
    v1::VisualPrior {
        encoding: v1::PointEncoding::XyzF32Le.into(),
        points: spiral.flatten().flat_map(|x| (x as f32).to_le_bytes()).collect::<Vec<u8>>().into(),
        viewpoint: Some(v1::Vector3 { x: 1.0, y: 0.0, z: 0.3 }),
        ..Default::default()
    }
}

fn prior(session_id: &str) -> v1::AddVisualPriorRequest {
    v1::AddVisualPriorRequest {
        session_id: session_id.into(),
        prior: Some(cap()),
        request_id: "prior".into(),
        propose: 2,
        ..Default::default()
    }
}

/// A touch exactly where the candidate expects the surface.
fn touch(candidate: &v1::Candidate) -> v1::ContactResult {
    let pose = v1::Pose { position: candidate.point, orientation: candidate.tool_pose.unwrap().orientation };
    let wrench = v1::Wrench {
        force: Some(v1::Vector3 { x: 0.0, y: 0.0, z: -2.0 }),
        torque: Some(v1::Vector3 { x: 0.004, y: 0.0, z: 0.0 }),
    };
    let contact = v1::Contact { sensor_pose: Some(pose), wrench: Some(wrench), ..Default::default() };
    v1::ContactResult {
        candidate_id: candidate.candidate_id.clone(),
        outcome: Some(v1::contact_result::Outcome::Contact(contact)),
        ..Default::default()
    }
}

fn report(session_id: &str, result: v1::ContactResult, request_id: &str) -> v1::ReportContactRequest {
    v1::ReportContactRequest {
        session_id: session_id.into(),
        result: Some(result),
        request_id: request_id.into(),
        propose: 1,
        ..Default::default()
    }
}

fn reason(status: &tonic::Status) -> String {
    status.get_error_details().error_info().unwrap().reason.clone()
}

#[tokio::test]
async fn a_session_goes_on_after_a_restart_exactly_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = start(&folder).await;
    let created = server.create("ball").await;
    assert_eq!((created.revision, created.state()), (1, v1::SessionState::AwaitingPrior));

    let seen = server.exploration.add_visual_prior(prior("ball")).await.unwrap().into_inner();
    assert_eq!((seen.accepted_points, seen.candidates.len()), (120, 2));
    let first = &seen.candidates[0];
    let sum: f64 = first.terms.iter().map(|term| term.weight * term.value).sum();
    assert!((sum - first.score).abs() < 1e-9, "the terms sum to the score");

    let request = report("ball", touch(first), "touch-1");
    let accepted = server.exploration.report_contact(request.clone()).await.unwrap().into_inner();
    assert_eq!((accepted.seq, accepted.duplicate), (3, false));
    assert!(accepted.contact_uncertainty > 0.0 && accepted.contact_uncertainty < 0.2);
    let before = server.session("ball").await;
    server.stop().await;

    let mut server = start(&folder).await;
    let cold = server.session("ball").await;
    assert_eq!(cold, before);
    let again = server.exploration.report_contact(request.clone()).await.unwrap().into_inner();
    assert_eq!(again, v1::ReportContactResponse { duplicate: true, ..accepted.clone() });
    assert_eq!(server.session("ball").await.revision, 3, "a retry is not counted twice");

    // A candidate from before the restart, and the state it leads to, are still good.
    let next = report("ball", touch(&accepted.candidates[0]), "touch-2");
    let reply = server.exploration.report_contact(next).await.unwrap().into_inner();
    assert_eq!(reply.session.unwrap().stats.unwrap().contacts, 2);

    let mut other = request;
    other.result.as_mut().unwrap().robot_id = "another".into();
    let refused = server.exploration.report_contact(other).await.unwrap_err();
    assert_eq!((refused.code(), reason(&refused).as_str()), (Code::AlreadyExists, "REQUEST_ID_REUSED"));
    let mut stale = report("ball", touch(&accepted.candidates[0]), "touch-3");
    stale.expected_revision = Some(3);
    let refused = server.exploration.report_contact(stale).await.unwrap_err();
    assert_eq!((refused.code(), reason(&refused).as_str()), (Code::Aborted, "REVISION_MISMATCH"));
    server.stop().await;
}

#[tokio::test]
async fn a_past_mesh_after_a_restart_is_the_mesh_of_that_time() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = start(&folder).await;
    server.create("ball").await;
    let seen = server.exploration.add_visual_prior(prior("ball")).await.unwrap().into_inner();
    let newest = v1::GetMeshRequest { session_id: "ball".into(), ..Default::default() };
    let live = server.reconstruction.get_mesh(newest.clone()).await.unwrap().into_inner();
    let request = report("ball", touch(&seen.candidates[0]), "touch-1");
    server.exploration.report_contact(request).await.unwrap();
    server.stop().await;

    let mut server = start(&folder).await;
    let past = v1::GetMeshRequest { revision: 2, ..newest.clone() };
    let folded = server.reconstruction.get_mesh(past.clone()).await.unwrap().into_inner();
    assert_eq!(folded, live);
    let Some(v1::mesh::Body::Raw(raw)) = live.body else { panic!("raw is the default") };
    assert_eq!((raw.n_vertices, raw.positions_f32_le.len()), (2562, 2562 * 12));

    let known = v1::GetMeshRequest { if_none_match: live.etag.clone(), ..past };
    assert!(server.reconstruction.get_mesh(known).await.unwrap().into_inner().not_modified);
    let shape = v1::GetMeshRequest { have_topology: raw.topology_etag, ..newest.clone() };
    let shape = server.reconstruction.get_mesh(shape).await.unwrap().into_inner();
    let Some(v1::mesh::Body::Raw(raw)) = shape.body else { panic!("raw is the default") };
    assert!(raw.faces_u32_le.is_empty() && shape.etag != live.etag);
    let ply = v1::GetMeshRequest { format: v1::MeshFormat::Ply.into(), ..newest.clone() };
    let ply = server.reconstruction.get_mesh(ply).await.unwrap().into_inner();
    assert!(matches!(ply.body, Some(v1::mesh::Body::File(file)) if file.starts_with(b"ply")));
    let beyond = v1::GetMeshRequest { revision: 9, ..newest };
    assert_eq!(server.reconstruction.get_mesh(beyond).await.unwrap_err().code(), Code::InvalidArgument);
    server.stop().await;
}

#[tokio::test]
async fn a_watcher_sees_every_event_once_and_shutdown_does_not_wait_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = start(&folder).await;
    server.create("ball").await;
    let watch = v1::WatchSessionRequest {
        session_id: "ball".into(),
        include_mesh: true,
        heartbeat: Some(palpate_proto::Duration { seconds: 1, nanos: 0 }),
        ..Default::default()
    };
    let mut updates = server.reconstruction.watch_session(watch).await.unwrap().into_inner();
    let seen = server.exploration.add_visual_prior(prior("ball")).await.unwrap().into_inner();
    let request = report("ball", touch(&seen.candidates[0]), "touch-1");
    server.exploration.report_contact(request).await.unwrap();
    let mut story = Vec::new();
    while story.last().is_none_or(|last| last != "heartbeat") {
        story.push(match updates.next().await.unwrap().unwrap().update.unwrap() {
            v1::watch_session_response::Update::Event(event) => format!("event {}", event.seq),
            v1::watch_session_response::Update::Mesh(mesh) => format!("mesh {}", mesh.revision),
            v1::watch_session_response::Update::Heartbeat(_) => "heartbeat".to_owned(),
        });
    }
    assert_eq!(story, ["event 1", "event 2", "mesh 2", "event 3", "mesh 3", "heartbeat"]);
    server.stop().await;
    assert_eq!(updates.next().await.unwrap().unwrap_err().code(), Code::Unavailable);
}

#[tokio::test]
async fn an_exploration_stream_survives_bad_messages_and_tells_what_was_missed() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = start(&folder).await;
    server.create("ball").await;
    let say =
        |id: u64, message| v1::ExploreRequest { id, request_id: format!("m{id}"), message: Some(message) };
    let open = |resume_after_revision| {
        v1::explore_request::Message::Open(v1::ExploreOpen {
            session_id: "ball".into(),
            top_k: 1,
            send_mesh: true,
            resume_after_revision,
            ..Default::default()
        })
    };
    let unlocated = v1::VisualPrior { voxel_m: Some(-1.0), ..cap() };
    let messages = vec![
        say(1, v1::explore_request::Message::Ping(v1::Ping { nonce: 9 })),
        say(2, v1::explore_request::Message::Result(v1::ContactResult::default())),
        say(3, open(0)),
        say(4, v1::explore_request::Message::VisualPrior(unlocated)),
        say(5, v1::explore_request::Message::VisualPrior(cap())),
        say(6, v1::explore_request::Message::Propose(v1::ProposeContactsRequest::default())),
    ];
    let replies = server.exploration.explore(tokio_stream::iter(messages)).await.unwrap().into_inner();
    let replies: Vec<_> = replies.map(Result::unwrap).collect().await;
    let story: Vec<_> = replies.iter().map(|reply| (reply.in_reply_to, name(reply))).collect();
    assert_eq!(
        story,
        [
            (1, "pong"),
            (2, "message"),
            (3, "opened"),
            (4, "visual_prior.voxel_m"),
            (5, "prior"),
            (5, "mesh"),
            (6, "candidates")
        ]
    );
    let messages = vec![say(7, open(1)), say(5, v1::explore_request::Message::VisualPrior(cap()))];
    let replies = server.exploration.explore(tokio_stream::iter(messages)).await.unwrap().into_inner();
    let replies: Vec<_> = replies.map(Result::unwrap).collect().await;
    let story: Vec<_> = replies.iter().map(|reply| (reply.in_reply_to, name(reply))).collect();
    assert_eq!(story, [(7, "opened"), (7, "prior"), (5, "prior"), (5, "mesh")]);
    assert_eq!(server.session("ball").await.revision, 2, "the repeated view is not counted twice");
    server.stop().await;
}

/// What a reply says; for a problem the field that it names.
fn name(reply: &v1::ExploreResponse) -> &str {
    match reply.message.as_ref().unwrap() {
        v1::explore_response::Message::Opened(_) => "opened",
        v1::explore_response::Message::Accepted(_) => "accepted",
        v1::explore_response::Message::Prior(_) => "prior",
        v1::explore_response::Message::Candidates(_) => "candidates",
        v1::explore_response::Message::Mesh(_) => "mesh",
        v1::explore_response::Message::Problem(problem) => &problem.fields[0].field,
        v1::explore_response::Message::Pong(_) => "pong",
    }
}

#[tokio::test]
async fn refusals_have_their_codes_and_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = start(&folder).await;
    let created = server.create("ball").await;
    assert_eq!(server.create("ball").await, created, "a repeated creation is answered as before");
    let other = v1::CreateSessionRequest { session_id: "ball".into(), ..Default::default() };
    let refused = server.sessions.create_session(other).await.unwrap_err();
    assert_eq!(reason(&refused), "SESSION_EXISTS");

    let early = server.exploration.report_contact(report("ball", v1::ContactResult::default(), "x")).await;
    assert_eq!(early.unwrap_err().code(), Code::InvalidArgument);
    let unseen = v1::ProposeContactsRequest { session_id: "ball".into(), ..Default::default() };
    let refused = server.exploration.propose_contacts(unseen).await.unwrap_err();
    assert_eq!((refused.code(), reason(&refused).as_str()), (Code::FailedPrecondition, "NO_VISUAL_PRIOR"));
    let nowhere = v1::GetSessionRequest { session_id: "nowhere".into() };
    assert_eq!(server.sessions.get_session(nowhere).await.unwrap_err().code(), Code::NotFound);
    let unnamed = server.sessions.fork_session(v1::ForkSessionRequest::default()).await.unwrap_err();
    assert_eq!(unnamed.code(), Code::InvalidArgument);

    let mut huge = prior("ball");
    huge.prior.as_mut().unwrap().points = vec![0; 17 << 20].into();
    let refused = server.exploration.add_visual_prior(huge).await.unwrap_err();
    assert_eq!((refused.code(), reason(&refused).as_str()), (Code::ResourceExhausted, "TOO_LARGE"));
    let mut hurried = tonic::Request::new(prior("ball"));
    hurried.set_timeout(Duration::from_micros(1));
    assert!(server.exploration.add_visual_prior(hurried).await.is_err());

    assert_eq!(server.session("ball").await, created);
    let delete = v1::DeleteSessionRequest {
        session_id: "ball".into(),
        etag: created.etag.clone(),
        request_id: "delete".into(),
    };
    let stale = v1::DeleteSessionRequest { etag: "9-9".into(), request_id: "stale".into(), ..delete.clone() };
    assert_eq!(reason(&server.sessions.delete_session(stale).await.unwrap_err()), "ETAG_MISMATCH");
    server.sessions.delete_session(delete.clone()).await.unwrap();
    server.sessions.delete_session(delete.clone()).await.unwrap();
    let again = v1::DeleteSessionRequest { request_id: String::new(), ..delete };
    assert_eq!(reason(&server.sessions.delete_session(again).await.unwrap_err()), "SESSION_NOT_FOUND");
    server.stop().await;
}

#[tokio::test]
async fn sessions_are_listed_in_pages_and_events_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = start(&folder).await;
    for name in ["one", "two", "six"] {
        server.create(name).await;
    }
    let mut request = v1::ListSessionsRequest { page_size: 2, ..Default::default() };
    let first = server.sessions.list_sessions(request.clone()).await.unwrap().into_inner();
    request.page_token = first.next_page_token;
    let second = server.sessions.list_sessions(request).await.unwrap().into_inner();
    let names: Vec<_> =
        first.sessions.iter().chain(&second.sessions).map(|s| s.session_id.as_str()).collect();
    assert_eq!((names, second.next_page_token.as_str()), (vec!["six", "two", "one"], ""));

    server.exploration.add_visual_prior(prior("one")).await.unwrap();
    let mut request = v1::ListEventsRequest { session_id: "one".into(), page_size: 1, ..Default::default() };
    let first = server.reconstruction.list_events(request.clone()).await.unwrap().into_inner();
    request.page_token = first.next_page_token;
    request.include_points = true;
    let second = server.reconstruction.list_events(request).await.unwrap().into_inner();
    assert_eq!((first.events[0].seq, second.events[0].seq, second.next_page_token.as_str()), (1, 2, ""));
    let Some(v1::event::Kind::VisualPrior(logged)) = &second.events[0].kind else { panic!("a view") };
    assert_eq!(logged, &cap(), "the log keeps what was sent, bit for bit");
    assert_eq!(second.events[0].state_hash.len(), 64);
    server.stop().await;
}

#[tokio::test]
async fn one_port_speaks_http_health_and_reflection_too() {
    let folder = tempfile::tempdir().unwrap();
    let server = start(&folder).await;
    let mut plain = TcpStream::connect(server.address).await.unwrap();
    plain.write_all(b"GET /readyz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").await.unwrap();
    let mut answer = String::new();
    plain.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");

    let channel =
        Channel::from_shared(format!("http://{}", server.address)).unwrap().connect().await.unwrap();
    let mut health = tonic_health::pb::health_client::HealthClient::new(channel.clone());
    for service in ["", "palpate.v1.SessionService", "palpate.v1.ExplorationService"] {
        let request = tonic_health::pb::HealthCheckRequest { service: service.into() };
        let status = health.check(request).await.unwrap().into_inner().status();
        assert_eq!(status, tonic_health::pb::health_check_response::ServingStatus::Serving);
    }
    use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
    use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
    let mut reflection =
        tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient::new(channel);
    let request = tonic_reflection::pb::v1::ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::ListServices(String::new())),
    };
    let mut answers =
        reflection.server_reflection_info(tokio_stream::iter([request])).await.unwrap().into_inner();
    let Some(MessageResponse::ListServicesResponse(list)) =
        answers.next().await.unwrap().unwrap().message_response
    else {
        panic!("a list of services")
    };
    for service in ["SessionService", "ExplorationService", "ReconstructionService"] {
        assert!(list.service.iter().any(|listed| listed.name == format!("palpate.v1.{service}")));
    }
    server.stop().await;
}
