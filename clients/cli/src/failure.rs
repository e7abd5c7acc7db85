//! What a command says when it cannot go on.

/// What happened and what to do, for people.
pub(crate) type Failure = Box<dyn std::error::Error + Send + Sync>;
