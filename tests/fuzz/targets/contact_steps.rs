//! Evidence of every kind and size: each step ends, and leaves a surface and proposals of finite numbers.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_core::exploration::{Candidate, ProposalRequest};
use palpate_core::reconstruction::Reconstruction;
use palpate_fuzz::evidence::Session;

fuzz_target!(|session: Session| {
    let (Ok(config), Ok(view)) = (session.setup.config(), session.view.evidence()) else { return };
    let (mut state, _) = Reconstruction::new(config).absorb(&view).expect("a first view");
    let mut best = soundly_proposed(&state);
    for step in &session.steps {
        let Ok(Some(evidence)) = step.evidence(best.as_ref()) else { continue };
        let (next, update) = state.absorb(&evidence).expect("evidence after a view");
        assert!(update.max_vertex_move_m.is_finite());
        assert!(update.contact_uncertainty.is_none_or(|u| (0.0..=1.0).contains(&u)));
        state = next;
        best = soundly_proposed(&state);
    }
});

/// The best candidate of a state that is sound.
fn soundly_proposed(state: &Reconstruction) -> Option<Candidate> {
    let surface = state.surface().expect("a surface after a view");
    assert!(surface.mesh.vertices.iter().all(|vertex| vertex.iter().all(|x| x.is_finite())));
    assert!(surface.uncertainty.iter().all(|u| (0.0..=1.0).contains(u)));
    assert!(surface.std_m.iter().flatten().all(|std_m| std_m.is_finite() && *std_m >= 0.0));
    let candidates = state.propose(&ProposalRequest::best(3)).candidates;
    for Candidate { point, normal, score, .. } in &candidates {
        assert!(point.iter().chain(normal.iter()).all(|x| x.is_finite()) && score.is_finite());
    }
    candidates.into_iter().next()
}
