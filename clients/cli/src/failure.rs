//! What a command says when it does not go on, and the exit code that belongs to it.

use std::fmt::{Display, Formatter};
use std::process::ExitCode;

/// What happened and what to do, for people.
pub(crate) type Failure = Box<dyn std::error::Error + Send + Sync>;

/// An end that is no failure of the program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// Nobody reads the output any more, as in `palpate demo | head`.
    Unread,
    /// Ctrl-C; what there is to say of what was done until then.
    Interrupted(String),
}

impl Display for Ended {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unread => f.write_str("nobody reads the output any more"),
            Self::Interrupted(text) => f.write_str(text),
        }
    }
}

impl std::error::Error for Ended {}

/// Arguments that contradict each other in a manner that only the command itself knows.
pub(crate) fn wrong_usage(text: &str) -> Failure {
    clap::Error::raw(clap::error::ErrorKind::ArgumentConflict, format!("{text}\n")).into()
}

/// Tells people what happened, and programs by the exit code.
pub(crate) fn tell(failure: &Failure) -> ExitCode {
    use std::io::Write;
    if let Some(usage) = failure.downcast_ref::<clap::Error>() {
        // Whom could a failure to print be told?
        let _ = usage.print();
        return ExitCode::from(2);
    }
    let ended = failure.downcast_ref::<Ended>();
    if ended != Some(&Ended::Unread) {
        let _ = writeln!(anstream::stderr(), "palpate: {failure}");
    }
    // As a shell counts them: 128 and the number of the signal, SIGPIPE or SIGINT.
    match ended {
        Some(Ended::Unread) => ExitCode::from(141),
        Some(Ended::Interrupted(_)) => ExitCode::from(130),
        None => ExitCode::FAILURE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_end_has_the_exit_code_that_a_shell_expects() {
        let codes = [
            (tell(&wrong_usage("--this contradicts --that")), 2),
            (tell(&Ended::Unread.into()), 141),
            (tell(&Ended::Interrupted("3 of 4 runs are kept".to_owned()).into()), 130),
            (tell(&"the disk is full".into()), 1),
        ];
        for (code, expected) in codes {
            assert_eq!(code, ExitCode::from(expected));
        }
    }
}
