//! A session as an MCAP recording, read by the descriptors in the file alone and held against the API.

use std::collections::BTreeMap;
use std::path::Path;

use palpate_proto::v1;
use palpate_proto::v1::ArchiveFormat::Mcap;
use prost_reflect::{DescriptorPool, DynamicMessage, Value};

use crate::harness::{Caller, Server, Transport, database, header, miss, report, touch};

/// What a topic has at a time, in nanoseconds.
type Messages = BTreeMap<(String, u64), Vec<DynamicMessage>>;

fn read(file: &[u8]) -> Messages {
    let mut messages = Messages::new();
    for message in mcap::MessageStream::new(file).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(
            (schema.encoding.as_str(), message.channel.message_encoding.as_str()),
            ("protobuf", "protobuf")
        );
        let pool = DescriptorPool::decode(schema.data.as_ref()).unwrap();
        let descriptor = pool.get_message_by_name(&schema.name).unwrap();
        let decoded = DynamicMessage::decode(descriptor, message.data.as_ref()).unwrap();
        messages.entry((message.channel.topic.clone(), message.log_time)).or_default().push(decoded);
    }
    messages
}

fn nanoseconds(event: &v1::Event) -> u64 {
    let time = event.append_time.unwrap();
    time.seconds as u64 * 1_000_000_000 + time.nanos as u64
}

/// A field by its path; numbers are places in lists.
fn at(message: &DynamicMessage, path: &str) -> Value {
    let mut value = Value::Message(message.clone());
    for part in path.split('.') {
        value = match value {
            Value::Message(message) => message.get_field_by_name(part).unwrap().into_owned(),
            Value::List(list) => list[part.parse::<usize>().unwrap()].clone(),
            other => panic!("{path}: {other:?}"),
        };
    }
    value
}

fn number(message: &DynamicMessage, path: &str) -> f64 {
    at(message, path).as_f64().unwrap()
}

fn list(message: &DynamicMessage, path: &str) -> Vec<Value> {
    at(message, path).as_list().unwrap().to_vec()
}

async fn raw(caller: &Caller, revision: i64) -> v1::RawMesh {
    let request = v1::GetMeshRequest { session_id: "mug".into(), revision, ..Default::default() };
    let Some(v1::mesh::Body::Raw(raw)) = caller.mesh(request).await.unwrap().body else { panic!("raw") };
    raw
}

#[tokio::test]
async fn a_recording_says_at_the_time_of_each_event_what_the_api_says() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("mug").await;
    let next = caller.go_on("mug", next, 2).await;
    let reply = caller.report(report("mug", touch(&next, 0.02), "early")).await.unwrap();
    let next = reply.candidates[0].clone();
    caller.report(report("mug", miss(&next), "miss")).await.unwrap();
    let retraction = v1::RetractEventRequest {
        session_id: "mug".into(),
        seq: 4,
        reason: "cable".into(),
        ..Default::default()
    };
    caller.retract(retraction).await.unwrap();
    let finish =
        v1::FinishSessionRequest { session_id: "mug".into(), note: "enough".into(), ..Default::default() };
    let question = v1::ProposeContactsRequest { session_id: "mug".into(), top_k: 1, ..Default::default() };
    let last = caller.propose(question).await.unwrap().candidates.remove(0);
    caller.finish(finish).await.unwrap();
    let log = caller.log("mug").await;
    let file = caller.export("mug", Mcap, 0).await.unwrap();
    assert_eq!(server.caller(Transport::Http).export("mug", Mcap, 0).await.unwrap(), file);
    let messages = read(&file);
    let of = |topic: &str, event: &v1::Event| messages.get(&(topic.to_owned(), nanoseconds(event)));

    for event in &log {
        let stats = &of("/stats", event).unwrap()[0];
        let expected = event.stats_after.as_ref().unwrap();
        assert_eq!(number(stats, "mean_uncertainty"), expected.mean_uncertainty, "event {}", event.seq);
        assert_eq!(at(stats, "attempts").as_u32().unwrap(), expected.attempts);
    }
    for event in &log[1..7] {
        let mesh = raw(&caller, event.seq).await;
        let Some(scene) = of("/surface", event) else { continue };
        let triangles = at(&scene[0], "entities.0.triangles.0").as_message().unwrap().clone();
        let points: Vec<[f32; 3]> = list(&triangles, "points")
            .iter()
            .map(|point| ["x", "y", "z"].map(|axis| number(point.as_message().unwrap(), axis) as f32))
            .collect();
        assert_eq!(points, palpate_client::positions(&mesh).unwrap(), "event {}", event.seq);
        let indices: Vec<u32> =
            list(&triangles, "indices").iter().map(|index| index.as_u32().unwrap()).collect();
        assert_eq!(indices, palpate_client::faces(&mesh).unwrap().as_flattened());
        // Certain is green and a guess is red.
        let colours = list(&triangles, "colors");
        for (u, colour) in palpate_client::uncertainty(&mesh).unwrap().into_iter().zip(&colours) {
            let [red, green] = ["r", "g"].map(|part| number(colour.as_message().unwrap(), part));
            assert!(
                if u < 0.2 {
                    green > red
                } else if u > 0.8 {
                    red > green
                } else {
                    true
                },
                "{u}: {colour:?}"
            );
        }
        assert_eq!(at(&scene[0], "entities.0.frame_id").as_str(), Some("base"));
    }
    check_points(of("/points", &log[3]).unwrap(), &reply);
    let wrench = &of("/wrench", &log[2]).unwrap()[0];
    assert_eq!((number(wrench, "force.z"), number(wrench, "torque.x")), (-2.0, 0.004));
    assert_eq!(at(&of("/result", &log[5]).unwrap()[0], "robot_id").as_str(), Some("arm-1"));
    let lines = |event: &v1::Event| -> Vec<String> {
        let lines = of("/log", event).into_iter().flatten();
        lines.map(|line| at(line, "message").as_str().unwrap().to_owned()).collect()
    };
    assert!(!reply.warnings.is_empty() && lines(&log[4])[..reply.warnings.len()] == reply.warnings[..]);
    assert_eq!(lines(&log[6]), ["event 4 is retracted: cable"]);
    assert_eq!(lines(&log[7]), ["finished: enough"]);
    // The next place to touch after the last change of the surface, and the pose of the tool for it.
    let candidate = &of("/candidate", &log[6]).unwrap()[0];
    assert_eq!(number(candidate, "point.x"), last.point.unwrap().x);
    assert_eq!(at(candidate, "candidate_id").as_str(), Some(last.candidate_id.as_str()));
    let pose = &of("/next", &log[6]).unwrap()[0];
    assert_eq!(number(pose, "pose.position.z"), last.tool_pose.unwrap().position.unwrap().z);
}

/// The cloud after the second touch: 120 points of the view, and two touches.
fn check_points(clouds: &[DynamicMessage], later: &v1::ReportContactResponse) {
    let stride = at(&clouds[0], "point_stride").as_u32().unwrap() as usize;
    let data = at(&clouds[0], "data");
    let points: Vec<&[u8]> = data.as_bytes().unwrap().chunks(stride).collect();
    assert_eq!(points.len(), 122);
    let float =
        |point: &[u8], offset: usize| f32::from_le_bytes(point[offset..offset + 4].try_into().unwrap());
    assert_eq!(float(points[0], 12), 0.4, "the uncertainty of views");
    let seqs: Vec<u32> =
        points[119..].iter().map(|point| u32::from_le_bytes(point[16..20].try_into().unwrap())).collect();
    assert_eq!(seqs, [2, 3, 4]);
    assert_eq!([points[119][20], points[120][20], points[121][20]], [0, 1, 1]);
    assert!(later.contact_uncertainty >= 0.0);
}

#[tokio::test]
async fn a_recording_of_an_earlier_revision_ends_there_and_names_its_frame() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("mug").await;
    caller.go_on("mug", next, 1).await;
    let file = caller.export("mug", Mcap, 2).await.unwrap();
    let log = caller.log("mug").await;
    let last = read(&file).into_keys().map(|(_, time)| time).max().unwrap();
    assert_eq!(last, nanoseconds(&log[1]));
    let summary = mcap::Summary::read(&file).unwrap().expect("a summary, for viewers that seek");
    assert_eq!(
        summary.stats.unwrap().message_count,
        read(&file).values().map(|list| list.len() as u64).sum::<u64>()
    );
    let metadata = mcap::read::metadata(&file, &summary.metadata_indexes[0]).unwrap();
    assert_eq!((metadata.metadata["frame_id"].as_str(), metadata.metadata["unit"].as_str()), ("base", "m"));
    let http = server.http().get("/v1/sessions/mug/export?format=mcap");
    assert_eq!(
        header(&crate::harness::accepted(http).await.unwrap(), "content-type"),
        "application/octet-stream"
    );
}

#[tokio::test]
async fn a_recording_is_the_same_with_checkpoints_and_without_them() {
    let server = Server::start().await;
    let caller = server.grpc();
    let next = caller.begin("mug").await;
    let next = caller.go_on("mug", next, 5).await;
    let reply = caller.report(report("mug", touch(&next, 0.02), "early")).await.unwrap();
    caller.report(report("mug", miss(&reply.candidates[0]), "miss")).await.unwrap();
    let retraction = v1::RetractEventRequest {
        session_id: "mug".into(),
        seq: 8,
        reason: "cable".into(),
        ..Default::default()
    };
    caller.retract(retraction).await.unwrap();
    let expected = caller.export("mug", Mcap, 0).await.unwrap();
    let server = server.restart().await;
    assert_eq!(server.grpc().export("mug", Mcap, 0).await.unwrap(), expected, "with checkpoints");
    let without = async |database: &Path| {
        if database::is_shared() {
            database::run(database, "truncate checkpoints, shown").await;
        } else {
            std::fs::remove_file(database.with_file_name("palpate.db-checkpoints")).unwrap();
        }
    };
    let server = server.restart_after(without).await;
    assert_eq!(server.grpc().export("mug", Mcap, 0).await.unwrap(), expected, "without checkpoints");
}
