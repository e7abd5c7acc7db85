//! Numbers that are none, and the like: refused by name over both transports, and nothing is changed.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;

use crate::harness::{
    Caller, Outcome, Server, Transport, accepted, cap, cloud, creation, prior, question, reply, report,
    result, touch,
};

/// What is wrong, the field that is named, the reason, and how to make it wrong.
type Case<T> = (&'static str, &'static str, &'static str, fn(&mut T));

const NON_FINITE: &str = "NON_FINITE";
const INVALID: &str = "FIELD_INVALID";

/// Insists that a call is refused for `field`.
#[track_caller]
fn check<T: std::fmt::Debug>(outcome: Outcome<T>, what: &str, field: &str, reason: &str) {
    match outcome {
        Ok(accepted) => panic!("{what} was accepted: {accepted:?}"),
        Err(refused) => {
            assert_eq!(
                (refused.reason.as_str(), refused.fields.as_slice()),
                (reason, &[field.to_owned()][..]),
                "{what}"
            );
            assert!(refused.message.starts_with(field), "{what}: {}", refused.message);
        }
    }
}

fn points(prior: &mut v1::VisualPrior, points: &[[f32; 3]]) {
    prior.points = cloud(points).points;
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.3], [0.1, 0.0, 0.3], [0.0, 0.1, 0.3], [0.1, 0.1, 0.3]];

fn square_with(bad: f32) -> [[f32; 3]; 4] {
    let mut points = SQUARE;
    points[2][1] = bad;
    points
}

const BAD_PRIORS: [Case<v1::VisualPrior>; 24] = [
    ("NaN among the points", "prior.points", NON_FINITE, |prior| points(prior, &square_with(f32::NAN))),
    ("an infinite point", "prior.points", NON_FINITE, |prior| points(prior, &square_with(f32::INFINITY))),
    ("a point 1e5 m away", "prior.points", NON_FINITE, |prior| points(prior, &square_with(1e5))),
    ("no points", "prior.points", INVALID, |prior| points(prior, &[])),
    ("three points", "prior.points", INVALID, |prior| points(prior, &SQUARE[..3])),
    ("identical points", "prior.points", INVALID, |prior| points(prior, &[SQUARE[1]; 9])),
    ("nearly identical points", "prior.points", INVALID, |prior| {
        points(prior, &[SQUARE[1], SQUARE[1], [0.1, 0.0, 0.300_001], SQUARE[1]]);
    }),
    ("points on a line", "prior.points", INVALID, |prior| {
        points(prior, &std::array::from_fn::<_, 9, _>(|i| [0.01 * i as f32, 0.0, 0.3]));
    }),
    ("half a point", "prior.points", INVALID, |prior| prior.points = prior.points.slice(..25)),
    ("voxels that leave one point", "prior.points", INVALID, |prior| prior.voxel_m = Some(1.0)),
    ("a voxel of NaN", "prior.voxel_m", NON_FINITE, |prior| prior.voxel_m = Some(f64::NAN)),
    ("a voxel of nothing", "prior.voxel_m", INVALID, |prior| prior.voxel_m = Some(0.0)),
    ("NaN as uncertainty", "prior.uncertainty", NON_FINITE, |prior| prior.uncertainty = Some(f64::NAN)),
    ("more than uncertain", "prior.uncertainty", INVALID, |prior| prior.uncertainty = Some(1.5)),
    ("a viewpoint of NaN", "prior.viewpoint", NON_FINITE, |prior| {
        prior.viewpoint = Some(v1::Vector3 { x: f64::NAN, y: 0.0, z: 0.0 });
    }),
    ("a viewpoint beyond all rooms", "prior.viewpoint", NON_FINITE, |prior| {
        prior.viewpoint = Some(v1::Vector3 { x: -1e5, y: 0.0, z: 0.0 });
    }),
    ("bytes of no stated form", "prior.encoding", INVALID, |prior| prior.encoding = 0),
    ("bytes of an unknown form", "prior.encoding", INVALID, |prior| prior.encoding = 77),
    ("floats that are called PLY", "prior.points", INVALID, |prior| {
        prior.encoding = v1::PointEncoding::Ply.into();
    }),
    ("floats that are called PCD", "prior.points", INVALID, |prior| {
        prior.encoding = v1::PointEncoding::Pcd.into();
    }),
    ("packed points without a layout", "prior.packed", INVALID, |prior| {
        prior.encoding = v1::PointEncoding::Packed.into();
    }),
    ("packed points whose y is x", "prior.packed.y_offset", INVALID, |prior| {
        prior.encoding = v1::PointEncoding::Packed.into();
        prior.packed = Some(v1::PackedPoints { point_step: 12, z_offset: 8, ..Default::default() });
    }),
    ("a depth image without its camera", "prior.depth", INVALID, |prior| {
        prior.encoding = v1::PointEncoding::DepthU16.into();
    }),
    ("points with a depth camera", "prior.depth", INVALID, |prior| {
        prior.depth = Some(v1::DepthImage::default());
    }),
];

#[tokio::test]
async fn a_bad_view_is_refused_by_name_and_changes_nothing() {
    let server = Server::start().await;
    server.grpc().begin("ball").await;
    let before = server.grpc().get("ball").await.unwrap();
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (what, field, reason, spoil) in BAD_PRIORS {
            let mut view = cap();
            spoil(&mut view);
            let request =
                v1::AddVisualPriorRequest { prior: Some(view), request_id: "bad".into(), ..prior("ball") };
            check(caller.add_prior(request).await, what, field, reason);
        }
        let nothing = v1::AddVisualPriorRequest { prior: None, request_id: "bad".into(), ..prior("ball") };
        check(caller.add_prior(nothing).await, "no view", "prior", INVALID);
    }
    // It has no form in JSON, so nobody can send it there.
    let late = Some(palpate_proto::Timestamp { seconds: 253_402_300_800, nanos: 0 });
    let view = v1::VisualPrior { capture_time: late, ..cap() };
    let request = v1::AddVisualPriorRequest { prior: Some(view), request_id: "bad".into(), ..prior("ball") };
    check(server.grpc().add_prior(request).await, "the year 10000", "prior.capture_time", INVALID);
    assert_eq!(server.grpc().get("ball").await.unwrap(), before);
}

fn position(contact: &mut v1::Contact) -> &mut v1::Vector3 {
    contact.sensor_pose.as_mut().unwrap().position.as_mut().unwrap()
}

fn turn(contact: &mut v1::Contact, factor: f64) {
    let pose = contact.sensor_pose.as_mut().unwrap();
    let v1::Quaternion { x, y, z, w } = pose.orientation.unwrap();
    pose.orientation = Some(v1::Quaternion { x: factor * x, y: factor * y, z: factor * z, w: factor * w });
}

fn wrench(contact: &mut v1::Contact) -> &mut v1::Wrench {
    contact.wrench.as_mut().unwrap()
}

const POSITION: &str = "result.contact.sensor_pose.position";
const ORIENTATION: &str = "result.contact.sensor_pose.orientation";

const BAD_CONTACTS: [Case<v1::Contact>; 22] = [
    ("a pose of NaN", POSITION, NON_FINITE, |contact| position(contact).y = f64::NAN),
    ("an infinite pose", POSITION, NON_FINITE, |contact| position(contact).z = f64::NEG_INFINITY),
    ("a pose 1e5 m away", POSITION, NON_FINITE, |contact| position(contact).x = 1e5),
    ("no pose", "result.contact.sensor_pose", INVALID, |contact| contact.sensor_pose = None),
    ("no position", POSITION, INVALID, |contact| contact.sensor_pose.as_mut().unwrap().position = None),
    ("no rotation", ORIENTATION, INVALID, |contact| contact.sensor_pose.as_mut().unwrap().orientation = None),
    ("a zero quaternion", ORIENTATION, INVALID, |contact| turn(contact, 0.0)),
    ("a quaternion twice too long", ORIENTATION, INVALID, |contact| turn(contact, 2.0)),
    ("a quaternion off by 2e-3", ORIENTATION, INVALID, |contact| turn(contact, 1.002)),
    ("a quaternion of NaN", ORIENTATION, NON_FINITE, |contact| turn(contact, f64::NAN)),
    ("a force of NaN", "result.contact.wrench.force", NON_FINITE, |contact| {
        wrench(contact).force.as_mut().unwrap().z = f64::NAN;
    }),
    ("an infinite torque", "result.contact.wrench.torque", NON_FINITE, |contact| {
        wrench(contact).torque.as_mut().unwrap().x = f64::INFINITY;
    }),
    ("no force", "result.contact.wrench.force", INVALID, |contact| wrench(contact).force = None),
    ("no torque", "result.contact.wrench.torque", INVALID, |contact| wrench(contact).torque = None),
    ("no wrench", "result.contact.wrench", INVALID, |contact| contact.wrench = None),
    ("an unknown pad", "result.contact.sensor_id", INVALID, |contact| contact.sensor_id = "left".into()),
    ("NaN as uncertainty", "result.contact.uncertainty", NON_FINITE, |contact| {
        contact.uncertainty = Some(f64::NAN);
    }),
    ("less than certain", "result.contact.uncertainty", INVALID, |contact| contact.uncertainty = Some(-0.1)),
    ("a sweep from nowhere", "result.contact.swept_from", NON_FINITE, |contact| {
        contact.swept_from.as_mut().unwrap().x = f64::NAN;
    }),
    ("a sweep from 1e5 m", "result.contact.swept_from", NON_FINITE, |contact| {
        contact.swept_from.as_mut().unwrap().x = 1e5;
    }),
    ("a normal of NaN", "result.contact.normal", NON_FINITE, |contact| {
        contact.normal = Some(v1::Vector3 { x: f64::NAN, y: 0.0, z: 0.0 });
    }),
    ("a normal without length", "result.contact.normal", INVALID, |contact| {
        contact.normal = Some(v1::Vector3::default());
    }),
];

#[tokio::test]
async fn a_bad_contact_is_refused_by_name_and_changes_nothing() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    let before = server.grpc().get("ball").await.unwrap();
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (what, field, reason, spoil) in BAD_CONTACTS {
            let mut result = touch(&next, 0.001);
            let Some(ContactOutcome::Contact(contact)) = &mut result.outcome else { panic!("a contact") };
            spoil(contact);
            check(caller.report(report("ball", result, "bad")).await, what, field, reason);
        }
    }
    assert_eq!(server.grpc().get("ball").await.unwrap(), before);
    assert_eq!(server.grpc().log("ball").await.len(), 2);
}

const BAD_RESULTS: [Case<v1::ContactResult>; 10] = [
    ("no outcome", "result.outcome", INVALID, |result| result.outcome = None),
    ("an id that nobody made", "result.candidate_id", INVALID, |result| result.candidate_id = "417".into()),
    ("a damaged id", "result.candidate_id", INVALID, |result| {
        result.candidate_id.pop();
    }),
    ("an id of a revision to come", "result.candidate_id", INVALID, |result| {
        result.candidate_id = result.candidate_id.replacen('2', "9", 1);
    }),
    ("a time with too many nanoseconds", "result.observe_time", INVALID, |result| {
        result.observe_time = Some(palpate_proto::Timestamp { seconds: 1, nanos: -1 });
    }),
    ("a time that JSON cannot write", "result.observe_time", INVALID, |result| {
        result.observe_time = Some(palpate_proto::Timestamp { seconds: i64::MAX, nanos: 0 });
    }),
    ("a sweep to nowhere", "result.no_contact.swept_to", NON_FINITE, |result| {
        sweep(result).swept_to.as_mut().unwrap().x = f64::NAN;
    }),
    ("no sweep", "result.no_contact.swept_from", INVALID, |result| sweep(result).swept_from = None),
    ("a sweep of negative width", "result.no_contact.sweep_radius_m", INVALID, |result| {
        sweep(result).sweep_radius_m = -0.01;
    }),
    ("an invalid contact nowhere", "result.invalid_contact.sensor_pose", INVALID, |result| {
        result.outcome = Some(ContactOutcome::InvalidContact(v1::InvalidContact::default()));
    }),
];

fn sweep(result: &mut v1::ContactResult) -> &mut v1::NoContact {
    match &mut result.outcome {
        Some(ContactOutcome::NoContact(sweep)) => sweep,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_bad_report_is_refused_by_name_and_changes_nothing() {
    let server = Server::start().await;
    let next = server.grpc().begin("ball").await;
    let before = server.grpc().get("ball").await.unwrap();
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (what, field, reason, spoil) in BAD_RESULTS {
            // Neither of these times has a form in JSON, so nobody can send it there.
            if transport == Transport::Http && field == "result.observe_time" {
                continue;
            }
            let mut result = crate::harness::miss(&next);
            spoil(&mut result);
            check(caller.report(report("ball", result, "bad")).await, what, field, reason);
        }
        let rejected =
            result(&next, ContactOutcome::Rejected(v1::Rejected { reason: 77, ..Default::default() }));
        let outcome = caller.report(report("ball", rejected, "bad")).await;
        check(outcome, "an unknown reason", "result.rejected.reason", INVALID);
        let nothing = v1::ReportContactRequest { result: None, ..report("ball", touch(&next, 0.0), "bad") };
        check(caller.report(nothing).await, "no result", "result", INVALID);
    }
    assert_eq!(server.grpc().get("ball").await.unwrap(), before);
}

const BAD_CONFIGS: [Case<v1::SessionConfig>; 14] = [
    ("NaN", "config.confident_max", NON_FINITE, |config| config.confident_max = Some(f64::NAN)),
    ("infinity", "config.alpha_geodesic", NON_FINITE, |config| config.alpha_geodesic = Some(f64::INFINITY)),
    ("a negative weight", "config.alpha_uncertainty", INVALID, |config| {
        config.alpha_uncertainty = Some(-1.0);
    }),
    ("a bound above one", "config.candidate_min", INVALID, |config| config.candidate_min = Some(1.1)),
    ("an uncertainty above one", "config.tactile_u_max", INVALID, |config| config.tactile_u_max = Some(2.0)),
    ("no travel", "config.probe_half_travel_m", INVALID, |config| config.probe_half_travel_m = Some(0.0)),
    ("a length of kilometres", "config.propagation_length_m", INVALID, |config| {
        config.propagation_length_m = Some(1000.0);
    }),
    ("no hops", "config.propagation_hops", INVALID, |config| config.propagation_hops = Some(0)),
    ("too fine a mesh", "config.icosphere_subdivisions", INVALID, |config| {
        config.icosphere_subdivisions = Some(12);
    }),
    ("an unknown method", "config.method", INVALID, |config| config.method = 77),
    ("an unknown strategy", "config.strategy", INVALID, |config| config.strategy = -1),
    ("a rule above one", "config.stop.mean_uncertainty_below", INVALID, |config| {
        config.stop = Some(v1::StopRule { mean_uncertainty_below: Some(7.0), ..Default::default() });
    }),
    ("a pad without a name", "config.sensors[0].id", INVALID, |config| {
        config.sensors = vec![v1::Sensor::default()];
    }),
    ("a pad without a pose", "config.sensors[0].tool_from_sensor", INVALID, |config| {
        config.sensors = vec![v1::Sensor { id: "tip".into(), ..Default::default() }];
    }),
];

#[tokio::test]
async fn a_bad_configuration_is_refused_by_name_and_creates_nothing() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (what, field, reason, spoil) in BAD_CONFIGS {
            let mut config = v1::SessionConfig::default();
            spoil(&mut config);
            let request = v1::CreateSessionRequest { config: Some(config), ..creation("ball") };
            check(caller.create(request).await, what, field, reason);
        }
        for bad in ["ab", "Ball", "1st", "a_b", "möwe"] {
            check(caller.create(creation(bad)).await, bad, "session_id", INVALID);
        }
    }
    assert_eq!(server.grpc().list(v1::ListSessionsRequest::default()).await.unwrap().sessions, []);
}

#[tokio::test]
async fn a_call_that_names_no_session_is_refused_by_that_field() {
    let server = Server::start().await;
    let caller = server.grpc();
    const FIELD: &str = "session_id";
    check(caller.get("").await, "GetSession", FIELD, INVALID);
    check(caller.delete(v1::DeleteSessionRequest::default()).await, "DeleteSession", FIELD, INVALID);
    check(caller.add_prior(prior("")).await, "AddVisualPrior", FIELD, INVALID);
    check(caller.propose(question("", 1)).await, "ProposeContacts", FIELD, INVALID);
    let nothing = v1::ContactResult::default();
    check(caller.report(report("", nothing, "report")).await, "ReportContact", FIELD, INVALID);
    check(caller.mesh(v1::GetMeshRequest::default()).await, "GetMesh", FIELD, INVALID);
    check(caller.events(v1::ListEventsRequest::default()).await, "ListEvents", FIELD, INVALID);
    let mut reconstruction = caller.reconstruction();
    let watch = reply(reconstruction.watch_session(v1::WatchSessionRequest::default())).await;
    check(watch, "WatchSession", FIELD, INVALID);

    let open = v1::explore_request::Message::Open(v1::ExploreOpen::default());
    let open = v1::ExploreRequest { message: Some(open), ..Default::default() };
    let mut answers = reply(caller.exploration().explore(tokio_stream::iter([open]))).await.unwrap();
    match answers.message().await.unwrap().unwrap().message {
        Some(v1::explore_response::Message::Problem(problem)) => {
            assert_eq!(
                (problem.reason.as_str(), problem.fields[0].field.as_str()),
                (INVALID, "open.session_id")
            );
        }
        other => panic!("an open without a session was answered by {other:?}"),
    }

    // Over HTTP the session is part of the path.
    let http = server.http();
    let body = serde_json::json!({});
    let delete = http.request(reqwest::Method::DELETE, "/v1/sessions/");
    for request in [http.get("/v1/sessions/"), delete] {
        assert_eq!(accepted(request).await.unwrap_err().reason, "NO_SUCH_PATH");
    }
    for (what, request) in [
        ("mesh", http.get("/v1/sessions//mesh")),
        ("events", http.get("/v1/sessions//events")),
        ("priors", http.post("/v1/sessions//priors", &body)),
        ("candidates", http.post("/v1/sessions//candidates", &body)),
        ("contacts", http.post("/v1/sessions//contacts", &body)),
    ] {
        check(accepted(request).await, what, FIELD, INVALID);
    }
}

#[tokio::test]
async fn a_bad_region_is_refused_by_name() {
    use palpate_proto::v1::keep_out::Shape;
    let server = Server::start().await;
    server.grpc().begin("ball").await;
    let normal = |z| Some(v1::Vector3 { x: 0.0, y: 0.0, z });
    let ball = |radius_m| Some(Shape::Ball(v1::Ball { center: normal(0.0), radius_m }));
    let plane = |z, offset_m| Some(Shape::HalfSpace(v1::HalfSpace { normal: normal(z), offset_m }));
    for (what, shape, field, reason) in [
        ("no shape", None, "shape", INVALID),
        ("no radius", ball(0.0), "ball.radius_m", INVALID),
        ("a radius of NaN", ball(f64::NAN), "ball.radius_m", NON_FINITE),
        ("a long normal", plane(2.0, 0.0), "half_space.normal", INVALID),
        ("an infinite offset", plane(1.0, f64::INFINITY), "half_space.offset_m", NON_FINITE),
    ] {
        for transport in Transport::BOTH {
            let robot = v1::RobotContext { keep_out: vec![v1::KeepOut { shape }], ..Default::default() };
            let request = v1::ProposeContactsRequest { robot: Some(robot), ..question("ball", 1) };
            let outcome = server.caller(transport).propose(request).await;
            check(outcome, what, &format!("robot.keep_out[0].{field}"), reason);
        }
    }
}

#[tokio::test]
async fn what_is_only_unusual_is_accepted() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let flat: Vec<[f32; 3]> =
            (0..36).map(|i| [0.01 * (i % 6) as f32, 0.01 * (i / 6) as f32, 0.3]).collect();
        let mut view = cloud(&flat);
        view.viewpoint = None;
        let request = v1::AddVisualPriorRequest { prior: Some(view), ..prior(name) };
        let seen = caller.add_prior(request).await.unwrap();
        assert_eq!(seen.accepted_points, 36, "a patch may be flat");
        assert_eq!(seen.warnings.len(), 1, "a view without a viewpoint could be better: {:?}", seen.warnings);

        for (step, factor) in [1.0005, 0.9995].into_iter().enumerate() {
            let mut nearly = touch(&seen.candidates[0], 0.001);
            let Some(ContactOutcome::Contact(contact)) = &mut nearly.outcome else { panic!("a contact") };
            turn(contact, factor);
            caller.report(report(name, nearly, &format!("nearly-{step}"))).await.unwrap();
        }
        let mut sure = touch(&seen.candidates[0], 0.002);
        let Some(ContactOutcome::Contact(contact)) = &mut sure.outcome else { panic!("a contact") };
        (contact.wrench, contact.uncertainty) = (None, Some(0.05));
        let reply = caller.report(report(name, sure, "sure")).await.unwrap();
        assert_eq!(reply.contact_uncertainty, 0.05, "the caller's own word counts");
        check_finite(&caller, name).await;
    }
}

/// Nothing that a reader sees is NaN or infinite.
async fn check_finite(caller: &Caller, session_id: &str) {
    let request = v1::GetMeshRequest { session_id: session_id.into(), ..Default::default() };
    let Some(v1::mesh::Body::Raw(raw)) = caller.mesh(request).await.unwrap().body else { panic!("raw") };
    assert!(palpate_client::positions(&raw).unwrap().iter().flatten().all(|x| x.is_finite()));
    assert!(palpate_client::uncertainty(&raw).unwrap().iter().all(|x| (0.0..=1.0).contains(x)));
}
