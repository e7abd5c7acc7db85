//! What is explored and how: every object with every method, strategy and seed.

use palpate_client::proto::v1::{Method, Strategy};
use palpate_simulator::robot::Plan;
use serde::{Deserialize, Serialize};

use super::super::robot::{SessionArgs, name_of, plan};
use super::Args;
use super::objects::EvaluatedObject;

/// One cell of the evaluation; the first columns of its files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Case {
    pub(super) object: String,
    pub(super) method: String,
    pub(super) strategy: String,
    pub(super) seed: u64,
}

impl Case {
    pub(super) fn new(object: &str, method: Method, strategy: Strategy, seed: u64) -> Self {
        let (method, strategy) = (name_of(method).to_owned(), name_of(strategy).to_owned());
        Self { object: object.to_owned(), method, strategy, seed }
    }
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { object, method, strategy, seed } = self;
        write!(f, "{object}, {method}, {strategy}, seed {seed}")
    }
}

/// A run that is to be made.
#[derive(Clone, Debug)]
pub(super) struct Task {
    pub(super) case: Case,
    pub(super) object: EvaluatedObject,
    pub(super) plan: Plan,
}

impl Task {
    /// The same for the same arguments, so that a run is found again.
    pub(super) fn session_id(&self) -> &str {
        &self.plan.session.session_id
    }
}

/// Every method with every strategy that it has.
pub(super) fn pairs(args: &Args) -> impl Iterator<Item = (Method, Strategy)> {
    let strategies = |&method| args.strategies.iter().map(move |&strategy| (method, strategy));
    // The others state no deviation that a gain could be expected from.
    let exists = |&(method, strategy): &(Method, Strategy)| {
        method == Method::Palpate || strategy != Strategy::ExpectedGain
    };
    args.methods.iter().flat_map(strategies).filter(exists)
}

/// The same as they are typed, in the order of rows and colours.
pub(super) fn series(args: &Args) -> Vec<(String, String)> {
    let names = |(method, strategy)| (name_of(method).to_owned(), name_of(strategy).to_owned());
    pairs(args).map(names).collect()
}

/// Methods are compared after the same number of attempts, whatever is covered by then.
fn explore_to_the_last_attempt(plan: &mut Plan) {
    let rule = plan.session.config.as_mut().and_then(|config| config.stop.as_mut());
    if let Some(rule) = rule {
        rule.mean_uncertainty_below = Some(0.0);
    }
}

/// All runs, object by object.
pub(super) fn tasks(objects: &[EvaluatedObject], args: &Args) -> Vec<Task> {
    let mut tasks = Vec::new();
    for object in objects {
        for (method, strategy) in pairs(args) {
            for seed in 1..=args.seeds {
                let session = SessionArgs {
                    attempts: args.attempts,
                    strategy,
                    method: Some(method),
                    template_axes: args.template_axes.filter(|_| method == Method::Paper),
                    symmetry: args.symmetry.filter(|_| method == Method::Palpate),
                    seed,
                };
                let mut plan = plan(&object.name, "evaluate", &session, &args.sensors);
                explore_to_the_last_attempt(&mut plan);
                plan.session.session_id = format!("run-{:04}", tasks.len() + 1);
                let case = Case::new(&object.name, method, strategy, seed);
                tasks.push(Task { case, object: object.clone(), plan });
            }
        }
    }
    tasks
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::Symmetry;
    use palpate_simulator::probe::Pad;

    use super::super::objects;
    use super::super::tests::typed;
    use super::*;

    #[test]
    fn a_symmetry_is_declared_to_every_method_but_the_papers_which_refuses_one() {
        let args = typed(&["--symmetry", "mirror", "--seeds", "1", "--measured-normals"]);
        let objects = objects::load(None, 1.0, &["ball".to_owned()]).unwrap();
        let tasks = tasks(&objects, &args);
        assert_eq!(tasks.len(), 4);
        for Task { case, plan, .. } in tasks {
            let declared = plan.session.config.unwrap().symmetry();
            assert_eq!(declared == Symmetry::Mirror, case.method == "palpate", "{case:?}");
            assert!(plan.probe.measures_normals);
        }
    }

    #[test]
    fn the_papers_point_touches_and_nothing_goes_wrong_unless_it_is_asked_for() {
        let objects = objects::load(None, 1.0, &["ball".to_owned()]).unwrap();
        let planned = |args: &[&str]| tasks(&objects, &typed(args)).remove(0).plan;
        let usual = planned(&[]);
        assert!(usual.probe.pad == Pad::Point && !usual.faults.any());
        let faulty = planned(&["--pad", "flat", "--table", "--false-contacts", "0.1"]);
        assert!(faulty.probe.pad == Pad::Flat && faulty.faults.table_share == 0.25);
        assert_eq!(faulty.faults.false_contact_share, 0.1);
    }

    #[test]
    fn several_values_are_separated_by_blanks_or_by_commas() {
        let blanks = typed(&["--objects", "can", "mug", "--strategies", "random", "uniform"]);
        let commas = typed(&["--objects", "can,mug", "--strategies", "random,uniform"]);
        assert_eq!(blanks.objects, ["can", "mug"]);
        assert_eq!(blanks.objects, commas.objects);
        assert_eq!(series(&blanks), series(&commas));
    }
}
