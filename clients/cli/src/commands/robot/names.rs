//! The contract's enums as they are typed: `proactive` is `STRATEGY_PROACTIVE`.
//!
//! There is no second set of enums to keep equal: a value that the contract gains does not compile before it has
//! its word and its line of help here.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use palpate_client::proto::v1::{Method, Strategy, Symmetry, TemplateAxes};

/// An enum of the contract whose values have a word on the command line.
pub(in crate::commands) trait Typed: Copy + TryFrom<i32> + Send + Sync + 'static {
    /// The word and what it means; `None` for the value that stands for no choice.
    fn word(self) -> Option<(&'static str, &'static str)>;
}

impl Typed for Strategy {
    fn word(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Unspecified => None,
            Self::Proactive => {
                Some(("proactive", "From the frontier of what is known: the paper's own (OURS)"))
            }
            Self::MinUncertainty => {
                Some(("min_uncertainty", "Where the uncertainty is highest: the paper's baseline (minU)"))
            }
            Self::Uniform => Some(("uniform", "Directions spread evenly over the object")),
            Self::Random => Some(("random", "Anywhere on the estimate")),
            Self::ExpectedGain => Some(("expected_gain", "Where the most is expected to be learnt")),
        }
    }
}

impl Typed for Method {
    fn word(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Unspecified => None,
            Self::Paper => Some(("paper", "The paper's stages, faithful and comparable")),
            Self::Palpate => Some(("palpate", "Palpate's own")),
            Self::Gpis => Some(("gpis", "A Gaussian process implicit surface, for comparison")),
        }
    }
}

impl Typed for TemplateAxes {
    fn word(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Unspecified => None,
            Self::Frame => Some(("frame", "Those of the session's frame, as the paper's formula has it")),
            Self::Free => Some(("free", "They may turn, for objects that stand askew")),
        }
    }
}

impl Typed for Symmetry {
    fn word(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Unspecified => None,
            Self::Revolution => Some(("revolution", "A surface of revolution about some axis")),
            Self::Mirror => Some(("mirror", "A mirror image of itself in some plane")),
        }
    }
}

/// Every value of the enum, in the order of the contract, which numbers them without gaps.
fn values<T: Typed>() -> impl Iterator<Item = T> {
    (0..).map_while(|number| T::try_from(number).ok())
}

/// Reads a word, and lists all of them in the help.
pub(in crate::commands) fn parser<T: Typed>() -> impl TypedValueParser<Value = T> {
    let words = values::<T>().filter_map(T::word);
    let words = words.map(|(word, meaning)| PossibleValue::new(word).help(meaning));
    PossibleValuesParser::new(words).try_map(|typed| {
        let is_typed = |value: &T| value.word().is_some_and(|(word, _)| word == typed);
        values().find(is_typed).ok_or("is none of the possible values")
    })
}

/// The value as it is typed; empty for no choice.
pub(in crate::commands) fn name_of(value: impl Typed) -> &'static str {
    value.word().map_or("", |(word, _)| word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_contract() {
        assert_eq!(name_of(Strategy::MinUncertainty), "min_uncertainty");
        assert_eq!(name_of(Strategy::Unspecified), "");
        fn check<T: Typed>(prefix: &str, name: fn(&T) -> &'static str) {
            for value in values::<T>().skip(1) {
                assert_eq!(format!("{prefix}_{}", name_of(value).to_uppercase()), name(&value));
            }
        }
        check("STRATEGY", Strategy::as_str_name);
        check("METHOD", Method::as_str_name);
        check("SYMMETRY", Symmetry::as_str_name);
    }

    #[test]
    fn every_value_of_the_contract_but_no_choice_can_be_typed() {
        let command =
            clap::Command::new("palpate").arg(clap::Arg::new("how").value_parser(parser::<Strategy>()));
        for strategy in values::<Strategy>().skip(1) {
            let typed = command.clone().get_matches_from(["palpate", name_of(strategy)]);
            assert_eq!(typed.get_one("how"), Some(&strategy));
        }
        assert!(command.try_get_matches_from(["palpate", "unspecified"]).is_err());
    }
}
