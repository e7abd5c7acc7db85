//! Who may call, and what: tokens, client certificates, scopes, and the experiments that a caller is kept to.
//!
//! ```text
//! request -- who is it? --> Caller -- may it make this call? -- may it see this session? --> the service
//!            guard.rs                 scope.rs                  Api::run_on_session
//! ```
//! Nothing here knows the wire: [`guard`] reads a request's headers, everything else is plain values. A call that is not
//! in the table of scopes needs all of them, so that a new one is closed until somebody decides.

mod attempts;
mod caller;
pub(crate) mod guard;
mod registry;
mod scope;
mod tickets;
mod token;

pub(crate) use caller::CertificateName;
pub use caller::{Account, Caller};
pub use guard::require;
pub(crate) use registry::Registry;
pub use registry::{IssueError, Issued, NewToken, TokenInfo, Tokens};
pub use scope::{Scope, needed};
pub(crate) use tickets::LASTS as TICKET_LASTS;
