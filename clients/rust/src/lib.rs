//! A typed client for a Palpate server: every call has a deadline and is retried safely.
//!
//! "Safely" means that a retry is never counted twice: each call that changes something carries one `request_id`,
//! made once and sent again with every attempt, and the server answers a known one with its first reply.
//! Messages are those of [`proto::v1`], whose docs give units and frames; all of SI, right-handed, quaternions x, y, z, w.
//!
//! The robot's whole loop:
//!
//! ```no_run
//! use palpate_client::proto::v1::{
//!     AddVisualPriorRequest, Candidate, ContactResult, CreateSessionRequest, NoContact,
//!     HalfSpace, KeepOut, ReportContactRequest, SessionConfig, StopReason, Vector3, contact_result::Outcome,
//!     keep_out::Shape,
//! };
//! use palpate_client::{Client, Error, visual_prior};
//!
//! /// Moves the robot; here it never finds anything.
//! fn touch(candidate: &Candidate) -> Outcome {
//!     Outcome::NoContact(NoContact {
//!         swept_from: candidate.probe_start,
//!         swept_to: candidate.probe_end,
//!         sweep_radius_m: 0.0,
//!     })
//! }
//!
//! # async fn explore() -> Result<(), Error> {
//! let client = Client::connect("http://127.0.0.1:7257").await?;
//! // The object stands on a table at z = 0: no approach may go below it.
//! let up = Some(Vector3 { x: 0.0, y: 0.0, z: 1.0 });
//! let table = KeepOut { shape: Some(Shape::HalfSpace(HalfSpace { normal: up, offset_m: 0.0 })) };
//! let session = client
//!     .create_session(CreateSessionRequest {
//!         frame_id: "base".to_owned(),
//!         config: Some(SessionConfig { keep_out: vec![table], ..Default::default() }),
//!         ..Default::default()
//!     })
//!     .await?;
//!
//! let patch = [[0.00, 0.00, 0.1], [0.01, 0.00, 0.1], [0.00, 0.01, 0.1], [0.01, 0.01, 0.1]];
//! let camera_in_base = [0.3, 0.3, 0.5];
//! let first = client
//!     .add_visual_prior(AddVisualPriorRequest {
//!         session_id: session.session_id.clone(),
//!         prior: Some(visual_prior(&patch, Some(camera_in_base))),
//!         propose: 1,
//!         ..Default::default()
//!     })
//!     .await?;
//!
//! let mut next = first.candidates.into_iter().next();
//! while let Some(candidate) = next {
//!     let reply = client
//!         .report_contact(ReportContactRequest {
//!             session_id: session.session_id.clone(),
//!             result: Some(ContactResult {
//!                 candidate_id: candidate.candidate_id.clone(),
//!                 outcome: Some(touch(&candidate)),
//!                 ..Default::default()
//!             }),
//!             propose: 1,
//!             ..Default::default()
//!         })
//!         .await?;
//!     // The server says when it is enough: 50 attempts, or an object that is covered before.
//!     let goes_on = reply.should_stop() == StopReason::Unspecified;
//!     next = reply.candidates.into_iter().next().filter(|_| goes_on);
//! }
//! # Ok(())
//! # }
//! ```

mod builder;
mod client;
mod error;
mod explore;
mod packed;
mod retry;
mod routing;
#[cfg(test)]
mod test_server;
mod transfer;
mod watch;

pub use palpate_proto as proto;
pub use tonic::Code;

pub use builder::ClientBuilder;
pub use client::Client;
pub use error::{Error, FieldProblem, Refusal};
pub use explore::Exploration;
pub use packed::{faces, positions, std_m, uncertainty, visual_prior};
pub use retry::RetryPolicy;
pub use transfer::{Download, Replay};
pub use watch::Watch;
