//! A call that is made twice under one request id is carried out once.

use palpate_proto::v1;

use crate::harness::{
    Server, Transport, accepted, creation, from_json, miss, prior, report, send, to_json, touch,
    without_timing,
};

#[tokio::test]
async fn a_repeated_call_gets_the_first_reply_and_is_not_counted_twice() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let created = caller.create(creation(name)).await.unwrap();
        let seen = caller.add_prior(prior(name)).await.unwrap();
        let touched = report(name, touch(&seen.candidates[0], 0.001), "touch");
        let first = caller.report(touched.clone()).await.unwrap();
        let missed = report(name, miss(&first.candidates[0]), "miss");
        caller.report(missed).await.unwrap();

        // Each is answered as it was then, although the session has moved on.
        assert_eq!(caller.create(creation(name)).await.unwrap(), created);
        assert_eq!(caller.add_prior(prior(name)).await.unwrap(), seen);
        let again = caller.report(touched).await.unwrap();
        assert_eq!(again, v1::ReportContactResponse { duplicate: true, ..first });
        let session = caller.get(name).await.unwrap();
        assert_eq!((session.revision, session.stats.unwrap().attempts), (4, 2));
    }
}

#[tokio::test]
async fn a_request_id_with_another_body_is_refused_and_changes_nothing() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let next = caller.begin(name).await;
        let touched = report(name, touch(&next, 0.001), "touch");
        caller.report(touched.clone()).await.unwrap();
        let before = caller.get(name).await.unwrap();

        let other = v1::CreateSessionRequest { display_name: "another".into(), ..creation(name) };
        assert_eq!(caller.create(other).await.unwrap_err().reason, "REQUEST_ID_REUSED");
        let other = v1::AddVisualPriorRequest { propose: 2, ..prior(name) };
        assert_eq!(caller.add_prior(other).await.unwrap_err().reason, "REQUEST_ID_REUSED");
        let other = report(name, miss(&next), "touch");
        assert_eq!(caller.report(other).await.unwrap_err().reason, "REQUEST_ID_REUSED");
        let of_another_kind = v1::AddVisualPriorRequest { request_id: "touch".into(), ..prior(name) };
        assert_eq!(caller.add_prior(of_another_kind).await.unwrap_err().reason, "REQUEST_ID_REUSED");
        assert_eq!(caller.get(name).await.unwrap(), before);
    }
}

#[tokio::test]
async fn a_session_whose_id_the_server_chose_is_found_by_the_request_id() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let request =
            v1::CreateSessionRequest { request_id: format!("create-{transport:?}"), ..Default::default() };
        let first = caller.create(request.clone()).await.unwrap();
        assert_eq!(caller.create(request.clone()).await.unwrap(), first);
        let other = v1::CreateSessionRequest { display_name: "another".into(), ..request };
        assert_eq!(caller.create(other).await.unwrap_err().reason, "REQUEST_ID_REUSED");
    }
    assert_eq!(server.grpc().list(v1::ListSessionsRequest::default()).await.unwrap().sessions.len(), 2);
}

#[tokio::test]
async fn a_request_id_that_made_a_session_makes_no_other_one_whatever_id_is_wanted() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let first = caller.create(creation(name)).await.unwrap();
        let before = caller.list(v1::ListSessionsRequest::default()).await.unwrap();
        for wanted in ["", "another", name] {
            let other = v1::CreateSessionRequest {
                session_id: wanted.into(),
                display_name: "another".into(),
                ..creation(name)
            };
            assert_eq!(caller.create(other).await.unwrap_err().reason, "REQUEST_ID_REUSED", "{wanted:?}");
        }
        let moved = v1::CreateSessionRequest { session_id: "another".into(), ..creation(name) };
        assert_eq!(caller.create(moved.clone()).await.unwrap_err().reason, "REQUEST_ID_REUSED");
        assert_eq!(caller.create(creation(name)).await.unwrap(), first, "the retry itself is answered");
        assert_eq!(caller.list(v1::ListSessionsRequest::default()).await.unwrap(), before);

        let deletion = v1::DeleteSessionRequest { session_id: name.into(), ..Default::default() };
        caller.delete(deletion).await.unwrap();
        assert_eq!(caller.create(moved).await.unwrap_err().reason, "REQUEST_ID_REUSED", "nor later");
    }
}

#[tokio::test]
async fn of_two_creations_at_once_under_one_request_id_one_is_made() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let wanted = |side: &str| v1::CreateSessionRequest {
            session_id: format!("{}-{side}", transport.name()),
            request_id: format!("create-{transport:?}"),
            ..Default::default()
        };
        let (left, right) = tokio::join!(caller.create(wanted("left")), caller.create(wanted("right")));
        let refused = [left, right].into_iter().filter_map(Result::err).collect::<Vec<_>>();
        assert_eq!(refused.iter().map(|one| one.reason.as_str()).collect::<Vec<_>>(), ["REQUEST_ID_REUSED"]);
    }
}

#[tokio::test]
async fn retries_are_known_after_a_restart() {
    let server = Server::start().await;
    let caller = server.grpc();
    let unnamed = v1::CreateSessionRequest { request_id: "unnamed".into(), ..Default::default() };
    let chosen = caller.create(unnamed.clone()).await.unwrap();
    let created = caller.create(creation("ball")).await.unwrap();
    let seen = caller.add_prior(prior("ball")).await.unwrap();
    let touched = report("ball", touch(&seen.candidates[0], 0.001), "touch");
    let first = caller.report(touched.clone()).await.unwrap();
    let before = caller.get("ball").await.unwrap();

    let server = server.restart().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        assert_eq!(caller.create(unnamed.clone()).await.unwrap(), chosen);
        assert_eq!(caller.create(creation("ball")).await.unwrap(), created);
        assert_eq!(caller.add_prior(prior("ball")).await.unwrap(), seen);
        let again = caller.report(touched.clone()).await.unwrap();
        assert_eq!(again, v1::ReportContactResponse { duplicate: true, ..first.clone() });
        let other = report("ball", miss(&seen.candidates[0]), "touch");
        assert_eq!(caller.report(other).await.unwrap_err().reason, "REQUEST_ID_REUSED");
        let after = caller.get("ball").await.unwrap();
        assert_eq!(without_timing(after), without_timing(before.clone()));
    }
}

#[tokio::test]
async fn the_idempotency_key_of_http_is_the_request_id() {
    let server = Server::start().await;
    let (http, caller) = (server.http(), server.grpc());
    let create = async |body: &serde_json::Value| {
        send(http.post("/v1/sessions", body).header("idempotency-key", "key-1")).await
    };
    let first = create(&serde_json::json!({})).await.text().await.unwrap();
    assert_eq!(create(&serde_json::json!({})).await.text().await.unwrap(), first);
    assert_eq!(create(&serde_json::json!({"display_name": "another"})).await.status(), 409);

    let session: v1::Session = from_json(&first);
    let id = session.session_id;
    let body = to_json(&v1::AddVisualPriorRequest { request_id: String::new(), ..prior(&id) });
    let add = || http.post(&format!("/v1/sessions/{id}/priors"), &body).header("idempotency-key", "key-2");
    let seen = accepted(add()).await.unwrap().text().await.unwrap();
    assert_eq!(accepted(add()).await.unwrap().text().await.unwrap(), seen);
    let over_grpc = v1::AddVisualPriorRequest { request_id: "key-2".into(), ..prior(&id) };
    assert_eq!(
        caller.add_prior(over_grpc).await.unwrap(),
        from_json(&seen),
        "over gRPC it is the same request"
    );
    assert_eq!(caller.get(&id).await.unwrap().revision, 2);

    let twice = http.post("/v1/sessions", &to_json(&creation("ball"))).header("idempotency-key", "other");
    assert_eq!(accepted(twice).await.unwrap_err().fields, ["request_id"]);
}

#[tokio::test]
async fn without_a_request_id_every_call_counts() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("ball").await;
    for seq in 3..=5 {
        let reply = caller.report(report("ball", miss(&next), "")).await.unwrap();
        assert_eq!((reply.seq, reply.duplicate), (seq, false));
    }
}
