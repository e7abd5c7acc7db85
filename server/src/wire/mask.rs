//! A configuration with some of its fields changed, named by a mask.

use palpate_proto::v1;
use prost::{Message, Name};
use prost_reflect::{DynamicMessage, FieldDescriptor, Kind, ReflectMessage};

use super::{CONTRACT, from_proto, to_proto};
use crate::error::Error;
use crate::limits::Limits;
use crate::text::quoted;

/// The configuration `known` with the fields at `paths` as `wanted` has them, or without them where it has none. With
/// another method, what had the default of the method before goes back to its default.
///
/// # Errors
/// A path that names nothing.
pub(crate) fn changed(
    known: &v1::SessionConfig,
    wanted: Option<&v1::SessionConfig>,
    paths: &[String],
) -> Result<v1::SessionConfig, Error> {
    if paths.is_empty() {
        if wanted.is_some_and(|wanted| *wanted != v1::SessionConfig::default()) {
            let description = "is empty, so nothing of config is taken: name its fields that are to change, for instance method";
            return Err(Error::field("config_mask", description));
        }
        return Ok(known.clone());
    }
    let wanted = dynamic(wanted.unwrap_or(&v1::SessionConfig::default()))?;
    let is_about_method = paths.iter().any(|path| path == "method");
    let mut changed = dynamic(known)?;
    if is_about_method {
        forget_defaults(&mut changed, &dynamic(&defaults_of(known.method)?)?);
    }
    for path in paths {
        copy(&wanted, &mut changed, path, path)?;
    }
    changed.transcode_to::<v1::SessionConfig>().map_err(|error| Error::internal(error.to_string()))
}

fn dynamic(config: &v1::SessionConfig) -> Result<DynamicMessage, Error> {
    let contract = CONTRACT.as_ref().map_err(|error| Error::internal(error.clone()))?;
    let descriptor = contract.get_message_by_name(&v1::SessionConfig::full_name());
    let descriptor = descriptor.ok_or_else(|| Error::internal("the contract has no configuration"))?;
    DynamicMessage::decode(descriptor, config.encode_to_vec().as_slice())
        .map_err(|error| Error::internal(error.to_string()))
}

/// What a session of a method is created with that says nothing else.
fn defaults_of(method: i32) -> Result<v1::SessionConfig, Error> {
    let config = Some(v1::SessionConfig { method, ..Default::default() });
    let request = v1::CreateSessionRequest { config, ..Default::default() };
    Ok(to_proto::session_config(&from_proto::definition(&request, 0, &Limits::default())?))
}

/// Clears the fields, those of messages one by one, that are as `defaults` has them.
fn forget_defaults(config: &mut DynamicMessage, defaults: &DynamicMessage) {
    let is_set = |field: &FieldDescriptor| config.has_field(field);
    let fields: Vec<FieldDescriptor> = config.descriptor().fields().filter(is_set).collect();
    for field in &fields {
        let default = defaults.get_field(field);
        if *config.get_field(field) == *default {
            config.clear_field(field);
        } else if let (Some(inner), Some(default)) =
            (config.get_field_mut(field).as_message_mut(), default.as_message())
        {
            forget_defaults(inner, default);
        }
    }
}

fn copy(from: &DynamicMessage, to: &mut DynamicMessage, path: &str, whole: &str) -> Result<(), Error> {
    let (name, rest) = path.split_once('.').map_or((path, None), |(name, rest)| (name, Some(rest)));
    let Some(field) = to.descriptor().get_field_by_name(name) else {
        let description = format!(
            "{} names no field of SessionConfig: its fields have names like method or stop.max_attempts",
            quoted(whole)
        );
        return Err(Error::field("config_mask", description));
    };
    match rest {
        None if from.has_field(&field) => to.set_field(&field, from.get_field(&field).into_owned()),
        None => to.clear_field(&field),
        Some(rest) => {
            if field.is_list() || !matches!(field.kind(), Kind::Message(_)) {
                let description = format!("{} goes too deep: {name} is changed as a whole", quoted(whole));
                return Err(Error::field("config_mask", description));
            }
            let inner = from.get_field(&field).into_owned();
            let Some((inner, target)) = inner.as_message().zip(to.get_field_mut(&field).as_message_mut())
            else {
                return Err(Error::internal("a message field holds no message"));
            };
            copy(inner, target, rest, whole)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    fn stored(config: v1::SessionConfig) -> v1::SessionConfig {
        let request = v1::CreateSessionRequest { config: Some(config), ..Default::default() };
        to_proto::session_config(&from_proto::definition(&request, 0, &Limits::default()).unwrap())
    }

    #[test]
    fn only_what_is_named_changes_and_what_is_named_and_not_set_is_cleared() {
        let known =
            stored(v1::SessionConfig { seed: Some(7), alpha_travel: Some(0.5), ..Default::default() });
        let stop =
            v1::StopRule { max_attempts: Some(20), max_consecutive_failures: Some(3), ..Default::default() };
        let wanted = v1::SessionConfig { stop: Some(stop), seed: Some(9), ..Default::default() };
        let changed = changed(&known, Some(&wanted), &paths(&["stop.max_attempts", "alpha_travel"])).unwrap();
        assert_eq!(changed.stop.unwrap().max_attempts, Some(20));
        assert_eq!(
            changed.stop.unwrap().max_consecutive_failures,
            known.stop.unwrap().max_consecutive_failures
        );
        assert_eq!((changed.seed, changed.alpha_travel), (Some(7), None));
    }

    #[test]
    fn another_method_has_its_own_defaults_and_what_was_chosen_stays() {
        let gpis = v1::SessionConfig { method: v1::Method::Gpis.into(), ..Default::default() };
        let known = stored(v1::SessionConfig { seed: Some(7), ..gpis });
        let wanted = v1::SessionConfig { method: v1::Method::Paper.into(), ..Default::default() };
        let paper = stored(changed(&known, Some(&wanted), &paths(&["method"])).unwrap());
        assert_eq!(paper, stored(v1::SessionConfig { seed: Some(7), ..wanted }));
        assert_ne!(paper.strategy, known.strategy);
    }

    #[test]
    fn a_name_of_nothing_is_refused_by_its_name() {
        let known = stored(v1::SessionConfig::default());
        for bad in ["methods", "seed.low", "keep_out.ball", "", "stop.most"] {
            let refusal = changed(&known, None, &paths(&[bad])).unwrap_err();
            assert_eq!(refusal.fields()[0].field, "config_mask", "{bad}");
        }
        let forgotten =
            changed(&known, Some(&v1::SessionConfig { seed: Some(3), ..Default::default() }), &[]);
        assert_eq!(forgotten.unwrap_err().fields()[0].field, "config_mask");
    }
}
