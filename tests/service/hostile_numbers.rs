//! Numbers that nobody means: a mistake in the unit, or malice. They are refused by name or warned about, and cost what
//! ordinary ones cost, also when the log is replayed.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;
use palpate_proto::v1::mesh::Body;
use reqwest::Method;

use crate::harness::{
    Caller, Server, Transport, accepted, cap, cloud, creation, prior, report, result, touch, without_timing,
};

const KILOMETRES: v1::Vector3 = v1::Vector3 { x: 9e3, y: 0.0, z: 0.3 };

fn swept(candidate: &v1::Candidate, from: v1::Vector3, to: v1::Vector3) -> v1::ContactResult {
    let free = v1::NoContact { swept_from: Some(from), swept_to: Some(to), sweep_radius_m: 0.009 };
    result(candidate, ContactOutcome::NoContact(free))
}

fn codes(warnings: &[v1::Warning]) -> Vec<v1::WarningCode> {
    warnings.iter().map(v1::Warning::code).collect()
}

async fn farthest_m(caller: &Caller, session_id: &str) -> f64 {
    let request = v1::GetMeshRequest {
        session_id: session_id.into(),
        format: v1::MeshFormat::Raw.into(),
        ..Default::default()
    };
    let Some(Body::Raw(raw)) = caller.mesh(request).await.unwrap().body else { panic!("raw") };
    let (numbers, _) = raw.positions_f32_le.as_chunks::<4>();
    numbers.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes)).abs()).fold(0.0, f64::max)
}

#[tokio::test]
async fn a_way_of_kilometres_is_warned_about_and_replays_to_the_same_session() {
    let server = Server::start().await;
    let mut before = Vec::new();
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let mut next = caller.begin(name).await;
        for step in 0..3 {
            let away = v1::Vector3 { x: -9e3, ..KILOMETRES };
            let reply = caller.report(report(name, swept(&next, KILOMETRES, away), &format!("{step}"))).await;
            let reply = reply.unwrap();
            assert!(codes(&reply.warning_details).contains(&v1::WarningCode::LongSweep), "{reply:?}");
            assert!(
                reply.warnings.iter().any(|text| text.contains("18000.0 m long")),
                "{:?}",
                reply.warnings
            );
            next = reply.candidates[0].clone();
        }
        let ordinary = caller.report(report(name, touch(&next, 0.001), "ordinary")).await.unwrap();
        assert!(!codes(&ordinary.warning_details).contains(&v1::WarningCode::LongSweep));
        before.push(without_timing(caller.get(name).await.unwrap()));
    }
    let server = server.restart().await;
    for (transport, before) in Transport::BOTH.into_iter().zip(before) {
        let caller = server.caller(transport);
        assert!(farthest_m(&caller, transport.name()).await < 1.0);
        assert_eq!(without_timing(caller.get(transport.name()).await.unwrap()), before);
    }
}

#[tokio::test]
async fn a_contact_kilometres_away_is_warned_about_and_drags_no_surface_there() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        let mut far = touch(&next, 0.0);
        let Some(ContactOutcome::Contact(contact)) = &mut far.outcome else { panic!("a contact") };
        contact.sensor_pose.as_mut().unwrap().position = Some(KILOMETRES);
        let reply = caller.report(report(name, far, "far")).await.unwrap();
        assert!(codes(&reply.warning_details).contains(&v1::WarningCode::FarContact), "{reply:?}");
        assert!(farthest_m(&caller, name).await < 1.0);
    }
}

#[tokio::test]
async fn a_cloud_too_small_to_be_an_object_is_refused_by_name() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        for size_m in [1e-39, 1e-20, 1e-7, 9e-7] {
            let points: Vec<[f32; 3]> = (0..25_u8)
                .map(|i| [f32::from(i % 5), f32::from(i / 5), f32::from(i % 3)].map(|x| x * size_m / 4.0))
                .collect();
            let view = v1::VisualPrior { viewpoint: None, ..cloud(&points) };
            let request = v1::AddVisualPriorRequest { prior: Some(view), ..prior(name) };
            let refused = caller.add_prior(request).await.unwrap_err();
            assert_eq!(
                (refused.reason.as_str(), refused.fields),
                ("FIELD_INVALID", vec!["prior.points".into()])
            );
            let is_named =
                ["limit of 0.00001 m", "on one line"].iter().any(|text| refused.message.contains(text));
            assert!(is_named, "{}", refused.message);
        }
        assert_eq!(caller.get(name).await.unwrap().revision, 1);
        caller.add_prior(prior(name)).await.unwrap();
    }
}

#[tokio::test]
async fn headers_of_files_are_bounded_and_the_refusal_names_the_limit() {
    const PLY: &str = "ply\nformat ascii 1.0\n";
    const VERTEX: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n";
    let files = [
        ("comments", format!("comment {}\n", "c".repeat(1000)).repeat(15_000), "1024 lines"),
        ("one comment", format!("comment {}\n", "c".repeat(15_000_000)), "4096 bytes"),
        ("elements", "element e 0\n".repeat(500_000), "64 elements"),
        (
            "lists",
            format!("element e 1\n{}", "property list uchar int l\n".repeat(500_000)),
            "256 properties",
        ),
        ("chars", format!("element e 1\n{}", "property char c\n".repeat(900_000)), "256 properties"),
    ];
    let server = Server::start().await;
    let caller = server.grpc();
    caller.create(creation("ball")).await.unwrap();
    for (what, padding, limit) in files {
        let file = format!("{PLY}{padding}{VERTEX}");
        let view = v1::VisualPrior {
            encoding: v1::PointEncoding::Ply.into(),
            points: file.clone().into_bytes().into(),
            ..cap()
        };
        let request = v1::AddVisualPriorRequest { prior: Some(view), ..prior("ball") };
        let over_grpc = caller.add_prior(request).await.unwrap_err();
        let sent = server.http().request(Method::POST, "/v1/sessions/ball/priors");
        let over_http =
            accepted(sent.header("content-type", "application/ply").body(file)).await.unwrap_err();
        for refused in [over_grpc, over_http] {
            assert_eq!(refused.fields, ["prior.points"], "{what}");
            assert!(
                refused.message.contains(limit) && refused.message.len() < 500,
                "{what}: {}",
                refused.message
            );
        }
    }
    assert_eq!(caller.get("ball").await.unwrap().revision, 1);
}
