//! Who may make which call: every RPC and every route, tried by every caller who may not, and by one who may.
//!
//! The calls come from the contract's descriptors and from the document of the routes, so that a new one cannot be
//! forgotten: it has to be in the table of scopes, and here it is seen what the table means.

use std::collections::BTreeMap;

use palpate_proto::{Bytes, v1};
use palpate_server::access::{NewToken, Scope, needed};
use prost::Message;
use prost_reflect::{DescriptorPool, DynamicMessage, MethodDescriptor, Value as Field};
use reqwest::Method;
use serde_json::Value;
use tonic::Request;
use tonic::client::Grpc;

use crate::harness::{Guarded, Http, OnTheWire, Refused, accepted, creation, new_token, soon};

fn methods() -> Vec<MethodDescriptor> {
    let contract = DescriptorPool::decode(palpate_proto::FILE_DESCRIPTOR_SET).unwrap();
    let services: Vec<_> = contract.services().collect();
    services.iter().flat_map(|service| service.methods().collect::<Vec<_>>()).collect()
}

/// A message of this call that is about a session and says nothing else.
fn about(method: &MethodDescriptor, session_id: &str) -> Vec<u8> {
    let mut message = DynamicMessage::new(method.input());
    let id = Field::String(session_id.to_owned());
    if method.input().get_field_by_name("session_id").is_some() {
        message.set_field_by_name("session_id", id);
    } else if method.name() == "UpdateSession" {
        let field = method.input().get_field_by_name("session").unwrap();
        let mut session = DynamicMessage::new(field.kind().as_message().unwrap().clone());
        session.set_field_by_name("session_id", id);
        message.set_field_by_name("session", Field::Message(session));
    }
    message.encode_to_vec()
}

/// What comes of a call with this message: the first reply, or why there is none.
async fn call(
    server: &Guarded,
    method: &MethodDescriptor,
    message: Vec<u8>,
    token: Option<&str>,
) -> Result<(), Refused> {
    let mut client = Grpc::new(server.server.channel());
    soon("a connection", client.ready()).await.unwrap();
    let path = format!("/{}/{}", method.parent_service().full_name(), method.name());
    let mut request = Request::new(tokio_stream::iter([Bytes::from(message)]));
    if let Some(token) = token {
        request.metadata_mut().insert("authorization", format!("Bearer {token}").parse().unwrap());
    }
    let reply = client.streaming(request, path.parse().unwrap(), OnTheWire);
    let outcome = match soon("an answer", reply).await {
        Ok(stream) => soon("a reply", stream.into_inner().message()).await.map(|_| ()),
        Err(status) => Err(status),
    };
    outcome.map_err(|status| Refused::from_status(&status))
}

/// What the guard says to those whom it does not know.
fn strangers(server: &Guarded) -> Vec<(&'static str, Option<String>, &'static str)> {
    let known = &server.tokens["admin"];
    let last = if known.ends_with('0') { "1" } else { "0" };
    vec![
        ("none", None, "TOKEN_MISSING"),
        ("nonsense", Some("let me in".to_owned()), "TOKEN_INVALID"),
        ("wrong", Some(format!("{}{last}", &known[..known.len() - 1])), "TOKEN_INVALID"),
        ("expired", Some(server.tokens["expired"].clone()), "TOKEN_EXPIRED"),
        ("revoked", Some(server.tokens["revoked"].clone()), "TOKEN_INVALID"),
    ]
}

/// A server with a session of another experiment, and callers of all kinds.
async fn server() -> Guarded {
    let mut new: Vec<NewToken> = Scope::ALL.map(|scope| new_token(scope.name(), scope)).to_vec();
    new.push(NewToken {
        lasts: Some(std::time::Duration::from_millis(1)),
        ..new_token("expired", Scope::Admin)
    });
    new.push(new_token("revoked", Scope::Admin));
    new.push(NewToken { experiments: Some("mugs".to_owned()), ..new_token("kept", Scope::Admin) });
    let server = Guarded::start(&new).await;
    server.revoke("revoked").await;
    // It counts within a second.
    let known = async {
        while accepted(server.http("revoked").get("/v1/sessions")).await.is_ok() {
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
    };
    soon("the token is revoked", known).await;
    let admin = server.client("admin").await;
    let request = v1::CreateSessionRequest { experiment: "cups".to_owned(), ..creation("cup") };
    admin.create_session(request).await.unwrap();
    server
}

#[tokio::test]
async fn no_rpc_is_answered_to_who_may_not_make_it() {
    let server = server().await;
    let mut tried = 0;
    for method in methods() {
        let name = method.name().to_owned();
        for (who, token, reason) in strangers(&server) {
            let refused = call(&server, &method, about(&method, "cup"), token.as_deref()).await.unwrap_err();
            assert_eq!(refused.reason, reason, "{name} {who}");
            tried += 1;
        }
        let needed = needed(&name);
        for scope in Scope::ALL {
            let outcome =
                call(&server, &method, about(&method, "cup"), Some(&server.tokens[scope.name()])).await;
            let reason = outcome.err().map(|refused| refused.reason).unwrap_or_default();
            assert_eq!(reason == "SCOPE_DENIED", scope < needed, "{name} by {scope}: {reason:?}");
            tried += 1;
            if scope >= needed && name == "DeleteSession" {
                let (experiment, request_id) = ("cups".to_owned(), format!("after {tried}"));
                let request = v1::CreateSessionRequest { experiment, request_id, ..creation("cup") };
                server.client("admin").await.create_session(request).await.unwrap();
            }
        }
    }
    println!("{tried} calls over gRPC");
}

#[tokio::test]
async fn a_session_of_another_experiment_is_as_if_it_were_not_there() {
    let server = server().await;
    let kept = server.tokens["kept"].as_str();
    for method in methods() {
        let name = method.name();
        if about(&method, "cup").is_empty() {
            continue;
        }
        let there = call(&server, &method, about(&method, "cup"), Some(kept)).await;
        let nowhere = call(&server, &method, about(&method, "pot"), Some(kept)).await;
        if name == "CreateSession" {
            for outcome in [there, nowhere] {
                assert_eq!(outcome.unwrap_err().reason, "SCOPE_DENIED", "of no experiment that it may use");
            }
            continue;
        }
        let (there, nowhere) = (there.unwrap_err(), nowhere.unwrap_err());
        let anonymous = |refused: &Refused, id: &str| refused.message.replace(id, "ID");
        assert_eq!(anonymous(&there, "cup"), anonymous(&nowhere, "pot"), "{name}");
        assert_eq!(there.reason, nowhere.reason, "{name}");
    }
    let http = server.http("kept");
    let listed: Value = accepted(http.get("/v1/sessions")).await.unwrap().json().await.unwrap();
    assert_eq!(listed["sessions"].as_array().map_or(0, Vec::len), 0);
    let listed: Value = accepted(http.get("/v1/experiments")).await.unwrap().json().await.unwrap();
    assert_eq!(listed["experiments"].as_array().map_or(0, Vec::len), 0);
    let refused = accepted(http.get("/v1/experiments/cups/summary")).await.unwrap_err();
    assert_eq!(refused.reason, "SCOPE_DENIED");
}

/// The operations of the document whose names are not those of an RPC.
const OTHERWISE_NAMED: [(&str, &str); 4] = [
    ("list_or_watch_events", "ListEvents"),
    ("get_version", "GetServerInfo"),
    ("version", "GetServerInfo"),
    ("issue_ticket", "GetSession"),
];
/// The operations that answer whoever asks.
const OPEN: [&str; 3] = ["healthz", "livez", "readyz"];

fn rpc_of(operation: &str) -> String {
    if let Some((_, rpc)) = OTHERWISE_NAMED.iter().find(|(name, _)| *name == operation) {
        return (*rpc).to_owned();
    }
    let capitalized = operation.split('_').map(|word| word[..1].to_uppercase() + &word[1..]);
    capitalized.collect()
}

#[tokio::test]
async fn no_route_is_answered_to_who_may_not_make_its_call() {
    let server = server().await;
    let document: Value =
        accepted(server.anonymous().get("/openapi.json")).await.unwrap().json().await.unwrap();
    let known: Vec<String> = methods().iter().map(|method| method.name().to_owned()).collect();
    let mut tried = BTreeMap::new();
    for (path, operations) in document["paths"].as_object().unwrap() {
        for (method, operation) in operations.as_object().unwrap() {
            let name = operation["operationId"].as_str().unwrap().to_owned();
            let path =
                path.replace("{session_id}", "cup").replace("{experiment}", "cups").replace("{seq}", "1");
            let method = Method::from_bytes(method.to_uppercase().as_bytes()).unwrap();
            let request = |http: &Http| http.request(method.clone(), &path).json(&serde_json::json!({}));
            if OPEN.contains(&name.as_str()) {
                accepted(server.anonymous().get(&path)).await.unwrap();
                continue;
            }
            for (who, token, reason) in strangers(&server) {
                let http = match &token {
                    Some(token) => server.anonymous().with_token(token),
                    None => server.anonymous(),
                };
                let refused = accepted(request(&http)).await.unwrap_err();
                assert_eq!(refused.reason, reason, "{name} {who}");
            }
            let scope = if name == "metrics" || name == "get_metrics" {
                Scope::Read
            } else {
                let rpc = rpc_of(&name);
                assert!(known.contains(&rpc), "{name}: {rpc} is no RPC: say in this test which one it calls");
                needed(&rpc)
            };
            for lesser in Scope::ALL.into_iter().filter(|lesser| *lesser < scope) {
                let refused = accepted(request(&server.http(lesser.name()))).await;
                // A body may be refused before anybody asks who may send it; nothing is told by that.
                let refused = refused.unwrap_err();
                let of_body = ["UNPARSABLE", "UNSUPPORTED_MEDIA_TYPE", "FIELD_INVALID"];
                let reason = refused.reason.as_str();
                assert!(
                    reason == "SCOPE_DENIED" || of_body.contains(&reason),
                    "{name} by {lesser}: {refused:?}"
                );
            }
            tried.insert(name, scope);
        }
    }
    println!("{} routes: {tried:?}", tried.len());
}
