//! The series of a session: what happened, how good it was, and what others would have done.

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome as ContactOutcome;
use tokio::time::{Duration, Instant};

use crate::evaluation::explored;
use crate::harness::ball::{CENTRE, RADIUS_M, met, plausible};
use crate::harness::truth::{keep_ball, obj};
use crate::harness::{Caller, Server, Transport, accepted, header, miss, result, touch};

fn series(session_id: &str) -> v1::GetSeriesRequest {
    v1::GetSeriesRequest { session_id: session_id.into(), ..Default::default() }
}

/// The series once no error is missing.
pub(crate) async fn complete(caller: &Caller, session_id: &str) -> v1::GetSeriesResponse {
    let end = Instant::now() + Duration::from_secs(60);
    loop {
        let found = caller.series(series(session_id)).await.unwrap();
        if found.errors_pending == 0 {
            return found;
        }
        let missing = found.rows.iter().filter(|row| row.surface_distance_m.is_none()).count();
        assert_eq!(missing, found.errors_pending as usize);
        assert!(Instant::now() < end, "errors are still missing: {}", found.errors_pending);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

fn errors(found: &v1::GetSeriesResponse) -> Vec<f64> {
    found.rows.iter().map(|row| row.surface_distance_m.unwrap()).collect()
}

/// What a comparison of each of these revisions says.
async fn compared(caller: &Caller, session_id: &str, revisions: Vec<i64>) -> Vec<f64> {
    let request =
        v1::EvaluateSessionRequest { session_id: session_id.into(), revisions, ..Default::default() };
    let found = caller.evaluate(request).await.unwrap().evaluations;
    found.iter().map(|each| each.surface_distance_m).collect()
}

#[tokio::test]
async fn every_view_and_every_attempt_has_its_row() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let first = caller.begin_coarse(name, v1::SessionConfig::default()).await;
        let second = caller.tell(name, miss(&first), "miss").await.candidates.remove(0);
        let third = caller.tell(name, touch(&second, 0.001), "touch").await.candidates.remove(0);
        let fourth = caller.tell(name, touch(&third, 0.02), "early").await.candidates.remove(0);
        let reason = v1::RejectReason::Collision.into();
        let rejected = ContactOutcome::Rejected(v1::Rejected { reason, detail: "the cable".into() });
        caller.tell(name, result(&fourth, rejected), "rejected").await;
        let new_from_old = Some(v1::Pose {
            position: Some(v1::Vector3 { x: 0.01, y: 0.0, z: 0.0 }),
            orientation: Some(v1::Quaternion { w: 1.0, ..Default::default() }),
        });
        let moved = v1::ObjectMoved { new_from_old, std_m: 0.0, detail: String::new() };
        let moved =
            v1::ContactResult { outcome: Some(ContactOutcome::ObjectMoved(moved)), ..Default::default() };
        caller.tell(name, moved, "moved").await;
        let retract = v1::RetractEventRequest { session_id: name.into(), seq: 5, ..Default::default() };
        caller.retract(retract).await.unwrap();

        let found = caller.series(series(name)).await.unwrap();
        assert_eq!((found.revision, found.reference_sha256.as_str(), found.errors_pending), (8, "", 0));
        let outcomes: Vec<(i64, u32, &str)> =
            found.rows.iter().map(|row| (row.revision, row.attempt, row.outcome.as_str())).collect();
        let expected = [
            (2, 0, "view"),
            (3, 1, "no_contact"),
            (4, 2, "contact"),
            (5, 3, "early_contact"),
            (6, 4, "rejected"),
            (7, 0, "object_moved"),
        ];
        assert_eq!(outcomes, expected);
        let log = caller.log(name).await;
        for row in &found.rows {
            let event = &log[row.revision as usize - 1];
            let stats = event.stats_after.as_ref().unwrap();
            assert_eq!((row.append_time, row.failures), (event.append_time, stats.failures));
            assert_eq!(
                (row.mean_uncertainty, row.max_uncertainty),
                (stats.mean_uncertainty, stats.max_uncertainty)
            );
            assert!(row.mean_std_m.is_some() && row.mean_std_m == stats.mean_std_m);
            let nanos = |time: &Option<palpate_proto::Timestamp>| {
                time.as_ref()
                    .map(|time| i128::from(time.seconds) * 1_000_000_000 + i128::from(time.nanos))
                    .unwrap()
            };
            let since = nanos(&row.append_time) - nanos(&log[row.revision as usize - 2].append_time);
            let said = row.duration.as_ref().unwrap();
            assert_eq!(i128::from(said.seconds) * 1_000_000_000 + i128::from(said.nanos), since);
        }
        let forces: Vec<Option<f64>> = found.rows.iter().map(|row| row.force_n).collect();
        assert_eq!(forces, [None, None, Some(2.0), Some(2.0), None, None]);
        let retracted: Vec<i64> = found.rows.iter().map(|row| row.retracted_by_seq).collect();
        assert_eq!(retracted, [0, 0, 0, 8, 0, 0]);
        assert_eq!(
            (found.rows[2].candidate_id.as_str(), found.rows[2].robot_id.as_str()),
            (second.candidate_id.as_str(), "arm-1")
        );

        let rest = caller.series(v1::GetSeriesRequest { after_revision: 4, ..series(name) }).await.unwrap();
        assert_eq!(rest.rows, found.rows[3..], "a row says the same wherever one begins");
        let nothing =
            caller.series(v1::GetSeriesRequest { after_revision: 99, ..series(name) }).await.unwrap();
        assert!(nothing.rows.is_empty());
        let negative = caller.series(v1::GetSeriesRequest { after_revision: -1, ..series(name) }).await;
        assert_eq!(negative.unwrap_err().fields, ["after_revision"]);
        assert_eq!(caller.series(series("nobody")).await.unwrap_err().reason, "SESSION_NOT_FOUND");
    }
}

#[tokio::test]
async fn the_errors_of_a_series_are_those_of_a_comparison_and_all_come_in_the_end() {
    let mut server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        explored(&caller, name, 6, v1::SessionConfig::default()).await;
        caller.set_reference(keep_ball(name)).await.unwrap();
        let first = caller.series(series(name)).await.unwrap();
        assert_eq!((first.rows.len(), first.errors_pending), (7, 7), "nobody has asked before");
        let found = complete(&caller, name).await;
        let all = compared(&caller, name, (2..=8).collect()).await;
        assert_eq!(errors(&found), all);
        assert_eq!(found.reference_sha256, caller.reference(name).await.unwrap().sha256);
        assert!(all[6] < all[0], "touches make it better: {all:?}");

        // They are kept beside the log.
        server = server.restart().await;
        let caller = server.caller(transport);
        let kept = caller.series(series(name)).await.unwrap();
        assert_eq!((errors(&kept), kept.errors_pending), (all.clone(), 0));
        // Another truth, other errors; the same one again changes nothing.
        caller.set_reference(keep_ball(name)).await.unwrap();
        assert_eq!(caller.series(series(name)).await.unwrap().errors_pending, 0);
        let twice = v1::SetReferenceRequest { mesh: obj(2.0 * RADIUS_M, 1.0).into(), ..keep_ball(name) };
        caller.set_reference(twice).await.unwrap();
        assert_eq!(caller.series(series(name)).await.unwrap().errors_pending, 7);
        let other = complete(&caller, name).await;
        assert!(errors(&other).iter().all(|error| *error > 0.03), "{other:?}");
        // What comes after is computed after.
        caller.set_reference(keep_ball(name)).await.unwrap();
        let question = v1::ProposeContactsRequest { session_id: name.into(), ..Default::default() };
        let next = caller.propose(question).await.unwrap().candidates.remove(0);
        caller.tell(name, met(&next, CENTRE, plausible(7)), "late").await;
        let late = complete(&caller, name).await;
        assert_eq!(errors(&late)[..7], all);
        assert_eq!(errors(&late)[7..], compared(&caller, name, vec![9]).await);
        caller.delete_reference(name).await.unwrap();
        let without = caller.series(series(name)).await.unwrap();
        assert_eq!((without.errors_pending, without.reference_sha256.as_str()), (0, ""));
        assert!(without.rows.iter().all(|row| row.surface_distance_m.is_none()));
    }
}

#[tokio::test]
async fn errors_around_a_retraction_are_those_of_what_was_believed_then() {
    let server = Server::start().await;
    let caller = server.grpc();
    let first = caller.begin_coarse("ball", v1::SessionConfig::default()).await;
    let next = caller.tell("ball", touch(&first, 0.012), "wrong").await.candidates.remove(0);
    caller.tell("ball", met(&next, CENTRE, plausible(1)), "right").await;
    let retract = v1::RetractEventRequest { session_id: "ball".into(), seq: 3, ..Default::default() };
    caller.retract(retract).await.unwrap();
    caller.set_reference(keep_ball("ball")).await.unwrap();
    let fork = v1::ForkSessionRequest {
        session_id: "ball".into(),
        new_session_id: "fork".into(),
        ..Default::default()
    };
    caller.fork(fork).await.unwrap();
    for name in ["ball", "fork"] {
        let found = complete(&caller, name).await;
        assert_eq!(errors(&found), compared(&caller, name, vec![2, 3, 4]).await, "{name}");
        assert_eq!(caller.get(name).await.unwrap().state(), v1::SessionState::Active, "{name}");
    }
}

#[tokio::test]
async fn hindsight_of_ones_own_choice_is_what_happened_then() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let shadow = [v1::Strategy::Random, v1::Strategy::MinUncertainty].map(Into::into).to_vec();
        let config = v1::SessionConfig { shadow, ..Default::default() };
        let mut next = caller.begin_coarse(name, config).await;
        for number in 0..25 {
            let said = met(&next, CENTRE, plausible(number));
            next = caller.tell(name, said, &format!("touch-{number}")).await.candidates.remove(0);
        }
        let found = caller.series(series(name)).await.unwrap();
        let mut settled = 0;
        for (row, then) in found.rows.iter().zip(&found.rows[1..]) {
            let choices: Vec<v1::Strategy> =
                row.shadow_choices.iter().map(v1::ShadowChoice::strategy).collect();
            assert_eq!(
                choices,
                [v1::Strategy::Proactive, v1::Strategy::Random, v1::Strategy::MinUncertainty]
            );
            assert!(row.shadow_choices.iter().all(|choice| choice.hindsight() != v1::Hindsight::Unspecified));
            let own = &row.shadow_choices[0];
            assert_eq!(
                own.candidate.as_ref().unwrap().candidate_id,
                then.candidate_id,
                "the robot followed it"
            );
            let happened = match then.outcome.as_str() {
                "contact" => v1::Hindsight::Hit,
                "no_contact" => v1::Hindsight::Miss,
                "early_contact" => v1::Hindsight::Early,
                other => panic!("{other}"),
            };
            // What is known now is known to a millimetre or so, and an approach may end that near to its bound.
            settled += usize::from(own.hindsight() == happened);
        }
        assert!(settled >= 24, "{settled} of 25");
        let hits = found.rows.iter().filter(|row| row.outcome == "contact").count();
        assert!(hits >= 10, "{hits} contacts");
        let bare = v1::GetSeriesRequest { without_shadow: true, ..series(name) };
        assert!(caller.series(bare).await.unwrap().rows.iter().all(|row| row.shadow_choices.is_empty()));
    }
}

#[tokio::test]
async fn choices_from_before_the_object_moved_are_not_looked_at_again() {
    let server = Server::start().await;
    let caller = server.grpc();
    let config = v1::SessionConfig { shadow: vec![v1::Strategy::Random.into()], ..Default::default() };
    let first = caller.begin_coarse("ball", config).await;
    caller.tell("ball", met(&first, CENTRE, plausible(1)), "touch").await;
    let new_from_old = Some(v1::Pose {
        position: Some(v1::Vector3 { x: 0.1, y: 0.0, z: 0.0 }),
        orientation: Some(v1::Quaternion { w: 1.0, ..Default::default() }),
    });
    let moved = v1::ObjectMoved { new_from_old, std_m: 0.0, detail: String::new() };
    let moved = v1::ContactResult { outcome: Some(ContactOutcome::ObjectMoved(moved)), ..Default::default() };
    caller.tell("ball", moved, "moved").await;
    let found = caller.series(series("ball")).await.unwrap();
    let looked_at: Vec<bool> = found
        .rows
        .iter()
        .map(|row| row.shadow_choices.iter().any(|choice| choice.hindsight() != v1::Hindsight::Unspecified))
        .collect();
    assert_eq!(looked_at, [false, false, true]);
}

#[tokio::test]
async fn as_a_table_it_has_the_same_rows() {
    let server = Server::start().await;
    let (caller, http) = (server.grpc(), server.http());
    let config = v1::SessionConfig { shadow: vec![v1::Strategy::Uniform.into()], ..Default::default() };
    let first = caller.begin_coarse("ball", config).await;
    let mut said = met(&first, CENTRE, plausible(1));
    said.robot_id = "the \"left\", arm".into();
    caller.tell("ball", said, "touch").await;
    let found = caller.series(series("ball")).await.unwrap();
    let by_query = http.get("/v1/sessions/ball/series?format=csv");
    let by_header = http.get("/v1/sessions/ball/series").header("accept", "text/csv");
    for call in [by_query, by_header] {
        let answer = accepted(call).await.unwrap();
        assert!(header(&answer, "content-type").starts_with("text/csv"));
        let text = answer.text().await.unwrap();
        let mut table = csv::Reader::from_reader(text.as_bytes());
        let names: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
        let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), found.rows.len());
        for (cells, row) in rows.iter().zip(&found.rows) {
            let cell = |name: &str| &cells[names.iter().position(|known| known == name).unwrap()];
            assert_eq!(cell("revision"), row.revision.to_string());
            assert_eq!((cell("outcome"), cell("robot_id")), (row.outcome.as_str(), row.robot_id.as_str()));
            assert_eq!(cell("mean_uncertainty").parse::<f64>().unwrap(), row.mean_uncertainty);
            assert_eq!(cell("surface_distance_m"), "");
            let other = row.shadow_choices[1].candidate.as_ref().unwrap();
            assert_eq!(cell("uniform_x_m").parse::<f64>().unwrap(), other.point.unwrap().x);
            assert!(["hit", "miss", "early"].contains(&cell("uniform_hindsight")));
        }
    }
    let wrong = accepted(http.get("/v1/sessions/ball/series?format=xls")).await.unwrap_err();
    assert_eq!(wrong.fields, ["format"]);
}

#[tokio::test]
async fn nothing_of_a_session_that_is_gone_is_computed_for_its_successor() {
    let server = Server::start().await;
    let caller = server.grpc();
    explored(&caller, "ball", 4, v1::SessionConfig::default()).await;
    caller.set_reference(keep_ball("ball")).await.unwrap();
    caller.series(series("ball")).await.unwrap();
    caller
        .delete(v1::DeleteSessionRequest { session_id: "ball".into(), ..Default::default() })
        .await
        .unwrap();
    let again = v1::CreateSessionRequest { request_id: "again".into(), ..crate::harness::creation("ball") };
    caller.create(again).await.unwrap();
    caller.set_reference(keep_ball("ball")).await.unwrap();
    let view = v1::AddVisualPriorRequest { request_id: "view-again".into(), ..crate::harness::prior("ball") };
    caller.add_prior(view).await.unwrap();
    let found = complete(&caller, "ball").await;
    assert_eq!(errors(&found), compared(&caller, "ball", vec![2]).await);
}
