//! Encrypted connections: certificates of a lab's own authority, clients that are known by theirs, and new files while
//! the server runs.

use std::process::Output;
use std::time::Duration;

use palpate_client::Client;
use palpate_server::access::Scope;
use palpate_server::{ServeOptions, TlsFiles};
use tokio::process::Command;

use crate::harness::{Authority, Guarded, Identity, creation, new_token, say_raw, soon};

/// What a server of this authority is given.
fn files(authority: &Authority, trusts_clients: bool) -> TlsFiles {
    TlsFiles {
        certificate: authority.path().join("server.pem"),
        key: authority.path().join("server-key.pem"),
        client_ca: trusts_clients.then(|| authority.path().join("ca.pem")),
    }
}

async fn server(authority: &Authority, trusts_clients: bool) -> Guarded {
    authority.write("server", &authority.issue("server"));
    let options = ServeOptions { tls: Some(files(authority, trusts_clients)), ..ServeOptions::default() };
    Guarded::with_options(&[new_token("arm", Scope::Robot)], options).await
}

fn url(server: &Guarded) -> String {
    format!("https://{}", server.server.address)
}

async fn curl(authority: &Authority, server: &Guarded, path: &str, more: &[&str]) -> Output {
    let mut command = Command::new("curl");
    command.args(["--silent", "--show-error", "--include", "--cacert"]).arg(authority.path().join("ca.pem"));
    soon("curl", command.args(more).arg(format!("{}{path}", url(server))).output()).await.unwrap()
}

#[tokio::test]
async fn a_client_and_curl_call_over_tls_with_a_token() {
    let authority = Authority::new();
    let server = server(&authority, false).await;
    let client = Client::builder(&url(&server)).certificate_authority(&authority.pem());
    let client = client.token(&server.tokens["arm"]).connect().await.unwrap();
    client.create_session(creation("ball")).await.unwrap();
    let bearer = format!("Authorization: Bearer {}", server.tokens["arm"]);
    for (version, said) in [("--http1.1", "HTTP/1.1 200"), ("--http2", "HTTP/2 200")] {
        let output = curl(&authority, &server, "/v1/sessions/ball", &[version, "-H", &bearer]).await;
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(text.starts_with(said) && text.contains("\"ball\""), "{text}");
    }
    let output = curl(&authority, &server, "/v1/sessions/ball", &[]).await;
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        text.contains("TOKEN_MISSING") && text.to_lowercase().contains("www-authenticate: bearer"),
        "{text}"
    );
}

#[tokio::test]
async fn who_does_not_trust_the_server_or_speaks_in_the_clear_is_told() {
    let authority = Authority::new();
    let server = server(&authority, false).await;
    let other = Authority::new();
    let refused = Client::builder(&url(&server)).certificate_authority(&other.pem()).connect().await;
    let text = refused.unwrap_err().to_string();
    assert!(text.to_lowercase().contains("certificate"), "{text}");
    let plain = say_raw(server.server.address, "GET /v1/sessions HTTP/1.1\r\nHost: localhost\r\n\r\n").await;
    let text = format!("{plain:?}");
    assert!(text.contains("https://"), "{text}");
}

#[tokio::test]
async fn a_certificate_says_who_calls_and_what_they_may_do() {
    let authority = Authority::new();
    let server = server(&authority, true).await;
    let as_holder = async |name: &str| {
        let Identity { certificate, key } = authority.issue(name);
        let builder = Client::builder(&url(&server)).certificate_authority(&authority.pem());
        builder.certificate(&certificate, &key).connect().await.unwrap()
    };
    let robot = as_holder("robot:arm-7").await;
    robot.create_session(creation("ball")).await.unwrap();
    let request =
        palpate_proto::v1::ListEventsRequest { session_id: "ball".to_owned(), ..Default::default() };
    let events = robot.list_events(request).await.unwrap().events;
    assert_eq!(events[0].actor, "arm-7/certificate");
    let wall = as_holder("read:wall").await;
    wall.get_session("ball").await.unwrap();
    assert_eq!(wall.create_session(creation("cup")).await.unwrap_err().reason(), "SCOPE_DENIED");
    let kept = as_holder("read:wall:mugs").await;
    assert_eq!(kept.get_session("ball").await.unwrap_err().reason(), "SESSION_NOT_FOUND");
    assert_eq!(as_holder("arm-7").await.get_session("ball").await.unwrap_err().reason(), "CERTIFICATE_NAME");
    // Of another authority: not even the connection is there.
    let Identity { certificate, key } = Authority::new().issue("admin:mallory");
    let stranger = Client::builder(&url(&server)).certificate_authority(&authority.pem());
    let stranger = stranger.certificate(&certificate, &key).connect().await;
    let refused = match stranger {
        Ok(client) => client.get_session("ball").await.map(|_| ()),
        Err(error) => Err(error),
    };
    assert!(refused.is_err());
    // Whoever has none may have a token, and curl a certificate.
    let token = Client::builder(&url(&server)).certificate_authority(&authority.pem());
    token.token(&server.tokens["arm"]).connect().await.unwrap().get_session("ball").await.unwrap();
    authority.write("arm", &authority.issue("robot:arm-8"));
    let [certificate, key] =
        ["arm.pem", "arm-key.pem"].map(|name| authority.path().join(name).to_str().unwrap().to_owned());
    let output =
        curl(&authority, &server, "/v1/sessions/ball", &["--cert", &certificate, "--key", &key]).await;
    assert!(String::from_utf8_lossy(&output.stdout).contains(" 200"), "{output:?}");
}

#[tokio::test]
async fn a_new_certificate_is_used_without_a_restart_and_a_broken_one_changes_nothing() {
    let authority = Authority::new();
    let server = server(&authority, false).await;
    let connect = async |authority: &Authority| {
        let builder = Client::builder(&url(&server)).certificate_authority(&authority.pem());
        builder.token(&server.tokens["arm"]).connect().await
    };
    let old = connect(&authority).await.unwrap();
    old.create_session(creation("ball")).await.unwrap();
    std::fs::write(authority.path().join("server.pem"), "nothing").unwrap();
    tokio::time::sleep(Duration::from_secs(3)).await;
    connect(&authority).await.unwrap();
    let successor = Authority::new();
    let Identity { certificate, key } = successor.issue("server");
    std::fs::write(authority.path().join("server-key.pem"), key).unwrap();
    std::fs::write(authority.path().join("server.pem"), certificate).unwrap();
    soon("the new certificate", async {
        while connect(&successor).await.is_err() {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    })
    .await;
    assert!(connect(&authority).await.is_err(), "the old authority has nothing to do with it any more");
    // What was connected goes on.
    old.get_session("ball").await.unwrap();
}

#[tokio::test]
async fn files_that_cannot_be_used_are_named_at_the_start() {
    let authority = Authority::new();
    authority.write("server", &authority.issue("server"));
    authority.write("other", &authority.issue("other"));
    let files = |certificate: &str, key: &str| TlsFiles {
        certificate: authority.path().join(certificate),
        key: authority.path().join(key),
        client_ca: None,
    };
    for (files, named) in [
        (files("nowhere.pem", "server-key.pem"), "nowhere.pem"),
        (files("server-key.pem", "server-key.pem"), "there is no certificate in it"),
        (files("server.pem", "server.pem"), "its private key"),
        (files("server.pem", "other-key.pem"), "cannot be used together"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let options = ServeOptions {
            database: folder.path().join("a.db").into(),
            tls: Some(files),
            ..ServeOptions::default()
        };
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let stop = tokio_util::sync::CancellationToken::new();
        let text = palpate_server::serve(listener, options, stop).await.unwrap_err().to_string();
        assert!(text.contains(named), "{text}");
    }
}
