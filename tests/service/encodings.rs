//! Compressed bodies over HTTP: gzip is understood wherever a body is, within the same bounds.

use std::io::{Read, Write};

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use palpate_proto::v1;
use reqwest::{Method, RequestBuilder};
use serde_json::json;

use crate::harness::{Server, accepted, cap, from_json, header, prior, question, send, to_json};

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn post(server: &Server, path: &str, media_type: &str, encoding: &str, body: Vec<u8>) -> RequestBuilder {
    let request = server.http().request(Method::POST, path).header("content-type", media_type);
    request.header("content-encoding", encoding).body(body)
}

#[tokio::test]
async fn json_and_files_may_come_compressed() {
    let server = Server::start().await;
    let json = |path: &str, body: serde_json::Value| {
        post(&server, path, "application/json", "gzip", gzip(body.to_string().as_bytes()))
    };
    accepted(json("/v1/sessions", json!({"session_id": "ball"}))).await.unwrap();
    accepted(json("/v1/sessions", json!({"session_id": "file"}))).await.unwrap();
    accepted(json("/v1/sessions/ball/priors", to_json(&prior("ball")))).await.unwrap();
    let candidates =
        accepted(json("/v1/sessions/ball/candidates", to_json(&question("ball", 2)))).await.unwrap();
    let candidates: v1::ProposeContactsResponse = from_json(&candidates.text().await.unwrap());
    assert_eq!(candidates.candidates.len(), 2);
    let path = "/v1/sessions/file/priors?viewpoint=1,0,0.3";
    let file = post(&server, path, "application/octet-stream", "gzip", gzip(&cap().points));
    accepted(file).await.unwrap();
    let hash = async |name: &str| server.grpc().log(name).await.remove(1).state_hash;
    assert_eq!(hash("file").await, hash("ball").await);
    let plain = post(&server, "/v1/sessions", "application/json", "identity", b"{}".to_vec());
    accepted(plain).await.unwrap();
}

#[tokio::test]
async fn a_body_that_grows_beyond_the_limit_is_refused_like_a_large_one() {
    let server = Server::start().await;
    accepted(server.http().post("/v1/sessions", &json!({"session_id": "ball"}))).await.unwrap();
    let bomb = gzip(&vec![b' '; 64 << 20]);
    assert!(bomb.len() < 100_000, "{} bytes are sent", bomb.len());
    for (path, media_type) in [
        ("/v1/sessions", "application/json"),
        ("/v1/sessions/ball/priors", "application/json"),
        ("/v1/sessions/ball/priors", "application/octet-stream"),
        ("/v1/sessions/ball/priors", "image/png"),
    ] {
        let refused = accepted(post(&server, path, media_type, "gzip", bomb.clone())).await.unwrap_err();
        assert_eq!(refused.reason, "TOO_LARGE", "{path} {media_type}");
    }
    // What grows and is within the limit is read.
    let blanks = gzip(&[&vec![b' '; 3 << 20][..], b"{}"].concat());
    accepted(post(&server, "/v1/sessions", "application/json", "gzip", blanks)).await.unwrap();
}

#[tokio::test]
async fn another_encoding_is_refused_with_the_one_that_is_taken() {
    let server = Server::start().await;
    accepted(server.http().post("/v1/sessions", &json!({"session_id": "ball"}))).await.unwrap();
    for (path, media_type) in [
        ("/v1/sessions", "application/json"),
        ("/v1/sessions/ball/candidates", "application/json"),
        ("/v1/sessions/ball/contacts", "application/json"),
        ("/v1/sessions/ball/priors", "application/json"),
        ("/v1/sessions/ball/priors", "application/ply"),
    ] {
        for encoding in ["br", "zstd", "deflate", "gzip, gzip", "made-up"] {
            let request = || post(&server, path, media_type, encoding, b"{}".to_vec());
            let answer = send(request()).await;
            assert_eq!(
                (answer.status().as_u16(), header(&answer, "accept-encoding")),
                (415, "gzip"),
                "{encoding}"
            );
            let refused = accepted(request()).await.unwrap_err();
            assert_eq!(refused.reason, "UNSUPPORTED_MEDIA_TYPE");
            assert!(
                refused.message.contains(encoding) && refused.message.contains("gzip"),
                "{}",
                refused.message
            );
        }
    }
}

#[tokio::test]
async fn what_is_called_gzip_and_is_none_is_no_body() {
    let server = Server::start().await;
    let whole = gzip(&json!({"session_id": "ball"}).to_string().into_bytes());
    for body in [b"{}".to_vec(), whole[..whole.len() / 2].to_vec(), Vec::new()] {
        let request = post(&server, "/v1/sessions", "application/json", "gzip", body);
        assert_eq!(accepted(request).await.unwrap_err().reason, "UNPARSABLE");
    }
    let mut damaged = whole.clone();
    let checksum = damaged.len() - 8;
    damaged[checksum] ^= 1;
    let request = post(&server, "/v1/sessions", "application/json", "gzip", damaged);
    assert_eq!(accepted(request).await.unwrap_err().reason, "UNPARSABLE");
    assert_eq!(server.grpc().list(v1::ListSessionsRequest::default()).await.unwrap().sessions, []);
}

#[tokio::test]
async fn large_answers_come_compressed_where_that_is_taken_and_are_the_same() {
    let server = Server::start().await;
    let get = async |encoding: &str| {
        let request = server.http().request(Method::GET, "/openapi.json").header("accept-encoding", encoding);
        let answer = request.send().await.unwrap();
        let named = |name| {
            let values = answer.headers().get_all(name).iter();
            values.map(|value| value.to_str().unwrap()).collect::<Vec<_>>().join(", ")
        };
        let [encoding, vary] = ["content-encoding", "vary"].map(named);
        (encoding, vary, answer.bytes().await.unwrap())
    };
    let (encoding, _, plain) = get("identity").await;
    assert_eq!(encoding, "");
    let (encoding, vary, compressed) = get("br, gzip").await;
    assert_eq!((encoding.as_str(), vary.to_lowercase().contains("accept-encoding")), ("gzip", true));
    assert!(2 * compressed.len() < plain.len(), "{} of {}", compressed.len(), plain.len());
    let mut text = Vec::new();
    GzDecoder::new(compressed.as_ref()).read_to_end(&mut text).unwrap();
    assert!(text == plain);
    assert_eq!(get("gzip;q=0").await.0, "");
}
