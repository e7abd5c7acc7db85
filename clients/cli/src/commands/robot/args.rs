//! Arguments that say what is explored and how, and the plan that they make.

use std::collections::BTreeMap;
use std::path::PathBuf;

use palpate_client::proto::v1::{
    CreateSessionRequest, Method, Pose, Quaternion, Sensor, SessionConfig, StopRule, Strategy, Symmetry,
    TemplateAxes, TouchedPoint, Vector3,
};
use palpate_server::Limits;
use palpate_simulator::body::Body;
use palpate_simulator::probe::Pad;
use palpate_simulator::robot::Plan;
use palpate_simulator::{mesh_file, shapes};

use super::names::{name_of, parser};
use super::sensors::SensorArgs;
use crate::failure::{Failure, wrong_usage};

/// What the robot explores.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Object")]
pub(in crate::commands) struct ObjectArgs {
    /// A generated object: bottle, box, can, pear, ball, mug, jar, l-shape, dumbbell, plate,
    /// strawberry, magnum, or superquadric-N for a random one from the seed N. An estimate has no holes and no
    /// hollows yet: a handle becomes a bulge.
    #[arg(long, value_name = "NAME", conflicts_with = "mesh")]
    pub(in crate::commands) object: Option<String>,

    /// A closed triangle mesh in metres: a .ply, .stl or .obj file.
    #[arg(long, value_name = "FILE")]
    pub(in crate::commands) mesh: Option<PathBuf>,

    /// Multiplies the coordinates of the mesh file: 0.001 for one in millimetres.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, requires = "mesh")]
    pub(in crate::commands) scale: f64,
}

impl ObjectArgs {
    /// The object and its name; the object called `default` when none is asked for.
    pub(in crate::commands) fn load(&self, default: &str) -> Result<(String, Body), Failure> {
        if let Some(path) = &self.mesh {
            let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            return Ok((name, mesh_file::read(path, self.scale)?));
        }
        let name = self.object.as_deref().unwrap_or(default).to_lowercase();
        let body = shapes::generate(&name)?;
        Ok((name, body))
    }
}

/// How one session explores.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Exploration")]
pub(in crate::commands) struct SessionArgs {
    /// How many times the robot tries to touch, failures included; a session takes at most 1000.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = attempts)]
    pub(in crate::commands) attempts: u32,

    /// How the next contact is chosen.
    #[arg(long, value_parser = parser::<Strategy>(), default_value = "proactive")]
    pub(in crate::commands) strategy: Strategy,

    /// Which method reconstructs; the server's best unless given.
    #[arg(long, value_parser = parser::<Method>())]
    pub(in crate::commands) method: Option<Method>,

    /// What is known of the object's symmetry beforehand; only the method `palpate` takes one.
    #[arg(long, value_parser = parser::<Symmetry>())]
    pub(in crate::commands) symmetry: Option<Symmetry>,

    /// The axes of the ellipsoid of the method `paper`, which alone takes this.
    #[arg(long, value_parser = parser::<TemplateAxes>())]
    pub(in crate::commands) template_axes: Option<TemplateAxes>,

    /// Decides the view, the offsets on the pad and all noise: the same seed gives the same run.
    #[arg(long, default_value_t = 1)]
    pub(in crate::commands) seed: u64,
}

impl SessionArgs {
    /// Refuses what the method would refuse, in the words of the flags and before anything is explored.
    pub(in crate::commands) fn check(&self) -> Result<(), Failure> {
        if self.template_axes == Some(TemplateAxes::Free) && self.method != Some(Method::Paper) {
            return Err(wrong_usage(
                "--template-axes free needs --method paper: the others turn their axes always",
            ));
        }
        if matches!(self.method, None | Some(Method::Unspecified | Method::Palpate)) {
            return Ok(());
        }
        if self.strategy == Strategy::ExpectedGain {
            return Err(wrong_usage(
                "--strategy expected_gain needs --method palpate: the other methods state no deviation that a gain \
                 could be expected from",
            ));
        }
        if self.symmetry.is_some() {
            return Err(wrong_usage("--symmetry needs --method palpate: the other methods know no symmetry"));
        }
        Ok(())
    }
}

/// As many attempts as a session takes results.
pub(in crate::commands) fn attempts(text: &str) -> Result<u32, String> {
    let most = Limits::default().contacts;
    match text.parse() {
        Ok(attempts) if (1..=most).contains(&attempts) => Ok(attempts),
        _ => Err(format!("must be between 1 and {most}, which is what a session takes")),
    }
}

/// The pad as the session is told of it. The paper's probe touches with its tip, whatever torque is simulated.
fn declared(pad: Pad) -> Sensor {
    let touched_point = match pad {
        Pad::Point => TouchedPoint::PadCenter,
        Pad::Flat => TouchedPoint::Unspecified,
    };
    Sensor {
        id: "pad".to_owned(),
        tool_from_sensor: Some(Pose {
            position: Some(Vector3::default()),
            orientation: Some(Quaternion { w: 1.0, ..Quaternion::default() }),
        }),
        touched_point: touched_point.into(),
        ..Sensor::default()
    }
}

/// What the robot sets out to do, its session labelled with what produced it.
pub(in crate::commands) fn plan(
    object: &str,
    experiment: &str,
    session: &SessionArgs,
    sensors: &SensorArgs,
) -> Plan {
    let mut labels = BTreeMap::from([
        ("object".to_owned(), object.to_owned()),
        ("strategy".to_owned(), name_of(session.strategy).to_owned()),
        ("seed".to_owned(), session.seed.to_string()),
    ]);
    if let Some(method) = session.method {
        labels.insert("method".to_owned(), name_of(method).to_owned());
    }
    if let Some(symmetry) = session.symmetry {
        labels.insert("symmetry".to_owned(), name_of(symmetry).to_owned());
    }
    Plan {
        session: CreateSessionRequest {
            display_name: object.to_owned(),
            experiment: experiment.to_owned(),
            frame_id: "object".to_owned(),
            labels,
            config: Some(SessionConfig {
                method: session.method.unwrap_or_default().into(),
                strategy: session.strategy.into(),
                symmetry: session.symmetry.unwrap_or_default().into(),
                template_axes: session.template_axes.unwrap_or_default().into(),
                seed: Some(session.seed),
                sensors: vec![declared(sensors.probe().pad)],
                stop: Some(StopRule { max_attempts: Some(session.attempts), ..StopRule::default() }),
                ..SessionConfig::default()
            }),
            ..CreateSessionRequest::default()
        },
        seed: session.seed,
        attempts: session.attempts,
        camera: sensors.camera(),
        probe: sensors.probe(),
        faults: sensors.faults.faults(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_caller_knows_is_declared_and_what_the_robot_measures_is_set() {
        #[derive(clap::Parser)]
        struct Program {
            #[command(flatten)]
            session: SessionArgs,
            #[command(flatten)]
            sensors: SensorArgs,
        }
        let planned = |args: &[&str]| {
            let program = <Program as clap::Parser>::try_parse_from([&["palpate"], args].concat());
            program.map(|Program { session, sensors }| plan("can", "test", &session, &sensors))
        };
        let known = planned(&["--symmetry", "revolution", "--measured-normals"]).unwrap();
        assert_eq!(known.session.config.unwrap().symmetry(), Symmetry::Revolution);
        assert_eq!(known.session.labels["symmetry"], "revolution");
        assert!(known.probe.measures_normals);
        assert!((known.probe.normal_noise_rad - 5.0_f64.to_radians()).abs() < 1e-15);
        let exact = planned(&["--measured-normals", "--normal-noise-deg", "0"]).unwrap();
        assert_eq!(exact.probe.normal_noise_rad, 0.0);
        let nothing = planned(&[]).unwrap();
        assert_eq!(nothing.session.config.unwrap().symmetry(), Symmetry::Unspecified);
        assert!(!nothing.probe.measures_normals && !nothing.session.labels.contains_key("symmetry"));
        let alone = planned(&["--normal-noise-deg", "3"]).unwrap_err().to_string();
        assert!(alone.contains("--measured-normals"), "{alone}");
    }

    #[test]
    fn the_help_names_every_generated_object() {
        #[derive(clap::Parser)]
        struct Program {
            #[command(flatten)]
            object: ObjectArgs,
        }
        let help = <Program as clap::CommandFactory>::command().render_long_help().to_string();
        for object in shapes::OBJECTS {
            assert!(help.contains(object.name), "{}", object.name);
        }
        let program = <Program as clap::Parser>::parse_from(["palpate"]);
        assert_eq!(program.object.load("can").unwrap().0, "can");
        let program = <Program as clap::Parser>::parse_from(["palpate", "--object", "L-Shape"]);
        assert_eq!(program.object.load("can").unwrap().0, "l-shape", "whatever its case");
    }

    #[test]
    fn more_attempts_than_a_session_takes_are_refused_before_the_first() {
        assert_eq!(attempts("1000"), Ok(1000));
        for wrong in ["1001", "0", "-1", "many"] {
            assert!(attempts(wrong).unwrap_err().contains("between 1 and 1000"), "{wrong}");
        }
    }

    #[test]
    fn what_the_papers_method_has_not_is_refused_in_the_words_of_the_flags() {
        let session = SessionArgs {
            attempts: 50,
            strategy: Strategy::Proactive,
            method: Some(Method::Paper),
            symmetry: None,
            template_axes: None,
            seed: 1,
        };
        session.check().unwrap();
        let gain = SessionArgs { strategy: Strategy::ExpectedGain, ..session.clone() };
        let refusal = gain.check().unwrap_err().to_string();
        assert!(refusal.contains("--strategy expected_gain needs --method palpate"), "{refusal}");
        SessionArgs { method: None, ..gain }.check().unwrap();
        let askew = SessionArgs { template_axes: Some(TemplateAxes::Free), ..session.clone() };
        askew.check().unwrap();
        let refusal = SessionArgs { method: None, ..askew }.check().unwrap_err().to_string();
        assert!(refusal.contains("--template-axes free needs --method paper"), "{refusal}");
        let mirrored = SessionArgs { symmetry: Some(Symmetry::Mirror), ..session };
        assert!(mirrored.check().unwrap_err().to_string().contains("--symmetry needs --method palpate"));
    }
}
