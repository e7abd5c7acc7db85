//! The log proves itself: each event carries a link, the hash of all that it says and of the link before it.
//!
//! ```text
//! first(session) --> link 1 --> link 2 --> ... --> link at head, which the session's row knows
//!                      ^          ^
//!                   event 1    event 2: payload, reply, digests, state hash, order, who and when
//! ```
//! A changed bit, a swap, a gap or a shortened log breaks a link. The seal does the same for the session's row.

use sha2::{Digest, Sha256};

/// The hash of an event and of all events before it.
pub(crate) type Link = [u8; 32];

/// What a link covers of an event.
#[derive(Clone, Copy, Debug)]
pub(super) struct Content<'a> {
    pub(super) seq: i64,
    pub(super) request_id: Option<&'a str>,
    pub(super) request_digest: &'a [u8],
    pub(super) kind: &'a str,
    pub(super) payload: &'a [u8],
    pub(super) reply: &'a [u8],
    pub(super) state_hash: &'a str,
    pub(super) stats_after: &'a [u8],
    pub(super) algorithm_version: &'a str,
    pub(super) append_us: i64,
    pub(super) actor: &'a str,
}

/// What the first event of a session is linked to: an event does not fit into another session.
pub(crate) fn first(session_id: &str) -> Link {
    let mut hash = Fields::of("palpate log 1");
    hash.add(session_id.as_bytes());
    hash.done()
}

/// The link of an event after the event with the link `before`.
pub(super) fn next(before: &Link, content: &Content<'_>) -> Link {
    let Content {
        seq,
        request_id,
        request_digest,
        kind,
        payload,
        reply,
        state_hash,
        stats_after,
        algorithm_version,
        append_us,
        actor,
    } = *content;
    let mut hash = Fields::of("palpate event 1");
    hash.add(before);
    hash.add(&seq.to_le_bytes());
    hash.add(&[u8::from(request_id.is_some())]);
    hash.add(request_id.unwrap_or_default().as_bytes());
    hash.add(request_digest);
    hash.add(kind.as_bytes());
    hash.add(payload);
    hash.add(reply);
    hash.add(state_hash.as_bytes());
    hash.add(stats_after);
    hash.add(algorithm_version.as_bytes());
    hash.add(&append_us.to_le_bytes());
    hash.add(actor.as_bytes());
    hash.done()
}

/// What a seal covers of a session's row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sealed<'a> {
    pub(super) session_id: &'a str,
    pub(super) created_us: i64,
    pub(super) state: i32,
    pub(super) head: i64,
    pub(super) link: &'a [u8],
    pub(super) summary: &'a [u8],
}

/// The seal of a session's row.
pub(super) fn seal(row: &Sealed<'_>) -> Link {
    let Sealed { session_id, created_us, state, head, link, summary } = *row;
    let mut hash = Fields::of("palpate session 1");
    hash.add(session_id.as_bytes());
    hash.add(&created_us.to_le_bytes());
    hash.add(&state.to_le_bytes());
    hash.add(&head.to_le_bytes());
    hash.add(link);
    hash.add(summary);
    hash.done()
}

/// A hash of fields, each with its length, so that no two lists of fields have the same bytes.
struct Fields(Sha256);

impl Fields {
    fn of(what: &str) -> Self {
        let mut fields = Self(Sha256::new());
        fields.add(what.as_bytes());
        fields
    }

    fn add(&mut self, bytes: &[u8]) {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    fn done(self) -> Link {
        self.0.finalize().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVENT: Content<'static> = Content {
        seq: 2,
        request_id: Some("r"),
        request_digest: b"d",
        kind: "contact_result",
        payload: b"payload",
        reply: b"reply",
        state_hash: "ab",
        stats_after: b"s",
        algorithm_version: "1",
        append_us: 11,
        actor: "robot",
    };

    #[test]
    fn a_link_depends_on_every_field_on_their_bounds_and_on_what_came_before() {
        let before = first("mug");
        let link = next(&before, &EVENT);
        assert_eq!(link, next(&before, &EVENT));
        let others = [
            next(&first("pot"), &EVENT),
            next(&before, &Content { seq: 3, ..EVENT }),
            next(&before, &Content { request_id: None, ..EVENT }),
            next(&before, &Content { request_id: Some(""), ..EVENT }),
            next(&before, &Content { request_digest: b"e", ..EVENT }),
            next(&before, &Content { kind: "contact_resul", payload: b"tpayload", ..EVENT }),
            next(&before, &Content { payload: b"payloae", ..EVENT }),
            next(&before, &Content { reply: b"", ..EVENT }),
            next(&before, &Content { state_hash: "ac", ..EVENT }),
            next(&before, &Content { stats_after: b"t", ..EVENT }),
            next(&before, &Content { algorithm_version: "2", ..EVENT }),
            next(&before, &Content { append_us: 12, ..EVENT }),
            next(&before, &Content { actor: "", ..EVENT }),
        ];
        for (number, other) in others.iter().enumerate() {
            assert_ne!(*other, link, "{number}");
            assert!(!others[..number].contains(other), "{number}");
        }
    }

    #[test]
    fn a_seal_does_not_fit_another_row() {
        let row = Sealed { session_id: "mug", created_us: 7, state: 1, head: 2, link: b"l", summary: b"s" };
        for other in [
            Sealed { session_id: "pot", ..row },
            Sealed { created_us: 8, ..row },
            Sealed { state: 2, ..row },
            Sealed { head: 1, ..row },
            Sealed { link: b"m", ..row },
            Sealed { summary: b"", ..row },
        ] {
            assert_ne!(seal(&other), seal(&row), "{other:?}");
        }
    }
}
