//! Texts that callers chose, as far as they may be shown: cut to a length that fits into an answer and a line of
//! the log, and without characters that forge such a line or turn its direction.

use std::borrow::Cow;
use std::fmt::{Display, Formatter, Result, Write};

use crate::limits::ECHO_BYTES;

/// The beginning of a text of at most `bytes`; what was cut is marked.
pub(crate) fn cut(text: &str, bytes: usize) -> Cow<'_, str> {
    if text.len() <= bytes {
        text.into()
    } else {
        format!("{}…", &text[..text.floor_char_boundary(bytes)]).into()
    }
}

/// What an error echoes of something that a caller sent: in quotes, escaped, and cut.
pub(crate) fn quoted(text: &str) -> String {
    if text.len() <= ECHO_BYTES {
        return format!("{text:?}");
    }
    format!("{:?}… ({} bytes)", &text[..text.floor_char_boundary(ECHO_BYTES)], text.len())
}

/// Whether a character is a control character, or changes the direction in which the text around it is shown.
pub(crate) fn is_forbidden_in_names(character: char) -> bool {
    let is_bidirectional =
        matches!(character, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    character.is_control() || is_bidirectional
}

/// A text for the log, one line whatever it holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Escaped<'a>(pub(crate) &'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        for character in self.0.chars() {
            // Line and paragraph separators break lines for some who read logs.
            if is_forbidden_in_names(character) || matches!(character, '\u{2028}' | '\u{2029}') {
                write!(f, "{}", character.escape_default())?;
            } else {
                f.write_char(character)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_is_cut_between_characters_and_says_so() {
        assert_eq!(cut("short", 5), "short");
        assert_eq!(cut("täglich", 2), "t…");
        assert_eq!(quoted("a \"mug\"\n"), r#""a \"mug\"\n""#);
        let long = quoted(&"x".repeat(15 << 20));
        assert!(long.ends_with("x\"… (15728640 bytes)") && long.len() < 2 * ECHO_BYTES, "{long}");
    }

    #[test]
    fn the_log_gets_one_line_without_escape_sequences_or_turned_text() {
        let forged = "mug\r\n2026 INFO forged \u{1b}[31m \u{202e}\u{9b}\u{2028}\u{7f}, süß \\n";
        let shown = Escaped(forged).to_string();
        assert_eq!(shown, r"mug\r\n2026 INFO forged \u{1b}[31m \u{202e}\u{9b}\u{2028}\u{7f}, süß \n");
    }

    #[test]
    fn letters_of_all_languages_are_plain() {
        for plain in ["a-mug", "süß", "杯子", "كوب", "🫖", "a b"] {
            assert!(!plain.contains(is_forbidden_in_names), "{plain}");
        }
        for c in [
            '\0', '\n', '\u{1b}', '\u{7f}', '\u{85}', '\u{200e}', '\u{200f}', '\u{202a}', '\u{202e}',
            '\u{2066}', '\u{2069}',
        ] {
            assert!(is_forbidden_in_names(c), "{c:?}");
        }
    }
}
