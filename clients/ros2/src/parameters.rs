//! The node's parameters: their names, units and defaults, from YAML files and from the command line.
//!
//! A file says for which nodes it speaks (`palpate:`, `/lab/palpate:`, `/**:`) and has its values under
//! `ros__parameters`; nested names may be written with dots. What is not a parameter is refused by name, because a
//! misspelt one would silently keep its default. `config` is `palpate.v1.SessionConfig` itself, so all of it can be set.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use palpate_client::proto::{FILE_DESCRIPTOR_SET, v1};
use prost_reflect::{DescriptorPool, DynamicMessage};
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::contact_detector::Thresholds;
use crate::crop::Crop;
use crate::names::Names;
use crate::ros_args::Given;

/// All parameters.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// Address of the server.
    pub server: String,
    /// File with the token to call with; empty = PALPATE_TOKEN_FILE, then PALPATE_TOKEN.
    pub token_file: PathBuf,
    /// PEM file of the authority of the server's certificate, for https://; empty = PALPATE_CA, then the system's.
    pub ca: PathBuf,
    /// PEM files of a certificate to call with, and of its key; empty = none.
    pub certificate: PathBuf,
    /// See `certificate`.
    pub key: PathBuf,

    /// The session to drive; empty = a new one, named by the server.
    pub session_id: String,
    /// Whether a session that is missing is made at the start; otherwise the service `~/create` makes it.
    pub create_session: bool,
    /// Name for people of a session that is made.
    pub display_name: String,
    /// Experiment of a session that is made.
    pub experiment: String,
    /// Labels of a session that is made.
    pub labels: BTreeMap<String, String>,
    /// Configuration of a session that is made: `palpate.v1.SessionConfig`.
    pub config: Value,

    /// The session's frame: fixed, such as the robot's base.
    pub frame_id: String,
    /// The pad's frame in TF: origin at the centre of its face, z out of the pad.
    pub sensor_frame: String,
    /// The pad's name in `config.sensors`; empty = the only one.
    pub sensor_id: String,
    /// Who reports and asks.
    pub robot_id: String,
    /// How many candidates to publish.
    pub candidates: u32,
    /// Which cloud or depth image becomes the view of the object.
    pub prior: PriorPolicy,
    /// The camera's frame, where clouds come in another one; empty = that of the message. Its origin is the viewpoint.
    pub camera_frame: String,
    /// Edge of the voxels of which each gives one point of a view, in m; 0 = as they come.
    pub voxel_m: f64,
    /// The box that the object is in; what is outside of it is left out of views.
    pub crop: Crop,
    /// Whether a touch that the wrench shows belongs to the candidate that was published last.
    pub follow_candidates: bool,

    /// When a wrench is a touch.
    pub contact: Thresholds,
    /// The depth image's range.
    pub depth: DepthRange,
    /// How long transforms are kept and waited for.
    pub tf: TfLimits,

    /// Whether wrench, clouds and images are asked for again when they get lost; a driver that sends by best effort is then
    /// not heard.
    pub reliable_sensors: bool,
    /// Which RMW the other nodes use, which decides how services travel; empty = RMW_IMPLEMENTATION, then Fast DDS.
    pub rmw: String,
    /// How many reports are kept while the server is away.
    pub outbox_limit: usize,
    /// Accepted as every node has it; stamps come from the messages, so nothing depends on it.
    pub use_sim_time: bool,
}

/// Which cloud or depth image becomes the view of the object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PriorPolicy {
    /// The first that is accepted, and those after a call of `~/take_view`.
    First,
    /// The one after each call of `~/take_view`.
    Service,
}

/// Which depths are of interest, in metres along the optical axis; 0 = no bound.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DepthRange {
    /// Nearer pixels are dropped.
    pub min_m: f64,
    /// Farther pixels are dropped.
    pub max_m: f64,
}

/// How transforms are kept.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TfLimits {
    /// How long a transform is kept, in s.
    pub buffer_s: f64,
    /// Over how much time is interpolated, in s.
    pub max_gap_s: f64,
    /// How long a measurement waits for the transform at its stamp, in s.
    pub timeout_s: f64,
}

impl Default for TfLimits {
    fn default() -> Self {
        Self { buffer_s: 10.0, max_gap_s: 0.5, timeout_s: 1.0 }
    }
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            server: "http://127.0.0.1:7257".to_owned(),
            token_file: PathBuf::new(),
            ca: PathBuf::new(),
            certificate: PathBuf::new(),
            key: PathBuf::new(),
            session_id: String::new(),
            create_session: true,
            display_name: String::new(),
            experiment: String::new(),
            labels: BTreeMap::new(),
            config: Value::Object(Map::new()),
            frame_id: "base".to_owned(),
            sensor_frame: "pad".to_owned(),
            sensor_id: String::new(),
            robot_id: "ros2".to_owned(),
            candidates: 5,
            prior: PriorPolicy::First,
            camera_frame: String::new(),
            voxel_m: 0.0,
            crop: Crop::default(),
            follow_candidates: true,
            contact: Thresholds::default(),
            depth: DepthRange::default(),
            tf: TfLimits::default(),
            reliable_sensors: false,
            rmw: String::new(),
            outbox_limit: 1000,
            use_sim_time: false,
        }
    }
}

impl Parameters {
    /// Those of the node with these names, from files and values in their order.
    ///
    /// # Errors
    /// Names the file, the parameter and what is wrong with it.
    pub fn read(given: &[Given], names: &Names) -> Result<Self, String> {
        let mut values = Map::new();
        for given in given {
            match given {
                Given::File(path) => read_file(path, names, &mut values)?,
                Given::Value(name, yaml) => {
                    let (node, name) = name.split_once(':').unwrap_or(("", name));
                    if node.is_empty() || node == names.node {
                        let value = serde_saphyr::from_str(yaml)
                            .map_err(|error| format!("-p {name}:={yaml} is no YAML: {error}"))?;
                        merge(&mut values, name, value)?;
                    }
                }
            }
        }
        Self::from_values(Value::Object(values))
    }

    fn from_values(values: Value) -> Result<Self, String> {
        let parameters: Self = serde_path_to_error::deserialize(values)
            .map_err(|error| format!("parameter {}: {}", error.path(), error.inner()))?;
        parameters.checked()
    }

    fn checked(self) -> Result<Self, String> {
        let Self { tf, depth, outbox_limit, .. } = &self;
        let positive = [("tf.buffer_s", tf.buffer_s), ("tf.max_gap_s", tf.max_gap_s)];
        if let Some((name, value)) =
            positive.into_iter().find(|(_, value)| !(*value > 0.0 && *value < 3600.0))
        {
            return Err(format!("parameter {name} is {value}: give seconds above 0, below 3600"));
        }
        if !(0.0..=60.0).contains(&tf.timeout_s) {
            return Err(format!("parameter tf.timeout_s is {}: give 0 to 60 s", tf.timeout_s));
        }
        if !(depth.min_m >= 0.0 && depth.max_m >= 0.0 && depth.max_m.is_finite()) {
            return Err("parameters depth.min_m and depth.max_m are metres, 0 for no bound".to_owned());
        }
        if !(1..=100_000).contains(outbox_limit) {
            return Err(format!("parameter outbox_limit is {outbox_limit}: give 1 to 100000 reports"));
        }
        if self.frame_id.is_empty() || self.sensor_frame.is_empty() {
            return Err("parameters frame_id and sensor_frame need the names of frames in TF".to_owned());
        }
        if !(self.voxel_m >= 0.0 && self.voxel_m.is_finite()) {
            return Err(format!("parameter voxel_m is {}: give metres, 0 for none", self.voxel_m));
        }
        self.crop.problem().map_or(Ok(()), |problem| Err(format!("parameter {problem}")))?;
        self.contact.problem().map_or(Ok(()), |problem| Err(format!("parameter {problem}")))?;
        session_config(&self.config).map_err(|problem| format!("parameter config: {problem}"))?;
        Ok(self)
    }
}

/// A configuration of a session from its JSON form.
///
/// # Errors
/// Names what is not of `palpate.v1.SessionConfig`.
pub fn session_config(values: &Value) -> Result<v1::SessionConfig, String> {
    let contract =
        || DescriptorPool::decode(FILE_DESCRIPTOR_SET).ok()?.get_message_by_name("palpate.v1.SessionConfig");
    let descriptor = contract().ok_or("the contract's descriptors cannot be read, a fault of the build")?;
    let message = DynamicMessage::deserialize(descriptor, values)
        .map_err(|error| format!("{error}; it is written as palpate.v1.SessionConfig in JSON"))?;
    message.transcode_to().map_err(|error| error.to_string())
}

/// Adds what a file has for this node.
fn read_file(path: &Path, names: &Names, values: &mut Map<String, Value>) -> Result<(), String> {
    let shown = path.display();
    let text = std::fs::read_to_string(path).map_err(|error| format!("{shown} cannot be read: {error}"))?;
    let tree: Value =
        serde_saphyr::from_str(&text).map_err(|error| format!("{shown} is no YAML: {error}"))?;
    let mut found = Vec::new();
    sections(&tree, "", &mut found);
    if found.is_empty() {
        return Err(format!(
            "{shown} has no ros__parameters: write NODE:, below it ros__parameters:, below it the values"
        ));
    }
    let whole = format!("{}/{}", names.namespace.trim_end_matches('/'), names.node);
    for (pattern, section) in found.into_iter().filter(|(pattern, _)| matches(pattern, &whole)) {
        let Value::Object(section) = section else {
            return Err(format!("{shown}: ros__parameters of {pattern} is no table of names and values"));
        };
        for (name, value) in section {
            merge(values, name, value.clone()).map_err(|problem| format!("{shown}: {problem}"))?;
        }
    }
    Ok(())
}

/// All `ros__parameters` of a file, each with the pattern of the nodes that it is for.
fn sections<'a>(tree: &'a Value, under: &str, found: &mut Vec<(String, &'a Value)>) {
    for (name, below) in tree.as_object().into_iter().flatten() {
        if name == "ros__parameters" {
            found.push((under.to_owned(), below));
        } else {
            sections(below, &format!("{under}/{}", name.trim_matches('/')), found);
        }
    }
}

/// Whether a pattern such as `/**`, `/*/palpate` or `/palpate` is for a node.
fn matches(pattern: &str, node: &str) -> bool {
    fn fits(pattern: &[&str], name: &[&str]) -> bool {
        match (pattern, name) {
            ([], []) => true,
            (["**", rest @ ..], _) => (0..=name.len()).any(|from| fits(rest, &name[from..])),
            (["*", rest @ ..], [_, name @ ..]) => fits(rest, name),
            ([token, rest @ ..], [first, name @ ..]) => token == first && fits(rest, name),
            _ => false,
        }
    }
    fits(&tokens(pattern), &tokens(node))
}

fn tokens(name: &str) -> Vec<&str> {
    name.split('/').filter(|token| !token.is_empty()).collect()
}

/// Sets a value by its name with dots; tables are merged, everything else is replaced.
fn merge(values: &mut Map<String, Value>, name: &str, value: Value) -> Result<(), String> {
    let (first, rest) = match name.split_once('.') {
        Some((first, rest)) => (first, Some(rest)),
        None => (name, None),
    };
    if first.is_empty() {
        return Err(format!("{name:?} is no name of a parameter"));
    }
    let slot = values.entry(first).or_insert(Value::Null);
    match (rest, value) {
        (None, Value::Object(table)) => {
            let below = as_table(slot);
            table.into_iter().try_for_each(|(name, value)| merge(below, &name, value))
        }
        (None, value) => {
            *slot = value;
            Ok(())
        }
        (Some(rest), value) => merge(as_table(slot), rest, value),
    }
}

/// The table in a slot; what else was there is dropped.
fn as_table(slot: &mut Value) -> &mut Map<String, Value> {
    if !slot.is_object() {
        *slot = Value::Object(Map::new());
    }
    slot.as_object_mut().expect("it was made a table just now")
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn names() -> Names {
        Names { namespace: "/lab".to_owned(), node: "palpate".to_owned(), rules: Vec::new() }
    }

    fn read(yaml: &str, values: &[(&str, &str)]) -> Result<Parameters, String> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(yaml.as_bytes()).unwrap();
        let mut given = vec![Given::File(file.path().to_owned())];
        given.extend(values.iter().map(|(name, yaml)| Given::Value((*name).to_owned(), (*yaml).to_owned())));
        Parameters::read(&given, &names())
    }

    const FILE: &str = "
/**:
  ros__parameters:
    server: http://10.0.0.2:7257
    contact.threshold_n: 2
    contact:
      debounce_samples: 3
lab:
  palpate:
    ros__parameters:
      session_id: mug-1
      labels: {object: mug}
      config:
        method: METHOD_PAPER
        support: {normal: {z: 1}, offset_m: 0.06}
        sensors:
          - {id: pad, tool_from_sensor: {orientation: {w: 1}}, pad_half_side_m: 0.009}
/other/palpate:
  ros__parameters:
    server: http://no
";

    #[test]
    fn a_file_speaks_for_its_nodes_and_the_command_line_comes_after_it() {
        let parameters =
            read(FILE, &[("contact.release_n", "0.25"), ("config.support.offset_m", "0.07")]).unwrap();
        assert_eq!(parameters.server, "http://10.0.0.2:7257");
        assert_eq!(parameters.session_id, "mug-1");
        assert_eq!(parameters.labels["object"], "mug");
        let Thresholds { threshold_n, release_n, debounce_samples, .. } = parameters.contact;
        assert_eq!((threshold_n, release_n, debounce_samples), (2.0, 0.25, 3));
        let config = session_config(&parameters.config).unwrap();
        assert_eq!(config.method(), v1::Method::Paper);
        assert_eq!(config.support.unwrap().offset_m, 0.07);
        assert_eq!(config.sensors[0].pad_half_side_m, 0.009);
    }

    #[test]
    fn the_file_that_is_shipped_has_every_parameter_with_its_default() {
        let shipped = include_str!("../parameters.yaml");
        let names = Names { namespace: "/".to_owned(), ..names() };
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(shipped.as_bytes()).unwrap();
        let read = Parameters::read(&[Given::File(file.path().to_owned())], &names).unwrap();
        assert_eq!(session_config(&read.config).unwrap().sensors[0].pad_half_side_m, 0.009);
        let defaults = Parameters {
            session_id: "mug-1".to_owned(),
            config: read.config.clone(),
            ..Parameters::default()
        };
        assert_eq!(read, defaults);
        // Each name of the struct stands in the file.
        let shown = format!("{read:#?}");
        let fields = shown
            .lines()
            .filter_map(|line| line.strip_prefix("    ")?.split_once(": ").map(|(name, _)| name));
        for name in fields.filter(|name| !name.starts_with(' ')) {
            assert!(shipped.contains(&format!("    {name}:")), "{name} is not in parameters.yaml");
        }
    }

    #[test]
    fn what_is_no_parameter_is_refused_by_name() {
        let refused = |name: &str, yaml: &str| read(FILE, &[(name, yaml)]).unwrap_err();
        assert!(refused("sesion_id", "x").contains("sesion_id"));
        assert!(refused("contact.treshold_n", "1").contains("treshold_n"));
        assert!(refused("contact.threshold_n", "much").contains("contact.threshold_n"));
        assert!(refused("contact.release_n", "3").contains("contact.release_n"));
        assert!(refused("prior", "always").contains("prior"));
        assert!(refused("config.metod", "METHOD_PAPER").contains("metod"));
        assert!(refused("config.method", "PAPER").contains("config"));
        assert!(refused("tf.buffer_s", "-1").contains("tf.buffer_s"));
        assert!(read("palpate: {server: x}", &[]).unwrap_err().contains("ros__parameters"));
    }

    #[test]
    fn patterns_of_nodes_fit_as_in_rcl() {
        for fits in ["/**", "/**/palpate", "/lab/palpate", "/*/palpate", "/lab/*", "/lab/**"] {
            assert!(matches(fits, "/lab/palpate"), "{fits}");
        }
        for other in ["/palpate", "/*", "/lab", "/lab/palpate/x", "/**/other"] {
            assert!(!matches(other, "/lab/palpate"), "{other}");
        }
    }
}
