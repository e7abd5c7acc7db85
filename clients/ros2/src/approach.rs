//! Where a pad began its straight way to a touch, by TF: what it went through is free, and the server is told so.
//!
//! From the touch backwards, as long as the pad's centre lay on the pad's own axis and TF knows where it was. Nothing is
//! taken on trust: a robot that came round a corner swept only what lies after the corner.

use nalgebra::Isometry3;

use crate::transforms::Transforms;

/// How far apart the looks back are, in ns.
const STEP_NS: i64 = 10_000_000;
/// How many looks back there are at most, ten seconds: a pad in a static frame was always there.
const MOST_STEPS: i64 = 1000;
/// Farther from the axis, in m, it is another way.
const ASIDE_M: f64 = 0.003;
/// A shorter way, in m, says nothing.
const SHORTEST_M: f64 = 0.002;

/// Where the pad's centre began its way, in m in frame `base`; `None` where it did not come along its axis.
pub fn swept_from(
    transforms: &Transforms,
    base: &str,
    pad: &str,
    base_from_pad: &Isometry3<f64>,
    stamp_ns: i64,
) -> Option<[f64; 3]> {
    let touched = base_from_pad.translation.vector;
    let out_of_pad = base_from_pad.rotation * nalgebra::Vector3::z();
    let (mut begun, mut way_m) = (None, SHORTEST_M);
    for step in 1..=MOST_STEPS {
        let Ok(earlier) = transforms.lookup(base, pad, stamp_ns - step * STEP_NS) else { break };
        let from_touch = earlier.translation.vector - touched;
        let back_m = -from_touch.dot(&out_of_pad);
        let aside_m = (from_touch + back_m * out_of_pad).norm();
        if aside_m > ASIDE_M {
            break;
        }
        if back_m > way_m {
            (begun, way_m) = (Some(earlier.translation.vector.into()), back_m);
        }
    }
    begun
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Header, Quaternion, Time, Transform, TransformStamped, Vector3};

    const MS: i64 = 1_000_000;

    /// A pad that looks down: it comes from the side for half a second, and goes down 20 mm in another one.
    fn coming(upto_ms: i64) -> Transforms {
        let mut transforms = Transforms::new(10.0, 0.5);
        for at_ms in (1000..=upto_ms).step_by(20) {
            let down_m = 0.02 * ((at_ms - 1500).max(0) as f64) / 500.0;
            let aside_m = 0.1 * ((1500 - at_ms).max(0) as f64) / 500.0;
            let transform = Transform {
                translation: Vector3 { x: 0.5 + aside_m, y: 0.0, z: 0.12 - down_m },
                rotation: Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 },
            };
            let header = Header { stamp: Time::from_ns(at_ms * MS), frame_id: "base".to_owned() };
            let one = TransformStamped { header, child_frame_id: "pad".to_owned(), transform };
            transforms.insert(&one, false).unwrap();
        }
        transforms
    }

    fn swept(transforms: &Transforms, at_ms: i64) -> Option<[f64; 3]> {
        let base_from_pad = transforms.lookup("base", "pad", at_ms * MS).unwrap();
        swept_from(transforms, "base", "pad", &base_from_pad, at_ms * MS)
    }

    #[test]
    fn a_way_begins_where_the_pad_came_onto_its_axis() {
        let begun = swept(&coming(2000), 2000).unwrap();
        assert!((begun[2] - 0.12).abs() < 1e-9 && (begun[0] - 0.5).abs() < ASIDE_M, "{begun:?}");
    }

    #[test]
    fn a_pad_that_came_from_the_side_or_has_not_moved_swept_nothing() {
        assert_eq!(swept(&coming(1500), 1500), None);
        assert_eq!(swept(&coming(2000), 1520), None);
    }

    #[test]
    fn a_pad_that_pulls_back_into_a_touch_swept_nothing_in_front_of_it() {
        let transforms = coming(2000);
        let base_from_pad = transforms.lookup("base", "pad", 2000 * MS).unwrap();
        let turned = base_from_pad
            * nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::x_axis(), std::f64::consts::PI);
        assert_eq!(swept_from(&transforms, "base", "pad", &turned, 2000 * MS), None);
    }
}
