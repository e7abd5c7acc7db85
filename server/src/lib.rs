//! Palpate's server: sessions that reconstruct an object's shape, over gRPC and HTTP on one port.
//!
//! Dependencies point one way: `grpc`, `http` -> `api` -> `sessions` -> `store`, `compute` and the
//! method itself in `palpate-core`. `wire` holds the conversions between messages and values.

pub mod access;
mod api;
mod archive;
mod compute;
mod cors;
mod depth;
pub mod dry_run;
mod error;
mod grpc;
mod http;
mod limits;
mod mesh_format;
mod metrics;
mod peer;
mod serve;
mod session;
mod sessions;
mod store;
mod text;
mod voxel;
mod wire;

pub use limits::Limits;
pub use serve::{ServeError, ServeOptions, TlsError, TlsFiles, parse_host, parse_origin, serve};
pub use store::{
    Address, AddressError, BackupError, Copied, Inspection, Location, MigrateError, Migrated, Older,
    OpenError, Progress, Proof, Restored, SharedInspection, Witnessed, back_up, inspect, inspect_shared,
    migrate, restore,
};
