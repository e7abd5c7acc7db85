//! Between messages of the contract and values of the method, by free functions.
//!
//! `from_proto` refuses and names the field as the caller wrote it; `to_proto` cannot fail. Both
//! take messages apart without `..`, so that a new field is a compile error and never overlooked.

use std::sync::LazyLock;

use prost_reflect::DescriptorPool;

pub(crate) mod candidate_id;
pub(crate) mod event;
pub(crate) mod from_proto;
pub(crate) mod json;
pub(crate) mod mask;
pub(crate) mod to_proto;

/// The contract's descriptors, with all comments.
pub(crate) static CONTRACT: LazyLock<Result<DescriptorPool, String>> = LazyLock::new(|| {
    DescriptorPool::decode(palpate_proto::FILE_DESCRIPTOR_SET).map_err(|error| error.to_string())
});

/// A time in microseconds since 1970, UTC; what no clock shows is the nearest that one does.
pub(crate) fn microseconds(time: &palpate_proto::Timestamp) -> i64 {
    let palpate_proto::Timestamp { seconds, nanos } = *time;
    seconds.saturating_mul(1_000_000).saturating_add(i64::from(nanos) / 1000)
}
