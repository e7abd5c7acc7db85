//! What a robot reports of one approach.

use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Moved, Outcome, RejectReason, Sweep, Target, Wrench,
};
use palpate_core::geometry::Point;
use palpate_core::warning::{Warning, WarningKind};
use palpate_proto::v1;

use super::geometry::{optional_vector, point, pose, vector};
use super::{at, check_name, check_showable, check_text, check_timestamp};
use crate::error::Error;
use crate::limits::{Limits, OPAQUE_BYTES};
use crate::session::{Definition, Sensor};
use crate::text::quoted;
use crate::wire::candidate_id;

/// What a robot reported, and what is odd about the report itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reported {
    pub(crate) evidence: Evidence,
    pub(crate) warnings: Vec<Warning>,
}

/// Reads a report that is sent now, of which more is asked than of one that is in a log.
///
/// # Errors
/// As [`reported`], or a time that cannot be shown.
pub(crate) fn sent_report(
    result: &v1::ContactResult,
    definition: &Definition,
    head: i64,
    limits: &Limits,
) -> Result<Reported, Error> {
    check_showable("result.observe_time", result.observe_time.as_ref())?;
    reported(result, definition, head, limits)
}

/// Reads a report that the caller wrote at `result`, on a session at revision `head`.
///
/// # Errors
/// A required message is missing, a number is none, or an id names nothing of this session.
pub(crate) fn reported(
    result: &v1::ContactResult,
    definition: &Definition,
    head: i64,
    limits: &Limits,
) -> Result<Reported, Error> {
    let v1::ContactResult { candidate_id, robot_id, observe_time, outcome } = result;
    check_name("result.robot_id", robot_id, limits)?;
    check_text("result.candidate_id", candidate_id, OPAQUE_BYTES)?;
    check_timestamp("result.observe_time", observe_time.as_ref())?;
    let (target, warnings) = target(candidate_id, definition, head)?;
    let Some(outcome) = outcome else {
        let choices = "is missing: report one of contact, contacts, no_contact, rejected, invalid_contact, object_moved";
        return Err(Error::field("result.outcome", choices));
    };
    let outcome = match outcome {
        v1::contact_result::Outcome::Contact(message) => {
            Outcome::Contact(contact("result.contact", message, definition, limits)?)
        }
        v1::contact_result::Outcome::Contacts(message) => contacts(message, definition, limits)?,
        v1::contact_result::Outcome::NoContact(message) => Outcome::NoContact(sweep(message)?),
        v1::contact_result::Outcome::Rejected(message) => {
            Outcome::Rejected(rejected(message, target.is_some(), limits)?)
        }
        v1::contact_result::Outcome::InvalidContact(v1::InvalidContact { sensor_pose, detail }) => {
            check_text("result.invalid_contact.detail", detail, limits.text_bytes)?;
            Outcome::InvalidContact(pose("result.invalid_contact.sensor_pose", sensor_pose.as_ref())?)
        }
        v1::contact_result::Outcome::ObjectMoved(message) => {
            return Ok(Reported { evidence: Evidence::Moved(moved(message, limits)?), warnings });
        }
    };
    Ok(Reported { evidence: Evidence::Attempt(Attempt { target, outcome }), warnings })
}

fn moved(message: &v1::ObjectMoved, limits: &Limits) -> Result<Moved, Error> {
    let v1::ObjectMoved { new_from_old, std_m, detail } = message;
    let path = "result.object_moved";
    check_text(&format!("{path}.detail"), detail, limits.text_bytes)?;
    let new_from_old = pose(&format!("{path}.new_from_old"), new_from_old.as_ref())?;
    Moved::new(new_from_old, *std_m).map_err(|error| at(path, error))
}

/// What an id aims at, and a warning where it was proposed in another session: it aims at nothing here.
fn target(id: &str, definition: &Definition, head: i64) -> Result<(Option<Target>, Vec<Warning>), Error> {
    if id.is_empty() {
        return Ok((None, Vec::new()));
    }
    let field = "result.candidate_id";
    let Some(id) = candidate_id::decode(id) else {
        return Err(Error::field(
            field,
            "was not made by this service: echo Candidate.candidate_id as it came",
        ));
    };
    if id.session.is_some_and(|tag| !definition.knows(tag, id.revision)) {
        let message = "candidate_id: proposed in another session, so the result counts as one that the robot chose \
                       itself: send it to the session that proposed it";
        return Ok((None, vec![Warning::new(WarningKind::CandidateOfAnotherSession, message)]));
    }
    if id.revision > head {
        let description = format!(
            "is of revision {}, but the session is at revision {head}: is it of another session?",
            id.revision
        );
        return Err(Error::field(field, description));
    }
    Ok((Some(id.target), Vec::new()))
}

/// Several pads' contacts in one attempt, of which each pad has one.
fn contacts(message: &v1::Contacts, definition: &Definition, limits: &Limits) -> Result<Outcome, Error> {
    let v1::Contacts { contacts: messages } = message;
    let list = "result.contacts.contacts";
    if messages.len() > limits.pads {
        let description = format!("{} contacts are more than the limit of {}", messages.len(), limits.pads);
        return Err(Error::field(list, description));
    }
    let mut touches = Vec::new();
    for (index, message) in messages.iter().enumerate() {
        let path = format!("{list}[{index}]");
        check_name(&format!("{path}.sensor_id"), &message.sensor_id, limits)?;
        let touched_before =
            || messages[..index].iter().any(|earlier| earlier.sensor_id == message.sensor_id);
        if definition.sensors.len() > 1 && touched_before() {
            let description =
                format!("{} touched already: a pad touches once in an event", quoted(&message.sensor_id));
            return Err(Error::field(format!("{path}.sensor_id"), description));
        }
        touches.push(contact(&path, message, definition, limits)?);
    }
    let mut touches = touches.into_iter();
    match (touches.next(), touches.collect::<Vec<_>>()) {
        (None, _) => Err(Error::field(list, "is empty: give the contact of each pad that touched")),
        (Some(aimed), others) if others.is_empty() => Ok(Outcome::Contact(aimed)),
        (Some(aimed), others) => Ok(Outcome::Contacts { aimed, others }),
    }
}

fn contact(
    path: &str,
    message: &v1::Contact,
    definition: &Definition,
    limits: &Limits,
) -> Result<Contact, Error> {
    let v1::Contact {
        sensor_pose,
        wrench: measured,
        sensor_id,
        uncertainty,
        swept_from,
        normal,
        rest_wrench,
    } = message;
    let field = |name: &str| format!("{path}.{name}");
    check_name(&field("sensor_id"), sensor_id, limits)?;
    let Sensor { id: _, tool_from_sensor: _, contact_force_n: _, pad } =
        definition.sensor(sensor_id).ok_or_else(|| unknown_sensor(path, sensor_id, definition))?;
    let base_from_sensor = pose(&field("sensor_pose"), sensor_pose.as_ref())?;
    let wrench = match measured {
        None if uncertainty.is_none() => {
            let description = "is missing: give the wrench, or this contact's uncertainty";
            return Err(Error::field(field("wrench"), description));
        }
        None => Wrench::default(),
        Some(measured) => wrench(&field("wrench"), measured)?,
    };
    let detail = ContactDetail {
        uncertainty: *uncertainty,
        swept_from: optional_vector(&field("swept_from"), swept_from.as_ref())?.map(Point::from),
        normal: optional_vector(&field("normal"), normal.as_ref())?,
        rest_wrench: rest_wrench
            .as_ref()
            .map(|rest| self::wrench(&field("rest_wrench"), rest))
            .transpose()?,
    };
    Contact::new(base_from_sensor, wrench, pad, detail).map_err(|error| at(path, error))
}

fn wrench(path: &str, message: &v1::Wrench) -> Result<Wrench, Error> {
    let v1::Wrench { force, torque } = message;
    if torque.is_none() {
        let description = "is missing: a sensor that measures no torque sends zeros, x 0, y 0, z 0";
        return Err(Error::field(format!("{path}.torque"), description));
    }
    Ok(Wrench {
        force: vector(&format!("{path}.force"), force.as_ref())?,
        torque: vector(&format!("{path}.torque"), torque.as_ref())?,
    })
}

fn unknown_sensor(path: &str, sensor_id: &str, definition: &Definition) -> Error {
    let declared: Vec<&str> = definition.sensors.iter().map(|sensor| sensor.id.as_str()).collect();
    let sensor_id = quoted(sensor_id);
    let description = if declared.is_empty() {
        format!("{sensor_id} is not declared: the session declares no sensors, so leave it empty")
    } else {
        format!("{sensor_id} is not declared: the session declares {}", declared.join(", "))
    };
    Error::field(format!("{path}.sensor_id"), description)
}

fn sweep(message: &v1::NoContact) -> Result<Sweep, Error> {
    let v1::NoContact { swept_from, swept_to, sweep_radius_m } = message;
    let from = point("result.no_contact.swept_from", swept_from.as_ref())?;
    let to = point("result.no_contact.swept_to", swept_to.as_ref())?;
    Sweep::new(from, to, *sweep_radius_m).map_err(|error| at("result.no_contact", error))
}

fn rejected(message: &v1::Rejected, has_target: bool, limits: &Limits) -> Result<RejectReason, Error> {
    let v1::Rejected { reason, detail } = message;
    let reason = reject_reason(*reason)?;
    check_text("result.rejected.detail", detail, limits.text_bytes)?;
    if has_target {
        return Ok(reason);
    }
    Err(Error::field("result.candidate_id", "is missing: only a proposed candidate can be rejected"))
}

fn reject_reason(value: i32) -> Result<RejectReason, Error> {
    match v1::RejectReason::try_from(value) {
        Ok(v1::RejectReason::Unspecified) => Ok(RejectReason::Unspecified),
        Ok(v1::RejectReason::NoIk) => Ok(RejectReason::NoIk),
        Ok(v1::RejectReason::Collision) => Ok(RejectReason::Collision),
        Ok(v1::RejectReason::SafetyStop) => Ok(RejectReason::SafetyStop),
        Ok(v1::RejectReason::Timeout) => Ok(RejectReason::Timeout),
        Ok(v1::RejectReason::Operator) => Ok(RejectReason::Operator),
        Err(_) => Err(Error::field("result.rejected.reason", format!("{value} is no reason"))),
    }
}
