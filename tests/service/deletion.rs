//! A deleted session is gone for good; a guard, a retry and a new session of the same name are told apart.

use palpate_proto::v1;

use crate::harness::{Server, Transport, creation, header, question, send};

fn deletion(session_id: &str, etag: &str, request_id: &str) -> v1::DeleteSessionRequest {
    v1::DeleteSessionRequest {
        session_id: session_id.into(),
        etag: etag.into(),
        request_id: request_id.into(),
    }
}

#[tokio::test]
async fn nothing_is_found_of_a_deleted_session() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let request_id = format!("create-{transport:?}");
        caller.create(v1::CreateSessionRequest { request_id, ..creation("ball") }).await.unwrap();
        caller.delete(deletion("ball", "", "")).await.unwrap();
        assert_eq!(caller.get("ball").await.unwrap_err().reason, "SESSION_NOT_FOUND");
        assert_eq!(caller.propose(question("ball", 1)).await.unwrap_err().reason, "SESSION_NOT_FOUND");
        let events = v1::ListEventsRequest { session_id: "ball".into(), ..Default::default() };
        assert_eq!(caller.events(events).await.unwrap_err().reason, "SESSION_NOT_FOUND");
        assert_eq!(caller.list(v1::ListSessionsRequest::default()).await.unwrap().sessions, []);
        assert_eq!(caller.delete(deletion("ball", "", "")).await.unwrap_err().reason, "SESSION_NOT_FOUND");

        let request_id = format!("create-{transport:?}");
        let late =
            caller.create(v1::CreateSessionRequest { request_id, ..creation("ball") }).await.unwrap_err();
        assert_eq!(late.reason, "SESSION_NOT_FOUND", "a late retry of the creation brings nothing back");
        assert!(late.message.contains("deleted") && late.message.contains("new request_id"), "{late:?}");
        let anew = v1::CreateSessionRequest { request_id: format!("anew-{transport:?}"), ..creation("ball") };
        let again = caller.create(anew).await.unwrap();
        assert_eq!(again.revision, 1, "the name is free again, and nothing of the old session comes back");
        caller.delete(deletion("ball", &again.etag, "")).await.unwrap();
    }
}

#[tokio::test]
async fn a_stale_etag_does_not_delete() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let name = transport.name();
        let created = caller.create(creation(name)).await.unwrap();
        caller.add_prior(crate::harness::prior(name)).await.unwrap();
        let refused = caller.delete(deletion(name, &created.etag, "stale")).await.unwrap_err();
        assert_eq!(refused.reason, "ETAG_MISMATCH");
        let newest = caller.get(name).await.unwrap();
        assert_eq!(newest.revision, 2);
        caller.delete(deletion(name, &newest.etag, "fresh")).await.unwrap();
    }
}

#[tokio::test]
async fn a_retried_deletion_is_answered_as_before_even_after_a_restart() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.begin(name).await;
        caller.delete(deletion(name, "", "once")).await.unwrap();
        caller.delete(deletion(name, "", "once")).await.unwrap();
        let other = caller.delete(deletion(name, "another-etag", "once")).await.unwrap_err();
        assert_eq!(other.reason, "REQUEST_ID_REUSED");
    }
    let server = server.restart().await;
    server.grpc().delete(deletion("http", "", "once")).await.unwrap();
    let twice = server.grpc().delete(deletion("grpc", "", "twice")).await.unwrap_err();
    assert_eq!(twice.reason, "SESSION_NOT_FOUND");
}

#[tokio::test]
async fn the_etag_of_http_guards_the_deletion_as_it_came() {
    let server = Server::start().await;
    let created = send(server.http().post("/v1/sessions", &serde_json::json!({"session_id": "ball"}))).await;
    let etag = header(&created, "etag").to_owned();
    let delete = || server.http().request(reqwest::Method::DELETE, "/v1/sessions/ball");
    assert_eq!(send(delete().header("if-match", "\"another\"")).await.status(), 412);
    assert_eq!(send(delete().header("if-match", etag)).await.status(), 204);
    assert_eq!(send(delete()).await.status(), 404);
}
