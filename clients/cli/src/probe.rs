//! A plain HTTP client, for what has no place in the contract: probes and what only operators ask.

use std::time::Duration;

use crate::failure::Failure;

/// A server that takes longer for a short answer is not well.
const TIMEOUT: Duration = Duration::from_secs(5);

/// The client.
///
/// # Errors
/// The system has none.
pub(crate) fn client() -> Result<reqwest::Client, Failure> {
    // A proxy of the environment would answer for the server that is asked about.
    Ok(reqwest::Client::builder().timeout(TIMEOUT).no_proxy().build()?)
}

/// What is at the bottom of an error, such as "connection refused".
pub(crate) fn cause(error: &(dyn std::error::Error + 'static)) -> String {
    let mut cause = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    cause.to_string()
}
