//! What callers may do, in four steps of which each includes those before it.

use std::fmt;
use std::str::FromStr;

/// What a caller may do; each scope includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Scope {
    /// Look at sessions, meshes and tables, and ask for candidates without holding them.
    Read,
    /// Run sessions: create them, add views and touches, take one's own back, finish.
    Robot,
    /// Take away and bring in: delete sessions, import them.
    Operate,
    /// Run the server itself.
    Admin,
}

impl Scope {
    /// All of them, the least first.
    pub const ALL: [Self; 4] = [Self::Read, Self::Robot, Self::Operate, Self::Admin];

    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Robot => "robot",
            Self::Operate => "operate",
            Self::Admin => "admin",
        }
    }
}

impl fmt::Display for Scope {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for Scope {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|scope| scope.name() == text);
        known.ok_or_else(|| format!("{text:?} is no scope: say read, robot, operate or admin"))
    }
}

/// The scope that a call needs, by the name of the RPC; HTTP makes the same calls. One that is not listed needs the
/// highest.
pub fn needed(call: &str) -> Scope {
    match call {
        "GetSession"
        | "ListSessions"
        | "ListExperiments"
        | "SummarizeExperiment"
        | "GetServerInfo"
        | "ExportSession"
        | "ProposeContacts"
        | "GetMesh"
        | "ListEvents"
        | "WatchSession"
        | "ReplaySession"
        | "EvaluateSession"
        | "GetSeries"
        | "GetReference" => Scope::Read,
        "CreateSession" | "UpdateSession" | "FinishSession" | "ForkSession" | "AddVisualPrior"
        | "ReportContact" | "RetractEvent" | "Explore" | "SetReference" => Scope::Robot,
        "DeleteSession" | "ImportSession" | "DeleteReference" => Scope::Operate,
        _ => Scope::Admin,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scope_includes_those_before_it_and_is_read_as_it_is_written() {
        for pair in Scope::ALL.windows(2) {
            assert!(pair[0] < pair[1]);
        }
        for scope in Scope::ALL {
            assert_eq!(scope.to_string().parse(), Ok(scope));
        }
        assert!("root".parse::<Scope>().unwrap_err().contains("operate"));
    }

    #[test]
    fn a_call_that_nobody_decided_about_is_closed() {
        assert_eq!(needed("LaunchRockets"), Scope::Admin);
    }
}
