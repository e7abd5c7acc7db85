//! JSON bodies, parsed within bounds and without keeping the executor from other calls.
//!
//! A parsed body takes many times its bytes, and an empty object in it a hundred times, so what it is made of is
//! counted before it is parsed. A large one is parsed where threads may block, on no more of them than there are cores.

use std::sync::{Arc, LazyLock};
use std::thread::available_parallelism;

use axum::body::Bytes;
use serde_json::Value;
use tokio::sync::Semaphore;

use super::problem::Problem;
use crate::error::Error;
use crate::limits::{INLINE_JSON_BYTES, Limits};

/// What large bodies wait for: as many are parsed at once as there are cores, so that memory has a bound, too.
static LARGE: LazyLock<Arc<Semaphore>> =
    LazyLock::new(|| Arc::new(Semaphore::new(available_parallelism().map_or(1, usize::from))));

/// What `read` makes of a body.
///
/// # Errors
/// The body is not JSON, or is made of too many parts, or `read` refuses it.
pub(super) async fn parsed<T: Send + 'static>(
    body: Bytes,
    limits: &Limits,
    read: impl FnOnce(Value) -> Result<T, Error> + Send + 'static,
) -> Result<T, Problem> {
    if body.len() <= INLINE_JSON_BYTES {
        return parse(&body, limits, read);
    }
    let limits = limits.clone();
    let turn = LARGE.clone().acquire_owned().await.map_err(|_closed| Error::Draining)?;
    let parsing = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        parse(&body, &limits, read)
    });
    parsing.await.map_err(|failure| Error::internal(format!("a body could not be parsed: {failure}")))?
}

/// The same at once, however large the body is.
///
/// # Errors
/// As [`parsed`].
pub(super) fn parse<T>(
    body: &[u8],
    limits: &Limits,
    read: impl FnOnce(Value) -> Result<T, Error>,
) -> Result<T, Problem> {
    let most = Parts { fields: limits.json_fields, values: limits.json_values };
    Parts::of(body).check(&most)?;
    let json = serde_json::from_slice(body)
        .map_err(|error| Problem::unparsable(format!("the body is not JSON: {error}")))?;
    Ok(read(json)?)
}

/// How many parts a body has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Parts {
    /// Objects and their fields.
    fields: usize,
    /// Arrays and their values, and whatever else is separated by a comma.
    values: usize,
}

impl Parts {
    /// Counts what stands between the texts of a body, whether it is JSON or not.
    fn of(body: &[u8]) -> Self {
        let mut parts = Self::default();
        let mut bytes = body.iter();
        while let Some(byte) = bytes.next() {
            match byte {
                b'{' | b':' => parts.fields += 1,
                b'[' | b',' => parts.values += 1,
                b'"' => skip_text(&mut bytes),
                _ => {}
            }
        }
        parts
    }

    fn check(&self, most: &Self) -> Result<(), Error> {
        let hint = "send large clouds as PLY or as packed floats (application/octet-stream)";
        let too_large = |what: &str, found: usize, limit: usize| {
            let what = format!("the JSON body, with {found} {what}, and that");
            Err(Error::TooLarge { what, limit: limit.to_string(), hint })
        };
        if self.fields > most.fields {
            too_large("objects and fields", self.fields, most.fields)
        } else if self.values > most.values {
            too_large("arrays and values", self.values, most.values)
        } else {
            Ok(())
        }
    }
}

/// Goes on behind the quotation mark that ends a text.
fn skip_text(bytes: &mut std::slice::Iter<'_, u8>) {
    while let Some(byte) = bytes.next() {
        match byte {
            b'"' => return,
            b'\\' => {
                bytes.next();
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    async fn parse(body: String) -> Result<Value, Problem> {
        parsed(body.into(), &Limits::default(), Ok).await
    }

    #[test]
    fn what_stands_in_texts_is_not_counted() {
        assert_eq!(Parts::of(br#"{"a{:[,\"\\": "[,{:"}"#), Parts { fields: 2, values: 0 });
        assert_eq!(Parts::of(br"[[1,2,3],[4,5,6]]"), Parts { fields: 0, values: 8 });
        assert_eq!(Parts::of(br#""never ends [[["#), Parts::default());
    }

    #[tokio::test]
    async fn small_and_large_bodies_are_read_alike() {
        assert_eq!(parse(r#"{"a": [1]}"#.into()).await.unwrap(), json!({ "a": [1] }));
        let large =
            json!({ "points": vec![[0.25, -1.0, 2.0]; 50_000], "text": "x".repeat(INLINE_JSON_BYTES) });
        assert_eq!(parse(large.to_string()).await.unwrap(), large);
        for broken in ["{".to_owned(), format!("[{}", " ".repeat(2 * INLINE_JSON_BYTES))] {
            assert!(parse(broken).await.unwrap_err().to_json().contains("UNPARSABLE"));
        }
    }

    #[tokio::test]
    async fn a_body_that_would_take_far_more_memory_than_it_has_bytes_is_refused_with_the_limit() {
        let many = |part: &str| format!("[{}0]", part.repeat((4 << 20) / part.len() - 1));
        for part in [r#"{"":0},"#, "{},", "[0],", "[],", r#"{"a":{"b":{}}},"#] {
            let problem = parse(many(part)).await.unwrap_err().to_json();
            assert!(
                problem.contains("TOO_LARGE") && problem.contains("over the limit of "),
                "{part}: {problem}"
            );
            assert!(problem.contains("octet-stream"), "{part}: {problem}");
        }
    }
}
