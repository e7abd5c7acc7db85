//! Names as ROS resolves them: relative, private and absolute, and remapped.
//!
//! `points` is relative to the node's namespace, `~/candidate` to the node itself, `/tf` to nothing. Rules of
//! `-r from:=to` are asked in their order, with both sides resolved, as rcl does.

/// A node's name with its namespace, and its rules.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names {
    /// Begins with a slash.
    pub namespace: String,
    /// The node's own name.
    pub node: String,
    /// What is called differently, and how; as given.
    pub rules: Vec<(String, String)>,
}

impl Names {
    /// The whole name of a topic or service, remapped.
    ///
    /// # Errors
    /// What is wrong with the name.
    pub fn resolve(&self, name: &str) -> Result<String, String> {
        let whole = self.expand(name)?;
        for (from, to) in &self.rules {
            // A rule of another node's name, or of the node's own: not of topics.
            if from.starts_with("__") || from.contains(':') {
                continue;
            }
            if self.expand(from)? == whole {
                return self.expand(to);
            }
        }
        Ok(whole)
    }

    fn expand(&self, name: &str) -> Result<String, String> {
        let namespace = self.namespace.trim_end_matches('/');
        let whole = if name.starts_with('/') {
            name.to_owned()
        } else if name == "~" || name.starts_with("~/") {
            format!("{namespace}/{}{}", self.node, &name[1..])
        } else {
            format!("{namespace}/{name}")
        };
        let is_token = |token: &str| {
            token.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
                && token.chars().all(|part| part.is_ascii_alphanumeric() || part == '_')
        };
        if whole.len() > 1 && whole[1..].split('/').all(is_token) {
            Ok(whole)
        } else {
            Err(format!(
                "{name:?} is no name of a topic or service: letters, digits, _ and single slashes, such as /camera/points"
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(rules: &[(&str, &str)]) -> Names {
        let rules = rules.iter().map(|(from, to)| ((*from).to_owned(), (*to).to_owned())).collect();
        Names { namespace: "/lab".to_owned(), node: "palpate".to_owned(), rules }
    }

    #[test]
    fn relative_private_and_absolute_names_are_told_apart() {
        let names = names(&[]);
        assert_eq!(names.resolve("points").unwrap(), "/lab/points");
        assert_eq!(names.resolve("~/mesh").unwrap(), "/lab/palpate/mesh");
        assert_eq!(names.resolve("/tf").unwrap(), "/tf");
        let root = Names { namespace: "/".to_owned(), ..names };
        assert_eq!(root.resolve("points").unwrap(), "/points");
    }

    #[test]
    fn rules_are_resolved_on_both_sides_and_the_first_that_fits_counts() {
        let names = names(&[
            ("points", "/camera/depth/points"),
            ("/tf", "tf"),
            ("~/mesh", "mesh"),
            ("/lab/wrench", "ft"),
            ("wrench", "never"),
        ]);
        assert_eq!(names.resolve("points").unwrap(), "/camera/depth/points");
        assert_eq!(names.resolve("/tf").unwrap(), "/lab/tf");
        assert_eq!(names.resolve("~/mesh").unwrap(), "/lab/mesh");
        assert_eq!(names.resolve("wrench").unwrap(), "/lab/ft");
        assert_eq!(names.resolve("~/candidate").unwrap(), "/lab/palpate/candidate");
    }

    #[test]
    fn names_that_are_none_are_refused() {
        for wrong in ["", "a//b", "a/", "1a", "a b", "~x", "/"] {
            assert!(names(&[]).resolve(wrong).is_err(), "{wrong:?}");
        }
        assert!(names(&[("points", "no good")]).resolve("points").unwrap_err().contains("no good"));
    }
}
