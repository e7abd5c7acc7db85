//! Which point of the pad is taken as touched, and that the reply says so.

use palpate_proto::v1;
use palpate_proto::v1::{Method, TouchedPoint};

use crate::harness::ball::{CENTRE, distance_m, met, pushed, rotated, xyz};
use crate::harness::{Server, Transport};

const OFFSET: [f64; 3] = [0.004, -0.003, 0.0];

fn sensor(touched_point: TouchedPoint) -> v1::Sensor {
    let upright = v1::Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };
    let pose = v1::Pose { position: Some(v1::Vector3::default()), orientation: Some(upright) };
    v1::Sensor {
        id: "pad".into(),
        tool_from_sensor: Some(pose),
        pad_half_side_m: 0.009,
        touched_point: touched_point.into(),
        ..Default::default()
    }
}

#[tokio::test]
async fn the_touched_point_is_what_the_pad_and_the_method_say_and_the_reply_tells_it() {
    use TouchedPoint::{CenterOfPressure, PadCenter, Unspecified};
    let server = Server::start().await;
    for transport in Transport::BOTH {
        let caller = server.caller(transport);
        for (method, declared, expected) in [
            (Method::Palpate, None, CenterOfPressure),
            (Method::Palpate, Some(Unspecified), CenterOfPressure),
            (Method::Palpate, Some(CenterOfPressure), CenterOfPressure),
            (Method::Palpate, Some(PadCenter), PadCenter),
            (Method::Paper, None, PadCenter),
            (Method::Paper, Some(Unspecified), PadCenter),
            (Method::Paper, Some(PadCenter), PadCenter),
        ] {
            let name = format!("{}-{method:?}-{declared:?}", transport.name());
            let name: String =
                name.to_lowercase().chars().filter(|c| c.is_alphabetic() || *c == '-').collect();
            let sensors = declared.map(sensor).into_iter().collect();
            let config = v1::SessionConfig { method: method.into(), sensors, ..Default::default() };
            let next = caller.begin_coarse(&name, config).await;
            let said = met(&next, CENTRE, pushed([0.3, -0.2, -5.0], OFFSET));
            let Some(v1::contact_result::Outcome::Contact(contact)) = &said.outcome else {
                panic!("{said:?}")
            };
            let pose = contact.sensor_pose.unwrap();
            let (centre, beside) = (xyz(pose.position.unwrap()), rotated(&pose.orientation.unwrap(), OFFSET));
            let pressed = [0, 1, 2].map(|k| centre[k] + beside[k]);
            let reply = caller.tell(&name, said, "touch").await;
            assert_eq!(reply.touched_point(), expected, "{name}");
            assert_eq!(reply.touched_points.len(), 1);
            let point = if expected == PadCenter { centre } else { pressed };
            assert!(distance_m(xyz(reply.touched_points[0]), point) < 1e-6, "{name}: {reply:?}");
            assert_eq!(reply.warnings, Vec::<String>::new());
        }
    }
}
