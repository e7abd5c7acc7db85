//! The robot that requests candidates, and the regions that it must keep out of.

use palpate_core::exploration::{KeepOut, ProposalRequest};
use palpate_proto::v1;

use super::geometry::{point, pose, vector};
use super::{at, check_name};
use crate::error::Error;
use crate::limits::Limits;
use crate::session::Question;

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
) -> Result<Question, Error> {
    if top_k > limits.top_k {
        let description = format!("{top_k} candidates are more than the limit of {}", limits.top_k);
        return Err(Error::field(top_k_field, description));
    }
    let Some(v1::RobotContext { robot_id, tool_pose, keep_out: regions }) = robot else {
        let request = ProposalRequest::best(top_k as usize);
        return Ok(Question { request, robot_id: String::new() });
    };
    check_name(&format!("{robot_field}.robot_id"), robot_id, limits)?;
    let tool_field = format!("{robot_field}.tool_pose");
    let tool_pose = tool_pose.as_ref().map(|tool| pose(&tool_field, Some(tool))).transpose()?;
    let keep_out = keep_out_regions(&format!("{robot_field}.keep_out"), regions, limits)?;
    let request = ProposalRequest::best(top_k as usize).keeping_out_of(keep_out);
    let request = match tool_pose {
        None => request,
        Some(tool) => request.with_tool(&tool).map_err(|error| at(&tool_field, error))?,
    };
    Ok(Question { request, robot_id: robot_id.clone() })
}

/// The question with the vertices whose score is asked.
///
/// # Errors
/// More of them than the limits allow.
pub(crate) fn explaining(
    field: &str,
    vertices: Vec<u32>,
    question: Question,
    limits: &Limits,
) -> Result<Question, Error> {
    if vertices.len() > limits.explained_vertices {
        let description =
            format!("{} vertices are more than the limit of {}", vertices.len(), limits.explained_vertices);
        return Err(Error::field(field, description));
    }
    Ok(Question { request: question.request.explaining(vertices), ..question })
}

/// The regions at a path.
///
/// # Errors
/// More than the limits allow, or one that is none.
pub(super) fn keep_out_regions(
    path: &str,
    regions: &[v1::KeepOut],
    limits: &Limits,
) -> Result<Vec<KeepOut>, Error> {
    if regions.len() > limits.keep_out {
        let description = format!("{} regions are more than the limit of {}", regions.len(), limits.keep_out);
        return Err(Error::field(path, description));
    }
    let regions = regions.iter().enumerate();
    regions.map(|(index, region)| keep_out(&format!("{path}[{index}]"), region)).collect()
}

fn keep_out(path: &str, region: &v1::KeepOut) -> Result<KeepOut, Error> {
    let v1::KeepOut { shape } = region;
    match shape {
        None => Err(Error::field(format!("{path}.shape"), "is missing: give a half_space or a ball")),
        Some(v1::keep_out::Shape::HalfSpace(message)) => half_space(&format!("{path}.half_space"), message),
        Some(v1::keep_out::Shape::Ball(v1::Ball { center, radius_m })) => {
            let path = format!("{path}.ball");
            let center = point(&format!("{path}.center"), center.as_ref())?;
            KeepOut::ball(center, *radius_m).map_err(|error| at(&path, error))
        }
    }
}

/// Everything on one side of a plane.
///
/// # Errors
/// A normal that is missing or not of length one, or an offset that is none.
pub(super) fn half_space(path: &str, message: &v1::HalfSpace) -> Result<KeepOut, Error> {
    let v1::HalfSpace { normal, offset_m } = message;
    let normal_field = format!("{path}.normal");
    let normal = vector(&normal_field, normal.as_ref())?;
    let length = normal.norm();
    if length.is_nan() || (length - 1.0).abs() > NORMAL_TOLERANCE {
        let description = format!("has length {length:.4} and must be normalised to 1");
        return Err(Error::field(normal_field, description));
    }
    KeepOut::half_space(normal, *offset_m).map_err(|error| at(path, error))
}
