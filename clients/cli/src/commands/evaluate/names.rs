//! Objects have any name; what is written about them has rules.

use std::collections::HashSet;

/// The picture that is of no object.
pub(super) const RELIABILITY: &str = "reliability";

/// A name for each object's picture that every file system takes, and that no other one has.
pub(super) fn file_names(objects: &[String]) -> Vec<String> {
    // Not every file system tells upper from lower case.
    let mut taken = HashSet::from([RELIABILITY.to_owned()]);
    let mut names = Vec::new();
    for object in objects {
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let base: String = object.chars().map(plain).collect();
        let mut name = base.clone();
        for number in 2.. {
            if taken.insert(name.to_lowercase()) {
                break;
            }
            name = format!("{base}-{number}");
        }
        names.push(name);
    }
    names
}

/// A name in a cell of a markdown table; underscores are blanks, as in the paper.
pub(super) fn cell(object: &str) -> String {
    let mut text = String::new();
    for c in object.replace('_', " ").chars() {
        if "\\|*`<[".contains(c) {
            text.push('\\');
        }
        text.push(c);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_object_gets_a_picture_of_its_own() {
        let objects =
            ["can.1", "can.2", "a|b", "a/b", "Mug", "mug", "reliability", "Öl kanne"].map(str::to_owned);
        assert_eq!(
            file_names(&objects),
            ["can.1", "can.2", "a_b", "a_b-2", "Mug", "mug-2", "reliability-2", "Öl_kanne"]
        );
    }

    #[test]
    fn a_name_does_not_break_a_table() {
        assert_eq!(cell("a|b"), r"a\|b");
        assert_eq!(cell("sugar_box"), "sugar box");
        assert_eq!(cell(r"*b* `c` \d"), r"\*b\* \`c\` \\d");
    }
}
