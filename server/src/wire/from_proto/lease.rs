//! For how long a robot wants its candidates to itself, and what was promised to it.

use std::sync::Arc;
use std::time::Duration;

use palpate_proto::v1;

use super::required;
use crate::error::Error;
use crate::limits::Limits;
use crate::session::{Lease, Question};
use crate::wire::{candidate_id, microseconds};

/// How long a lease is to last, for the robot that asks; `lease_field` and `robot_field` are where the
/// caller wrote both.
///
/// # Errors
/// A duration that is not positive or longer than the limit, or a robot without a name.
pub(crate) fn lease_duration(
    lease_field: &str,
    wanted: palpate_proto::Duration,
    robot_field: &str,
    question: &Question,
    limits: &Limits,
) -> Result<Duration, Error> {
    let most = limits.lease_max;
    let duration = Duration::try_from(wanted).ok().filter(|wanted| !wanted.is_zero() && *wanted <= most);
    let duration = duration.ok_or_else(|| {
        let description =
            format!("is not above 0 s and at most {} s: ask again when it ends", most.as_secs());
        Error::field(lease_field, description)
    })?;
    if question.robot_id.is_empty() {
        let description = "is missing: a lease is promised to a robot by its name";
        return Err(Error::field(format!("{robot_field}.robot_id"), description));
    }
    Ok(duration)
}

/// The places that a lease promises.
///
/// # Errors
/// A candidate that is none, or a time that is none.
pub(crate) fn leases(message: &v1::Lease) -> Result<Vec<Lease>, Error> {
    let v1::Lease { robot_id, candidate_ids, expire_time } = message;
    let robot_id: Arc<str> = robot_id.as_str().into();
    let expire_us = microseconds(required("lease.expire_time", expire_time.as_ref())?);
    let lease = |candidate_id: &String| {
        let id = candidate_id::decode(candidate_id).ok_or_else(|| {
            Error::field("lease.candidate_ids", format!("{candidate_id:?} is no candidate"))
        })?;
        let place = *id.target.point();
        Ok(Lease { robot_id: robot_id.clone(), candidate_id: candidate_id.clone(), place, expire_us })
    };
    candidate_ids.iter().map(lease).collect()
}
