//! What is physically doubtful about a touch's wrench and pose, in words for the caller.

use super::attempt::{Contact, Target};
use super::wrench::Wrench;
use crate::warning::{Warning, WarningKind};

/// A force farther than this from the pad's axis, in degrees, is beyond any friction.
const FRICTION_DEG: f64 = 60.0;
/// A force this many half diagonals beside the pad's centre is in other units, or about another point.
const TORQUE_LIMIT: f64 = 3.0;
/// A wrench at rest beyond this many deviations of the sensor's noise asks for a tare.
const REST_DEVIATIONS: f64 = 6.0;
/// The approach may be this far from the candidate's normal, in degrees.
const APPROACH_DEG: f64 = 100.0;

/// All that is doubtful about a touch by itself.
pub(super) fn warnings(contact: &Contact, target: Option<&Target>) -> Vec<Warning> {
    let found =
        [sign(contact), direction(contact), lever(contact), at_rest(contact), approach(contact, target)];
    found.into_iter().flatten().collect()
}

fn sign(contact: &Contact) -> Option<Warning> {
    let wrench = contact.wrench();
    if wrench.force.norm() == 0.0 && wrench.torque.norm() == 0.0 {
        if contact.uncertainty().is_some() {
            return None;
        }
        let message = "wrench: force and torque are zero, so it is not known how reliable the contact is";
        return Some(Warning::new(WarningKind::ZeroWrench, message));
    }
    let (force_n, noise_n) = (wrench.force.z, contact.pad().force_noise_n());
    if force_n > REST_DEVIATIONS * noise_n && !is_sideways(contact) {
        let message =
            format!("wrench.force.z: {force_n} N pulls on the pad; pressing on an object gives a negative z");
        return Some(Warning::new(WarningKind::PullingForce, message).with("force_z_n", force_n));
    }
    (!contact.pressure().is_loaded && !is_sideways(contact)).then(|| {
        let message = format!(
            "wrench.force.z: {force_n:.3} N is hardly more than the sensor's noise of {noise_n} N, so it is not \
             known where on the pad the contact was: press harder, or set Sensor.force_noise_n"
        );
        Warning::new(WarningKind::WeakContact, message).with("force_z_n", force_n)
    })
}

/// The angle between the force and the pad's axis, whatever the sign, in degrees.
fn angle_deg(contact: &Contact) -> f64 {
    let force = contact.wrench().force;
    force.xy().norm().atan2(force.z.abs()).to_degrees()
}

fn is_sideways(contact: &Contact) -> bool {
    let loud = contact.wrench().force.norm() > REST_DEVIATIONS * contact.pad().force_noise_n();
    loud && angle_deg(contact) > FRICTION_DEG
}

fn direction(contact: &Contact) -> Option<Warning> {
    is_sideways(contact).then(|| {
        let angle_deg = angle_deg(contact);
        let message = format!(
            "wrench.force: {angle_deg:.0} degrees from the pad's axis, more than friction can do: is the wrench in \
             the sensor's own frame, z out of the pad?"
        );
        Warning::new(WarningKind::WrenchFrame, message).with("angle_deg", angle_deg)
    })
}

fn lever(contact: &Contact) -> Option<Warning> {
    let (wrench, pad) = (contact.wrench(), contact.pad());
    let half_diagonal_m = std::f64::consts::SQRT_2 * pad.half_side_m();
    let noise_nm = REST_DEVIATIONS * pad.torque_noise_nm();
    let torque_nm = wrench.torque.norm();
    let most_nm = wrench.force.norm() * half_diagonal_m;
    if torque_nm > TORQUE_LIMIT * most_nm + noise_nm {
        let message = format!(
            "wrench.torque: {torque_nm:.4} N m is more than {:.3} N can exert on a pad of half side {} m: is it in \
             N m, about the centre of the pad's face?",
            wrench.force.norm(),
            pad.half_side_m()
        );
        return Some(Warning::new(WarningKind::TorqueTooLarge, message).with("torque_nm", torque_nm));
    }
    let pressure = contact.pressure();
    (pressure.is_beside_pad() && torque_nm > most_nm + noise_nm).then(|| {
        let beside_m = (1.0 + pressure.beside) * pad.half_side_m();
        let message = format!(
            "wrench: the force acts {:.1} mm from the pad's centre, beside the pad: did the housing touch? Report \
             invalid_contact then, or check Sensor.pad_half_side_m",
            1e3 * beside_m
        );
        Warning::new(WarningKind::TouchedByHousing, message).with("lever_m", beside_m)
    })
}

fn at_rest(contact: &Contact) -> Option<Warning> {
    let (rest, pad) = (contact.rest_wrench()?, contact.pad());
    let deviations =
        (rest.force.amax() / pad.force_noise_n()).max(rest.torque.amax() / pad.torque_noise_nm());
    (deviations > REST_DEVIATIONS).then(|| {
        let (force_n, torque_nm) = (rest.force.norm(), rest.torque.norm());
        let message = format!(
            "rest_wrench: {force_n:.2} N and {torque_nm:.4} N m without a contact, which is subtracted: tare the \
             sensor before each approach"
        );
        Warning::new(WarningKind::TareDrift, message).with("force_n", force_n).with("torque_nm", torque_nm)
    })
}

/// Contacts of which all show the same are looked at this many at a time.
const DRIFT_CONTACTS: usize = 12;
/// A mean this many times as large as its own deviation is no chance, and this many times the sensor's noise
/// is no noise.
const DRIFT_DEVIATIONS: f64 = 8.0;
const DRIFT_NOISES: f64 = 10.0;

/// Whether all contacts share a wrench that none of them can have: forces and torques across the pad's axis
/// point one way here and another way there.
pub(super) fn drift(contacts: &[&Contact]) -> Option<Warning> {
    if contacts.is_empty() || !contacts.len().is_multiple_of(DRIFT_CONTACTS) {
        return None;
    }
    let pad = contacts[0].pad();
    let across = |contact: &Contact| {
        let Wrench { force, torque } = contact.wrench();
        [
            force.x / pad.force_noise_n(),
            force.y / pad.force_noise_n(),
            torque.x / pad.torque_noise_nm(),
            torque.y / pad.torque_noise_nm(),
        ]
    };
    let count = contacts.len() as f64;
    let drifts = (0..4).any(|component| {
        let values: Vec<f64> = contacts.iter().map(|contact| across(contact)[component]).collect();
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let of_mean = (variance.max(1.0) / count).sqrt();
        mean.abs() > DRIFT_NOISES && mean.abs() > DRIFT_DEVIATIONS * of_mean
    });
    drifts.then(|| {
        let mean = |of: fn(&Wrench) -> crate::geometry::Vector| {
            contacts.iter().map(|contact| of(contact.wrench())).sum::<crate::geometry::Vector>() / count
        };
        let (force_n, torque_nm) = (mean(|w| w.force).xy().norm(), mean(|w| w.torque).xy().norm());
        let message = format!(
            "wrench: all {count:.0} contacts share {force_n:.2} N and {torque_nm:.4} N m across the pad's axis, which no \
             object does: tare the sensor, and report rest_wrench with each contact"
        );
        Warning::new(WarningKind::TareDrift, message).with("force_n", force_n).with("torque_nm", torque_nm)
    })
}

fn approach(contact: &Contact, target: Option<&Target>) -> Option<Warning> {
    let into = -target?.normal().into_inner();
    let angle_deg = contact.approach().angle(&into).to_degrees();
    if angle_deg <= APPROACH_DEG {
        return None;
    }
    let swapped = contact.approach_if_w_first().angle(&into).to_degrees();
    let hint = if swapped < 90.0 - (APPROACH_DEG - 90.0) {
        "read as w, x, y, z it would point into it: quaternions are x, y, z, w"
    } else {
        "z is the pad's outward normal, into the object when it touches"
    };
    let message = format!(
        "sensor_pose: the pad points {angle_deg:.0} degrees off its approach, out of the object; {hint}"
    );
    Some(Warning::new(WarningKind::QuaternionOrder, message).with("angle_deg", angle_deg))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{ContactDetail, Pad, Wrench};
    use crate::geometry::{Point, Pose, Vector};
    use nalgebra::{Quaternion, UnitQuaternion};

    const PUSH: Vector = Vector::new(0.0, 0.0, -5.0);

    fn kinds(pose: Pose, wrench: Wrench, rest_wrench: Option<Wrench>) -> Vec<WarningKind> {
        let detail = ContactDetail { rest_wrench, ..ContactDetail::default() };
        let contact = Contact::new(pose, wrench, Pad::new(0.009).unwrap(), detail).unwrap();
        let target = Target::new(Point::origin(), -Vector::z()).unwrap();
        warnings(&contact, Some(&target)).iter().map(|warning| warning.kind).collect()
    }

    fn of(force: Vector, torque: Vector) -> Vec<WarningKind> {
        kinds(Pose::identity(), Wrench { force, torque }, None)
    }

    #[test]
    fn pushes_anywhere_on_the_pad_with_friction_are_sound() {
        for offset in [Vector::zeros(), Vector::new(0.009, -0.009, 0.0), Vector::new(0.004, 0.002, 0.0)] {
            for across in [Vector::zeros(), Vector::new(3.0, -2.0, 0.0)] {
                let force = PUSH + across;
                assert_eq!(of(force, offset.cross(&force)), []);
            }
        }
    }

    #[test]
    fn each_fault_has_its_own_name() {
        assert_eq!(of(Vector::zeros(), Vector::zeros()), [WarningKind::ZeroWrench]);
        assert_eq!(of(-PUSH, Vector::zeros()), [WarningKind::PullingForce]);
        assert_eq!(of(Vector::new(0.0, 0.0, -0.1), Vector::zeros()), [WarningKind::WeakContact]);
        assert_eq!(of(Vector::new(5.0, 0.0, -0.5), Vector::zeros()), [WarningKind::WrenchFrame]);
        assert_eq!(of(PUSH, Vector::new(40.0, 0.0, 0.0)), [WarningKind::TorqueTooLarge]);
        let housing = Vector::new(0.02, 0.0, 0.0);
        assert_eq!(of(PUSH, housing.cross(&PUSH)), [WarningKind::TouchedByHousing]);
        let rest = Wrench { force: Vector::new(0.5, 0.0, 0.0), torque: Vector::zeros() };
        let push = Wrench { force: PUSH, torque: Vector::zeros() };
        assert_eq!(kinds(Pose::identity(), push, Some(rest)), [WarningKind::TareDrift]);
        assert_eq!(kinds(Pose::identity(), push, Some(Wrench::default())), []);
    }

    #[test]
    fn a_pad_that_points_out_of_the_object_is_noticed_and_w_first_is_named() {
        let right = UnitQuaternion::from_axis_angle(&Vector::x_axis(), 0.2);
        let q = right.coords;
        // Sent as w, x, y, z and read as x, y, z, w.
        let wrong = UnitQuaternion::from_quaternion(Quaternion::new(q.z, q.w, q.x, q.y));
        let push = Wrench { force: PUSH, torque: Vector::zeros() };
        let contact = |rotation| {
            let pose = Pose::from_parts(Vector::zeros().into(), rotation);
            Contact::new(pose, push, Pad::new(0.009).unwrap(), ContactDetail::default()).unwrap()
        };
        let target = Target::new(Point::origin(), -Vector::z()).unwrap();
        assert!(warnings(&contact(right), Some(&target)).is_empty());
        let noticed = &warnings(&contact(wrong), Some(&target))[0];
        assert_eq!(noticed.kind, WarningKind::QuaternionOrder);
        assert!(noticed.message.contains("x, y, z, w"), "{}", noticed.message);
    }
}
