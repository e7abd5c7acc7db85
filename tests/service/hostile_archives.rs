//! Bundles that are none, that were cut, changed or forged: each is refused by a sentence, and leaves nothing behind.

use std::io::Write;

use palpate_proto::v1;
use palpate_proto::v1::ArchiveFormat::Bundle;
use palpate_server::Limits;
use prost::Message;
use reqwest::Method;

use crate::harness::bundle::{Members, pack};
use crate::harness::{Caller, Server, Transport, accepted, report, touch};

/// A session with a view and two touches, as a bundle.
async fn bundle() -> Vec<u8> {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("mug").await;
    caller.go_on("mug", next, 2).await;
    caller.export("mug", Bundle, 0).await.unwrap()
}

/// Refused over both transports, by the field `data` and in these words.
async fn check(server: &Server, bundle: &[u8], words: &str) {
    for transport in Transport::BOTH {
        for session_id in ["", "copy"] {
            let header = v1::CreateSessionRequest { session_id: session_id.into(), ..Default::default() };
            let refused = server.caller(transport).import(header, bundle).await.unwrap_err();
            assert_eq!(refused.fields, ["data"], "{words}: {refused:?}");
            assert!(refused.message.contains(words), "{words}: {}", refused.message);
        }
    }
    check_empty(server).await;
}

async fn check_empty(server: &Server) {
    let listed = server.grpc().list(v1::ListSessionsRequest::default()).await.unwrap();
    assert!(listed.sessions.is_empty(), "{listed:?}");
    for entry in std::fs::read_dir(server.folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(name.starts_with("palpate.db"), "{name} is left behind");
    }
}

/// A header of the tar format for a member of some kind and size.
fn header(name: &str, kind: u8, size: u64) -> tar::Header {
    let mut header = tar::Header::new_gnu();
    header.as_old_mut().name[..name.len()].copy_from_slice(name.as_bytes());
    header.set_size(size);
    header.set_mode(0o644);
    header.set_entry_type(tar::EntryType::new(kind));
    header.set_cksum();
    header
}

#[tokio::test]
async fn what_is_no_bundle_is_refused() {
    let server = Server::start().await;
    let whole = bundle().await;
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(&whole).unwrap();
    check(&server, b"", "is empty").await;
    check(&server, &[0; 1024], "is empty").await;
    check(&server, &[7; 4096], "is no tar file").await;
    check(&server, &gzip.finish().unwrap(), "is no tar file").await;
    let text = ("notes.txt".to_owned(), b"hello".to_vec());
    check(&server, &pack([&text]), "does not begin with manifest.json").await;
    let mut other = Members::of(&whole);
    *other.get("manifest.json") = br#"{"format": "another", "version": 1}"#.to_vec();
    check(&server, &other.pack(), "is not of the format palpate-bundle").await;
    *other.get("manifest.json") = br#"{"format": "palpate-bundle", "version": 2, "more": []}"#.to_vec();
    check(&server, &other.pack(), "is a bundle of version \"2\", and this server reads version 1").await;
    *other.get("manifest.json") = vec![b'['; 16 << 10];
    check(&server, &other.pack(), "cannot be read").await;
}

#[tokio::test]
async fn a_bundle_that_was_cut_or_changed_is_refused_wherever_that_is() {
    let server = Server::start().await;
    let whole = bundle().await;
    // Two blocks of zeros end the file: a cut within them loses nothing.
    for cut in (1..whole.len() - 1024).step_by(whole.len() / 12).chain([512, whole.len() - 1025]) {
        let header = v1::CreateSessionRequest::default();
        let refused = server.grpc().import(header, &whole[..cut]).await.unwrap_err();
        assert_eq!(refused.fields, ["data"], "cut at {cut}: {refused:?}");
    }
    let mut members = Members::of(&whole);
    let sums = ("SHA256SUMS".to_owned(), members.sums().into_bytes());
    members.get("mesh.ply")[700] ^= 1;
    check(&server, &pack(members.0.iter().chain([&sums])), "mesh.ply that is not what SHA256SUMS says").await;
    members.get("mesh.ply")[700] ^= 1;
    let without = members.0.iter().filter(|(name, _)| name != "attempts.csv");
    check(&server, &pack(without.chain([&sums])), "fewer members than SHA256SUMS says").await;
    check(&server, &pack(&members.0), "ends before SHA256SUMS").await;
    let mut longer = whole.clone();
    longer.extend(b"and more");
    check(&server, &longer, "goes on after its end").await;
    members.0.retain(|(name, _)| name != "log/000004.pb");
    check(&server, &members.pack(), "has 3 events, and its manifest says 4").await;
    members.0.retain(|(name, _)| name != "log/000002.pb");
    check(&server, &members.pack(), "in the place of log/000002.pb").await;
}

#[tokio::test]
async fn members_that_no_bundle_has_are_refused_before_they_are_read() {
    let server = Server::start().await;
    let whole = bundle().await;
    let members = Members::of(&whole);
    let with = |name: &str| {
        let extra = (name.to_owned(), b"x".to_vec());
        pack([&members.0[0], &extra])
    };
    for name in ["../../etc/passwd", "/etc/passwd", "log/../x", "log/000000.pb", "Manifest.json", "x"] {
        let words = if name.starts_with("log/") { "in the place of" } else { "that no bundle has" };
        check(&server, &with(name), words).await;
    }
    check(&server, &with("manifest.json"), "twice").await;
    let start = pack([&members.0[0]]);
    let start = &start[..start.len() - 1024];
    let raw = |header: &tar::Header| [start, header.as_bytes().as_slice()].concat();
    // Links, devices, folders, long names and what else the format knows.
    for kind in *b"123456xgLKSV" {
        check(&server, &raw(&header("session.json", kind, 0)), "no plain file").await;
    }
    // Sizes that no memory has: the refusal comes before a byte of it.
    for size in [1 << 30, 1 << 40, 1 << 60] {
        check(&server, &raw(&header("session.json", b'0', size)), "more than the limit").await;
    }
    let endless = raw(&header("session.json", b'0', u64::MAX));
    check(&server, &endless, "is no tar file, or a damaged one").await;
    let mut broken = header("session.json", b'0', 5);
    broken.as_old_mut().size = *b"not a number";
    broken.set_cksum();
    check(&server, &raw(&broken), "is no tar file, or a damaged one").await;
}

#[tokio::test]
async fn a_log_that_does_not_hang_together_is_refused() {
    let server = Server::start().await;
    let members = Members::of(&bundle().await);
    let change = |seq: i64, change: fn(&mut v1::LoggedEvent)| {
        let mut members = members.clone();
        let member = members.get(&format!("log/{seq:06}.pb"));
        let mut event = v1::LoggedEvent::decode(member.as_slice()).unwrap();
        change(&mut event);
        *member = event.encode_to_vec();
        members.pack()
    };
    check(&server, &change(3, |event| event.append_us += 1), "an event 3 that does not follow").await;
    check(&server, &change(3, |event| event.link = Vec::new().into()), "an event 3 that does not follow")
        .await;
    check(&server, &change(4, |event| event.seq = 5), "event 5 in the place of event 4").await;
    // The log of another session, whole as it is.
    let mut foreign = members.clone();
    let manifest = String::from_utf8(foreign.get("manifest.json").clone()).unwrap();
    *foreign.get("manifest.json") = manifest.replace("\"mug\"", "\"cup\"").into_bytes();
    check(&server, &foreign.pack(), "an event 1 that does not follow").await;
    let mut undecodable = members.clone();
    *undecodable.get("log/000002.pb") = vec![0xff; 20];
    check(&server, &undecodable.pack(), "an event 2 that is none").await;
}

#[tokio::test]
async fn a_log_that_was_forged_with_all_its_links_is_refused_for_what_it_says() {
    let server = Server::start().await;
    let members = Members::of(&bundle().await);
    let forged = |change: fn(&mut Vec<v1::LoggedEvent>)| members.forged("mug", change).pack();
    // To be sure that a forgery is read as far as it is meant to be.
    let same = forged(|_| {});
    let whole = Server::start().await;
    whole.grpc().import(v1::CreateSessionRequest::default(), &same).await.unwrap();

    check(&server, &forged(|log| log[2].kind = "visual_prior".into()), "is not what the event is").await;
    check(&server, &forged(|log| log[2].request_id = Some("a\nb".into())), "request_id").await;
    check(&server, &forged(|log| log[2].actor = "x".repeat(5000)), "actor").await;
    check(&server, &forged(|log| log[2].state_hash = "x".into()), "state_hash").await;
    check(&server, &forged(|log| log[2].append_us = i64::MAX), "is no time").await;
    check(&server, &forged(|log| log[2].payload = Vec::new().into()), "says nothing").await;
    check(&server, &forged(|log| log[2].reply = vec![0xff].into()), "reply").await;
    check(&server, &forged(|log| log.swap(2, 3)), "does not follow").await;
    let foreign_reply = forged(|log| {
        let mut reply = v1::ReportContactResponse::decode(log[2].reply.clone()).unwrap();
        reply.session.as_mut().unwrap().session_id = "cup".into();
        log[2].reply = reply.encode_to_vec().into();
    });
    check(&server, &foreign_reply, "is about another session").await;
    let bad_name = forged(|log| {
        let mut event = v1::Event::decode(log[0].payload.clone()).unwrap();
        let Some(v1::event::Kind::Created(request)) = &mut event.kind else { panic!("a creation") };
        request.display_name = "\u{202e}gum".into();
        log[0].payload = event.encode_to_vec().into();
    });
    check(&server, &bad_name, "event 1 that cannot be taken over: display_name").await;
    let another = forged(|log| {
        let mut event = v1::Event::decode(log[0].payload.clone()).unwrap();
        let Some(v1::event::Kind::Created(request)) = &mut event.kind else { panic!("a creation") };
        request.session_id = "cup".into();
        log[0].payload = event.encode_to_vec().into();
    });
    check(&server, &another, "creates \"cup\"").await;
}

#[tokio::test]
async fn states_must_be_those_that_were_recorded_unless_another_version_computed_them() {
    let members = Members::of(&bundle().await);
    let wrong = |version: &'static str| {
        let change = move |log: &mut Vec<v1::LoggedEvent>| {
            log[2].state_hash = "0".repeat(64);
            if !version.is_empty() {
                log.iter_mut().for_each(|event| event.algorithm_version = version.into());
            }
        };
        members.forged("mug", change).pack()
    };
    for transport in Transport::BOTH {
        let server = Server::start().await;
        let caller = server.caller(transport);
        let header = v1::CreateSessionRequest::default();
        let refused = caller.import(header.clone(), &wrong("")).await.unwrap_err();
        assert_eq!(refused.fields, ["data"]);
        assert!(
            refused.message.contains("event 3") && refused.message.contains("another state"),
            "{refused:?}"
        );
        check_empty(&server).await;
        let imported = caller.import(header, &wrong("palpate-0")).await.unwrap();
        assert_eq!(imported.revision, 4);
        // It is computed again as replay does, here and after a restart.
        let server = server.restart().await;
        assert_eq!(server.caller(transport).get("mug").await.unwrap().revision, 4);
    }
}

#[tokio::test]
async fn bundles_have_bounds_each_and_together() {
    let whole = bundle().await;
    let import = async |limits: Limits, transport: Transport| {
        let server = Server::with_limits(limits).await;
        let refused =
            server.caller(transport).import(v1::CreateSessionRequest::default(), &whole).await.unwrap_err();
        check_empty(&server).await;
        refused
    };
    for transport in Transport::BOTH {
        let few_contacts = import(Limits { contacts: 1, ..Limits::default() }, transport).await;
        assert!(
            few_contacts.message.contains("more contact results than the limit of 1"),
            "{few_contacts:?}"
        );
        let few_members = import(Limits { archive_members: 4, ..Limits::default() }, transport).await;
        assert!(few_members.message.contains("more members than the limit of 4"), "{few_members:?}");
        let small = import(Limits { archive_bytes: 20_000, ..Limits::default() }, transport).await;
        assert_eq!(small.reason, "TOO_LARGE");
        let together = import(Limits { import_bytes: 20_000, ..Limits::default() }, transport).await;
        assert_eq!(together.reason, "OVERLOADED");
        let session = import(Limits { session_bytes: 5_000, ..Limits::default() }, transport).await;
        assert_eq!(session.reason, "QUOTA");
    }
    // What swells is bounded by what it swells to.
    let server = Server::with_limits(Limits { archive_bytes: 1 << 20, ..Limits::default() }).await;
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    gzip.write_all(&vec![0; 64 << 20]).unwrap();
    let bomb = server.http().request(Method::POST, "/v1/imports").header("content-type", "application/x-tar");
    let bomb = bomb.header("content-encoding", "gzip").body(gzip.finish().unwrap());
    assert_eq!(accepted(bomb).await.unwrap_err().reason, "TOO_LARGE");
    check_empty(&server).await;
}

#[tokio::test]
async fn room_for_bundles_is_free_again_after_each_and_bodies_do_not_count_twice() {
    let whole = bundle().await;
    let bytes = whole.len() as u64;
    let limits = Limits { import_bytes: bytes, body_bytes: 64 << 10, ..Limits::default() };
    let server = Server::with_limits(limits).await;
    for (number, transport) in [Transport::Grpc, Transport::Http, Transport::Grpc].into_iter().enumerate() {
        let header = v1::CreateSessionRequest { session_id: format!("copy-{number}"), ..Default::default() };
        let refused = server.caller(transport).import(header.clone(), &whole[..700]).await.unwrap_err();
        assert_eq!(refused.fields, ["data"]);
        again(&server.caller(transport), header, &whole).await;
    }
}

/// The room of the call before is given back when its task has ended, which may be after its answer.
async fn again(caller: &Caller, header: v1::CreateSessionRequest, bundle: &[u8]) {
    for _ in 0..100 {
        match caller.import(header.clone(), bundle).await {
            Ok(_) => return,
            Err(refused) => assert_eq!(refused.reason, "OVERLOADED", "{refused:?}"),
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
    panic!("the room is never free again");
}

#[tokio::test]
async fn a_finished_log_does_not_go_on() {
    let origin = Server::start().await;
    let caller = origin.grpc();
    let next = caller.begin("mug").await;
    caller.report(report("mug", touch(&next, 0.0), "a")).await.unwrap();
    let finish = v1::FinishSessionRequest { session_id: "mug".into(), ..Default::default() };
    caller.finish(finish).await.unwrap();
    let members = Members::of(&caller.export("mug", Bundle, 0).await.unwrap());
    let forged = members.forged("mug", |log| {
        let (touch, finish) = (log[2].clone(), log[3].clone());
        log[2] = v1::LoggedEvent { seq: 3, ..finish };
        log[3] = v1::LoggedEvent { seq: 4, ..touch };
    });
    let server = Server::start().await;
    check(&server, &forged.pack(), "after the session was finished").await;
}
