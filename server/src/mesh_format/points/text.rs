//! The text in files of points: the lines of a header, within bounds, and numbers whatever the line breaks.

use std::str::FromStr;

use crate::limits::{FILE_HEADER_LINE_BYTES, FILE_HEADER_LINES};

/// What is quoted of something that cannot be read, in characters.
const QUOTED: usize = 32;

/// Reads a file's header line by line.
#[derive(Clone, Debug)]
pub(super) struct HeaderLines<'a> {
    bytes: &'a [u8],
    position: usize,
    line: usize,
}

impl<'a> HeaderLines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0, line: 0 }
    }

    /// The next line without its end and the blanks around it; `None` at the end of the bytes.
    ///
    /// # Errors
    /// One line too many, one that is too long, or one that is no text.
    pub(super) fn next(&mut self) -> Result<Option<&'a str>, String> {
        let rest = &self.bytes[self.position..];
        if rest.is_empty() {
            return Ok(None);
        }
        self.line += 1;
        if self.line > FILE_HEADER_LINES {
            return Err(format!("the header has more than {FILE_HEADER_LINES} lines, the limit"));
        }
        let within = &rest[..rest.len().min(FILE_HEADER_LINE_BYTES + 1)];
        let length = match within.iter().position(|&byte| byte == b'\n') {
            Some(length) => length,
            None if rest.len() <= FILE_HEADER_LINE_BYTES => rest.len(),
            None => {
                let line = self.line;
                return Err(format!(
                    "line {line} of the header has more than {FILE_HEADER_LINE_BYTES} bytes, the limit"
                ));
            }
        };
        self.position = (self.position + length + 1).min(self.bytes.len());
        // Some programs write comments in another encoding than UTF-8; what matters is ASCII in any.
        let text = match std::str::from_utf8(&rest[..length]) {
            Ok(text) => text.trim(),
            Err(error) => std::str::from_utf8(&rest[..error.valid_up_to()]).unwrap_or_default().trim(),
        };
        Ok(Some(text))
    }

    /// What follows the header.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.position..]
    }

    /// The number of the last line, from 1.
    pub(super) fn line(&self) -> usize {
        self.line
    }
}

/// Words between blanks and line breaks.
#[derive(Clone, Debug)]
pub(super) struct Tokens<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Tokens<'a> {
    /// The words of `bytes`, which begin in the file's line `line`.
    pub(super) fn new(bytes: &'a [u8], line: usize) -> Self {
        Self { rest: bytes, line }
    }

    /// How many bytes are left.
    pub(super) fn bytes(&self) -> usize {
        self.rest.len()
    }

    /// The next word.
    ///
    /// # Errors
    /// There is none.
    pub(super) fn word(&mut self) -> Result<&'a [u8], String> {
        let blanks = self.rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(self.rest.len());
        self.line += self.rest[..blanks].iter().filter(|&&byte| byte == b'\n').count();
        let word = &self.rest[blanks..];
        let length = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
        if length == 0 {
            return Err("it ends too early".into());
        }
        self.rest = &word[length..];
        Ok(&word[..length])
    }

    /// The next word as a number of 64 or 32 bits, NaN and infinities among them.
    ///
    /// # Errors
    /// The word is none, said with its line.
    pub(super) fn number(&mut self, is_double: bool) -> Result<f64, String> {
        let word = self.word()?;
        let text = std::str::from_utf8(word).unwrap_or("");
        let read = if is_double { number(text) } else { number::<f32>(text).map(f64::from) };
        read.ok_or_else(|| {
            let line = self.line;
            let quoted: String = String::from_utf8_lossy(word).chars().take(QUOTED).collect();
            if text.contains(',') && text.split(',').all(|part| number::<f64>(part).is_some()) {
                format!("line {line}: {quoted} is a number with a comma: write a point, and blanks between numbers")
            } else {
                format!("line {line}: {quoted:?} is no number")
            }
        })
    }
}

/// A number as programs write them: `nan` in any case and with a sign, and what Windows makes of it.
fn number<F: FromStr + From<f32>>(text: &str) -> Option<F> {
    text.parse().ok().or_else(|| {
        let lower = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
        (lower.starts_with("nan(") || lower.starts_with("1.#")).then(|| F::from(f32::NAN))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_what_blanks_and_line_breaks_of_any_system_separate() {
        let mut tokens = Tokens::new(b"  1 2\t3\r\n\n-4e-1", 7);
        let numbers: Vec<f64> = (0..4).map(|_| tokens.number(true).unwrap()).collect();
        assert_eq!(numbers, [1.0, 2.0, 3.0, -0.4]);
        assert_eq!((tokens.line, tokens.number(true).unwrap_err().as_str()), (9, "it ends too early"));
    }

    #[test]
    fn what_is_not_finite_is_a_number_in_every_spelling() {
        for text in ["nan", "NaN", "-nan", "NAN", "-nan(ind)", "nan(snan)", "1.#QNAN", "-1.#IND"] {
            assert!(Tokens::new(text.as_bytes(), 1).number(true).unwrap().is_nan(), "{text}");
        }
        for text in ["inf", "-inf", "Inf", "INFINITY"] {
            assert!(Tokens::new(text.as_bytes(), 1).number(true).unwrap().is_infinite(), "{text}");
        }
    }

    #[test]
    fn a_comma_is_called_a_comma_and_long_words_are_cut() {
        let error = |text: &str| Tokens::new(text.as_bytes(), 8).number(true).unwrap_err();
        assert!(error("0,25 1").starts_with("line 8: 0,25 is a number with a comma"), "{}", error("0,25"));
        assert!(error("0.1,0.2,0.3").contains("a number with a comma"));
        assert_eq!(error("\n\nx,1"), "line 10: \"x,1\" is no number");
        assert!(error(&"z".repeat(5000)).len() < 60);
    }

    #[test]
    fn a_header_of_too_many_or_too_long_lines_is_refused_with_the_limit() {
        let lines = |text: &str| {
            let mut lines = HeaderLines::new(text.as_bytes());
            loop {
                match lines.next() {
                    Ok(Some(_)) => {}
                    Ok(None) => return Ok(lines.line()),
                    Err(reason) => return Err(reason),
                }
            }
        };
        assert_eq!(lines("a\r\nb\n\nc"), Ok(4));
        assert_eq!(lines(&"a\n".repeat(1024)), Ok(1024));
        assert!(lines(&"a\n".repeat(1025)).unwrap_err().contains("1024 lines"));
        assert_eq!(lines(&"a".repeat(4096)), Ok(1));
        assert!(
            lines(&format!("a\n{}\n", "b".repeat(4097))).unwrap_err().starts_with("line 2 of the header")
        );
    }
}
