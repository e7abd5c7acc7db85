//! Who asks for candidates, and what it must keep away from.

use palpate_core::exploration::{KeepOut, ProposalRequest};
use palpate_core::geometry::Direction;
use palpate_proto::v1;

use super::geometry::{point, pose, vector};
use super::{check_text, non_finite};
use crate::error::Error;
use crate::limits::Limits;

/// How far a normal's length may be from one: `offset_m` is a distance only along a unit normal.
const NORMAL_TOLERANCE: f64 = 1e-3;

/// A question for `top_k` candidates; `top_k_field` and `robot_field` are where the caller wrote them.
///
/// # Errors
/// More candidates or regions than the limits allow, or a region that is none.
pub(crate) fn exploration_request(
    top_k_field: &str,
    top_k: u32,
    robot_field: &str,
    robot: Option<&v1::RobotContext>,
    limits: &Limits,
) -> Result<ProposalRequest, Error> {
    if top_k > limits.top_k {
        let description = format!("{top_k} candidates are more than the limit of {}", limits.top_k);
        return Err(Error::field(top_k_field, description));
    }
    let Some(v1::RobotContext { robot_id, tool_pose, keep_out: regions }) = robot else {
        return Ok(ProposalRequest { top_k: top_k as usize, ..ProposalRequest::default() });
    };
    check_text(&format!("{robot_field}.robot_id"), robot_id, limits.name_bytes)?;
    let tool_field = format!("{robot_field}.tool_pose");
    let tool_pose = tool_pose.as_ref().map(|tool| pose(&tool_field, Some(tool))).transpose()?;
    if regions.len() > limits.keep_out {
        let description = format!("{} regions are more than the limit of {}", regions.len(), limits.keep_out);
        return Err(Error::field(format!("{robot_field}.keep_out"), description));
    }
    let regions = regions.iter().enumerate();
    let keep_out = regions
        .map(|(index, region)| keep_out(&format!("{robot_field}.keep_out[{index}]"), region))
        .collect::<Result<_, _>>()?;
    Ok(ProposalRequest {
        top_k: top_k as usize,
        keep_out,
        tool: tool_pose.map(|tool| tool.translation.vector.into()),
    })
}

fn keep_out(path: &str, region: &v1::KeepOut) -> Result<KeepOut, Error> {
    let v1::KeepOut { shape } = region;
    let field = |name: &str| format!("{path}.{name}");
    match shape {
        None => Err(Error::field(field("shape"), "is missing: give a half_space or a ball")),
        Some(v1::keep_out::Shape::HalfSpace(v1::HalfSpace { normal, offset_m })) => {
            let normal_field = field("half_space.normal");
            let (normal, length) = Direction::new_and_get(vector(&normal_field, normal.as_ref())?);
            if length.is_nan() || (length - 1.0).abs() > NORMAL_TOLERANCE {
                let description = format!("has length {length:.4} and must be normalised to 1");
                return Err(Error::field(normal_field, description));
            }
            let offset_m = finite(&field("half_space.offset_m"), *offset_m)?;
            Ok(KeepOut::HalfSpace { normal, offset_m })
        }
        Some(v1::keep_out::Shape::Ball(v1::Ball { center, radius_m })) => {
            let center = point(&field("ball.center"), center.as_ref())?;
            let radius_field = field("ball.radius_m");
            let radius_m = finite(&radius_field, *radius_m)?;
            if radius_m <= 0.0 {
                return Err(Error::field(radius_field, format!("{radius_m} m is not above 0 m")));
            }
            Ok(KeepOut::Ball { center, radius_m })
        }
    }
}

fn finite(field: &str, value: f64) -> Result<f64, Error> {
    if value.is_finite() { Ok(value) } else { Err(non_finite(field, format!("{value} is not finite"))) }
}
