//! Limits of a server as people write them: `16 MiB`, `30 s`, `64`.

use std::time::Duration;

use bytesize::ByteSize;
use palpate_server::Limits;
use serde_json::{Value, json};

use crate::near::nearest;

/// Units that a number of bytes is told in, the largest first.
const UNITS: [(&str, u64); 4] = [("TiB", 1 << 40), ("GiB", 1 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10)];

/// A limit as it is typed: `NAME=VALUE`.
pub(crate) fn pair(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("write NAME=VALUE, such as streams=512 or drain=30s")?;
    let pair = (name.trim().to_owned(), value.trim().to_owned());
    with(&Limits::default(), [&pair].into_iter()).map(|_| pair)
}

/// Whether a limit is called so.
pub(crate) fn is_limit(name: &str) -> bool {
    Limits::MEANINGS.iter().any(|(known, _)| *known == name)
}

/// The limits, some of which are set anew.
///
/// # Errors
/// There is no such limit, or it cannot have this value.
pub(crate) fn with<'a>(
    limits: &Limits,
    settings: impl Iterator<Item = &'a (String, String)>,
) -> Result<Limits, String> {
    let mut limits = limits.clone();
    for (name, text) in settings {
        let mut values = serde_json::to_value(&limits).map_err(|error| error.to_string())?;
        let Some(value) = values.get_mut(name) else { return Err(unknown(name)) };
        let failed = |what: String| format!("{name} = {text:?}: {what}");
        *value = parsed(name, value, text).map_err(failed)?;
        limits = serde_json::from_value(values).map_err(|error| failed(error.to_string()))?;
    }
    Ok(limits)
}

/// Each limit by name, with its value as one writes it, in quotation marks where it is no number.
pub(crate) fn written(limits: &Limits) -> Result<Vec<(&'static str, String)>, String> {
    let values = serde_json::to_value(limits).map_err(|error| error.to_string())?;
    let written = |name: &'static str| {
        let value = &values[name];
        let text = match value {
            Value::Object(_) => {
                let time: Duration =
                    serde_json::from_value(value.clone()).map_err(|error| error.to_string())?;
                format!("\"{}\"", humantime::format_duration(time))
            }
            Value::Number(number) if is_size(name) => size(number.as_u64().unwrap_or_default()),
            other => other.to_string(),
        };
        Ok((name, text))
    };
    Limits::MEANINGS.iter().map(|(name, _)| written(name)).collect()
}

/// What `text` means where `before` stands now, which says whether it is a time, a size, a number or a choice.
fn parsed(name: &str, before: &Value, text: &str) -> Result<Value, String> {
    match before {
        Value::Object(_) => {
            let time = humantime::parse_duration(text)
                .map_err(|_| "write a time with its unit, such as \"30 s\" or \"6 h\"".to_owned())?;
            serde_json::to_value(time).map_err(|error| error.to_string())
        }
        Value::Bool(_) => match text {
            "true" => Ok(json!(true)),
            "false" => Ok(json!(false)),
            _ => Err("write true or false".to_owned()),
        },
        _ if is_size(name) => {
            let size: Result<ByteSize, _> = text.parse();
            let size =
                size.map_err(|_| "write a size, such as \"16 MiB\" or a number of bytes".to_owned())?;
            Ok(json!(size.as_u64()))
        }
        _ => {
            let number: Result<u64, _> = text.replace('_', "").parse();
            Ok(json!(number.map_err(|_| "write a whole number".to_owned())?))
        }
    }
}

fn is_size(name: &str) -> bool {
    name.contains("bytes")
}

fn size(bytes: u64) -> String {
    let unit = UNITS.into_iter().find(|(_, size)| bytes > 0 && bytes.is_multiple_of(*size));
    unit.map_or_else(|| bytes.to_string(), |(unit, size)| format!("\"{} {unit}\"", bytes / size))
}

fn unknown(name: &str) -> String {
    let names = Limits::MEANINGS.iter().map(|(name, _)| *name);
    let advice = nearest(name, names).map(|near| format!("did you mean {near}?"));
    let advice = advice.unwrap_or_else(|| "`palpate config --show` prints all limits".to_owned());
    format!("there is no limit {name}; {advice}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(name: &str, text: &str) -> Result<Limits, String> {
        with(&Limits::default(), [(name.to_owned(), text.to_owned())].iter())
    }

    #[test]
    fn every_limit_is_written_as_it_can_be_read() {
        let mut limits = Limits::default();
        for (name, text) in written(&limits).unwrap() {
            limits = with(&limits, [(name.to_owned(), text.trim_matches('"').to_owned())].iter()).unwrap();
        }
        assert_eq!(limits, Limits::default());
    }

    #[test]
    fn sizes_times_numbers_and_choices_are_read_with_their_units() {
        assert_eq!(set("message_bytes", "32 MiB").unwrap().message_bytes, 32 << 20);
        assert_eq!(set("session_bytes", "1000000").unwrap().session_bytes, 1_000_000);
        assert_eq!(set("drain", "1min 30s").unwrap().drain, Duration::from_secs(90));
        assert_eq!(set("drain", "0.5 s").unwrap().drain, Duration::from_millis(500));
        assert_eq!(set("sessions", "1_000_000").unwrap().sessions, 1_000_000);
        assert!(set("unprintable_names", "true").unwrap().unprintable_names);
    }

    #[test]
    fn what_cannot_be_set_is_said_with_what_to_write() {
        for (name, text, said) in [
            ("steams", "3", "there is no limit steams; did you mean streams?"),
            ("colour", "3", "prints all limits"),
            ("drain", "30", "drain = \"30\": write a time with its unit"),
            ("message_bytes", "16 apples", "write a size"),
            ("streams", "-1", "write a whole number"),
            ("contacts", "5000000000", "expected u32"),
            ("unprintable_names", "yes", "write true or false"),
        ] {
            let refusal = set(name, text).unwrap_err();
            assert!(refusal.contains(said), "{name}: {refusal}");
        }
    }

    #[test]
    fn sizes_are_told_without_rounding() {
        let told = [16 << 20, 3 << 19, 1000, 0].map(size);
        assert_eq!(told, ["\"16 MiB\"", "\"1536 KiB\"", "1000", "0"]);
    }
}
