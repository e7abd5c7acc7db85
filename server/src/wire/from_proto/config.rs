//! The configuration of a session; what is not set takes the method's default.

use palpate_core::config::{Axes, Config, DeclaredSymmetry, Method, Settings, StopRule, Strategy};
use palpate_core::evidence::{Pad, TouchedPoint};
use palpate_core::exploration::Region;
use palpate_core::geometry::Plane;
use palpate_proto::v1;

use super::geometry::pose;
use super::robot::half_space;
use super::{at, check_name, non_finite};
use crate::error::Error;
use crate::limits::Limits;
use crate::session::{DEFAULT_PAD_HALF_SIDE_M, Sensor};
use crate::text::quoted;

/// # Errors
/// A value out of its range, or a field that this version has no use for.
pub(super) fn config(config: &v1::SessionConfig, limits: &Limits) -> Result<(Config, Vec<Sensor>), Error> {
    let &v1::SessionConfig {
        method: wanted_method,
        strategy: wanted_strategy,
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
        sensors: ref declared_sensors,
        stop: ref stop_rule,
        symmetry: declared_symmetry,
        template_axes,
        // The session's definition keeps them: the method does not know them.
        keep_out: _,
        support: ref support_plane,
        on_motion: wanted_on_motion,
        plausible_size: _,
        shadow: _,
    } = config;
    let default = Settings::default();
    let method = method(wanted_method)?;
    let settings = Settings {
        method,
        strategy: strategy(wanted_strategy)?.unwrap_or(method.own_strategy()),
        alpha_geodesic: alpha_geodesic.unwrap_or(default.alpha_geodesic),
        alpha_uncertainty,
        alpha_travel: alpha_travel.unwrap_or(default.alpha_travel),
        confident_max: confident_max.unwrap_or(default.confident_max),
        candidate_min: candidate_min.unwrap_or(default.candidate_min),
        visual_uncertainty: visual_uncertainty.unwrap_or(default.visual_uncertainty),
        tactile_u_max: tactile_u_max.unwrap_or(default.tactile_u_max),
        propagation_hops: propagation_hops.unwrap_or(default.propagation_hops),
        propagation_length_m: propagation_length_m.unwrap_or(default.propagation_length_m),
        probe_half_travel_m: probe_half_travel_m.unwrap_or(default.probe_half_travel_m),
        failure_distance_m: failure_distance_m.unwrap_or(default.failure_distance_m),
        icosphere_subdivisions: icosphere_subdivisions.unwrap_or(default.icosphere_subdivisions),
        seed: seed.unwrap_or(default.seed),
        stop: stop(stop_rule.as_ref(), method),
        symmetry: symmetry(declared_symmetry)?,
        template_axes: axes(template_axes)?,
        support: support(support_plane.as_ref())?,
        follows_motion: follows_motion(wanted_on_motion)?,
        stages: default.stages,
    };
    let config = Config::new(settings).map_err(|error| at("config", error))?;
    Ok((config, sensors(declared_sensors, limits)?))
}

fn method(value: i32) -> Result<Method, Error> {
    match v1::Method::try_from(value) {
        Ok(v1::Method::Unspecified) => Ok(Method::default()),
        Ok(v1::Method::Paper) => Ok(Method::Paper),
        Ok(v1::Method::Palpate) => Ok(Method::Palpate),
        Ok(v1::Method::Gpis) => Ok(Method::Gpis),
        Err(_) => Err(Error::field("config.method", format!("{value} is no method"))),
    }
}

/// Nothing for the method's own.
fn strategy(value: i32) -> Result<Option<Strategy>, Error> {
    match v1::Strategy::try_from(value) {
        Ok(v1::Strategy::Unspecified) => Ok(None),
        Ok(v1::Strategy::Proactive) => Ok(Some(Strategy::Proactive)),
        Ok(v1::Strategy::MinUncertainty) => Ok(Some(Strategy::MinUncertainty)),
        Ok(v1::Strategy::Uniform) => Ok(Some(Strategy::Uniform)),
        Ok(v1::Strategy::Random) => Ok(Some(Strategy::Random)),
        Ok(v1::Strategy::ExpectedGain) => Ok(Some(Strategy::ExpectedGain)),
        Err(_) => Err(Error::field("config.strategy", format!("{value} is no strategy"))),
    }
}

fn stop(rule: Option<&v1::StopRule>, method: Method) -> StopRule {
    let default = method.own_stop_rule();
    let Some(&v1::StopRule { max_attempts, mean_uncertainty_below, max_consecutive_failures }) = rule else {
        return default;
    };
    // Zero switches a rule off.
    let unless_zero = |count: &u32| *count > 0;
    StopRule {
        max_attempts: max_attempts.or(default.max_attempts).filter(unless_zero),
        mean_uncertainty_below: mean_uncertainty_below
            .or(default.mean_uncertainty_below)
            .filter(|below| *below != 0.0),
        max_consecutive_failures,
    }
}

/// The strategies that are asked beside the session's own.
///
/// # Errors
/// Too many, one that is named twice, or one that the method refuses.
pub(super) fn shadow(values: &[i32], config: &Config, limits: &Limits) -> Result<Vec<Strategy>, Error> {
    if values.len() > limits.shadow {
        let description = format!("{} strategies are more than the limit of {}", values.len(), limits.shadow);
        return Err(Error::field("config.shadow", description));
    }
    let mut shadow = Vec::new();
    for (index, &value) in values.iter().enumerate() {
        let field = format!("config.shadow[{index}]");
        let named = strategy(value).ok().flatten();
        let named = named.ok_or_else(|| Error::field(&field, format!("{value} is no strategy")))?;
        if named == config.strategy || shadow.contains(&named) {
            let description = "is asked already: name each strategy once, and not the session's own";
            return Err(Error::field(field, description));
        }
        config.with_strategy(named).map_err(|refusal| Error::field(field, refusal.reason))?;
        shadow.push(named);
    }
    Ok(shadow)
}

fn symmetry(value: i32) -> Result<Option<DeclaredSymmetry>, Error> {
    match v1::Symmetry::try_from(value) {
        Ok(v1::Symmetry::Unspecified) => Ok(None),
        Ok(v1::Symmetry::Revolution) => Ok(Some(DeclaredSymmetry::Revolution)),
        Ok(v1::Symmetry::Mirror) => Ok(Some(DeclaredSymmetry::Mirror)),
        Err(_) => Err(Error::field("config.symmetry", format!("{value} is no symmetry"))),
    }
}

fn axes(value: i32) -> Result<Axes, Error> {
    match v1::TemplateAxes::try_from(value) {
        Ok(v1::TemplateAxes::Unspecified | v1::TemplateAxes::Frame) => Ok(Axes::Frame),
        Ok(v1::TemplateAxes::Free) => Ok(Axes::Free),
        Err(_) => Err(Error::field("config.template_axes", format!("{value} is no choice of axes"))),
    }
}

fn support(plane: Option<&v1::HalfSpace>) -> Result<Option<Plane>, Error> {
    let Some(plane) = plane else { return Ok(None) };
    match *half_space("config.support", plane)?.region() {
        Region::HalfSpace { normal, offset_m } => Ok(Some(Plane::new(normal, offset_m))),
        Region::Ball { .. } => Ok(None),
    }
}

fn follows_motion(value: i32) -> Result<bool, Error> {
    match v1::OnMotion::try_from(value) {
        Ok(v1::OnMotion::Unspecified | v1::OnMotion::Follow) => Ok(true),
        Ok(v1::OnMotion::Warn) => Ok(false),
        Err(_) => Err(Error::field("config.on_motion", format!("{value} is nothing that can be done"))),
    }
}

fn sensors(declared: &[v1::Sensor], limits: &Limits) -> Result<Vec<Sensor>, Error> {
    if declared.len() > limits.pads {
        let description = format!("{} pads are more than the limit of {}", declared.len(), limits.pads);
        return Err(Error::field("config.sensors", description));
    }
    for (index, sensor) in declared.iter().enumerate() {
        check_name(&format!("config.sensors[{index}].id"), &sensor.id, limits)?;
        if declared[..index].iter().any(|earlier| earlier.id == sensor.id && !sensor.id.is_empty()) {
            let description =
                format!("{} is declared twice: contacts name their pad by it", quoted(&sensor.id));
            return Err(Error::field(format!("config.sensors[{index}].id"), description));
        }
    }
    declared.iter().enumerate().map(|(index, declared)| sensor(index, declared)).collect()
}

fn sensor(index: usize, declared: &v1::Sensor) -> Result<Sensor, Error> {
    let v1::Sensor {
        id,
        tool_from_sensor,
        pad_half_side_m,
        contact_force_n,
        force_noise_n,
        torque_noise_nm,
        touched_point,
    } = declared;
    let field = |name: &str| format!("config.sensors[{index}].{name}");
    if id.is_empty() {
        return Err(Error::field(field("id"), "is missing: contacts name their pad by it"));
    }
    let positive = |name: &str, value: f64, most: f64, unit: &str| {
        if !value.is_finite() {
            return Err(non_finite(field(name), format!("{value} is not finite")));
        }
        if value > 0.0 && value <= most {
            return Ok(value);
        }
        Err(Error::field(field(name), format!("{value} {unit} is not above 0 and at most {most} {unit}")))
    };
    // In proto3 an unset number is zero, and no pad has that size.
    let pad_half_side_m = if *pad_half_side_m == 0.0 { DEFAULT_PAD_HALF_SIDE_M } else { *pad_half_side_m };
    let touched = match v1::TouchedPoint::try_from(*touched_point) {
        Ok(v1::TouchedPoint::Unspecified) => TouchedPoint::Open,
        Ok(v1::TouchedPoint::PadCenter) => TouchedPoint::PadCentre,
        Ok(v1::TouchedPoint::CenterOfPressure) => TouchedPoint::CentreOfPressure,
        Err(_) => {
            return Err(Error::field(field("touched_point"), format!("{touched_point} is no such point")));
        }
    };
    let refused = |error| at(&format!("config.sensors[{index}]"), error);
    let pad = Pad::new(positive("pad_half_side_m", pad_half_side_m, 1.0, "m")?).map_err(refused)?;
    let force_noise_n = force_noise_n.unwrap_or(pad.force_noise_n());
    let torque_noise_nm = torque_noise_nm.unwrap_or(pad.torque_noise_nm());
    let pad = pad.with_noise(force_noise_n, torque_noise_nm).map_err(refused)?.touching_with(touched);
    Ok(Sensor {
        id: id.clone(),
        tool_from_sensor: pose(&field("tool_from_sensor"), tool_from_sensor.as_ref())?,
        pad,
        contact_force_n: contact_force_n
            .map(|force_n| positive("contact_force_n", force_n, 1e4, "N"))
            .transpose()?,
    })
}
