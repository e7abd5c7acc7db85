//! What a robot reports of one approach.

use palpate_core::evidence::{Attempt, Contact, ContactDetail, Outcome, Sweep, Target, Wrench};
use palpate_core::geometry::Point;
use palpate_proto::v1;

use super::geometry::{optional_vector, point, pose, vector};
use super::{at, check_text, check_timestamp};
use crate::error::Error;
use crate::limits::Limits;
use crate::session::{Definition, Sensor};
use crate::wire::candidate_id;

/// Reads a report that the caller wrote at `result`, on a session at revision `head`.
///
/// # Errors
/// A required message is missing, a number is none, or an id names nothing of this session.
pub(crate) fn attempt(
    result: &v1::ContactResult,
    definition: &Definition,
    head: i64,
    limits: &Limits,
) -> Result<Attempt, Error> {
    let v1::ContactResult { candidate_id, robot_id, observe_time, outcome } = result;
    check_text("result.robot_id", robot_id, limits.name_bytes)?;
    check_timestamp("result.observe_time", observe_time.as_ref())?;
    let target = target(candidate_id, head)?;
    let Some(outcome) = outcome else {
        let choices = "is missing: report one of contact, no_contact, rejected, invalid_contact";
        return Err(Error::field("result.outcome", choices));
    };
    let outcome = match outcome {
        v1::contact_result::Outcome::Contact(message) => Outcome::Contact(contact(message, definition)?),
        v1::contact_result::Outcome::NoContact(message) => Outcome::NoContact(sweep(message)?),
        v1::contact_result::Outcome::Rejected(message) => {
            rejected(message, target.is_some(), limits)?;
            Outcome::Rejected
        }
        v1::contact_result::Outcome::InvalidContact(v1::InvalidContact { sensor_pose, detail }) => {
            check_text("result.invalid_contact.detail", detail, limits.text_bytes)?;
            Outcome::InvalidContact(pose("result.invalid_contact.sensor_pose", sensor_pose.as_ref())?)
        }
    };
    Ok(Attempt { target, outcome })
}

fn target(id: &str, head: i64) -> Result<Option<Target>, Error> {
    if id.is_empty() {
        return Ok(None);
    }
    let field = "result.candidate_id";
    let Some(id) = candidate_id::decode(id) else {
        return Err(Error::field(
            field,
            "was not made by this service: echo Candidate.candidate_id as it came",
        ));
    };
    if id.revision > head {
        let description = format!(
            "is of revision {}, but the session is at revision {head}: is it of another session?",
            id.revision
        );
        return Err(Error::field(field, description));
    }
    Ok(Some(id.target))
}

fn contact(message: &v1::Contact, definition: &Definition) -> Result<Contact, Error> {
    let v1::Contact { sensor_pose, wrench: measured, sensor_id, uncertainty, swept_from, normal } = message;
    let path = "result.contact";
    let Sensor { id: _, tool_from_sensor: _, pad_half_side_m, contact_force_n: _ } =
        definition.sensor(sensor_id).ok_or_else(|| unknown_sensor(sensor_id, definition))?;
    let base_from_sensor = pose("result.contact.sensor_pose", sensor_pose.as_ref())?;
    let wrench = match measured {
        None if uncertainty.is_none() => {
            let description = "is missing: give the wrench, or this contact's uncertainty";
            return Err(Error::field("result.contact.wrench", description));
        }
        None => Wrench::default(),
        Some(measured) => wrench(measured)?,
    };
    let detail = ContactDetail {
        uncertainty: *uncertainty,
        swept_from: optional_vector("result.contact.swept_from", swept_from.as_ref())?.map(Point::from),
        normal: optional_vector("result.contact.normal", normal.as_ref())?,
    };
    Contact::new(base_from_sensor, wrench, pad_half_side_m, detail).map_err(|error| at(path, error))
}

fn wrench(message: &v1::Wrench) -> Result<Wrench, Error> {
    let v1::Wrench { force, torque } = message;
    if torque.is_none() {
        let description = "is missing: a sensor that measures no torque sends zeros, x 0, y 0, z 0";
        return Err(Error::field("result.contact.wrench.torque", description));
    }
    Ok(Wrench {
        force: vector("result.contact.wrench.force", force.as_ref())?,
        torque: vector("result.contact.wrench.torque", torque.as_ref())?,
    })
}

fn unknown_sensor(sensor_id: &str, definition: &Definition) -> Error {
    let declared: Vec<&str> = definition.sensors.iter().map(|sensor| sensor.id.as_str()).collect();
    let description = if declared.is_empty() {
        format!("{sensor_id:?} is not declared: the session declares no sensors, so leave it empty")
    } else {
        format!("{sensor_id:?} is not declared: the session declares {}", declared.join(", "))
    };
    Error::field("result.contact.sensor_id", description)
}

fn sweep(message: &v1::NoContact) -> Result<Sweep, Error> {
    let v1::NoContact { swept_from, swept_to, sweep_radius_m } = message;
    let from = point("result.no_contact.swept_from", swept_from.as_ref())?;
    let to = point("result.no_contact.swept_to", swept_to.as_ref())?;
    Sweep::new(from, to, *sweep_radius_m).map_err(|error| at("result.no_contact", error))
}

fn rejected(message: &v1::Rejected, has_target: bool, limits: &Limits) -> Result<(), Error> {
    let v1::Rejected { reason, detail } = message;
    if v1::RejectReason::try_from(*reason).is_err() {
        return Err(Error::field("result.rejected.reason", format!("{reason} is no reason")));
    }
    check_text("result.rejected.detail", detail, limits.text_bytes)?;
    if has_target {
        return Ok(());
    }
    Err(Error::field("result.candidate_id", "is missing: only a proposed candidate can be rejected"))
}
