//! The command line as every ROS node takes it: `--ros-args -r from:=to -p name:=value --params-file FILE`.
//!
//! What is between `--ros-args` and `--`, or the end, is ROS's; the rest is left to the program.

use std::path::PathBuf;

use crate::names::Names;

/// What ROS says on the command line.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RosArgs {
    /// `-r`: what is called differently, and how, in order; a node's name before a colon is taken off where it is ours.
    pub rules: Vec<(String, String)>,
    /// `-p` and `--params-file`, in order: later ones win.
    pub parameters: Vec<Given>,
    /// `--log-level`, for instance `debug`.
    pub log_level: Option<String>,
}

/// Where parameters come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Given {
    /// A file.
    File(PathBuf),
    /// A name and its value as YAML; the name may be that of a node, a colon and a parameter.
    Value(String, String),
}

/// Takes ROS's part out of the arguments and gives the rest back.
///
/// # Errors
/// An argument that is not understood, in words that say what is.
pub fn split(arguments: impl IntoIterator<Item = String>) -> Result<(RosArgs, Vec<String>), String> {
    let mut arguments = arguments.into_iter();
    let (mut ros, mut rest) = (RosArgs::default(), Vec::new());
    while let Some(argument) = arguments.next() {
        if argument == "--ros-args" {
            ros.read(&mut arguments)?;
        } else {
            rest.push(argument);
        }
    }
    Ok((ros, rest))
}

impl RosArgs {
    fn read(&mut self, arguments: &mut impl Iterator<Item = String>) -> Result<(), String> {
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--" => return Ok(()),
                // A launch file adds its own after those of its caller.
                "--ros-args" => {}
                "-r" | "--remap" => self.rules.push(assignment(&argument, &value()?)?),
                "-p" | "--param" => {
                    let (name, value) = assignment(&argument, &value()?)?;
                    self.parameters.push(Given::Value(name, value));
                }
                "--params-file" => self.parameters.push(Given::File(value()?.into())),
                "--log-level" => self.log_level = Some(value()?),
                // Of rcl's own log and of security, which the bridge has not.
                "-e" | "--enclave" | "--log-config-file" | "--log-file-name" => drop(value()?),
                flag if flag.starts_with("--enable-") || flag.starts_with("--disable-") => {}
                other => {
                    return Err(format!(
                        "{other:?} is no ROS argument: -r from:=to, -p name:=value, --params-file FILE and --log-level \
                         LEVEL are; arguments of the program itself come before --ros-args or after --"
                    ));
                }
            }
        }
        Ok(())
    }

    /// The node's names by these rules.
    ///
    /// # Errors
    /// A namespace or a node's name that is none.
    pub fn names(&self, default_node: &str) -> Result<Names, String> {
        let special = |keys: &[&str]| {
            let found = self.rules.iter().find(|(from, _)| {
                let from = from.strip_prefix(&format!("{default_node}:")).unwrap_or(from);
                keys.contains(&from)
            });
            found.map(|(_, to)| to.clone())
        };
        let node = special(&["__node", "__name"]).unwrap_or_else(|| default_node.to_owned());
        let namespace = special(&["__ns"]).unwrap_or_else(|| "/".to_owned());
        if !namespace.starts_with('/') || (namespace.len() > 1 && namespace.ends_with('/')) {
            return Err(format!(
                "__ns:={namespace} is no namespace: it begins with a slash and ends without one"
            ));
        }
        // Rules may be for one node of several: `palpate:points:=/camera/points`.
        let own = |(from, to): &(String, String)| match from.split_once(':') {
            Some((of, from)) => (of == default_node || of == node).then(|| (from.to_owned(), to.clone())),
            None => Some((from.clone(), to.clone())),
        };
        let rules = self.rules.iter().filter_map(own).collect();
        let names = Names { namespace, node, rules };
        names.resolve("~/check").map_err(|_| {
            format!("{} in {} is no name of a node: letters, digits and _", names.node, names.namespace)
        })?;
        Ok(names)
    }
}

/// The two sides of `from:=to`.
fn assignment(flag: &str, text: &str) -> Result<(String, String), String> {
    match text.split_once(":=") {
        Some((from, to)) if !from.is_empty() => Ok((from.to_owned(), to.to_owned())),
        _ => Err(format!("{flag} {text}: write it as NAME:=VALUE")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split_words(line: &str) -> Result<(RosArgs, Vec<String>), String> {
        split(line.split_whitespace().map(str::to_owned))
    }

    #[test]
    fn what_is_ros_and_what_is_the_programs_is_told_apart() {
        let line = "play bag.mcap --ros-args -r points:=/camera/points --params-file a.yaml -p server:=http://x:1 \
                    --log-level debug --disable-rosout-logs -- --fast --ros-args -r __ns:=/lab -r palpate:__node:=touch";
        let (ros, rest) = split_words(line).unwrap();
        assert_eq!(rest, ["play", "bag.mcap", "--fast"]);
        assert_eq!(ros.log_level.as_deref(), Some("debug"));
        let server = Given::Value("server".to_owned(), "http://x:1".to_owned());
        assert_eq!(ros.parameters, [Given::File("a.yaml".into()), server]);
        let names = ros.names("palpate").unwrap();
        assert_eq!((names.namespace.as_str(), names.node.as_str()), ("/lab", "touch"));
        assert_eq!(names.resolve("points").unwrap(), "/camera/points");
        assert_eq!(names.resolve("~/mesh").unwrap(), "/lab/touch/mesh");
    }

    #[test]
    fn rules_of_other_nodes_are_left_to_them() {
        let (ros, _) = split_words("--ros-args -r camera:points:=/no -r palpate:points:=/yes").unwrap();
        assert_eq!(ros.names("palpate").unwrap().resolve("points").unwrap(), "/yes");
    }

    #[test]
    fn arguments_that_are_none_are_refused_in_words() {
        assert!(split_words("--ros-args -r points").unwrap_err().contains("NAME:=VALUE"));
        assert!(split_words("--ros-args -p").unwrap_err().contains("needs a value"));
        assert!(split_words("--ros-args --remapp a:=b").unwrap_err().contains("--params-file"));
        let (ros, _) = split_words("--ros-args -r __ns:=lab").unwrap();
        assert!(ros.names("palpate").unwrap_err().contains("begins with a slash"));
    }
}
