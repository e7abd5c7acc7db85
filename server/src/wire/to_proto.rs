//! From values to messages.

use nalgebra::{Rotation3, Translation3, UnitQuaternion};
use palpate_core::config::{Axes, DeclaredSymmetry, Method, Settings, StopRule, Strategy};
use palpate_core::evidence::Target;
use palpate_core::exploration::{self, KeepOut, Region};
use palpate_core::geometry::{Direction, Point, Pose, Vector};
use palpate_core::reconstruction::{ALGORITHM_VERSION, Stats, StopReason};
use palpate_proto::{Duration, Timestamp, v1};

use super::candidate_id::{self, CandidateId};
use crate::session::{Definition, Sensor, SessionState, Snapshot};

pub(crate) fn vector(vector: &Vector) -> v1::Vector3 {
    v1::Vector3 { x: vector.x, y: vector.y, z: vector.z }
}

pub(crate) fn point(point: &Point) -> v1::Vector3 {
    vector(&point.coords)
}

pub(crate) fn pose(pose: &Pose) -> v1::Pose {
    let (q, position) = (pose.rotation.coords, vector(&pose.translation.vector));
    v1::Pose {
        position: Some(position),
        orientation: Some(v1::Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }),
    }
}

/// A time in microseconds since 1970, UTC.
pub(crate) fn timestamp(us: i64) -> Timestamp {
    let nanos = i32::try_from(us.rem_euclid(1_000_000) * 1000).unwrap_or(0);
    Timestamp { seconds: us.div_euclid(1_000_000), nanos }
}

/// The session as callers see it.
pub(crate) fn session(snapshot: &Snapshot) -> v1::Session {
    let Definition {
        session_id,
        display_name,
        experiment,
        frame_id,
        labels,
        config: _,
        sensors: _,
        keep_out: _,
        created_us,
    } = &*snapshot.definition;
    v1::Session {
        session_id: session_id.clone(),
        display_name: display_name.clone(),
        experiment: experiment.clone(),
        frame_id: frame_id.clone(),
        labels: labels.clone(),
        config: Some(session_config(&snapshot.definition)),
        state: state(snapshot.state).into(),
        revision: snapshot.revision,
        etag: snapshot.etag(),
        stats: Some(stats(&snapshot.stats, snapshot.last_update)),
        create_time: Some(timestamp(*created_us)),
        update_time: Some(timestamp(snapshot.updated_us)),
        forked_from: String::new(),
        forked_at_revision: 0,
        algorithm_version: ALGORITHM_VERSION.to_owned(),
        should_stop: stop_reason(snapshot.should_stop).into(),
    }
}

/// The configuration with every default written out, so that it means the same in a later version.
pub(crate) fn session_config(definition: &Definition) -> v1::SessionConfig {
    let Definition { config, sensors, keep_out, .. } = definition;
    let Settings {
        method: used_method,
        strategy: used_strategy,
        alpha_geodesic,
        alpha_uncertainty,
        alpha_travel,
        confident_max,
        candidate_min,
        visual_uncertainty,
        tactile_u_max,
        propagation_hops,
        propagation_length_m,
        probe_half_travel_m,
        failure_distance_m,
        icosphere_subdivisions,
        seed,
        stop: StopRule { max_attempts, mean_uncertainty_below, max_consecutive_failures },
        symmetry: declared_symmetry,
        template_axes,
        // A session always has them all.
        stages: _,
    } = **config;
    v1::SessionConfig {
        method: method(used_method).into(),
        strategy: strategy(used_strategy).into(),
        alpha_geodesic: Some(alpha_geodesic),
        alpha_uncertainty,
        alpha_travel: Some(alpha_travel),
        confident_max: Some(confident_max),
        candidate_min: Some(candidate_min),
        visual_uncertainty: Some(visual_uncertainty),
        tactile_u_max: Some(tactile_u_max),
        propagation_hops: Some(propagation_hops),
        propagation_length_m: Some(propagation_length_m),
        probe_half_travel_m: Some(probe_half_travel_m),
        failure_distance_m: Some(failure_distance_m),
        icosphere_subdivisions: Some(icosphere_subdivisions),
        seed: Some(seed),
        sensors: sensors.iter().map(sensor).collect(),
        // A rule that is off is written as zero: unset would mean its default.
        stop: Some(v1::StopRule {
            max_attempts: max_attempts.or(Some(0)),
            mean_uncertainty_below: mean_uncertainty_below.or(Some(0.0)),
            max_consecutive_failures,
        }),
        symmetry: symmetry(declared_symmetry).into(),
        keep_out: keep_out.iter().map(region).collect(),
        template_axes: axes(template_axes).into(),
    }
}

fn region(keep_out: &KeepOut) -> v1::KeepOut {
    let shape = match *keep_out.region() {
        Region::HalfSpace { normal, offset_m } => {
            v1::keep_out::Shape::HalfSpace(v1::HalfSpace { normal: Some(vector(&normal)), offset_m })
        }
        Region::Ball { center, radius_m } => {
            v1::keep_out::Shape::Ball(v1::Ball { center: Some(point(&center)), radius_m })
        }
    };
    v1::KeepOut { shape: Some(shape) }
}

fn method(method: Method) -> v1::Method {
    match method {
        Method::Paper => v1::Method::Paper,
        Method::Palpate => v1::Method::Palpate,
        Method::Gpis => v1::Method::Gpis,
    }
}

fn symmetry(symmetry: Option<DeclaredSymmetry>) -> v1::Symmetry {
    match symmetry {
        None => v1::Symmetry::Unspecified,
        Some(DeclaredSymmetry::Revolution) => v1::Symmetry::Revolution,
        Some(DeclaredSymmetry::Mirror) => v1::Symmetry::Mirror,
    }
}

/// The frame's axes are the default, and the only choice of methods that refuse another.
fn axes(axes: Axes) -> v1::TemplateAxes {
    match axes {
        Axes::Frame => v1::TemplateAxes::Unspecified,
        Axes::Free => v1::TemplateAxes::Free,
    }
}

fn strategy(strategy: Strategy) -> v1::Strategy {
    match strategy {
        Strategy::Proactive => v1::Strategy::Proactive,
        Strategy::MinUncertainty => v1::Strategy::MinUncertainty,
        Strategy::Uniform => v1::Strategy::Uniform,
        Strategy::Random => v1::Strategy::Random,
        Strategy::ExpectedGain => v1::Strategy::ExpectedGain,
    }
}

fn sensor(sensor: &Sensor) -> v1::Sensor {
    let Sensor { id, tool_from_sensor, pad_half_side_m, contact_force_n } = sensor;
    v1::Sensor {
        id: id.clone(),
        tool_from_sensor: Some(pose(tool_from_sensor)),
        pad_half_side_m: *pad_half_side_m,
        contact_force_n: *contact_force_n,
    }
}

pub(crate) fn state(state: SessionState) -> v1::SessionState {
    match state {
        SessionState::AwaitingPrior => v1::SessionState::AwaitingPrior,
        SessionState::Active => v1::SessionState::Active,
        SessionState::Quarantined => v1::SessionState::Quarantined,
    }
}

pub(crate) fn stop_reason(reason: Option<StopReason>) -> v1::StopReason {
    match reason {
        None => v1::StopReason::Unspecified,
        Some(StopReason::Coverage) => v1::StopReason::Coverage,
        Some(StopReason::Budget) => v1::StopReason::Budget,
        Some(StopReason::NoAdmissibleCandidate) => v1::StopReason::NoAdmissibleCandidate,
        Some(StopReason::Stalled) => v1::StopReason::Stalled,
        Some(StopReason::Diverged) => v1::StopReason::Diverged,
    }
}

pub(crate) fn stats(stats: &Stats, last_update: std::time::Duration) -> v1::SessionStats {
    let &Stats {
        visual_points,
        contacts,
        no_contacts,
        rejected,
        early_contacts,
        invalid_contacts,
        failures,
        attempts,
        consecutive_failures,
        mean_uncertainty,
        max_uncertainty,
        fit_rms_m,
        template,
    } = stats;
    v1::SessionStats {
        visual_points,
        contacts,
        no_contacts,
        rejected,
        mean_uncertainty,
        max_uncertainty,
        fit_rms_m,
        template: template.to_owned(),
        last_update: Duration::try_from(last_update).ok(),
        early_contacts,
        invalid_contacts,
        failures,
        attempts,
        consecutive_failures,
    }
}

/// The candidates of a proposal made from `snapshot`.
pub(crate) fn candidates(snapshot: &Snapshot, candidates: &[exploration::Candidate]) -> Vec<v1::Candidate> {
    candidates.iter().map(|proposed| candidate(snapshot, proposed)).collect()
}

fn candidate(snapshot: &Snapshot, candidate: &exploration::Candidate) -> v1::Candidate {
    let exploration::Candidate {
        vertex,
        point: place,
        normal,
        probe_start,
        probe_end,
        score,
        terms,
        uncertainty,
        std_m,
        mean_geodesic_m,
        failure_risk,
        relaxed,
        why,
    } = candidate;
    // The core's points are finite and its normals of length one, so there is always a target.
    let id = Target::new(*place, normal.into_inner()).map(|target| {
        candidate_id::encode(&CandidateId { revision: snapshot.revision, vertex: *vertex, target })
    });
    let sensor = snapshot.definition.sensor("");
    v1::Candidate {
        candidate_id: id.unwrap_or_default(),
        vertex: *vertex,
        point: Some(point(place)),
        normal: Some(vector(normal)),
        probe_start: Some(point(probe_start)),
        probe_end: Some(point(probe_end)),
        score: *score,
        terms: terms.iter().map(score_term).collect(),
        uncertainty: *uncertainty,
        std_m: std_m.unwrap_or(0.0),
        mean_geodesic_m: *mean_geodesic_m,
        failure_risk: failure_risk.unwrap_or(0.0),
        tool_pose: sensor
            .as_ref()
            .map(|sensor| pose(&tool_pose(probe_start, normal, &sensor.tool_from_sensor))),
        sensor_id: sensor.map_or_else(String::new, |sensor| sensor.id),
        relaxed: *relaxed,
        why: why.clone(),
        lease_expire_time: None,
    }
}

/// `base_from_tool` with the pad's centre at `start` and its outward normal against `normal`.
///
/// The turn about the normal is free; it is the smallest one from the frame's z axis.
fn tool_pose(start: &Point, normal: &Direction, tool_from_sensor: &Pose) -> Pose {
    let pad = -normal.into_inner();
    let half_turn = || Rotation3::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI);
    let rotation = Rotation3::rotation_between(&Vector::z(), &pad).unwrap_or_else(half_turn);
    let base_from_sensor =
        Pose::from_parts(Translation3::from(start.coords), UnitQuaternion::from_rotation_matrix(&rotation));
    base_from_sensor * tool_from_sensor.inverse()
}

fn score_term(term: &exploration::ScoreTerm) -> v1::ScoreTerm {
    let &exploration::ScoreTerm { term, weight, value } = term;
    v1::ScoreTerm { term: term.to_owned(), weight, value }
}

pub(crate) fn excluded(excluded: &exploration::Excluded) -> v1::Excluded {
    let &exploration::Excluded { already_certain, no_confident_neighbour, keep_out, recently_failed } =
        excluded;
    v1::Excluded {
        already_certain,
        no_confident_neighbour,
        keep_out,
        leased: 0,
        recently_failed,
        unreachable: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tool_puts_the_pad_before_the_candidate_and_facing_it() {
        let tool_from_sensor = Pose::new(Vector::new(0.02, -0.01, 0.15), Vector::new(0.3, -0.2, 0.5));
        let start = Point::new(0.4, 0.1, 0.2);
        for normal in [Vector::z(), -Vector::z(), Vector::new(0.6, -0.64, 0.48)] {
            let normal = Direction::new_normalize(normal);
            let base_from_sensor = tool_pose(&start, &normal, &tool_from_sensor) * tool_from_sensor;
            assert!((base_from_sensor.translation.vector - start.coords).norm() < 1e-12);
            assert!((base_from_sensor.rotation * Vector::z() + normal.into_inner()).norm() < 1e-12);
        }
    }

    #[test]
    fn times_before_1970_have_positive_parts_of_a_second() {
        assert_eq!(timestamp(1_500_000), Timestamp { seconds: 1, nanos: 500_000_000 });
        assert_eq!(timestamp(-1), Timestamp { seconds: -1, nanos: 999_999_000 });
    }
}
