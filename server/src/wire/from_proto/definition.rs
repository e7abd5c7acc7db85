//! What a session is created with.

use std::collections::BTreeMap;

use palpate_proto::v1;

use super::config::{config, shadow};
use super::robot::keep_out_regions;
use super::size::plausible_size;
use super::{check_name, required};
use crate::error::Error;
use crate::limits::{Limits, SESSION_ID_BYTES};
use crate::session::{Ancestor, Definition};
use crate::text::quoted;

/// The frame of a session that names none, as robot drivers call the robot's foot.
const DEFAULT_FRAME: &str = "base";

/// A session's definition from the request that creates it; `request.session_id` must be set by now.
///
/// # Errors
/// A name, a label or a part of the configuration cannot be used.
pub(crate) fn definition(
    request: &v1::CreateSessionRequest,
    created_us: i64,
    limits: &Limits,
) -> Result<Definition, Error> {
    let v1::CreateSessionRequest {
        session_id,
        display_name,
        experiment,
        frame_id,
        labels,
        config: wanted_config,
        request_id,
    } = request;
    check_name("display_name", display_name, limits)?;
    check_name("experiment", experiment, limits)?;
    check_name("frame_id", frame_id, limits)?;
    check_name("request_id", request_id, limits)?;
    check_labels(labels, limits)?;
    let wanted_config = wanted_config.clone().unwrap_or_default();
    let (config, sensors) = config(&wanted_config, limits)?;
    let keep_out = keep_out_regions("config.keep_out", &wanted_config.keep_out, limits)?;
    let plausible_size = plausible_size("config.plausible_size", wanted_config.plausible_size.as_ref())?;
    let shadow = shadow(&wanted_config.shadow, &config, limits)?;
    let frame_id = if frame_id.is_empty() { DEFAULT_FRAME } else { frame_id };
    Ok(Definition {
        session_id: session_id.clone(),
        display_name: display_name.clone(),
        experiment: experiment.clone(),
        frame_id: frame_id.to_owned(),
        labels: labels.clone(),
        config,
        sensors,
        keep_out,
        plausible_size,
        shadow,
        ancestors: Vec::new(),
        created_us,
    })
}

/// The definition of a fork, as its first event has it.
///
/// # Errors
/// It has none, or one that cannot be used.
pub(crate) fn fork(forked: &v1::Forked, created_us: i64, limits: &Limits) -> Result<Definition, Error> {
    let v1::Forked { definition: request, ancestors } = forked;
    let definition = definition(required("definition", request.as_ref())?, created_us, limits)?;
    let ancestor = |v1::Ancestor { session_id, revision }: &v1::Ancestor| Ancestor {
        session_id: session_id.clone(),
        revision: *revision,
    };
    Ok(Definition { ancestors: ancestors.iter().map(ancestor).collect(), ..definition })
}

/// # Errors
/// Too many labels, one without a name, or one that is too long or has control characters.
pub(crate) fn check_labels(labels: &BTreeMap<String, String>, limits: &Limits) -> Result<(), Error> {
    if labels.len() > limits.labels {
        let description = format!("{} labels are more than the limit of {}", labels.len(), limits.labels);
        return Err(Error::field("labels", description));
    }
    for (name, value) in labels {
        if name.is_empty() {
            return Err(Error::field("labels", "a label has no name"));
        }
        check_name("labels", name, limits)?;
        check_name(&format!("labels[{name}]"), value, limits)?;
    }
    Ok(())
}

/// Whether `session_id` may be chosen for a new session.
///
/// # Errors
/// It does not match `[a-z][a-z0-9-]{2,62}`.
pub(crate) fn check_session_id(session_id: &str) -> Result<(), Error> {
    let mut bytes = session_id.bytes();
    let well_formed = bytes.next().is_some_and(|first| first.is_ascii_lowercase())
        && bytes.all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-')
        && (3..=SESSION_ID_BYTES).contains(&session_id.len());
    if well_formed {
        return Ok(());
    }
    let rule =
        "use 3 to 63 lower-case letters, digits and hyphens, a letter first; or leave it empty for a UUID";
    Err(Error::field("session_id", format!("{} cannot be used: {rule}", quoted(session_id))))
}
