//! The log proves itself: each event carries a link, the hash of all that it says and of the link before it.
//!
//! ```text
//! first(session) --> link 1 --> link 2 --> ... --> link at head, which the session's row knows
//!                      ^          ^
//!                   event 1    event 2: payload, reply, digests, state hash, order, who and when
//! ```
//! A changed bit, a swap, a gap or a shortened log breaks a link. The seal does the same for the session's row.

use sha2::{Digest, Sha256};

use super::event::Event;

/// The hash of an event and of all events before it.
pub(crate) type Link = [u8; 32];

/// What the first event of a session is linked to: an event does not fit into another session.
pub(crate) fn first(session_id: &str) -> Link {
    let mut hash = Fields::of("palpate log 1");
    hash.add(session_id.as_bytes());
    hash.done()
}

/// The link of an event after the event with the link `before`.
pub(super) fn next(before: &Link, event: &Event) -> Link {
    let Event {
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
    } = event;
    let mut hash = Fields::of("palpate event 1");
    hash.add(before);
    hash.add(&seq.to_le_bytes());
    hash.add(&[u8::from(request_id.is_some())]);
    hash.add(request_id.as_deref().unwrap_or_default().as_bytes());
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

    fn event() -> Event {
        Event {
            seq: 2,
            request_id: Some("r".into()),
            request_digest: b"d".to_vec(),
            kind: "contact_result".into(),
            payload: b"payload".to_vec(),
            reply: b"reply".to_vec(),
            state_hash: "ab".into(),
            stats_after: b"s".to_vec(),
            algorithm_version: "1".into(),
            append_us: 11,
            actor: "robot".into(),
        }
    }

    #[test]
    fn a_link_depends_on_every_field_on_their_bounds_and_on_what_came_before() {
        let before = first("mug");
        let link = next(&before, &event());
        assert_eq!(link, next(&before, &event()));
        let others = [
            next(&first("pot"), &event()),
            next(&before, &Event { seq: 3, ..event() }),
            next(&before, &Event { request_id: None, ..event() }),
            next(&before, &Event { request_id: Some(String::new()), ..event() }),
            next(&before, &Event { request_digest: b"e".to_vec(), ..event() }),
            next(&before, &Event { kind: "contact_resul".into(), payload: b"tpayload".to_vec(), ..event() }),
            next(&before, &Event { payload: b"payloae".to_vec(), ..event() }),
            next(&before, &Event { reply: Vec::new(), ..event() }),
            next(&before, &Event { state_hash: "ac".into(), ..event() }),
            next(&before, &Event { stats_after: b"t".to_vec(), ..event() }),
            next(&before, &Event { algorithm_version: "2".into(), ..event() }),
            next(&before, &Event { append_us: 12, ..event() }),
            next(&before, &Event { actor: String::new(), ..event() }),
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
