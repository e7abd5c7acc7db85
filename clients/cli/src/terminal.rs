//! What commands print: coloured on a terminal, plain in a pipe or with `NO_COLOR`, and over when nobody reads.

use std::fmt::Display;
use std::io::{ErrorKind, Write};

use anstyle::{AnsiColor, Style};
use clap::builder::Styles;

use crate::failure::{Ended, Failure};

/// Headings.
pub(crate) const BOLD: Style = Style::new().bold();
/// What is worth a second look.
pub(crate) const ODD: Style = AnsiColor::Yellow.on_default();
/// What to type next.
pub(crate) const COMMAND: Style = AnsiColor::Cyan.on_default();

/// The same few styles in the help.
pub(crate) const HELP: Styles =
    Styles::styled().header(BOLD).usage(BOLD).literal(COMMAND).placeholder(Style::new());

/// Prints a line to standard output.
///
/// # Errors
/// [`Ended::Unread`] when whoever read it has gone.
pub(crate) fn say(line: impl Display) -> Result<(), Failure> {
    write_to(&mut anstream::stdout(), &line)
}

/// Prints a line to standard error, which may be gone.
pub(crate) fn warn(line: impl Display) {
    // Whom could a failure to print be told?
    let _ = writeln!(anstream::stderr(), "palpate: {line}");
}

/// Prints what is no text for people, such as a script, as it is.
pub(crate) fn hand_over(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout();
    explain(out.write_all(bytes).and_then(|()| out.flush()))
}

fn write_to(out: &mut impl Write, line: &impl Display) -> Result<(), Failure> {
    explain(writeln!(out, "{line}"))
}

fn explain(written: std::io::Result<()>) -> Result<(), Failure> {
    written.map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => Ended::Unread.into(),
        _ => format!("standard output: {error}").into(),
    })
}

/// `text` in this style.
pub(crate) fn styled(style: Style, text: impl Display) -> String {
    format!("{style}{text}{style:#}")
}

/// `text` broken at words to the terminal's width, each line after the first behind `indent` blanks.
pub(crate) fn wrapped(text: &str, indent: usize) -> String {
    wrapped_to(text, indent, textwrap::termwidth())
}

fn wrapped_to(text: &str, indent: usize, width: usize) -> String {
    let margin = " ".repeat(indent);
    textwrap::fill(text, textwrap::Options::new(width).subsequent_indent(&margin))
}

/// A number with the word for what it counts: `1 touch`, `2 touches`.
pub(crate) fn counted(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// The program as it was called, to be pasted into a shell.
pub(crate) fn program() -> String {
    let called = std::env::args().next().unwrap_or_else(|| "palpate".to_owned());
    shlex::try_quote(&called).map_or_else(|_| called.clone(), std::borrow::Cow::into_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_pipe_ends_the_command_and_another_failure_is_told() {
        struct Broken(ErrorKind);
        impl Write for Broken {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(self.0.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let failure = write_to(&mut Broken(ErrorKind::BrokenPipe), &"a line").unwrap_err();
        assert_eq!(failure.downcast_ref(), Some(&Ended::Unread));
        let failure = write_to(&mut Broken(ErrorKind::StorageFull), &"a line").unwrap_err();
        assert!(failure.to_string().starts_with("standard output: "), "{failure}");
    }

    #[test]
    fn one_is_singular() {
        assert_eq!(counted(1, "failure", "failures"), "1 failure");
        assert_eq!(counted(0, "failure", "failures"), "0 failures");
        assert_eq!(counted(2, "touch", "touches"), "2 touches");
    }

    #[test]
    fn long_lines_break_at_words_behind_a_margin() {
        assert_eq!(wrapped_to("    touched 18.2 mm from it", 4, 20), "    touched 18.2 mm\n    from it");
    }
}
