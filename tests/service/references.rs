//! Reference meshes that sessions keep: beside the log, through restarts, until nobody keeps them any more.

use palpate_proto::v1;
use palpate_server::{Limits, Location};
use reqwest::Method;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, SqliteConnection};

use crate::harness::ball::RADIUS_M;
use crate::harness::truth::{keep_ball, obj, ply, stl};
use crate::harness::{Server, Transport, accepted, creation, database, header, send};

/// How many files the database holds, read beside the server.
async fn files(server: &Server) -> i64 {
    if let Location::Postgres(_) = database::location(&server.folder().join("palpate.db")).await {
        // There each session has a file of its own, in its row.
        return database::count(server.folder(), "select count(distinct sha256) from session_references")
            .await;
    }
    let options = SqliteConnectOptions::new().filename(server.folder().join("palpate.db")).read_only(true);
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    let count = sqlx::query_scalar("select count(*) from reference_files").fetch_one(&mut connection).await;
    connection.close().await.unwrap();
    count.unwrap()
}

fn gone(session_id: &str) -> v1::DeleteSessionRequest {
    v1::DeleteSessionRequest { session_id: session_id.into(), ..Default::default() }
}

#[tokio::test]
async fn a_reference_is_kept_as_it_was_sent_replaced_and_forgotten() {
    let mut server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let created = caller.create(creation(name)).await.unwrap();
        assert_eq!(caller.reference(name).await.unwrap_err().reason, "NO_REFERENCE");
        caller.delete_reference(name).await.expect("that there is none is no error");
        let first = caller.set_reference(keep_ball(name)).await.unwrap();
        assert_eq!((first.format(), first.metres_per_unit), (v1::MeshFormat::Ply, 1.0));
        assert_eq!((first.n_vertices, first.n_faces), (3122, 6240));
        assert!(first.mesh.is_empty(), "the caller has it");
        let kept = caller.reference(name).await.unwrap();
        assert_eq!(kept, v1::Reference { mesh: ply(RADIUS_M, 1.0).into(), ..first });

        server = server.restart().await;
        let caller = server.caller(transport);
        assert_eq!(caller.reference(name).await.unwrap(), kept);
        let request = v1::SetReferenceRequest {
            session_id: name.into(),
            mesh: stl(RADIUS_M, 0.001).into(),
            format: v1::MeshFormat::Stl.into(),
            metres_per_unit: 0.001,
        };
        let second = caller.set_reference(request).await.unwrap();
        assert_ne!(second.sha256, kept.sha256);
        assert_eq!((second.format(), second.metres_per_unit), (v1::MeshFormat::Stl, 0.001));
        assert_eq!(files(&server).await, 1, "nobody keeps the first one any more");
        assert_eq!(caller.get(name).await.unwrap(), created, "it is no event of the session");
        caller.delete_reference(name).await.unwrap();
        assert_eq!(caller.reference(name).await.unwrap_err().reason, "NO_REFERENCE");
        assert_eq!(files(&server).await, 0);
    }
}

#[tokio::test]
async fn a_file_is_there_once_and_goes_with_the_last_session_that_keeps_it() {
    let server = Server::start().await;
    let caller = server.grpc();
    caller.begin("first").await;
    caller.set_reference(keep_ball("first")).await.unwrap();
    let fork = v1::ForkSessionRequest {
        session_id: "first".into(),
        new_session_id: "fork".into(),
        ..Default::default()
    };
    caller.fork(fork).await.unwrap();
    assert_eq!(caller.reference("fork").await.unwrap(), caller.reference("first").await.unwrap());
    caller.create(creation("second")).await.unwrap();
    caller.set_reference(keep_ball("second")).await.unwrap();
    assert_eq!(files(&server).await, 1);

    // The fork keeps its own, whatever becomes of the other's.
    caller
        .set_reference(v1::SetReferenceRequest { mesh: obj(RADIUS_M, 1.0).into(), ..keep_ball("first") })
        .await
        .unwrap();
    assert_eq!(files(&server).await, 2);
    assert_eq!(caller.reference("fork").await.unwrap().format(), v1::MeshFormat::Ply);
    caller.delete(gone("first")).await.unwrap();
    caller.delete(gone("second")).await.unwrap();
    assert_eq!(files(&server).await, 1);
    caller.delete(gone("fork")).await.unwrap();
    assert_eq!(files(&server).await, 0);
    // A session of the same id keeps nothing of the one before it.
    caller
        .create(v1::CreateSessionRequest { request_id: "again".into(), ..creation("first") })
        .await
        .unwrap();
    assert_eq!(caller.reference("first").await.unwrap_err().reason, "NO_REFERENCE");
}

#[tokio::test]
async fn what_is_no_surface_is_refused_and_the_one_before_stays() {
    let server = Server::with_limits(Limits { reference_faces: 7000, ..Limits::default() }).await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let kept = caller.set_reference(keep_ball(name)).await.unwrap();
        let vast = ply(RADIUS_M, 1.0);
        let vast = String::from_utf8_lossy(&vast[..300]).replace("face 6240", "face 4000000000");
        let fan = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", "f 1 2 3\n".repeat(7001));
        for (mesh, word) in [
            (Vec::new(), "empty"),
            (b"{}".to_vec(), "first bytes"),
            (vast.into_bytes(), "more than 7000"),
            (fan.into_bytes(), "more than 7000 triangles"),
            (b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n".to_vec(), "finite"),
        ] {
            let refused =
                caller.set_reference(v1::SetReferenceRequest { mesh: mesh.into(), ..keep_ball(name) });
            let refused = refused.await.unwrap_err();
            assert_eq!(refused.fields, ["mesh"], "{}", refused.message);
            assert!(refused.message.contains(word), "{word}: {}", refused.message);
        }
        let unknown = caller.set_reference(keep_ball("nobody")).await.unwrap_err();
        assert_eq!(unknown.reason, "SESSION_NOT_FOUND");
        assert_eq!(caller.reference("nobody").await.unwrap_err().reason, "SESSION_NOT_FOUND");
        assert_eq!(caller.delete_reference("nobody").await.unwrap_err().reason, "SESSION_NOT_FOUND");
        assert_eq!(caller.reference(name).await.unwrap().sha256, kept.sha256);
    }
}

#[tokio::test]
async fn over_http_it_is_a_file_with_a_name_that_is_sent_once() {
    let server = Server::start().await;
    let http = server.http();
    server.grpc().create(creation("ball")).await.unwrap();
    let put = http.request(Method::PUT, "/v1/sessions/ball/reference?metres_per_unit=0.001");
    let put = put.header("content-type", "application/octet-stream").body(stl(RADIUS_M, 0.001));
    let put = accepted(put).await.unwrap();
    let etag = header(&put, "etag").to_owned();
    let got = accepted(http.get("/v1/sessions/ball/reference")).await.unwrap();
    assert_eq!(header(&got, "content-type"), "model/stl");
    assert_eq!(header(&got, "content-disposition"), "inline; filename=\"ball-reference.stl\"");
    assert_eq!(header(&got, "etag"), etag);
    assert_eq!(got.bytes().await.unwrap(), stl(RADIUS_M, 0.001));
    let known = http.get("/v1/sessions/ball/reference").header("if-none-match", &etag);
    assert_eq!(send(known).await.status(), 304);
    let page = http.request(Method::PUT, "/v1/sessions/ball/reference").header("content-type", "text/html");
    assert_eq!(accepted(page.body("<p>")).await.unwrap_err().reason, "UNSUPPORTED_MEDIA_TYPE");
    let misspelt = http.request(Method::PUT, "/v1/sessions/ball/reference?scale=0.001");
    let misspelt = misspelt.header("content-type", "model/stl").body(stl(RADIUS_M, 0.001));
    assert_eq!(accepted(misspelt).await.unwrap_err().fields, ["scale"]);
}
