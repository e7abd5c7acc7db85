//! The name that was meant by one that does not exist.

/// Names that are less alike mean something else.
const ALIKE: f64 = 0.8;

/// The most similar of the names, if one is similar.
pub(crate) fn nearest<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let alike =
        names.map(|name| (strsim::jaro_winkler(wrong, name), name)).filter(|(alike, _)| *alike > ALIKE);
    alike.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_understood_and_another_word_is_not() {
        let names = || ["listen", "database", "allow_origin"].into_iter();
        assert_eq!(nearest("databse", names()), Some("database"));
        assert_eq!(nearest("allowed_origins", names()), Some("allow_origin"));
        assert_eq!(nearest("colour", names()), None);
    }
}
