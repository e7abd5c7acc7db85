//! JSON bodies of the HTTP routes that change a session; the first byte says which.
//! What is understood is written, and read again as the same.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_fuzz::{CALLS, assert_same_json, assert_sound_refusal};
use palpate_server::dry_run;

fuzz_target!(|bytes: &[u8]| {
    let [call, body @ ..] = bytes else { return };
    let call = CALLS[usize::from(*call) % CALLS.len()];
    match dry_run::json(call, body) {
        Ok(understood) => {
            let again = dry_run::json(call, understood.as_bytes()).expect("JSON that this service wrote");
            assert_same_json(&again, &understood);
        }
        Err(refusal) => assert_sound_refusal(&refusal),
    }
});
