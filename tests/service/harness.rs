//! What every test needs: a server to call, callers of both transports, and something to say.

mod authority;
pub(crate) mod ball;
pub(crate) mod bundle;
mod caller;
mod codec;
pub(crate) mod database;
mod guarded;
mod http;
pub(crate) mod postgres;
mod process;
mod program;
mod proxy;
mod random;
mod raw;
mod refusal;
mod robots;
mod samples;
mod server;
pub(crate) mod truth;

use std::time::Duration;

pub(crate) use authority::{Authority, Identity};
pub(crate) use caller::{Caller, Transport, reply};
pub(crate) use codec::OnTheWire;
pub(crate) use guarded::{Guarded, issue, new_token};
pub(crate) use http::{EventStream, Http, accepted, from_json, header, send, to_json};
pub(crate) use process::Process;
pub(crate) use program::{Ran, run, run_with};
pub(crate) use proxy::Proxy;
pub(crate) use random::Random;
pub(crate) use raw::{Raw, outcome, say_raw};
pub(crate) use refusal::{Outcome, Refused};
pub(crate) use robots::Robots;
pub(crate) use samples::{
    cap, cloud, creation, miss, prior, question, report, result, touch, without_timing,
};
pub(crate) use server::{Server, patient_client};

/// Nothing takes this long unless it is broken, whatever else the machine does.
const PATIENCE: Duration = Duration::from_secs(60);

/// The number that an environment variable gives, or another one.
pub(crate) fn given(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|value| value.parse().ok()).unwrap_or(otherwise)
}

/// Waits for what must come.
pub(crate) async fn soon<T>(what: &str, future: impl Future<Output = T>) -> T {
    tokio::time::timeout(PATIENCE, future).await.unwrap_or_else(|_| panic!("{what}: not within {PATIENCE:?}"))
}
