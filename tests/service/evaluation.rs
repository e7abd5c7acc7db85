//! Evaluation: estimates against a true surface that is known to the last digit.

use palpate_proto::v1;
use reqwest::{Method, RequestBuilder};

use crate::harness::ball::{CENTRE, RADIUS_M, met, plausible};
use crate::harness::truth::{keep_ball, mean_off_m, obj, ply, stl};
use crate::harness::{Caller, Http, Server, Transport, accepted, creation, from_json, header, miss, report};

fn evaluate(session_id: &str) -> v1::EvaluateSessionRequest {
    v1::EvaluateSessionRequest { session_id: session_id.into(), ..Default::default() }
}

fn against(session_id: &str, file: Vec<u8>) -> v1::EvaluateSessionRequest {
    v1::EvaluateSessionRequest { reference_mesh: file.into(), ..evaluate(session_id) }
}

/// A session on the coarsest mesh that makes sense, after a view and some touches of the true ball.
pub(crate) async fn explored(caller: &Caller, session_id: &str, touches: usize, config: v1::SessionConfig) {
    let mut next = caller.begin_coarse(session_id, config).await;
    for number in 0..touches {
        let said = met(&next, CENTRE, plausible(number));
        next = caller.tell(session_id, said, &format!("touch-{number}")).await.candidates.remove(0);
    }
}

async fn one(caller: &Caller, request: v1::EvaluateSessionRequest) -> v1::Evaluation {
    let mut found = caller.evaluate(request).await.unwrap().evaluations;
    assert_eq!(found.len(), 1);
    found.remove(0)
}

#[tokio::test]
async fn every_metric_is_near_what_the_ball_says() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        explored(&caller, name, 3, v1::SessionConfig::default()).await;
        let found = one(&caller, against(name, ply(RADIUS_M, 1.0))).await;
        let (_, vertices) = caller.vertices(name).await;
        // The distance of the vertices, which is known without any index of triangles, is one of the two directions.
        let of_vertices = mean_off_m(&vertices);
        assert!(
            (found.surface_distance_m - of_vertices).abs() < 0.5 * of_vertices + 2e-4,
            "{found:?} {of_vertices}"
        );
        assert!(found.hausdorff_m >= found.surface_distance_m && found.hausdorff_m < 0.05, "{found:?}");
        assert!((found.chamfer_mean_m - 0.5 * found.chamfer_sum_m).abs() < 1e-15);
        // Samples of one surface are apart by half the root of the area of each, in either direction.
        let floor = (4.0 * std::f64::consts::PI * RADIUS_M * RADIUS_M / 13_000.0).sqrt();
        assert!((found.chamfer_floor_m / floor - 1.0).abs() < 0.05, "{found:?} {floor}");
        assert!(found.chamfer_sum_m > found.chamfer_floor_m);
        assert!((0.0..=1.0).contains(&found.f_score_1mm) && (0.0..=1.0).contains(&found.coverage));
        assert!(found.has_calibration && found.calibration_1sigma <= found.calibration_2sigma);
        let failures = caller.get(name).await.unwrap().stats.unwrap().failures;
        assert_eq!((found.revision, found.attempts, found.failures), (5, 3, failures));

        // A ball of twice the radius is 50 mm outside of one that fits, and has eight times its volume.
        let twice = one(&caller, against(name, obj(2.0 * RADIUS_M, 1.0))).await;
        assert!((twice.surface_distance_m - RADIUS_M).abs() < 0.01, "{twice:?}");
        assert!((8.0 * twice.volume_ratio - found.volume_ratio).abs() < 0.01 * found.volume_ratio);
        assert_eq!((twice.f_score_1mm, twice.coverage), (0.0, 0.0));
    }
}

#[tokio::test]
async fn the_same_ball_in_any_format_and_unit_gives_the_same_figures() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        explored(&caller, name, 1, v1::SessionConfig::default()).await;
        let wanted = one(&caller, against(name, ply(RADIUS_M, 1.0))).await;
        for (file, metres_per_unit) in [
            (obj(RADIUS_M, 1.0), 1.0),
            (stl(RADIUS_M, 1.0), 0.0),
            (obj(RADIUS_M, 0.001), 0.001),
            (stl(RADIUS_M, 0.001), 0.001),
            (ply(RADIUS_M, 0.0254), 0.0254),
        ] {
            let request = v1::EvaluateSessionRequest { metres_per_unit, ..against(name, file) };
            let found = one(&caller, request).await;
            // OBJ and STL have seven digits.
            assert!((found.surface_distance_m - wanted.surface_distance_m).abs() < 1e-6, "{metres_per_unit}");
            assert!((found.volume_ratio - wanted.volume_ratio).abs() < 1e-4, "{metres_per_unit}");
        }
        let again = one(&caller, against(name, ply(RADIUS_M, 1.0))).await;
        assert_eq!(again, wanted, "the seed decides");
        let other = v1::EvaluateSessionRequest { seed: 7, ..against(name, ply(RADIUS_M, 1.0)) };
        let other = one(&caller, other).await;
        assert_ne!(other.chamfer_sum_m, wanted.chamfer_sum_m);
        assert!((other.surface_distance_m - wanted.surface_distance_m).abs() < 1e-4);
        let fewer = v1::EvaluateSessionRequest { samples: 500, ..against(name, ply(RADIUS_M, 1.0)) };
        let fewer = one(&caller, fewer).await;
        assert!(fewer.chamfer_floor_m > 3.0 * wanted.chamfer_floor_m, "fewer samples lie further apart");
    }
}

#[tokio::test]
async fn revisions_come_in_the_order_of_the_request_with_their_own_counts() {
    let mut server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let paper = v1::SessionConfig { method: v1::Method::Paper.into(), ..Default::default() };
        let first = caller.begin_coarse(name, paper).await;
        let second = caller.tell(name, miss(&first), "miss").await.candidates.remove(0);
        let early = crate::harness::touch(&second, 0.02);
        let third = caller.tell(name, early, "early").await.candidates.remove(0);
        let reason = v1::RejectReason::NoIk.into();
        let rejected = v1::contact_result::Outcome::Rejected(v1::Rejected { reason, detail: String::new() });
        caller.tell(name, crate::harness::result(&third, rejected), "rejected").await;
        caller.set_reference(keep_ball(name)).await.unwrap();

        let request = v1::EvaluateSessionRequest { revisions: vec![5, 2, 0, 3, 2], ..evaluate(name) };
        let found = caller.evaluate(request.clone()).await.unwrap().evaluations;
        assert_eq!(found.iter().map(|each| each.revision).collect::<Vec<_>>(), [5, 2, 5, 3, 2]);
        assert_eq!((&found[0], &found[1]), (&found[2], &found[4]));
        let newest = &found[0];
        let split = (newest.early_contacts, newest.no_contacts, newest.rejected, newest.invalid_contacts);
        assert_eq!((split, newest.failures, newest.attempts), ((1, 1, 1, 0), 3, 3));
        assert_eq!((found[1].failures, found[3].no_contacts), (0, 1));
        assert!(!newest.has_calibration, "METHOD_PAPER states no deviations");
        assert_eq!((newest.calibration_1sigma, newest.calibration_2sigma), (0.0, 0.0));

        server = server.restart().await;
        let again = server.caller(transport).evaluate(request).await.unwrap().evaluations;
        assert_eq!(again, found, "the kept reference and every revision survive a restart");
    }
}

#[tokio::test]
async fn what_cannot_be_compared_says_why_and_changes_nothing() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let awaiting = format!("{name}-empty");
        caller.create(creation(&awaiting)).await.unwrap();
        let unseen = caller.evaluate(against(&awaiting, ply(RADIUS_M, 1.0))).await.unwrap_err();
        assert_eq!(unseen.reason, "NO_VISUAL_PRIOR");
        explored(&caller, name, 1, v1::SessionConfig::default()).await;
        assert_eq!(caller.evaluate(evaluate(name)).await.unwrap_err().reason, "NO_REFERENCE");
        let before_view =
            v1::EvaluateSessionRequest { revisions: vec![1], ..against(name, ply(RADIUS_M, 1.0)) };
        assert_eq!(caller.evaluate(before_view).await.unwrap_err().reason, "NO_VISUAL_PRIOR");
        assert_eq!(caller.evaluate(evaluate("nobody")).await.unwrap_err().reason, "SESSION_NOT_FOUND");
        let ball = || against(name, ply(RADIUS_M, 1.0));
        for (request, field) in [
            (v1::EvaluateSessionRequest { revisions: vec![2, 9], ..ball() }, "revisions[1]"),
            (v1::EvaluateSessionRequest { revisions: vec![2; 65], ..ball() }, "revisions"),
            (v1::EvaluateSessionRequest { samples: 1_000_000, ..ball() }, "samples"),
            (v1::EvaluateSessionRequest { metres_per_unit: -0.001, ..ball() }, "metres_per_unit"),
            (v1::EvaluateSessionRequest { metres_per_unit: 1e9, ..ball() }, "reference_mesh"),
            (
                v1::EvaluateSessionRequest { reference_format: v1::MeshFormat::Glb.into(), ..ball() },
                "reference_format",
            ),
            (
                v1::EvaluateSessionRequest { reference_format: v1::MeshFormat::Stl.into(), ..ball() },
                "reference_mesh",
            ),
            (v1::EvaluateSessionRequest { keep_reference: true, ..evaluate(name) }, "keep_reference"),
            (against(name, b"glTF".to_vec()), "reference_mesh"),
            (against(name, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 1\n".to_vec()), "reference_mesh"),
        ] {
            let keep = v1::EvaluateSessionRequest { keep_reference: true, ..request.clone() };
            let refused = caller.evaluate(keep).await.unwrap_err();
            assert_eq!(refused.fields, [field], "{}", refused.message);
        }
        assert_eq!(caller.reference(name).await.unwrap_err().reason, "NO_REFERENCE", "nothing was kept");
        assert_eq!(caller.get(name).await.unwrap().revision, 3);
    }
}

#[tokio::test]
async fn what_was_sent_is_kept_if_that_is_wanted() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        explored(&caller, name, 0, v1::SessionConfig::default()).await;
        let request = v1::EvaluateSessionRequest {
            keep_reference: true,
            metres_per_unit: 0.001,
            ..against(name, obj(RADIUS_M, 0.001))
        };
        let sent = one(&caller, request).await;
        let kept = caller.reference(name).await.unwrap();
        assert_eq!((kept.format(), kept.metres_per_unit), (v1::MeshFormat::Obj, 0.001));
        assert_eq!(kept.mesh, obj(RADIUS_M, 0.001));
        assert_eq!(one(&caller, evaluate(name)).await, sent);
    }
}

fn file(http: &Http, query: &str, media_type: &str, body: Vec<u8>) -> RequestBuilder {
    let path = format!("/v1/sessions/ball/evaluate{query}");
    http.request(Method::POST, &path).header("content-type", media_type).body(body)
}

#[tokio::test]
async fn over_http_the_file_itself_is_a_question() {
    let server = Server::start().await;
    let (caller, http) = (server.grpc(), server.http());
    explored(&caller, "ball", 1, v1::SessionConfig::default()).await;
    let request = v1::EvaluateSessionRequest { revisions: vec![2, 3], ..against("ball", ply(RADIUS_M, 1.0)) };
    let wanted = caller.evaluate(request).await.unwrap();
    for (media_type, body) in [
        ("application/ply", ply(RADIUS_M, 1.0)),
        ("model/ply", ply(RADIUS_M, 1.0)),
        ("application/octet-stream", ply(RADIUS_M, 1.0)),
        ("model/stl", stl(RADIUS_M, 1.0)),
        ("application/sla", stl(RADIUS_M, 1.0)),
        ("model/obj", obj(RADIUS_M, 1.0)),
        ("text/plain; charset=utf-8", obj(RADIUS_M, 1.0)),
    ] {
        let answer = accepted(file(&http, "?revisions=2,3", media_type, body)).await.unwrap();
        assert_eq!(header(&answer, "content-type"), "application/json");
        let found: v1::EvaluateSessionResponse = from_json(&answer.text().await.unwrap());
        for (found, wanted) in found.evaluations.iter().zip(&wanted.evaluations) {
            assert_eq!(found.revision, wanted.revision);
            assert!((found.surface_distance_m - wanted.surface_distance_m).abs() < 1e-6, "{media_type}");
        }
    }
    let many = "?samples=2000&seed=3&metres_per_unit=0.001&keep_reference=true";
    accepted(file(&http, many, "model/stl", stl(RADIUS_M, 0.001))).await.unwrap();
    assert_eq!(caller.reference("ball").await.unwrap().metres_per_unit, 0.001);

    let refused = async |query: &str, media_type: &str, body: Vec<u8>| {
        accepted(file(&http, query, media_type, body)).await.unwrap_err()
    };
    let form = refused("", "application/x-www-form-urlencoded", ply(RADIUS_M, 1.0)).await;
    assert_eq!(form.reason, "UNSUPPORTED_MEDIA_TYPE");
    assert_eq!(refused("", "model/ply", Vec::new()).await.fields, ["reference_mesh"]);
    assert_eq!(refused("?revisions=two", "model/ply", ply(RADIUS_M, 1.0)).await.fields, ["revisions"]);
    assert_eq!(refused("?revision=2", "model/ply", ply(RADIUS_M, 1.0)).await.fields, ["revision"]);
    assert_eq!(refused("?seed=1", "application/json", b"{}".to_vec()).await.fields, ["query"]);
    assert_eq!(refused("", "model/stl", ply(RADIUS_M, 1.0)).await.fields, ["reference_mesh"]);
}

#[tokio::test]
async fn a_robot_goes_on_while_an_estimate_is_compared() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin_coarse("ball", v1::SessionConfig::default()).await;
    let slow = v1::EvaluateSessionRequest { samples: 50_000, ..against("ball", ply(RADIUS_M, 1.0)) };
    let said = report("ball", met(&next, CENTRE, plausible(1)), "touch");
    let (found, reported) = tokio::join!(caller.evaluate(slow), caller.report(said));
    reported.unwrap();
    assert!((2..=3).contains(&found.unwrap().evaluations[0].revision));
}
