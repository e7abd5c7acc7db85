//! Bodies as the routes read and write them, and refusals as they answer them, without a route.

use palpate_proto::v1;
use prost::{Message, Name};

use super::exploration::prior_from_json;
use super::json::parse;
use super::problem::Problem;
use super::proto_json::{from_json, to_json};
use crate::error::Error;
use crate::limits::Limits;

/// Reads the body of any call but that which adds a view.
///
/// # Errors
/// The problem document that the caller gets.
pub(crate) fn read<T: Message + Name + Default>(body: &[u8], limits: &Limits) -> Result<T, String> {
    parse(body, limits, |json| from_json(&json)).map_err(|problem| problem.to_json())
}

/// Reads the body of a call that adds a view.
///
/// # Errors
/// The problem document that the caller gets.
pub(crate) fn read_prior(body: &[u8], limits: &Limits) -> Result<v1::AddVisualPriorRequest, String> {
    parse(body, limits, prior_from_json).map_err(|problem| problem.to_json())
}

/// The problem document of a refusal.
pub(crate) fn problem(error: &Error) -> String {
    Problem::from(error.clone()).to_json()
}

/// Writes a message as the body of an answer.
///
/// # Errors
/// The message has what JSON cannot say.
pub(crate) fn write<T: Message + Name>(message: &T) -> Result<String, Error> {
    to_json(message)
}
