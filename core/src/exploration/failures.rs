//! What has failed is left alone for a while, and its surroundings attract less.
//!
//! A failed candidate is taboo, in METHOD_PALPATE until three later contacts have succeeded: the estimate
//! has hardly changed, and the same choice would fail for ever.

use super::proposal::ScoreTerm;
use super::situation::Situation;

/// Candidates this close to a failed one are taboo, in metres.
const TABOO_RADIUS_M: f64 = 0.010;
/// A failure makes its surroundings less attractive over this distance, in metres.
const FAILURE_RADIUS_M: f64 = 0.035;
/// Half of it is forgotten after this many contacts: the estimate has changed by then, and an end
/// that was missed once must be touched some day.
const HALF_LIFE_CONTACTS: f64 = 10.0;

/// Whether a candidate close by failed and too little has been learnt since.
pub(super) fn is_taboo(situation: &Situation<'_>, vertex: u32) -> bool {
    let point = &situation.mesh.vertices[vertex as usize];
    let contacts = situation.ledger.tallies.contacts;
    let until = situation.config.method.taboo_contacts();
    situation.ledger.failures.iter().any(|failure| {
        until.is_none_or(|until| contacts < failure.contacts_before + until)
            && (failure.point - point).norm() < TABOO_RADIUS_M
    })
}

/// The vertices that are not taboo, and how many are.
pub(super) fn leave_out_taboo(situation: &Situation<'_>, vertices: &[u32]) -> (Vec<u32>, u32) {
    let free: Vec<u32> = vertices.iter().copied().filter(|&vertex| !is_taboo(situation, vertex)).collect();
    let taboo = (vertices.len() - free.len()) as u32;
    (free, taboo)
}

/// The term for past failures, each counted by its nearness and by how little was learnt since: the
/// estimate is less to be trusted around them.
pub(super) fn term(situation: &Situation<'_>, vertex: u32) -> ScoreTerm {
    let point = &situation.mesh.vertices[vertex as usize];
    let nearness = |square_m2: f64| (-square_m2 / (2.0 * FAILURE_RADIUS_M.powi(2))).exp();
    let contacts = situation.ledger.tallies.contacts;
    let memory = |before: u32| 0.5_f64.powf(f64::from(contacts - before) / HALF_LIFE_CONTACTS);
    let failures = situation.ledger.failures.iter();
    let value = failures
        .map(|failure| memory(failure.contacts_before) * nearness((failure.point - point).norm_squared()))
        .sum();
    ScoreTerm { term: "failures", weight: -1.0, value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::evidence::ledger::{Failure, Ledger};
    use crate::geometry::{Icosphere, Point, Vector};

    #[test]
    fn a_failure_deters_close_by_and_is_half_forgotten_after_ten_contacts() {
        let sphere = Icosphere::get(3);
        let mesh = sphere.mesh_of(|direction| Point::from(direction.into_inner() * 0.1));
        let nearest = |to: Vector| {
            (0..mesh.vertices.len() as u32)
                .max_by(|a, b| {
                    let along = |vertex: &u32| mesh.vertices[*vertex as usize].coords.dot(&to);
                    along(a).total_cmp(&along(b))
                })
                .unwrap()
        };
        let (here, there) = (nearest(Vector::x()), nearest(-Vector::x()));
        let value = |vertex: u32, contacts: u32| {
            let mut ledger = Ledger::default();
            ledger.failures.push(Failure { point: mesh.vertices[here as usize], contacts_before: 3 });
            ledger.tallies.contacts = contacts;
            let config = Config::default();
            let situation = Situation::plain(&config, &ledger, sphere, &mesh);
            term(&situation, vertex).value
        };
        assert_eq!(value(here, 3), 1.0);
        assert!((value(here, 13) - 0.5).abs() < 1e-12);
        assert!(value(there, 3) < 1e-6);
    }
}
