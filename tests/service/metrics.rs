//! The metrics say what was sent.

use std::collections::BTreeMap;

use crate::harness::{Server, Transport, accepted, database, header, miss, report, touch};

/// Every sample by its name with labels.
async fn scraped(server: &Server) -> BTreeMap<String, f64> {
    let answer = accepted(server.http().get("/metrics")).await.unwrap();
    assert_eq!(header(&answer, "content-type"), "text/plain; version=0.0.4; charset=utf-8");
    let text = answer.text().await.unwrap();
    let samples = text.lines().filter(|line| !line.starts_with('#'));
    samples
        .map(|line| {
            let (name, value) = line.rsplit_once(' ').unwrap();
            (name.to_owned(), value.parse().unwrap())
        })
        .collect()
}

#[tokio::test]
async fn what_robots_sent_over_both_transports_is_counted_once() {
    let server = Server::start().await;
    for (transport, session_id) in [(Transport::Grpc, "mug"), (Transport::Http, "pot")] {
        let caller = server.caller(transport);
        let next = caller.begin(session_id).await;
        let said = report(session_id, touch(&next, 0.001), "first");
        caller.report(said.clone()).await.unwrap();
        let next = caller.report(said).await.unwrap().candidates.remove(0);
        caller.report(report(session_id, miss(&next), "second")).await.unwrap();
        caller.get("nobody").await.unwrap_err();
    }
    let found = scraped(&server).await;
    let value = |name: &str| *found.get(name).unwrap_or_else(|| panic!("no {name}: {found:#?}"));
    for (name, expected) in [
        ("palpate_contacts_total{outcome=\"contact\"}", 2.0),
        ("palpate_contacts_total{outcome=\"no_contact\"}", 2.0),
        ("palpate_views_total", 2.0),
        ("palpate_calls_total{method=\"ReportContact\",outcome=\"OK\"}", 6.0),
        ("palpate_calls_total{method=\"GetSession\",outcome=\"SESSION_NOT_FOUND\"}", 2.0),
        ("palpate_call_seconds_count{method=\"ReportContact\"}", 6.0),
        ("palpate_compute_seconds_count{work=\"contact\"}", 4.0),
        ("palpate_queue_wait_seconds_count{queue=\"robots\",work=\"view\"}", 2.0),
        ("palpate_sessions", 2.0),
        ("palpate_sessions_live", 2.0),
        ("palpate_sessions_quarantined", 0.0),
        ("palpate_missing_events", 0.0),
        ("palpate_failed_commits_total", 0.0),
        ("palpate_ready", 1.0),
        ("palpate_queue_length{queue=\"robots\"}", 0.0),
        ("palpate_limit{name=\"message_bytes\"}", 16.0 * 1024.0 * 1024.0),
        ("palpate_limit{name=\"drain\"}", 10.0),
    ] {
        assert_eq!(value(name), expected, "{name}");
    }
    // Two creations, two views and four results, and what else was written.
    assert!(value("palpate_committed_changes_total") >= 8.0 && value("palpate_commit_seconds_count") >= 8.0);
    assert!(value("palpate_file_bytes{file=\"database\"}") > 0.0);
    assert!(value("palpate_connections") >= 1.0);
    // Elsewhere these are PostgreSQL's own.
    #[cfg(unix)]
    if !database::is_shared() {
        assert!(value("palpate_file_bytes{file=\"wal\"}") > 0.0 && value("palpate_disk_free_bytes") > 0.0);
    }
    assert!(found.keys().any(|name| name.starts_with("palpate_build_info{version=\"0.")));
}

#[tokio::test]
async fn open_streams_and_a_refusal_while_stopping_show() {
    let server = Server::start().await;
    server.grpc().begin("ball").await;
    let events = server.http().events("ball", None).await;
    assert_eq!(scraped(&server).await["palpate_streams"], 1.0);
    drop(events);
}
