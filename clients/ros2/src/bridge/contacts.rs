//! What was touched, missed or not tried, as results of the contract.

use nalgebra::{Isometry3, Vector3 as Vector};
use palpate_client::proto::v1::{
    self, ContactResult, InvalidContact, NoContact, RejectReason, Rejected, contact_result::Outcome,
};

use super::{Bridge, Unready};
use crate::approach::swept_from;
use crate::contact_detector::Touch;
use crate::messages::{Contact, Pose, Time, Vector3, Wrench, frame, kind, no_candidate};
use crate::outbox::Command;

impl Bridge {
    /// A touch that the wrench showed, where TF says that the pad was.
    pub(super) fn touch(
        &self,
        touch: &Touch,
        wrench_frame: &str,
        candidate_id: &str,
    ) -> Result<Command, Unready> {
        let Touch { stamp_ns, wrench, rest_wrench } = *touch;
        let pad = frame(&self.parameters.sensor_frame);
        let base_from_sensor = self.transforms.lookup(&self.parameters.frame_id, pad, stamp_ns)?;
        // A sensor that names no frame is taken to be in the pad's.
        let sensor_from_wrench = match wrench_frame {
            "" => Isometry3::identity(),
            wrench_frame => self.transforms.lookup(pad, wrench_frame, stamp_ns)?,
        };
        let base = &self.parameters.frame_id;
        let begun = swept_from(&self.transforms, base, pad, &base_from_sensor, stamp_ns);
        let contact = v1::Contact {
            sensor_pose: Some(Pose::from_isometry(&base_from_sensor).to_proto()),
            swept_from: begun.map(|begun| Vector3::from_array(begun).to_proto()),
            wrench: Some(moved(&wrench, &sensor_from_wrench).to_proto()),
            rest_wrench: Some(moved(&rest_wrench, &sensor_from_wrench).to_proto()),
            sensor_id: self.parameters.sensor_id.clone(),
            ..Default::default()
        };
        Ok(self.report(candidate_id, Time::from_ns(stamp_ns), Outcome::Contact(contact)))
    }

    /// The candidate that a message is about.
    pub(super) fn candidate_of(&mut self, contact: &Contact) -> String {
        match contact.candidate_id.as_str() {
            "" => self.claim(),
            no_candidate::NAME => String::new(),
            given => {
                // It is tried: what comes next without a name is not about it.
                let is_best = self.proposal.candidates.first().is_some_and(|best| best.candidate_id == given);
                self.is_claimed |= is_best;
                given.to_owned()
            }
        }
    }

    /// What a message on topic `contact` says.
    pub(super) fn contact(&self, message: &Contact, candidate_id: &str) -> Result<Command, Unready> {
        let stamp_ns = message.header.stamp.as_ns();
        let source = match frame(&message.header.frame_id) {
            "" => frame(&self.parameters.frame_id),
            source => source,
        };
        let base_from_source = self.transforms.lookup(&self.parameters.frame_id, source, stamp_ns)?;
        let outcome = match message.kind {
            kind::CONTACT => Outcome::Contact(self.touched(message, &base_from_source)?),
            kind::NO_CONTACT => Outcome::NoContact(self.missed(message, candidate_id, &base_from_source)?),
            kind::INVALID => Outcome::InvalidContact(InvalidContact {
                sensor_pose: Some(self.sensor_pose(message, &base_from_source)?),
                detail: message.detail.clone(),
            }),
            other => {
                return Err(Unready::Wrong(format!(
                    "kind is {other}: CONTACT is 0, NO_CONTACT is 1, INVALID is 2"
                )));
            }
        };
        Ok(self.report(candidate_id, message.header.stamp, outcome))
    }

    fn touched(&self, message: &Contact, base_from_source: &Isometry3<f64>) -> Result<v1::Contact, Unready> {
        if !message.has_wrench && !message.has_uncertainty {
            return Err(Unready::Wrong(
                "neither has_wrench nor has_uncertainty is set: give one, so that it is known how sure the touch is".to_owned(),
            ));
        }
        let rest = message.rest_wrench;
        let sensor_id =
            if message.sensor_id.is_empty() { &self.parameters.sensor_id } else { &message.sensor_id };
        Ok(v1::Contact {
            sensor_pose: Some(self.sensor_pose(message, base_from_source)?),
            wrench: message.has_wrench.then(|| message.wrench.to_proto()),
            rest_wrench: (message.has_wrench && rest != Wrench::default()).then(|| rest.to_proto()),
            sensor_id: sensor_id.clone(),
            uncertainty: message.has_uncertainty.then_some(message.uncertainty),
            swept_from: message.has_sweep.then(|| point(base_from_source, message.swept_from)),
            normal: message.has_normal.then(|| {
                let normal = base_from_source.rotation * Vector::from(message.normal.to_array());
                Vector3::from_array(normal.into()).to_proto()
            }),
        })
    }

    fn sensor_pose(&self, message: &Contact, base_from_source: &Isometry3<f64>) -> Result<v1::Pose, Unready> {
        let base_from_sensor = if message.has_pose {
            let source_from_sensor = message.pose.to_isometry().ok_or_else(|| {
                Unready::Wrong(
                    "pose has numbers that are none, or an orientation that is not of length 1".to_owned(),
                )
            })?;
            base_from_source * source_from_sensor
        } else {
            let (base, pad) = (&self.parameters.frame_id, &self.parameters.sensor_frame);
            self.transforms.lookup(base, pad, message.header.stamp.as_ns())?
        };
        Ok(Pose::from_isometry(&base_from_sensor).to_proto())
    }

    fn missed(
        &self,
        message: &Contact,
        candidate_id: &str,
        base_from_source: &Isometry3<f64>,
    ) -> Result<NoContact, Unready> {
        if !message.has_sweep {
            return self.missed_candidate(candidate_id, message.sweep_radius_m).map_err(Unready::Wrong);
        }
        Ok(NoContact {
            swept_from: Some(point(base_from_source, message.swept_from)),
            swept_to: Some(point(base_from_source, message.swept_to)),
            sweep_radius_m: message.sweep_radius_m,
        })
    }

    /// An approach that went the candidate's whole way.
    fn missed_candidate(&self, candidate_id: &str, sweep_radius_m: f64) -> Result<NoContact, String> {
        let candidate = self.candidate(candidate_id).ok_or(
            "it has no sweep, and its candidate is not among those published last: set has_sweep, swept_from and swept_to",
        )?;
        Ok(NoContact { swept_from: candidate.probe_start, swept_to: candidate.probe_end, sweep_radius_m })
    }

    /// The service `~/no_contact`: the best candidate was tried its whole way, and nothing touched.
    ///
    /// # Errors
    /// There is no candidate, in words.
    pub fn no_contact(&mut self) -> Result<Command, String> {
        let candidate_id = self.claimed_or("")?;
        let missed = self.missed_candidate(&candidate_id, 0.0)?;
        Ok(self.report(&candidate_id, self.now, Outcome::NoContact(missed)))
    }

    /// The service `~/reject`: a candidate was not tried; an empty id is the best one's.
    ///
    /// # Errors
    /// There is no candidate, or the reason is none, in words.
    pub fn reject(&mut self, candidate_id: &str, reason: u8, detail: &str) -> Result<Command, String> {
        let reason = RejectReason::try_from(i32::from(reason))
            .map_err(|_| format!("reason is {reason}: 0 to 5, as palpate_msgs/srv/Reject has them"))?;
        let candidate_id = self.claimed_or(candidate_id)?;
        let rejected = Rejected { reason: reason.into(), detail: detail.to_owned() };
        Ok(self.report(&candidate_id, self.now, Outcome::Rejected(rejected)))
    }

    fn claimed_or(&mut self, candidate_id: &str) -> Result<String, String> {
        let candidate_id = if candidate_id.is_empty() { self.claim() } else { candidate_id.to_owned() };
        if candidate_id.is_empty() {
            return Err(
                "no candidate is open: none was published yet, or something was reported for it already"
                    .to_owned(),
            );
        }
        Ok(candidate_id)
    }

    fn report(&self, candidate_id: &str, stamp: Time, outcome: Outcome) -> Command {
        Command::Report(Box::new(ContactResult {
            candidate_id: candidate_id.to_owned(),
            robot_id: self.parameters.robot_id.clone(),
            observe_time: Some(stamp.to_proto()),
            outcome: Some(outcome),
        }))
    }
}

fn point(base_from_source: &Isometry3<f64>, point: Vector3) -> v1::Vector3 {
    let moved = base_from_source * nalgebra::Point3::from(point.to_array());
    Vector3::from_array(moved.coords.into()).to_proto()
}

/// A wrench about another origin and along other axes: the force acts at its old origin, so it adds a torque.
fn moved(wrench: &Wrench, target_from_source: &Isometry3<f64>) -> Wrench {
    let force = target_from_source.rotation * Vector::from(wrench.force.to_array());
    let torque = target_from_source.rotation * Vector::from(wrench.torque.to_array())
        + target_from_source.translation.vector.cross(&force);
    Wrench { force: Vector3::from_array(force.into()), torque: Vector3::from_array(torque.into()) }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};

    use super::*;

    #[test]
    fn a_force_at_the_flange_is_a_torque_about_the_pad() {
        // The sensor sits 50 mm behind the pad, turned by a quarter about z.
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), std::f64::consts::FRAC_PI_2);
        let pad_from_sensor = Isometry3::from_parts(Translation3::new(0.0, 0.0, -0.05), turn);
        let wrench =
            Wrench { force: Vector3 { x: 2.0, y: 0.0, z: -1.0 }, torque: Vector3 { x: 0.0, y: 0.0, z: 0.3 } };
        let at_pad = moved(&wrench, &pad_from_sensor);
        let expected = [0.0, 2.0, -1.0, 0.1, 0.0, 0.3];
        for (got, expected) in at_pad.to_array().into_iter().zip(expected) {
            assert!((got - expected).abs() < 1e-12, "{at_pad:?}");
        }
        let back = moved(&at_pad, &pad_from_sensor.inverse()).to_array();
        assert!(back.iter().zip(wrench.to_array()).all(|(got, sent)| (got - sent).abs() < 1e-12));
    }
}
