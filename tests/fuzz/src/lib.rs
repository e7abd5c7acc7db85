//! What several targets have in common: what must hold of whatever is accepted or refused.

pub mod evidence;

use palpate_proto::v1;
use palpate_server::dry_run::{self, Call, Refusal};

/// The calls that change a session.
pub const CALLS: [Call; 4] =
    [Call::CreateSession, Call::AddVisualPrior, Call::ReportContact, Call::ProposeContacts];

/// Nothing that a caller reads of a refusal is longer, in bytes.
const REFUSAL_BYTES: usize = 12 << 10;

/// Reads a view; one that is accepted has points that the method can use.
pub fn assert_sound_view(view: &v1::VisualPrior) {
    match dry_run::visual_prior(view) {
        Ok(read) => {
            assert!(read.points().len() >= 4);
            assert!(read.points().iter().all(|point| point.iter().all(|x| x.abs() <= 1e4)));
            assert!(read.centre().iter().all(|x| x.is_finite()));
        }
        Err(refusal) => assert_sound_refusal(&refusal),
    }
}

/// Two texts are the same JSON; the labels of a session have no order.
pub fn assert_same_json(one: &str, other: &str) {
    let parsed =
        |text: &str| serde_json::from_str::<serde_json::Value>(text).expect("JSON that this service wrote");
    assert_eq!(parsed(one), parsed(other));
}

/// A refusal says what is wrong, within bounds, and is no fault of the server.
pub fn assert_sound_refusal(refusal: &Refusal) {
    let Refusal { problem, trailers } = refusal;
    assert!(!problem.contains("\"INTERNAL\""), "{problem}");
    assert!(problem.len() < REFUSAL_BYTES, "{} bytes", problem.len());
    let bytes: usize = trailers.iter().map(|(name, value)| name.as_str().len() + value.len()).sum();
    assert!(bytes < REFUSAL_BYTES, "{bytes} bytes of headers");
}
