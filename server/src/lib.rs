//! Palpate's server: sessions that reconstruct an object's shape, over gRPC and HTTP on one port.
//!
//! Dependencies point one way: `grpc`, `http` -> `api` -> `sessions` -> `store`, `compute` and the
//! method itself in `palpate-core`. `wire` holds the conversions between messages and values.

pub mod api;
pub mod error;
pub mod limits;
