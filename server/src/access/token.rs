//! What a token looks like: `palpate_<id>_<secret>`, 48 public random bits and 256 secret ones, in hexadecimal.
//!
//! The id finds the token and may be shown; of the secret only its SHA-256 is kept. A hash that is made slow on purpose
//! would add nothing: nobody guesses 256 random bits.

use std::fmt;

use sha2::{Digest, Sha256};

const PREFIX: &str = "palpate_";
const ID_BYTES: usize = 6;
const SECRET_BYTES: usize = 32;

/// A token as its holder has it. Its text is shown once, and never by `Debug`.
#[derive(Clone)]
pub(super) struct Token {
    pub(super) id: String,
    secret: String,
}

impl Token {
    /// A new one, from the system's random numbers.
    ///
    /// # Errors
    /// The system gives none.
    pub(super) fn random() -> Result<Self, getrandom::Error> {
        let (mut id, mut secret) = ([0; ID_BYTES], [0; SECRET_BYTES]);
        getrandom::fill(&mut id)?;
        getrandom::fill(&mut secret)?;
        Ok(Self { id: hex(&id), secret: hex(&secret) })
    }

    /// The token in this text, if it is one.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (id, secret) = text.strip_prefix(PREFIX)?.split_once('_')?;
        let is_hex = |text: &str, bytes: usize| {
            text.len() == 2 * bytes && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        };
        let is_token = is_hex(id, ID_BYTES) && is_hex(secret, SECRET_BYTES);
        is_token.then(|| Self { id: id.to_owned(), secret: secret.to_owned() })
    }

    /// What its holder keeps.
    pub(super) fn text(&self) -> String {
        format!("{PREFIX}{}_{}", self.id, self.secret)
    }

    /// What the server keeps of its secret.
    pub(super) fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.secret.as_bytes()).into()
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Token({})", self.id)
    }
}

/// `N` random bytes in hexadecimal.
///
/// # Errors
/// The system gives none.
pub(super) fn random_text<const N: usize>() -> Result<String, getrandom::Error> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes)?;
    Ok(hex(&bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_read_back_and_never_shown() {
        let token = Token::random().unwrap();
        let read = Token::parse(&token.text()).unwrap();
        assert_eq!((&read.id, read.digest()), (&token.id, token.digest()));
        assert!(!format!("{token:?}").contains(&token.secret));
        assert_ne!(Token::random().unwrap().text(), token.text());
        assert_eq!(token.secret.len(), 64, "256 bits");
    }

    #[test]
    fn what_is_no_token_is_none() {
        let text = Token::random().unwrap().text();
        for other in
            ["", "palpate_", &text[1..], &text[..text.len() - 1], &text.to_uppercase(), "palpate_a_b"]
        {
            assert!(Token::parse(other).is_none(), "{other}");
        }
    }
}
