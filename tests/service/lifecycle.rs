//! Sessions are created, found and described, the same over both transports.

use palpate_proto::v1;
use palpate_proto::v1::SessionState;

use crate::harness::{Caller, Server, Transport, creation, header, prior, send};

#[tokio::test]
async fn a_new_session_awaits_its_prior_and_becomes_active_with_it() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let request = v1::CreateSessionRequest {
            display_name: "A ball".into(),
            experiment: "balls".into(),
            frame_id: "table".into(),
            labels: [("object".into(), "ball".into())].into(),
            config: Some(v1::SessionConfig { seed: Some(7), ..Default::default() }),
            ..creation(name)
        };
        let created = caller.create(request).await.unwrap();
        assert_eq!((created.revision, created.state()), (1, SessionState::AwaitingPrior));
        assert_eq!((created.display_name.as_str(), created.frame_id.as_str()), ("A ball", "table"));
        assert_eq!((created.experiment.as_str(), created.labels["object"].as_str()), ("balls", "ball"));
        let config = created.config.clone().unwrap();
        assert_eq!(
            (config.seed, config.icosphere_subdivisions),
            (Some(7), Some(4)),
            "defaults are filled in"
        );
        assert_eq!(config.method(), v1::Method::Palpate);
        assert_eq!(created.stats.as_ref().unwrap().mean_uncertainty, 1.0, "nothing is known");
        assert_eq!(caller.get(name).await.unwrap(), created);

        let seen = caller.add_prior(prior(name)).await.unwrap();
        let active = seen.session.unwrap();
        assert_eq!((active.revision, active.state()), (2, SessionState::Active));
        assert_ne!(active.etag, created.etag);
        let stats = active.stats.clone().unwrap();
        assert_eq!((stats.visual_points, stats.template.as_str()), (120, "ellipsoid"));
        assert!(stats.mean_uncertainty < 1.0 && stats.fit_rms_m < 0.001, "{stats:?}");
        assert_eq!((seen.accepted_points, seen.dropped_points, seen.warnings.len()), (120, 0, 0));
        assert_eq!(caller.get(name).await.unwrap(), active);
    }
}

#[tokio::test]
async fn a_session_without_an_id_gets_one_and_a_taken_id_is_refused() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let first = caller.create(v1::CreateSessionRequest::default()).await.unwrap();
        let second = caller.create(v1::CreateSessionRequest::default()).await.unwrap();
        assert_ne!(first.session_id, second.session_id);
        assert_eq!(first.session_id.len(), 36, "a UUID");
        let name = transport.name();
        caller.create(creation(name)).await.unwrap();
        let taken = v1::CreateSessionRequest { session_id: name.into(), ..Default::default() };
        assert_eq!(caller.create(taken).await.unwrap_err().reason, "SESSION_EXISTS");
        assert_eq!(caller.get("nowhere").await.unwrap_err().reason, "SESSION_NOT_FOUND");
    }
}

#[tokio::test]
async fn http_says_where_the_new_session_is() {
    let server = Server::start().await;
    let created = send(server.http().post("/v1/sessions", &serde_json::json!({}))).await;
    assert_eq!(created.status(), 201);
    let location = header(&created, "location").to_owned();
    let etag = header(&created, "etag").to_owned();
    let found = send(server.http().get(&location)).await;
    assert_eq!((found.status().as_u16(), header(&found, "etag")), (200, etag.as_str()));
    let known = send(server.http().get(&location).header("if-none-match", etag)).await;
    assert_eq!(known.status(), 304);
}

#[tokio::test]
async fn sessions_are_listed_newest_first_in_pages_and_by_filters() {
    let server = Server::start().await;
    let caller = server.grpc();
    for (index, name) in ["one", "two", "three", "four", "five"].into_iter().enumerate() {
        let object = if index % 2 == 0 { "mug" } else { "can" };
        let request = v1::CreateSessionRequest {
            experiment: if index < 3 { "morning" } else { "evening" }.into(),
            labels: [("object".into(), object.into()), ("arm".into(), "left".into())].into(),
            ..creation(name)
        };
        caller.create(request).await.unwrap();
    }
    caller.add_prior(prior("two")).await.unwrap();
    caller.add_prior(prior("three")).await.unwrap();

    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        let all = v1::ListSessionsRequest { page_size: 2, ..Default::default() };
        assert_eq!(pages(&caller, all).await, [vec!["five", "four"], vec!["three", "two"], vec!["one"]]);
        let morning = v1::ListSessionsRequest { experiment: "morning".into(), ..Default::default() };
        assert_eq!(pages(&caller, morning.clone()).await, [["three", "two", "one"]]);
        let mugs = v1::ListSessionsRequest {
            labels: [("object".into(), "mug".into()), ("arm".into(), "left".into())].into(),
            ..Default::default()
        };
        assert_eq!(pages(&caller, mugs.clone()).await, [["five", "three", "one"]]);
        let active = v1::ListSessionsRequest { state: SessionState::Active.into(), ..Default::default() };
        assert_eq!(pages(&caller, active).await, [["three", "two"]]);
        let all_three =
            v1::ListSessionsRequest { labels: mugs.labels, state: SessionState::Active.into(), ..morning };
        assert_eq!(pages(&caller, all_three).await, [["three"]]);
        let none = v1::ListSessionsRequest { experiment: "night".into(), ..Default::default() };
        assert_eq!(pages(&caller, none).await, [Vec::<String>::new()]);
        let foreign = v1::ListSessionsRequest { page_token: "x".into(), ..Default::default() };
        assert_eq!(caller.list(foreign).await.unwrap_err().fields, ["page_token"]);
    }
}

/// The ids on every page.
async fn pages(caller: &Caller, mut request: v1::ListSessionsRequest) -> Vec<Vec<String>> {
    let mut pages = Vec::new();
    loop {
        let page = caller.list(request.clone()).await.unwrap();
        pages.push(page.sessions.into_iter().map(|session| session.session_id).collect());
        request.page_token = page.next_page_token;
        if request.page_token.is_empty() {
            return pages;
        }
    }
}
