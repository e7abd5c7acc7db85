//! The configuration of a session; what is not set takes the method's default.

use palpate_core::config::{Axes, Config, DeclaredSymmetry, Method, Settings, StopRule, Strategy};
use palpate_proto::v1;

use super::geometry::pose;
use super::{at, check_text, non_finite};
use crate::error::Error;
use crate::limits::Limits;
use crate::session::{DEFAULT_PAD_HALF_SIDE_M, Sensor};

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

fn sensors(declared: &[v1::Sensor], limits: &Limits) -> Result<Vec<Sensor>, Error> {
    if declared.len() > 1 {
        return Err(Error::unimplemented("config.sensors with more than one pad"));
    }
    declared.iter().enumerate().map(|(index, declared)| sensor(index, declared, limits)).collect()
}

fn sensor(index: usize, declared: &v1::Sensor, limits: &Limits) -> Result<Sensor, Error> {
    let v1::Sensor { id, tool_from_sensor, pad_half_side_m, contact_force_n } = declared;
    let field = |name: &str| format!("config.sensors[{index}].{name}");
    if id.is_empty() {
        return Err(Error::field(field("id"), "is missing: contacts name their pad by it"));
    }
    check_text(&field("id"), id, limits.name_bytes)?;
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
    Ok(Sensor {
        id: id.clone(),
        tool_from_sensor: pose(&field("tool_from_sensor"), tool_from_sensor.as_ref())?,
        pad_half_side_m: positive("pad_half_side_m", pad_half_side_m, 1.0, "m")?,
        contact_force_n: contact_force_n
            .map(|force_n| positive("contact_force_n", force_n, 1e4, "N"))
            .transpose()?,
    })
}
