//! Experiments: which there are, and what their sessions amount to.

use std::path::Path;

use palpate_proto::v1;
use palpate_server::Limits;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, SqliteConnection};

use crate::harness::truth::keep_ball;
use crate::harness::{
    Caller, Server, Transport, accepted, creation, database, header, miss, prior, report, soon, touch,
};

fn member(session_id: &str, experiment: &str, object: &str) -> v1::CreateSessionRequest {
    let config = v1::SessionConfig {
        method: v1::Method::Paper.into(),
        icosphere_subdivisions: Some(2),
        ..Default::default()
    };
    v1::CreateSessionRequest {
        experiment: experiment.into(),
        labels: [("object".to_owned(), object.to_owned())].into(),
        config: Some(config),
        ..creation(session_id)
    }
}

/// A session with a view, some misses and then some touches.
async fn ran(caller: &Caller, request: v1::CreateSessionRequest, misses: usize, touches: usize) {
    let session_id = request.session_id.clone();
    caller.create(request).await.unwrap();
    let mut next = caller.add_prior(prior(&session_id)).await.unwrap().candidates.remove(0);
    for number in 0..misses + touches {
        let said = if number < misses { miss(&next) } else { touch(&next, 0.001) };
        let said = report(&session_id, said, &format!("attempt-{number}"));
        next = caller.report(said).await.unwrap().candidates.remove(0);
    }
}

fn summary(experiment: &str, by: &[&str]) -> v1::SummarizeExperimentRequest {
    v1::SummarizeExperimentRequest {
        experiment: experiment.into(),
        by: by.iter().map(|&name| name.to_owned()).collect(),
        ..Default::default()
    }
}

#[tokio::test]
async fn experiments_are_listed_by_name_in_pages_with_their_counts() {
    let server = Server::start().await;
    let caller = server.grpc();
    for (session_id, experiment) in [("aaa", "grasps"), ("bbb", "grasps"), ("ccc", ""), ("ddd", "süß / %41")]
    {
        caller.create(member(session_id, experiment, "ball")).await.unwrap();
    }
    caller.add_prior(prior("bbb")).await.unwrap();
    let done = v1::FinishSessionRequest { session_id: "ddd".into(), ..Default::default() };
    caller.finish(done).await.unwrap();
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let mut request = v1::ListExperimentsRequest { page_size: 2, ..Default::default() };
        let first = caller.experiments(request.clone()).await.unwrap();
        assert_eq!(first.experiments.len(), 2);
        request.page_token = first.next_page_token;
        let second = caller.experiments(request).await.unwrap();
        assert_eq!(second.next_page_token, "");
        let all = [first.experiments, second.experiments].concat();
        let counts: Vec<(&str, u32, u32, u32, u32)> = all
            .iter()
            .map(|each| {
                (each.experiment.as_str(), each.sessions, each.awaiting_prior, each.active, each.finished)
            })
            .collect();
        assert_eq!(counts, [("", 1, 1, 0, 0), ("grasps", 2, 1, 1, 0), ("süß / %41", 1, 0, 0, 1)]);
        let created = async |name: &str| caller.get(name).await.unwrap().create_time;
        assert_eq!(all[1].create_time, created("aaa").await);
        assert_eq!(all[1].last_create_time, created("bbb").await);
        let odd = v1::ListExperimentsRequest { page_token: "odd".into(), ..Default::default() };
        assert_eq!(caller.experiments(odd).await.unwrap_err().fields, ["page_token"]);
        let named = caller.summarize(summary("süß / %41", &["state"])).await.unwrap();
        assert_eq!(named.groups[0].key, ["SESSION_STATE_FINISHED"]);
    }
}

#[tokio::test]
async fn a_group_has_the_mean_and_the_spread_of_its_sessions() {
    let mut server = Server::start().await;
    let caller = server.grpc();
    for (session_id, object, misses, touches) in
        [("mug-1", "mug", 0, 1), ("mug-2", "mug", 1, 1), ("mug-3", "mug", 3, 3), ("ball-1", "ball", 2, 0)]
    {
        ran(&caller, member(session_id, "bench", object), misses, touches).await;
    }
    caller.create(member("other", "another bench", "mug")).await.unwrap();
    for session_id in ["mug-1", "mug-3"] {
        caller.set_reference(keep_ball(session_id)).await.unwrap();
    }
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let found = caller.summarize(summary("bench", &["labels.object", "method"])).await.unwrap();
        assert_eq!((found.experiment.as_str(), found.by.len()), ("bench", 2));
        assert!(found.quarantined_session_ids.is_empty());
        let keys: Vec<&[String]> = found.groups.iter().map(|group| group.key.as_slice()).collect();
        assert_eq!(keys, [["ball", "METHOD_PAPER"], ["mug", "METHOD_PAPER"]]);
        let mugs = &found.groups[1];
        assert_eq!(
            (mugs.n, mugs.session_ids.as_slice()),
            (3, &["mug-1", "mug-2", "mug-3"].map(String::from)[..])
        );
        // Attempts 1, 2, 6; failures 0, 1, 3: by hand.
        let attempts = mugs.attempts.unwrap();
        assert_eq!((attempts.n, attempts.mean, attempts.min, attempts.max), (3, 3.0, 1.0, 6.0));
        assert!((attempts.sd - 7.0_f64.sqrt()).abs() < 1e-12);
        let failures = mugs.failures.unwrap();
        assert!((failures.mean - 4.0 / 3.0).abs() < 1e-12);
        assert!((failures.sd - (7.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(mugs.mean_std_m.unwrap(), v1::Spread::default(), "METHOD_PAPER states none");
        // The error is that of each session's newest estimate, over those that keep a reference.
        let mut errors = Vec::new();
        for session_id in ["mug-1", "mug-3"] {
            let request = v1::EvaluateSessionRequest { session_id: session_id.into(), ..Default::default() };
            errors.push(caller.evaluate(request).await.unwrap().evaluations[0].surface_distance_m);
        }
        let distance = mugs.surface_distance_m.unwrap();
        assert_eq!(distance.n, 2);
        assert!((distance.mean - 0.5 * (errors[0] + errors[1])).abs() < 1e-12);
        assert!((distance.sd - (errors[0] - errors[1]).abs() / 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(found.groups[0].surface_distance_m.unwrap().n, 0);
        assert_eq!(found.groups[0].attempts.unwrap().sd, 0.0, "one session has no spread");

        let whole = caller.summarize(summary("bench", &[])).await.unwrap();
        assert_eq!((whole.groups.len(), whole.groups[0].n), (1, 4));
        let labels = [("object".to_owned(), "ball".to_owned())].into();
        let some = v1::SummarizeExperimentRequest { labels, ..summary("bench", &["template"]) };
        let some = caller.summarize(some).await.unwrap();
        assert_eq!((some.groups[0].key.as_slice(), some.groups[0].n), (&["ellipsoid".to_owned()][..], 1));
        assert!(caller.summarize(summary("nothing", &[])).await.unwrap().groups.is_empty());
        for (by, field) in [(&["labels.a", "colour"][..], "by[1]"), (&["method"; 9][..], "by")] {
            assert_eq!(caller.summarize(summary("bench", by)).await.unwrap_err().fields, [field]);
        }
        server = server.restart().await;
        let again = server.caller(transport).summarize(summary("bench", &["labels.object", "method"])).await;
        assert_eq!(again.unwrap(), found);
    }
}

#[tokio::test]
async fn as_a_table_a_group_is_a_row() {
    let server = Server::start().await;
    let caller = server.grpc();
    ran(&caller, member("mug", "a bench", "mug, \"the red\" one"), 1, 1).await;
    let url = "/v1/experiments/a%20bench/summary?by=labels.object,strategy&format=csv";
    let answer = accepted(server.http().get(url)).await.unwrap();
    assert!(header(&answer, "content-type").starts_with("text/csv"));
    let text = answer.text().await.unwrap();
    let mut table = csv::Reader::from_reader(text.as_bytes());
    let names: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
    assert_eq!(names[..5], ["labels.object", "strategy", "n", "attempts_n", "attempts_mean"]);
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 1);
    let first: Vec<&str> = rows[0].iter().take(5).collect();
    assert_eq!(first, ["mug, \"the red\" one", "STRATEGY_PROACTIVE", "1", "1", "2"]);
    let bad =
        accepted(server.http().get("/v1/experiments/a%20bench/summary?labels=object")).await.unwrap_err();
    assert_eq!(bad.fields, ["labels"]);
}

#[tokio::test]
async fn a_damaged_session_is_in_no_group_and_too_many_are_refused() {
    let server = Server::start().await;
    let caller = server.grpc();
    for session_id in ["sound", "damaged"] {
        ran(&caller, member(session_id, "bench", "mug"), 0, 1).await;
        caller.set_reference(keep_ball(session_id)).await.unwrap();
    }
    let damage = async |database: &Path| {
        if database::is_shared() {
            let statement = "update events set actor = 'nobody' where session_id = 'damaged' and seq = 2";
            return database::run(database, statement).await;
        }
        let options = SqliteConnectOptions::new().filename(database);
        let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
        let trigger = "select sql from sqlite_schema where name = 'events_are_never_changed'";
        let trigger: String = sqlx::query_scalar(trigger).fetch_one(&mut connection).await.unwrap();
        for statement in [
            "drop trigger events_are_never_changed".to_owned(),
            "update events set actor = 'nobody' where session_id = 'damaged' and seq = 2".to_owned(),
            trigger,
        ] {
            sqlx::query(sqlx::AssertSqlSafe(statement)).execute(&mut connection).await.unwrap();
        }
        connection.close().await.unwrap();
    };
    let server = server.restart_after(damage).await;
    for transport in Transport::BOTH {
        let found = server.caller(transport).summarize(summary("bench", &[])).await.unwrap();
        assert_eq!(found.quarantined_session_ids, ["damaged"]);
        assert_eq!(found.groups[0].session_ids, ["sound"]);
        // What was found is noted a moment later.
        let noted = async {
            loop {
                let request = v1::ListExperimentsRequest::default();
                let listed = server.caller(transport).experiments(request).await.unwrap();
                assert_eq!(listed.experiments[0].sessions, 2);
                if listed.experiments[0].quarantined == 1 {
                    return;
                }
                tokio::time::sleep(std::time::Duration::from_millis(10)).await;
            }
        };
        soon("the damage is noted", noted).await;
    }
    let small = Server::with_limits(Limits { summarized_sessions: 1, ..Limits::default() }).await;
    for session_id in ["one", "two"] {
        small.grpc().create(member(session_id, "bench", session_id)).await.unwrap();
    }
    for transport in Transport::BOTH {
        let refused = small.caller(transport).summarize(summary("bench", &[])).await.unwrap_err();
        assert_eq!(refused.reason, "TOO_LARGE");
        assert!(refused.message.contains("labels"), "{}", refused.message);
        let labels = [("object".to_owned(), "one".to_owned())].into();
        let some = v1::SummarizeExperimentRequest { labels, ..summary("bench", &[]) };
        assert_eq!(small.caller(transport).summarize(some).await.unwrap().groups[0].n, 1);
    }
}
