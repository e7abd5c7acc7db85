//! Which of the tool's pads touches, and how the tool is turned for it.
//!
//! An approach fixes where the chosen pad's centre is and that it faces the surface; the turn about
//! that axis is free. Of all pads and turns the one is taken that rotates the tool the least, so the
//! pad follows from the estimated normal, as in the paper (Section III-G), and the hand does not
//! spin. All is in the session's frame, since a hand knows where down is.

use nalgebra::{Rotation3, Translation3, UnitQuaternion};

use crate::geometry::{Direction, Point, Pose, Vector};

/// A pad that looks back at the tool by more than this, as a sine, has the arm on the object's side
/// of the surface that it touches: others come first.
const LOOKS_BACK: f64 = 0.1;
/// Rotations of the tool that differ by less, in radians, are equal: the pad declared first is taken.
const TIE_RAD: f64 = 1e-6;
/// Below this a direction is vertical: it has no azimuth.
const VERTICAL: f64 = 1e-9;

/// A square contact pad of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountedPad {
    /// The sensor's frame in the tool's: the origin in the middle of the pad's face, z out of it.
    pub tool_from_sensor: Pose,
    /// Half the side of the pad's square face, in metres.
    pub half_side_m: f64,
}

/// The tool before a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// The place of the pad in the order of their declaration; 0 where none is declared.
    pub pad: usize,
    /// Where the tool must be in the session's frame for the pad to be at `probe_start`, facing the
    /// surface.
    pub base_from_tool: Pose,
}

/// The tool's pads, and how the tool is held now.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Hand {
    pads: Vec<MountedPad>,
    /// The tool's present orientation in the session's frame, where it is known.
    base_from_tool: Option<UnitQuaternion<f64>>,
}

impl Hand {
    pub(super) fn with_pads(self, pads: Vec<MountedPad>) -> Self {
        Self { pads, ..self }
    }

    pub(super) fn held_at(self, base_from_tool: UnitQuaternion<f64>) -> Self {
        Self { base_from_tool: Some(base_from_tool), ..self }
    }

    /// The pad for a surface with this outward normal, and its place; nothing where none is declared.
    pub(super) fn pad_for(&self, normal: &Direction) -> Option<(usize, &MountedPad)> {
        if self.pads.len() < 2 {
            return self.pads.first().map(|pad| (0, pad));
        }
        let cost = |pad: &MountedPad| {
            let (_, angle_rad) = self.turned(pad, normal);
            let looks_back = axis(pad).z < -LOOKS_BACK;
            (looks_back, angle_rad)
        };
        let mut chosen = (0, cost(&self.pads[0]));
        for (place, pad) in self.pads.iter().enumerate().skip(1) {
            let (looks_back, angle_rad) = cost(pad);
            let (chosen_looks_back, least_rad) = chosen.1;
            let is_better = match looks_back.cmp(&chosen_looks_back) {
                std::cmp::Ordering::Less => true,
                std::cmp::Ordering::Equal => angle_rad < least_rad - TIE_RAD,
                std::cmp::Ordering::Greater => false,
            };
            if is_better {
                chosen = (place, (looks_back, angle_rad));
            }
        }
        Some((chosen.0, &self.pads[chosen.0]))
    }

    /// The side of the largest pad's square, in metres.
    pub(super) fn largest_side_m(&self) -> f64 {
        2.0 * self.pads.iter().map(|pad| pad.half_side_m).fold(0.0, f64::max)
    }

    /// The tool with a pad's centre at `start`, facing a surface with this outward normal.
    pub(super) fn approach(&self, start: &Point, normal: &Direction) -> Approach {
        let (place, tool_from_sensor, rotation) = match self.pad_for(normal) {
            // The turn of a lone pad whose tool's orientation nobody told is that of the pad itself,
            // the smallest one from the axes of the session's frame.
            None if self.base_from_tool.is_none() => (0, Pose::identity(), from_the_frame(normal)),
            Some((place, pad)) if self.base_from_tool.is_none() && self.pads.len() == 1 => {
                (place, pad.tool_from_sensor, from_the_frame(normal))
            }
            chosen => {
                let lone = MountedPad { tool_from_sensor: Pose::identity(), half_side_m: 0.0 };
                let (place, pad) = chosen.unwrap_or((0, &lone));
                let (base_from_tool, _) = self.turned(pad, normal);
                (place, pad.tool_from_sensor, base_from_tool * pad.tool_from_sensor.rotation)
            }
        };
        let base_from_sensor = Pose::from_parts(Translation3::from(start.coords), rotation);
        Approach { pad: place, base_from_tool: base_from_sensor * tool_from_sensor.inverse() }
    }

    /// The tool's orientation with a pad facing the surface, and by how much it was rotated for that,
    /// in radians: from its present one, or from hanging upright in whatever direction suits.
    ///
    /// A rotation must at least take the pad's axis to where it faces, and the shortest arc does
    /// nothing else, so it is the least of all turns.
    fn turned(&self, pad: &MountedPad, normal: &Direction) -> (UnitQuaternion<f64>, f64) {
        let facing = -normal.into_inner();
        let before = self.base_from_tool.unwrap_or_else(|| hanging(&axis(pad), &facing));
        let arc = shortest_arc(&(before * axis(pad)), &facing);
        (arc * before, arc.angle())
    }
}

/// The outward axis of a pad in the tool's frame.
fn axis(pad: &MountedPad) -> Vector {
    pad.tool_from_sensor.rotation * Vector::z()
}

/// The tool upright, its z axis down, turned about the vertical so that a pad looks the way it is
/// to face as far as that goes.
fn hanging(axis_in_tool: &Vector, facing: &Vector) -> UnitQuaternion<f64> {
    let upright = UnitQuaternion::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI);
    let looks = upright * axis_in_tool;
    let azimuth = |v: &Vector| (v.xy().norm() > VERTICAL).then(|| v.y.atan2(v.x));
    let yaw = azimuth(facing).zip(azimuth(&looks)).map_or(0.0, |(wanted, present)| wanted - present);
    UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw) * upright
}

/// The least rotation from one direction to another; of those half a turn wide the one about an axis
/// that is as upright as possible, which keeps a hanging tool hanging.
fn shortest_arc(from: &Vector, to: &Vector) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(from, to).unwrap_or_else(|| {
        let across = |v: Vector| Direction::try_new(v - from * from.dot(&v), 1e-6);
        let axis = across(Vector::z()).or_else(|| across(Vector::x())).unwrap_or_else(Vector::x_axis);
        UnitQuaternion::from_axis_angle(&axis, std::f64::consts::PI)
    })
}

/// A pad facing a surface, turned from the frame's axes as little as possible.
fn from_the_frame(normal: &Direction) -> UnitQuaternion<f64> {
    let pad = -normal.into_inner();
    let half_turn = || Rotation3::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI);
    let rotation = Rotation3::rotation_between(&Vector::z(), &pad).unwrap_or_else(half_turn);
    UnitQuaternion::from_rotation_matrix(&rotation)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    /// A pad that looks along an axis of the tool, with its face out there.
    fn pad(looks_along: Vector) -> MountedPad {
        let rotation = shortest_arc(&Vector::z(), &looks_along);
        let tool_from_sensor = Pose::from_parts(Translation3::from(looks_along * 0.04), rotation);
        MountedPad { tool_from_sensor, half_side_m: 0.009 }
    }

    fn hand(looks_along: &[Vector]) -> Hand {
        Hand::default().with_pads(looks_along.iter().copied().map(pad).collect())
    }

    /// Directions all over the sphere, the poles and the axes among them.
    fn normals() -> Vec<Direction> {
        let spiral = (0..200).map(|i| {
            let z = 1.0 - f64::from(i) / 99.5;
            let across = (1.0 - z * z).max(0.0).sqrt();
            let around = 2.4 * f64::from(i);
            Vector::new(across * around.cos(), across * around.sin(), z)
        });
        let axes = [Vector::x(), Vector::y(), Vector::z()].into_iter().flat_map(|axis| [axis, -axis]);
        spiral.chain(axes).map(Direction::new_normalize).collect()
    }

    fn facing(approach: &Approach, pad: &MountedPad) -> Pose {
        approach.base_from_tool * pad.tool_from_sensor
    }

    #[test]
    fn the_chosen_pad_is_at_the_start_and_faces_the_surface() {
        let start = Point::new(0.4, 0.1, 0.2);
        let askew = UnitQuaternion::from_scaled_axis(Vector::new(0.3, -1.2, 2.0));
        let pads = [Vector::z(), Vector::x(), Vector::new(-0.6, 0.0, 0.8)];
        for count in 0..=3 {
            for hand in [hand(&pads[..count]), hand(&pads[..count]).held_at(askew)] {
                for normal in normals() {
                    let approach = hand.approach(&start, &normal);
                    let lone = MountedPad { tool_from_sensor: Pose::identity(), half_side_m: 0.0 };
                    let sensor = facing(&approach, hand.pads.get(approach.pad).unwrap_or(&lone));
                    assert!((sensor.translation.vector - start.coords).norm() < 1e-12);
                    assert!(
                        (sensor.rotation * Vector::z() + normal.into_inner()).norm() < 1e-7,
                        "{normal:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn no_other_turn_and_no_other_pad_rotates_the_tool_less() {
        let now = UnitQuaternion::from_scaled_axis(Vector::new(2.4, 0.4, -0.7));
        let hand = hand(&[Vector::z(), Vector::x(), -Vector::y()]).held_at(now);
        for normal in normals() {
            let chosen = hand.approach(&Point::origin(), &normal).base_from_tool.rotation.angle_to(&now);
            for pad in &hand.pads {
                let (turned, _) = hand.turned(pad, &normal);
                for step in 0..72 {
                    let spin = UnitQuaternion::from_axis_angle(&normal, f64::from(step) * PI / 36.0);
                    assert!(chosen <= (spin * turned).angle_to(&now) + 1e-7, "{normal:?}");
                }
            }
        }
    }

    #[test]
    fn a_hanging_tool_touches_tops_with_its_end_and_sides_with_its_side() {
        let hand = hand(&[Vector::z(), Vector::x()]);
        for normal in normals() {
            let approach = hand.approach(&Point::origin(), &normal);
            assert_eq!(approach.pad, usize::from(normal.z < FRAC_PI_2.sin() * 0.5_f64.sqrt()), "{normal:?}");
            // The tool's body, behind its z axis, is above the pad, wherever that can be.
            let down = approach.base_from_tool.rotation * Vector::z();
            assert!(normal.z < -0.999 || down.z < 1e-6, "{normal:?} {down:?}");
        }
    }

    #[test]
    fn a_pad_that_has_the_arm_behind_the_surface_is_the_last_choice() {
        let hook = hand(&[-Vector::z(), Vector::z()]).held_at(UnitQuaternion::identity());
        // The first one would face this surface without any rotation.
        assert_eq!(hook.approach(&Point::origin(), &Vector::z_axis()).pad, 1);
        assert_eq!(hand(&[-Vector::z()]).approach(&Point::origin(), &Vector::z_axis()).pad, 0);
    }

    #[test]
    fn of_pads_that_rotate_the_tool_as_much_the_first_is_taken() {
        let twins = hand(&[Vector::x(), -Vector::x(), Vector::y()]);
        for normal in normals() {
            assert_eq!(twins.approach(&Point::origin(), &normal).pad, 0, "{normal:?}");
        }
    }

    #[test]
    fn a_lone_pad_is_turned_from_the_axes_of_the_frame_where_nobody_says_how_the_tool_is_held() {
        let up = hand(&[Vector::z()]).approach(&Point::origin(), &-Vector::z_axis());
        assert!(up.base_from_tool.rotation.angle() < 1e-12);
        let down = hand(&[Vector::z()]).approach(&Point::origin(), &Vector::z_axis());
        assert!((down.base_from_tool.rotation * Vector::x() - Vector::x()).norm() < 1e-12);
    }
}
