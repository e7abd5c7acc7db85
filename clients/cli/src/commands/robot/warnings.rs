//! Which of the server's warnings tell that something is wrong.

/// Said of every approach from below, whatever the object: the simulated robot has no table to hit.
const NO_TABLE: &str = "no table was declared";

/// Whether the server has noticed something beyond an early contact, which is a failure and counted as such, and
/// beyond a table that was not declared.
pub(in crate::commands) fn is_telling(warning: &str) -> bool {
    let is_early = warning.starts_with("touched ") && warning.contains(" mm from the candidate");
    !is_early && !warning.contains(NO_TABLE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn early_contacts_and_undeclared_tables_tell_nothing() {
        assert!(!is_telling(
            "touched 18.2 mm from the candidate: counts as a failure, as more than the 15 mm of \
                             failure_distance_m"
        ));
        assert!(!is_telling(
            "an approach begins at z = -0.100 m, below the object, and no table was declared: if"
        ));
        assert!(is_telling("wrench.force.z: 5 N pulls on the pad; pressing on an object gives a negative z"));
        assert!(is_telling(
            "the object seems to have moved by 20.0 mm (± 4.0 mm), by (0.0200, 0.0000, 0.0000) m"
        ));
    }
}
