//! A rosbag2 recording in MCAP, written by hand and played to a server.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::to_vec;
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use palpate_client::proto::v1::contact_result::Outcome;
use palpate_client::proto::v1::event::Kind;
use palpate_client::proto::v1::{GetMeshRequest, Mesh};
use palpate_ros2::messages::{Contact, RosMessage, kind};
use palpate_ros2::play::{Played, play};

use crate::harness::{Server, names};
use crate::robot::{CENTER, MS, RADIUS, camera, cloud, header, pad, wrench};

/// A recording as rosbag2 writes one.
struct Bag {
    writer: Writer<BufWriter<File>>,
    is_bigendian: bool,
}

impl Bag {
    fn new(path: &Path) -> Self {
        let options = WriteOptions::new().compression(None).profile("ros2");
        let file = BufWriter::new(File::create(path).unwrap());
        Self { writer: options.create(file).unwrap(), is_bigendian: false }
    }

    fn write<M: RosMessage>(&mut self, topic: &str, at_ns: i64, message: &M) {
        let schema = self.writer.add_schema(&M::full_name(), "ros2msg", b"not looked at").unwrap();
        let channel = self.writer.add_channel(schema, topic, "cdr", &[].into()).unwrap();
        let mut data = vec![0, u8::from(!self.is_bigendian), 0, 0];
        data.extend(match self.is_bigendian {
            true => to_vec::<_, BigEndian>(message).unwrap(),
            false => to_vec::<_, LittleEndian>(message).unwrap(),
        });
        let time = at_ns as u64;
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, &data).unwrap();
    }

    fn finish(mut self) {
        self.writer.finish().unwrap();
    }
}

/// The camera sees the ball; the pad comes down at 100 Hz, touches at 1.1 s, and goes up again. TF is recorded late.
fn exploration(path: &Path) {
    let mut bag = Bag::new(path);
    bag.write("/tf_static", 1, &camera());
    bag.write("/camera/points", 500 * MS, &cloud(500 * MS));
    for step in 0..150_i64 {
        let at = 600 * MS + step * 10 * MS;
        let touches = (50..80).contains(&step);
        let above_m = if touches { RADIUS } else { RADIUS + 0.0005 * (step - 50).abs() as f64 };
        bag.write("/tf", at + 25 * MS, &pad(at, above_m));
        bag.write("/ft", at, &wrench(at, if touches { 2.0 } else { 0.0 }));
        bag.write("/chatter", at, &camera());
    }
    // Who detects without the bridge, in the other byte order.
    bag.is_bigendian = true;
    let touched = Contact {
        header: header("base", 2000 * MS),
        kind: kind::INVALID,
        candidate_id: "none".to_owned(),
        detail: "the cable".to_owned(),
        ..Contact::default()
    };
    bag.write("/contact", 2050 * MS, &touched);
    bag.finish();
}

async fn played(server: &Server, path: &Path, session_id: &str) -> Result<Played, String> {
    let parameters = server.parameters(&[
        ("session_id", session_id),
        ("contact.tare_samples", "20"),
        ("config", "{icosphere_subdivisions: 3}"),
    ]);
    play(path, parameters, &names(&[("points", "/camera/points"), ("wrench", "/ft")])).await
}

async fn mesh(server: &Server, session_id: &str) -> Mesh {
    let request = GetMeshRequest { session_id: session_id.to_owned(), ..Default::default() };
    server.client().await.get_mesh(request).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_becomes_the_session_that_the_robot_made() {
    let server = Server::start().await;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag_0.mcap");
    exploration(&path);
    let first = played(&server, &path, "bag-1").await.unwrap();
    assert_eq!(first.problems, Vec::<String>::new());
    assert_eq!((first.views, first.reports, first.session_id.as_str()), (1, 2, "bag-1"));
    assert_eq!(first.messages, 1 + 1 + 300 + 1);

    let events = server.events("bag-1").await;
    let Some(Kind::VisualPrior(view)) = &events[1].kind else { panic!("{events:?}") };
    let viewpoint = view.viewpoint.unwrap();
    assert_eq!([viewpoint.x, viewpoint.y, viewpoint.z], [0.5, 0.0, 0.6]);
    let results = server.results("bag-1").await;
    let Some(Outcome::Contact(contact)) = &results[0].outcome else { panic!("{results:?}") };
    assert!(!results[0].candidate_id.is_empty(), "it is about the candidate that was open");
    assert_eq!(results[0].observe_time.unwrap().nanos, 100_000_000);
    let at = contact.sensor_pose.unwrap().position.unwrap();
    let expected = [CENTER[0], CENTER[1], CENTER[2] + RADIUS];
    for (at, expected) in [at.x, at.y, at.z].into_iter().zip(expected) {
        assert!((at - expected).abs() < 1e-9, "{at} is not {expected}");
    }
    let z = |wrench: Option<palpate_client::proto::v1::Wrench>| wrench.unwrap().force.unwrap().z;
    assert!((z(contact.wrench) - z(contact.rest_wrench) + 2.0).abs() < 1e-9);
    let Some(Outcome::InvalidContact(invalid)) = &results[1].outcome else { panic!("{results:?}") };
    assert_eq!(invalid.detail, "the cable");

    // The same recording gives the same surface.
    played(&server, &path, "bag-2").await.unwrap();
    assert!(mesh(&server, "bag-1").await.body == mesh(&server, "bag-2").await.body, "two surfaces");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_without_tf_says_what_was_lost_and_why() {
    let server = Server::start().await;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag_0.mcap");
    let mut bag = Bag::new(&path);
    bag.write("/camera/points", MS, &cloud(MS));
    bag.finish();
    let lost = played(&server, &path, "bag-1").await.unwrap();
    assert_eq!((lost.views, lost.reports), (0, 0));
    let [problem] = lost.problems.as_slice() else { panic!("{lost:?}") };
    assert!(problem.contains("topic points") && problem.contains("\"camera\""), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_recording_for_the_bridge_is_refused_by_topic() {
    let server = Server::start().await;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag_0.mcap");
    let mut bag = Bag::new(&path);
    bag.write("/ft", MS, &cloud(MS));
    bag.finish();
    let error = played(&server, &path, "bag-1").await.unwrap_err();
    assert!(error.contains("/ft") && error.contains("geometry_msgs/msg/WrenchStamped"), "{error}");
    std::fs::write(&path, b"#ROSBAG V2.0").unwrap();
    assert!(played(&server, &path, "bag-1").await.unwrap_err().contains("bag_0.mcap"));
}
