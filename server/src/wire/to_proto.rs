//! From values to messages.

use palpate_core::config::{Axes, DeclaredSymmetry, Method, Settings, StopRule, Strategy};
use palpate_core::evidence::{Target, TouchedPoint};
use palpate_core::exploration::{self, Approach, Exclusion, KeepOut, Region};
use palpate_core::geometry::{Plane, Point, Pose, Vector};
use palpate_core::reconstruction::{self, Stats, StopReason};
use palpate_core::warning::{Warning, WarningKind};
use palpate_proto::{Bytes, Duration, Timestamp, v1};

use super::candidate_id::{self, CandidateId};
use crate::session::{Definition, Doubted, PlausibleSize, Sensor, SessionState, SetAside, Snapshot};

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

/// A length of time in microseconds, which is not negative.
pub(crate) fn duration(us: i64) -> Duration {
    let Timestamp { seconds, nanos } = timestamp(us);
    Duration { seconds, nanos }
}

/// A plane as a half space, the allowed side being that of its normal.
pub(crate) fn half_space(plane: &Plane) -> v1::HalfSpace {
    v1::HalfSpace { normal: Some(vector(plane.normal())), offset_m: plane.offset_m() }
}

/// Points as packed little-endian 32-bit floats.
pub(crate) fn points_f32(points: &[Point]) -> Bytes {
    points
        .iter()
        .flat_map(|point| point.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect::<Vec<_>>())
        .collect()
}

/// How touched points were found; unspecified where there are none.
pub(crate) fn touched_point(touched: TouchedPoint, is_none: bool) -> v1::TouchedPoint {
    match touched {
        _ if is_none => v1::TouchedPoint::Unspecified,
        TouchedPoint::Open => v1::TouchedPoint::Unspecified,
        TouchedPoint::PadCentre => v1::TouchedPoint::PadCenter,
        TouchedPoint::CentreOfPressure => v1::TouchedPoint::CenterOfPressure,
    }
}

/// The touches that contradict what else is known at a revision.
pub(crate) fn doubted(doubted: &[Doubted]) -> Vec<v1::DoubtedContact> {
    let message = |Doubted { seq, point: at, doubt }: &Doubted| v1::DoubtedContact {
        seq: *seq,
        point: Some(point(&Point::from(*at))),
        doubt: *doubt,
    };
    doubted.iter().map(message).collect()
}

/// Warnings with their kinds and numbers.
pub(crate) fn warnings(warnings: &[Warning]) -> Vec<v1::Warning> {
    let message = |Warning { kind, message, parameters }: &Warning| v1::Warning {
        code: warning_code(*kind).into(),
        message: message.clone(),
        parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
    };
    warnings.iter().map(message).collect()
}

/// The sentences of warnings.
pub(crate) fn warning_texts(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(|warning| warning.message.clone()).collect()
}

fn warning_code(kind: WarningKind) -> v1::WarningCode {
    match kind {
        WarningKind::NoViewpoint => v1::WarningCode::NoViewpoint,
        WarningKind::EarlyContact => v1::WarningCode::EarlyContact,
        WarningKind::NormalIgnored => v1::WarningCode::NormalIgnored,
        WarningKind::ZeroWrench => v1::WarningCode::ZeroWrench,
        WarningKind::PullingForce => v1::WarningCode::PullingForce,
        WarningKind::WrenchFrame => v1::WarningCode::WrenchFrame,
        WarningKind::TorqueTooLarge => v1::WarningCode::TorqueTooLarge,
        WarningKind::TouchedByHousing => v1::WarningCode::TouchedByHousing,
        WarningKind::TareDrift => v1::WarningCode::TareDrift,
        WarningKind::QuaternionOrder => v1::WarningCode::QuaternionOrder,
        WarningKind::CandidateOfAnotherSession => v1::WarningCode::CandidateOfAnotherSession,
        WarningKind::DoubtedContact => v1::WarningCode::DoubtedContact,
        WarningKind::ObjectMoved => v1::WarningCode::ObjectMoved,
        WarningKind::CameraOffset => v1::WarningCode::CameraOffset,
        WarningKind::NonFinitePoints => v1::WarningCode::NonFinitePoints,
        WarningKind::SupportPoints => v1::WarningCode::SupportPoints,
        WarningKind::IsolatedPoints => v1::WarningCode::IsolatedPoints,
        WarningKind::RepeatedPoints => v1::WarningCode::RepeatedPoints,
        WarningKind::ImplausibleSize => v1::WarningCode::ImplausibleSize,
        WarningKind::NothingNew => v1::WarningCode::NothingNew,
        WarningKind::NoTable => v1::WarningCode::NoTable,
        WarningKind::FarContact => v1::WarningCode::FarContact,
        WarningKind::WeakContact => v1::WarningCode::WeakContact,
        WarningKind::LongSweep => v1::WarningCode::LongSweep,
    }
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
        plausible_size: _,
        shadow: _,
        ancestors,
        created_us,
    } = &*snapshot.definition;
    let origin = ancestors.first();
    v1::Session {
        session_id: session_id.clone(),
        display_name: display_name.clone(),
        experiment: experiment.clone(),
        frame_id: frame_id.clone(),
        labels: labels.clone(),
        config: Some(session_config(&snapshot.definition)),
        state: state(snapshot.state).into(),
        revision: snapshot.revision,
        quarantine: snapshot.set_aside.as_ref().map(|SetAside { reason, head }| v1::Quarantine {
            reason: reason.clone(),
            sound_revision: snapshot.revision,
            head: *head,
        }),
        etag: snapshot.etag(),
        stats: Some(stats(snapshot)),
        create_time: Some(timestamp(*created_us)),
        // The events of a fork keep the times at which they happened in the session that it was forked from.
        update_time: Some(timestamp(snapshot.updated_us.max(*created_us))),
        forked_from: origin.map(|origin| origin.session_id.clone()).unwrap_or_default(),
        forked_at_revision: origin.map_or(0, |origin| origin.revision),
        algorithm_version: reconstruction::version().to_owned(),
        should_stop: stop_reason(snapshot.should_stop).into(),
        finish_note: snapshot.finish_note.clone(),
        retracted_seqs: snapshot.retracted.clone(),
    }
}

/// The configuration with every default written out, so that it means the same in a later version.
pub(crate) fn session_config(definition: &Definition) -> v1::SessionConfig {
    let Definition { config, sensors, keep_out, plausible_size, shadow, .. } = definition;
    let PlausibleSize { min_m, max_m, refuse_above_m } = *plausible_size;
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
        support,
        follows_motion,
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
        support: support.as_ref().map(half_space),
        on_motion: if follows_motion { v1::OnMotion::Follow } else { v1::OnMotion::Warn }.into(),
        plausible_size: Some(v1::PlausibleSize {
            min_m: Some(min_m),
            max_m: Some(max_m),
            refuse_above_m: Some(refuse_above_m),
        }),
        shadow: shadow.iter().map(|&shadow| strategy(shadow).into()).collect(),
    }
}

/// What the session's own strategy and its shadows would touch next; nothing without shadows or without an estimate.
pub(crate) fn shadow_choices(snapshot: &Snapshot) -> Vec<v1::ShadowChoice> {
    let Definition { shadow, config, .. } = &*snapshot.definition;
    if shadow.is_empty() || snapshot.reconstruction.last_estimate().is_none() {
        return Vec::new();
    }
    let choice = |&chosen: &Strategy| v1::ShadowChoice {
        strategy: strategy(chosen).into(),
        candidate: snapshot.choice_of(chosen).and_then(|found| candidates(snapshot, &[found]).pop()),
        hindsight: v1::Hindsight::Unspecified.into(),
    };
    std::iter::once(&config.strategy).chain(shadow).map(choice).collect()
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
    let Sensor { id, tool_from_sensor, contact_force_n, pad } = sensor;
    v1::Sensor {
        force_noise_n: Some(pad.force_noise_n()),
        torque_noise_nm: Some(pad.torque_noise_nm()),
        touched_point: touched_point(pad.touched(), false).into(),
        id: id.clone(),
        tool_from_sensor: Some(pose(tool_from_sensor)),
        pad_half_side_m: pad.half_side_m(),
        contact_force_n: *contact_force_n,
    }
}

pub(crate) fn state(state: SessionState) -> v1::SessionState {
    match state {
        SessionState::AwaitingPrior => v1::SessionState::AwaitingPrior,
        SessionState::Active => v1::SessionState::Active,
        SessionState::Finished => v1::SessionState::Finished,
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
        Some(StopReason::Moved) => v1::StopReason::Moved,
    }
}

pub(crate) fn stats(snapshot: &Snapshot) -> v1::SessionStats {
    let Snapshot { stats, findings, last_update, .. } = snapshot;
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
        mean_std_m,
        max_std_m,
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
        last_update: Duration::try_from(*last_update).ok(),
        early_contacts,
        invalid_contacts,
        failures,
        attempts,
        consecutive_failures,
        doubted_seqs: findings.doubted.iter().map(|found| snapshot.seq_of(found.at)).collect(),
        doubted_points: findings.doubted_points as u32,
        camera_offsets: findings
            .offsets
            .iter()
            .map(|found| v1::CameraOffset {
                seq: snapshot.seq_of(found.at),
                translation_m: Some(vector(&found.translation_m)),
                std_m: found.std_m,
                rotation_rad: Some(vector(&found.rotation)),
                rotation_std_rad: found.rotation_std,
            })
            .collect(),
        motion: findings.motion.map(|found| v1::ObjectMotion {
            since_seq: snapshot.seq_of(found.since),
            translation_m: Some(vector(&found.translation_m)),
            std_m: found.std_m,
            followed: found.is_followed,
        }),
        mean_std_m,
        max_std_m,
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
        approach: Approach { pad, base_from_tool },
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
        candidate_id::encode(&CandidateId {
            revision: snapshot.revision,
            vertex: *vertex,
            target,
            session: Some(snapshot.definition.tag()),
        })
    });
    let sensor = snapshot.definition.sensors.get(*pad);
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
        tool_pose: Some(pose(base_from_tool)),
        sensor_id: sensor.map_or_else(String::new, |sensor| sensor.id.clone()),
        relaxed: *relaxed,
        why: why.clone(),
        lease_expire_time: None,
    }
}

fn score_term(term: &exploration::ScoreTerm) -> v1::ScoreTerm {
    let &exploration::ScoreTerm { term, weight, value } = term;
    v1::ScoreTerm { term: term.to_owned(), weight, value }
}

pub(crate) fn explained(explained: &exploration::Explained) -> v1::ExplainedVertex {
    let exploration::Explained {
        vertex,
        score,
        terms,
        uncertainty,
        std_m,
        mean_geodesic_m,
        failure_risk,
        excluded,
    } = explained;
    v1::ExplainedVertex {
        vertex: *vertex,
        score: *score,
        terms: terms.iter().map(score_term).collect(),
        uncertainty: *uncertainty,
        std_m: std_m.unwrap_or(0.0),
        mean_geodesic_m: *mean_geodesic_m,
        failure_risk: failure_risk.unwrap_or(0.0),
        excluded: exclusion(*excluded).into(),
    }
}

fn exclusion(exclusion: Option<Exclusion>) -> v1::Exclusion {
    match exclusion {
        None => v1::Exclusion::Unspecified,
        Some(Exclusion::AlreadyCertain) => v1::Exclusion::AlreadyCertain,
        Some(Exclusion::NoConfidentNeighbour) => v1::Exclusion::NoConfidentNeighbour,
        Some(Exclusion::KeepOut) => v1::Exclusion::KeepOut,
        Some(Exclusion::RecentlyFailed) => v1::Exclusion::RecentlyFailed,
        Some(Exclusion::Unreachable) => v1::Exclusion::Unreachable,
        Some(Exclusion::Leased) => v1::Exclusion::Leased,
        Some(Exclusion::NotCompared) => v1::Exclusion::NotCompared,
    }
}

pub(crate) fn excluded(excluded: &exploration::Excluded) -> v1::Excluded {
    let &exploration::Excluded {
        already_certain,
        no_confident_neighbour,
        keep_out,
        recently_failed,
        unreachable,
        leased,
    } = excluded;
    v1::Excluded { already_certain, no_confident_neighbour, keep_out, leased, recently_failed, unreachable }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_before_1970_have_positive_parts_of_a_second() {
        assert_eq!(timestamp(1_500_000), Timestamp { seconds: 1, nanos: 500_000_000 });
        assert_eq!(timestamp(-1), Timestamp { seconds: -1, nanos: 999_999_000 });
    }
}
