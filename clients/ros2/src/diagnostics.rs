//! The state of each part of the bridge, for people: in the log when it changes, on `/diagnostics` all the time.

use std::collections::BTreeMap;

use palpate_client::proto::v1::Warning;

use crate::messages::{DiagnosticArray, DiagnosticStatus, KeyValue, Time};

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// As it should be.
    Ok,
    /// It works, and somebody should look.
    Warn,
    /// It does not work until somebody does something.
    Error,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct State {
    level: Level,
    message: String,
    values: Vec<(String, String)>,
}

/// The states by part, such as `tf` or `server`.
#[derive(Debug, Clone, Default)]
pub struct Diagnostics {
    node: String,
    states: BTreeMap<String, State>,
    has_news: bool,
}

/// What the names of the server's warnings begin with.
const WARNING: &str = "warning ";

impl Diagnostics {
    /// Those of a node, whose name they bear.
    pub fn new(node: &str) -> Self {
        Self { node: node.to_owned(), ..Self::default() }
    }

    /// Sets the state of a part; a new message goes to the log.
    pub fn set(&mut self, part: &str, level: Level, message: &str) {
        self.set_with(part, level, message, Vec::new());
    }

    /// The same with figures.
    pub fn set_with(&mut self, part: &str, level: Level, message: &str, values: Vec<(String, String)>) {
        let state = State { level, message: message.to_owned(), values };
        let is_new = self
            .states
            .get(part)
            .is_none_or(|before| (before.level, &before.message) != (level, &state.message));
        if is_new {
            self.has_news = true;
            match level {
                Level::Ok => tracing::info!("{part}: {message}"),
                Level::Warn => tracing::warn!("{part}: {message}"),
                Level::Error => tracing::error!("{part}: {message}"),
            }
        }
        self.states.insert(part.to_owned(), state);
    }

    /// The server's warnings of its newest reply, in place of those of the one before.
    pub fn set_warnings(&mut self, warnings: &[Warning]) {
        let names = |warning: &Warning| {
            let code = warning.code().as_str_name();
            format!("{WARNING}{}", code.strip_prefix("WARNING_CODE_").unwrap_or(code))
        };
        let now: Vec<_> = warnings.iter().map(names).collect();
        self.states.retain(|part, _| !part.starts_with(WARNING) || now.contains(part));
        for (part, warning) in now.iter().zip(warnings) {
            let values = warning.parameters.iter().map(|(key, value)| (key.clone(), value.to_string()));
            self.set_with(part, Level::Warn, &warning.message, values.collect());
        }
    }

    /// Whether a message changed since the last call: what is soon over is published all the same.
    pub fn take_news(&mut self) -> bool {
        std::mem::take(&mut self.has_news)
    }

    /// The level and message of a part.
    pub fn get(&self, part: &str) -> Option<(Level, &str)> {
        self.states.get(part).map(|state| (state.level, state.message.as_str()))
    }

    /// All of them as a message.
    pub fn array(&self, stamp: Time) -> DiagnosticArray {
        let status = |(part, state): (&String, &State)| DiagnosticStatus {
            level: match state.level {
                Level::Ok => DiagnosticStatus::OK,
                Level::Warn => DiagnosticStatus::WARN,
                Level::Error => DiagnosticStatus::ERROR,
            },
            name: format!("{}: {part}", self.node),
            message: state.message.clone(),
            hardware_id: "palpate".to_owned(),
            values: state
                .values
                .iter()
                .map(|(key, value)| KeyValue { key: key.clone(), value: value.clone() })
                .collect(),
        };
        DiagnosticArray::at(stamp, self.states.iter().map(status).collect())
    }
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::WarningCode;

    use super::*;

    #[test]
    fn warnings_stand_until_the_next_reply_and_other_parts_stay() {
        let mut diagnostics = Diagnostics::new("palpate");
        diagnostics.set("tf", Level::Error, "no frame");
        assert!(diagnostics.take_news());
        diagnostics.set("tf", Level::Error, "no frame");
        assert!(!diagnostics.take_news());
        let warning = Warning {
            code: WarningCode::WeakContact.into(),
            message: "press harder".to_owned(),
            parameters: [("force_n".to_owned(), 0.1)].into(),
        };
        diagnostics.set_warnings(&[warning]);
        let array = diagnostics.array(Time { sec: 7, nanosec: 0 });
        let [tf, weak] = array.status.as_slice() else { panic!("{array:?}") };
        assert_eq!((tf.name.as_str(), tf.level), ("palpate: tf", DiagnosticStatus::ERROR));
        assert_eq!(
            (weak.name.as_str(), weak.level),
            ("palpate: warning WEAK_CONTACT", DiagnosticStatus::WARN)
        );
        assert_eq!((weak.values[0].key.as_str(), weak.values[0].value.as_str()), ("force_n", "0.1"));

        diagnostics.set_warnings(&[]);
        assert_eq!(diagnostics.get("warning WEAK_CONTACT"), None);
        assert_eq!(diagnostics.get("tf"), Some((Level::Error, "no frame")));
    }
}
