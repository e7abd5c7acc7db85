//! Candidate ids as callers give them back: what is read aims somewhere, and is read again as it is written.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_server::dry_run;

fuzz_target!(|text: &str| {
    let Some(id) = dry_run::candidate_id(text) else { return };
    assert!(id.target.point().iter().all(|x| x.is_finite()));
    assert!((id.target.normal().norm() - 1.0).abs() < 1e-12);
    let again = dry_run::candidate_id(&id.written).expect("an id that this service wrote");
    assert_eq!(again.target.point(), id.target.point());
    assert!((again.target.normal().into_inner() - id.target.normal().into_inner()).norm() < 1e-12);
});
