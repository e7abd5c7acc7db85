//! What a view shows beside the object: the table that it stands on, declared or found, and points that float alone.

use palpate_proto::v1;
use palpate_proto::v1::WarningCode;

use crate::harness::ball::{CENTRE, cap_with, kinds, met, plausible, xyz};
use crate::harness::{Caller, Outcome, Server, Transport, cloud, creation, prior, question};

/// Where the ball stands, in metres.
const TABLE_M: f64 = 0.25;
const TABLE: v1::HalfSpace =
    v1::HalfSpace { normal: Some(v1::Vector3 { x: 0.0, y: 0.0, z: 1.0 }), offset_m: TABLE_M };

/// 60 points of the table around the ball.
fn around_the_ball() -> Vec<[f32; 3]> {
    let point = |number: u16| {
        let (around, radius) = (2.4 * f32::from(number), 0.07 + 0.001 * f32::from(number));
        [radius * around.cos(), radius * around.sin(), TABLE_M as f32]
    };
    (0..60).map(point).collect()
}

async fn show(caller: &Caller, name: &str, view: v1::VisualPrior) -> Outcome<v1::AddVisualPriorResponse> {
    caller.add_prior(v1::AddVisualPriorRequest { prior: Some(view), ..prior(name) }).await
}

fn said(reply: &v1::AddVisualPriorResponse) -> Vec<WarningCode> {
    kinds(&reply.warnings, &reply.warning_details)
}

async fn assert_all_above(caller: &Caller, name: &str) {
    let (_, vertices) = caller.vertices(name).await;
    let lowest_m = vertices.iter().map(|vertex| vertex[2]).fold(f64::INFINITY, f64::min);
    // The mesh has 32-bit floats.
    assert!(lowest_m > TABLE_M - 1e-6, "{lowest_m}");
    let proposal = caller.propose(question(name, 32)).await.unwrap();
    assert!(proposal.candidates.len() > 3 && proposal.excluded.unwrap().keep_out > 0);
    assert_eq!(kinds(&proposal.warnings, &proposal.warning_details), []);
    for candidate in proposal.candidates {
        let (from, to) = (candidate.probe_start.unwrap(), candidate.probe_end.unwrap());
        assert!(from.z.min(to.z) >= TABLE_M, "{candidate:?}");
    }
}

#[tokio::test]
async fn nothing_of_the_surface_and_no_approach_is_below_a_declared_support() {
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        let config =
            v1::SessionConfig { support: Some(TABLE), icosphere_subdivisions: Some(3), ..Default::default() };
        let session =
            caller.create(v1::CreateSessionRequest { config: Some(config), ..creation(name) }).await.unwrap();
        assert_eq!(session.config.unwrap().support, Some(TABLE));
        let reply = show(&caller, name, cap_with(&around_the_ball())).await.unwrap();
        assert_eq!(reply.accepted_points, 120);
        let aside = reply.set_aside.as_ref().unwrap();
        assert_eq!((aside.support_points, aside.isolated_points, aside.repeated_points), (60, 0, 0));
        assert_eq!(aside.points_f32_le.len(), 60 * 12);
        assert_eq!(aside.support.map(|plane| plane.offset_m), Some(TABLE_M));
        assert_all_above(&caller, name).await;
        let mut next = reply.candidates[0].clone();
        for number in 0..6 {
            let said = met(&next, CENTRE, plausible(number));
            next = caller.tell(name, said, &format!("touch-{number}")).await.candidates.remove(0);
            assert_all_above(&caller, name).await;
        }
    }
}

/// A square grid of points from a corner along two edges, in centimetres.
fn face(corner: [f32; 3], u: [f32; 3], v: [f32; 3], steps: u16) -> Vec<[f32; 3]> {
    let at = |i: u16, j: u16| {
        let (a, b) = (f32::from(i) / f32::from(steps), f32::from(j) / f32::from(steps));
        [0, 1, 2].map(|k| 0.01 * (corner[k] + a * u[k] + b * v[k]))
    };
    (0..=steps).flat_map(|i| (0..=steps).map(move |j| at(i, j))).collect()
}

/// The top and the front of a box of 10 by 8 by 12 cm, and the table around it.
fn cuboid_on_a_table() -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let top = face([0.0, 0.0, 12.0], [10.0, 0.0, 0.0], [0.0, 8.0, 0.0], 9);
    let front = face([10.0, 0.0, 0.5], [0.0, 8.0, 0.0], [0.0, 0.0, 11.0], 9);
    let table = face([-6.0, -6.0, 0.0], [22.0, 0.0, 0.0], [0.0, 20.0, 0.0], 20);
    let beside = |p: &[f32; 3]| !((-0.001..0.101).contains(&p[0]) && (-0.001..0.081).contains(&p[1]));
    ([top, front].concat(), table.into_iter().filter(beside).collect())
}

fn view_of(points: &[[f32; 3]]) -> v1::VisualPrior {
    v1::VisualPrior { viewpoint: Some(v1::Vector3 { x: 0.5, y: 0.2, z: 0.5 }), ..cloud(points) }
}

#[tokio::test]
async fn a_table_around_a_box_is_set_aside_and_told_unless_it_is_to_be_kept() {
    let server = Server::start().await;
    let (cuboid, table) = cuboid_on_a_table();
    let all = [cuboid.clone(), table.clone()].concat();
    let count = |points: &[[f32; 3]]| u32::try_from(points.len()).unwrap();
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let reply = show(&caller, name, view_of(&all)).await.unwrap();
        assert_eq!(said(&reply), [WarningCode::SupportPoints], "{:?}", reply.warnings);
        assert_eq!(reply.warning_details[0].parameters["points"], table.len() as f64);
        let aside = reply.set_aside.unwrap();
        assert_eq!((aside.support_points, aside.isolated_points), (count(&table), 0));
        assert_eq!((reply.accepted_points, reply.dropped_points), (count(&cuboid), 0));
        let plane = aside.support.unwrap();
        let normal = xyz(plane.normal.unwrap());
        assert!((normal[2] - 1.0).abs() < 1e-6 && plane.offset_m.abs() < 1e-6, "{plane:?}");
        // All that is shown as set aside is of the table.
        for point in aside.points_f32_le.chunks_exact(12) {
            let z = f32::from_le_bytes(point[8..].try_into().unwrap());
            assert!(z.abs() < 1e-6, "{z}");
        }

        let kept = format!("{name}-kept");
        caller.create(creation(&kept)).await.unwrap();
        let view = v1::VisualPrior { keep_clutter: true, ..view_of(&all) };
        let reply = show(&caller, &kept, view).await.unwrap();
        assert_eq!(said(&reply), []);
        assert_eq!(reply.set_aside.unwrap(), v1::SetAside::default());
        assert_eq!((reply.accepted_points, reply.dropped_points), (count(&all), 0));
    }
}

#[tokio::test]
async fn pixels_without_depth_at_the_cameras_place_are_set_aside_and_told_unless_they_are_to_be_kept() {
    let server = Server::start().await;
    // The camera of the samples stands there.
    let view = || cap_with(&[[1.0, 0.0, 0.3]; 30]);
    for transport in Transport::BOTH {
        let (caller, name) = (server.caller(transport), transport.name());
        caller.create(creation(name)).await.unwrap();
        let reply = show(&caller, name, view()).await.unwrap();
        let told = said(&reply);
        assert!(told.contains(&WarningCode::IsolatedPoints), "{:?}", reply.warnings);
        assert!(told.contains(&WarningCode::RepeatedPoints) && told.len() == 2, "{:?}", reply.warnings);
        let aside = reply.set_aside.unwrap();
        assert_eq!((aside.repeated_points, aside.isolated_points, aside.support_points), (29, 1, 0));
        assert_eq!(reply.accepted_points, 120);

        let kept = format!("{name}-kept");
        caller.create(creation(&kept)).await.unwrap();
        let reply = show(&caller, &kept, v1::VisualPrior { keep_clutter: true, ..view() }).await.unwrap();
        assert_eq!(reply.set_aside.unwrap().isolated_points, 0);
        assert_eq!(reply.accepted_points, 121);
    }
}
