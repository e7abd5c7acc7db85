//! gRPC and HTTP are two ways into one service: what one says, the other says too.

use palpate_proto::v1;
use palpate_proto::v1::mesh::Body;
use serde_json::Value;

use crate::harness::{Server, Transport, accepted, cap, creation, header, prior, question, report, touch};

#[tokio::test]
async fn one_session_reads_the_same_over_both() {
    let server = Server::start().await;
    let (grpc, http) = (server.grpc(), server.caller(Transport::Http));
    let config = v1::SessionConfig {
        seed: Some(u64::MAX),
        alpha_geodesic: Some(1.0 / 3.0),
        stop: Some(v1::StopRule { mean_uncertainty_below: Some(1e-9), ..Default::default() }),
        ..Default::default()
    };
    let labels = [("object".into(), "Käse \"gerieben\"".into())].into();
    grpc.create(v1::CreateSessionRequest { config: Some(config), labels, ..creation("ball") }).await.unwrap();
    let first = grpc.add_prior(prior("ball")).await.unwrap().candidates.remove(0);
    grpc.go_on("ball", first, 3).await;

    assert_eq!(http.get("ball").await, grpc.get("ball").await);
    let all = v1::ListSessionsRequest::default();
    assert_eq!(http.list(all.clone()).await, grpc.list(all).await);
    let events =
        v1::ListEventsRequest { session_id: "ball".into(), include_points: true, ..Default::default() };
    let logged = grpc.events(events.clone()).await.unwrap();
    assert_eq!(http.events(events).await.unwrap(), logged);
    let Some(v1::event::Kind::VisualPrior(view)) = &logged.events[1].kind else { panic!("a view") };
    assert_eq!(*view, cap(), "the log keeps what was sent, bit for bit");
    assert_eq!(http.propose(question("ball", 9)).await, grpc.propose(question("ball", 9)).await);
    assert_eq!(http.server_info().await, grpc.server_info().await);
}

#[tokio::test]
async fn one_session_may_be_driven_over_both_by_turns() {
    let server = Server::start().await;
    let first = server.grpc().begin("mixed").await;
    let mut next = first;
    for step in 0..6 {
        next = server.caller(Transport::BOTH[step % 2]).go_on("mixed", next, 1).await;
    }
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let first = caller.begin(name).await;
        caller.go_on(name, first, 6).await;
    }
    let mut chains = Vec::new();
    for name in ["mixed", "grpc", "http"] {
        let log = server.grpc().log(name).await;
        chains.push(log.into_iter().map(|event| event.state_hash).collect::<Vec<_>>());
    }
    assert_eq!(chains[0].len(), 8);
    assert!(chains.iter().all(|chain| *chain == chains[0]), "the transport leaves no trace in the state");
}

#[tokio::test]
async fn files_are_the_same_bytes_over_both() {
    let server = Server::start().await;
    let first = server.grpc().begin("ball").await;
    server.grpc().go_on("ball", first, 2).await;
    let formats = [
        ("ply", "model/ply", v1::MeshFormat::Ply),
        ("obj", "model/obj", v1::MeshFormat::Obj),
        ("stl", "model/stl", v1::MeshFormat::Stl),
    ];
    for (name, media_type, format) in formats {
        for revision in [0, 2] {
            let request = v1::GetMeshRequest {
                session_id: "ball".into(),
                revision,
                format: format.into(),
                ..Default::default()
            };
            let mesh = server.grpc().mesh(request).await.unwrap();
            let path = format!("/v1/sessions/ball/mesh?format={name}&revision={revision}");
            let path = path.replace("&revision=0", "");
            let response = accepted(server.http().get(&path)).await.unwrap();
            assert_eq!(header(&response, "content-type"), media_type);
            assert_eq!(mesh.content_type, media_type);
            assert_eq!(header(&response, "etag"), format!("\"{}\"", mesh.etag));
            assert_eq!(Some(Body::File(response.bytes().await.unwrap())), mesh.body, "{name} {revision}");
            let accepting = server.http().get("/v1/sessions/ball/mesh").header("accept", media_type);
            assert_eq!(header(&accepted(accepting).await.unwrap(), "content-type"), media_type);
        }
    }
}

#[tokio::test]
async fn the_arrays_of_json_are_the_packed_ones() {
    let server = Server::start().await;
    server.grpc().begin("ball").await;
    let request = v1::GetMeshRequest { session_id: "ball".into(), ..Default::default() };
    let Some(Body::Raw(raw)) = server.grpc().mesh(request).await.unwrap().body else { panic!("raw") };
    let response = accepted(server.http().get("/v1/sessions/ball/mesh?format=json")).await.unwrap();
    let json: Value = response.json().await.unwrap();
    let numbers = |name: &str| -> Vec<f64> {
        let rows = json[name].as_array().unwrap().iter();
        rows.flat_map(|row| row.as_array().cloned().unwrap_or_else(|| vec![row.clone()]))
            .map(|number| number.as_f64().unwrap())
            .collect()
    };
    let floats = |bytes: &[u8]| -> Vec<f64> {
        bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four).into()).collect()
    };
    let indices = raw.faces_u32_le.as_chunks::<4>().0.iter().map(|four| f64::from(u32::from_le_bytes(*four)));
    let as_f32 = |numbers: Vec<f64>| numbers.into_iter().map(|x| f64::from(x as f32)).collect::<Vec<_>>();
    assert_eq!(as_f32(numbers("vertices")), floats(&raw.positions_f32_le));
    assert_eq!(as_f32(numbers("uncertainty")), floats(&raw.uncertainty_f32_le));
    assert_eq!(numbers("faces"), indices.collect::<Vec<_>>());
    assert_eq!(json["revision"], 2);
}

#[tokio::test]
async fn a_number_sent_as_json_is_kept_to_the_last_bit() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    // A reader of decimals that rounds carelessly errs on some of so many.
    for step in 0..50 {
        let mut sent = touch(&next, 0.0);
        let Some(v1::contact_result::Outcome::Contact(contact)) = &mut sent.outcome else {
            panic!("a contact")
        };
        let awkward = |k: i32| (f64::from(step * 7 + k) * 1.1).sin() * 10.0_f64.powi(-k);
        contact.normal = Some(v1::Vector3 { x: awkward(1), y: awkward(5), z: awkward(9) });
        let http = server.caller(Transport::Http);
        http.report(report("ball", sent.clone(), &format!("step-{step}"))).await.unwrap();
        let page = v1::ListEventsRequest {
            session_id: "ball".into(),
            page_token: (step + 2).to_string(),
            ..Default::default()
        };
        let logged = server.grpc().events(page).await.unwrap().events.remove(0);
        assert_eq!(logged.kind, Some(v1::event::Kind::ContactResult(sent)));
    }
}

#[tokio::test]
async fn a_view_may_come_as_packed_floats_as_a_ply_file_or_as_numbers() {
    let server = Server::start().await;
    let (http, grpc) = (server.http(), server.grpc());
    let points: Vec<f32> =
        cap().points.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect();
    let rows = points.as_chunks::<3>().0;
    let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n", rows.len());
    ply.push_str("property float x\nproperty float y\nproperty float z\nend_header\n");
    for [x, y, z] in rows {
        ply.push_str(&format!("{x} {y} {z}\n"));
    }
    let query = "viewpoint=1,0,0.3&propose=1";
    let numbers = serde_json::json!({
        "prior": { "points": rows, "viewpoint": { "x": 1.0, "z": 0.3 } },
        "propose": 1,
    });
    let file = |name: &str, media_type: &str, body: Vec<u8>| {
        http.request(reqwest::Method::POST, &format!("/v1/sessions/{name}/priors?{query}"))
            .header("content-type", media_type)
            .body(body)
    };
    let requests = [
        ("packed", file("packed", "application/octet-stream", cap().points.into())),
        ("as-ply", file("as-ply", "application/ply", ply.into_bytes())),
        ("numbers", http.post("/v1/sessions/numbers/priors", &numbers)),
    ];
    // An id names its session, too.
    let anywhere = |candidate: v1::Candidate| v1::Candidate { candidate_id: String::new(), ..candidate };
    let expected = anywhere(grpc.begin("ball").await);
    for (name, request) in requests {
        grpc.create(creation(name)).await.unwrap();
        accepted(request).await.unwrap();
        let next = grpc.propose(question(name, 1)).await.unwrap().candidates.remove(0);
        assert_eq!(anywhere(next), expected, "{name}");
        let hash = |log: Vec<v1::Event>| log.into_iter().last().unwrap().state_hash;
        assert_eq!(hash(grpc.log(name).await), hash(grpc.log("ball").await), "{name}");
    }
}

#[tokio::test]
async fn a_report_over_http_is_the_next_event_of_a_watch_over_grpc() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    let request =
        v1::WatchSessionRequest { session_id: "ball".into(), after_revision: 2, ..Default::default() };
    let mut updates = server.grpc().reconstruction().watch_session(request).await.unwrap().into_inner();
    let http = server.caller(Transport::Http);
    let replied = http.report(report("ball", touch(&next, 0.001), "touch")).await.unwrap();
    let update = crate::harness::soon("the event", updates.message()).await.unwrap().unwrap();
    assert_eq!(update.session, replied.session);
}
