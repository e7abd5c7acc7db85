//! Between messages of the contract and values of the method, by free functions.
//!
//! `from_proto` refuses and names the field as the caller wrote it; `to_proto` cannot fail. Both
//! take messages apart without `..`, so that a new field is a compile error and never overlooked.

pub(crate) mod candidate_id;
pub(crate) mod event;
pub(crate) mod from_proto;
pub(crate) mod to_proto;

/// A time in microseconds since 1970, UTC; what no clock shows is the nearest that one does.
pub(crate) fn microseconds(time: &palpate_proto::Timestamp) -> i64 {
    let palpate_proto::Timestamp { seconds, nanos } = *time;
    seconds.saturating_mul(1_000_000).saturating_add(i64::from(nanos) / 1000)
}
