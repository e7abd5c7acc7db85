use tokio::sync::mpsc;

use super::*;
use crate::messages::{Transform, TransformStamped, Vector3, Wrench};
use crate::outbox::Order;

const MS: i64 = 1_000_000;

fn header(frame: &str, at_ms: i64) -> Header {
    Header { stamp: Time::from_ns(at_ms * MS), frame_id: frame.to_owned() }
}

/// Moves along x by a millimetre each millisecond.
fn pad(at_ms: i64) -> Inbound {
    let translation = Vector3 { x: 0.001 * at_ms as f64, y: 0.0, z: 0.0 };
    let transform = Transform { translation, rotation: Default::default() };
    let child_frame_id = "pad".to_owned();
    Inbound::Tf(TfMessage {
        transforms: vec![TransformStamped { header: header("base", at_ms), child_frame_id, transform }],
    })
}

fn wrench(at_ms: i64, z: f64) -> Inbound {
    let force = Vector3 { x: 0.0, y: 0.0, z };
    let wrench = Wrench { force, torque: Vector3::default() };
    Inbound::Wrench(WrenchStamped { header: header("pad", at_ms), wrench })
}

/// A bridge whose detector has its tare and needs one sample; two candidates are open.
fn bridge() -> (Bridge, mpsc::Receiver<Order>) {
    let mut parameters = Parameters::default();
    (parameters.contact.tare_samples, parameters.contact.debounce_samples) = (1, 1);
    let (outbox, orders) = Outbox::new(2);
    let mut bridge = Bridge::new(parameters, outbox, "palpate");
    bridge.take(wrench(1, 0.0), Instant::now());
    bridge.update(Update::Proposed(proposal("first")));
    (bridge, orders)
}

fn proposal(candidate_id: &str) -> Proposal {
    let candidate = |id: &str| v1::Candidate { candidate_id: id.to_owned(), ..Default::default() };
    Proposal { candidates: vec![candidate(candidate_id), candidate("other")], ..Proposal::default() }
}

/// The candidate and the pad's x, in m, of the next report.
fn reported(orders: &mut mpsc::Receiver<Order>) -> Option<(String, f64)> {
    let Command::Report(result) = orders.try_recv().ok()?.command else { panic!("a report was expected") };
    let Some(v1::contact_result::Outcome::Contact(contact)) = result.outcome else { panic!("{result:?}") };
    Some((result.candidate_id, contact.sensor_pose?.position?.x))
}

#[test]
fn a_touch_waits_for_its_transform_and_takes_the_pose_at_its_stamp() {
    let (mut bridge, mut orders) = bridge();
    let at = Instant::now();
    bridge.take(pad(100), at);
    bridge.take(wrench(110, -3.0), at);
    assert_eq!(reported(&mut orders), None);
    bridge.take(pad(120), at);
    let (candidate_id, x_m) = reported(&mut orders).unwrap();
    assert!(candidate_id == "first" && (x_m - 0.110).abs() < 1e-12, "{candidate_id} at {x_m}");
}

#[test]
fn a_touch_that_tf_never_explains_is_told_with_its_topic() {
    let (mut bridge, mut orders) = bridge();
    let at = Instant::now();
    bridge.take(wrench(110, -3.0), at);
    bridge.settle(at + Duration::from_millis(900));
    assert_eq!(bridge.diagnostics().get("wrench"), None);
    bridge.settle(at + Duration::from_millis(1100));
    let (level, said) = bridge.diagnostics().get("wrench").unwrap();
    assert!(level == Level::Error && said.contains("topic wrench") && said.contains("\"pad\""), "{said}");
    assert_eq!(reported(&mut orders), None);
}

#[test]
fn a_candidate_is_claimed_once_and_the_same_one_again_is_no_other() {
    let (mut bridge, mut orders) = bridge();
    let at = Instant::now();
    let mut touch = |bridge: &mut Bridge, at_ms| {
        bridge.take(pad(at_ms), at);
        bridge.take(wrench(at_ms, -3.0), at);
        bridge.take(wrench(at_ms, 0.0), at);
        reported(&mut orders).unwrap().0
    };
    assert_eq!(touch(&mut bridge, 100), "first");
    assert_eq!(touch(&mut bridge, 200), "");
    bridge.update(Update::Proposed(proposal("first")));
    assert_eq!(touch(&mut bridge, 300), "");
    bridge.update(Update::Proposed(proposal("second")));
    assert_eq!(touch(&mut bridge, 400), "second");
}

#[test]
fn what_does_not_fit_into_the_outbox_is_told() {
    let (mut bridge, _orders) = bridge();
    let at = Instant::now();
    for at_ms in [100, 200, 300] {
        bridge.take(pad(at_ms), at);
        bridge.take(wrench(at_ms, -3.0), at);
        bridge.take(wrench(at_ms, 0.0), at);
    }
    let (level, said) = bridge.diagnostics().get("wrench").unwrap();
    assert!(level == Level::Error && said.contains("outbox_limit"), "{said}");
}

#[test]
fn a_depth_image_without_its_camera_is_told() {
    let (mut bridge, _orders) = bridge();
    bridge.take_view();
    bridge.take(Inbound::Image(Image::default()), Instant::now());
    let (_, said) = bridge.diagnostics().get("view").unwrap();
    assert!(said.contains("depth/camera_info"), "{said}");
}

#[test]
fn a_cloud_is_taken_only_where_one_is_wanted() {
    let (mut bridge, mut orders) = bridge();
    let at = Instant::now();
    let cloud = || Inbound::Cloud(PointCloud2 { header: header("base", 100), ..PointCloud2::default() });
    bridge.take(cloud(), at);
    assert_eq!(bridge.diagnostics().get("view"), None);
    bridge.take_view();
    bridge.take(cloud(), at);
    assert!(bridge.diagnostics().get("view").unwrap().1.contains("no points"));
    assert!(orders.try_recv().is_err());
    assert!(bridge.is_view_wanted, "the next one may be better");
}

#[test]
fn a_new_session_wants_a_view_and_an_old_one_does_not() {
    let (mut bridge, _orders) = bridge();
    let session = |state: SessionState| {
        Update::Opened(Box::new(v1::Session { state: state.into(), ..Default::default() }))
    };
    bridge.update(session(SessionState::Active));
    assert!(!bridge.is_view_wanted);
    bridge.update(session(SessionState::AwaitingPrior));
    assert!(bridge.is_view_wanted);
}
