//! Messages of the contract as JSON, by their descriptors: names as in the `.proto` files, enums by name,
//! bytes in base64, 64-bit integers as numbers.

use std::fmt::Display;

use prost::{Message, Name};
use prost_reflect::{DynamicMessage, MessageDescriptor, SerializeOptions};

use super::CONTRACT;
use crate::error::Error;
use crate::limits::ERROR_TEXT_BYTES;
use crate::text::cut;

/// Writes a message. Zeros and empty lists are there for scripts to read; what is unset is left out.
///
/// # Errors
/// None but by a bug of this server.
pub(crate) fn to_json<T: Message + Name>(message: &T) -> Result<String, Error> {
    const OPTIONS: SerializeOptions = SerializeOptions::new()
        .use_proto_field_name(true)
        .stringify_64_bit_integers(false)
        .skip_default_fields(false);
    let dynamic =
        DynamicMessage::decode(descriptor::<T>()?, message.encode_to_vec().as_slice()).map_err(broken)?;
    let mut json = serde_json::Serializer::new(Vec::new());
    dynamic.serialize_with_options(&mut json, &OPTIONS).map_err(broken)?;
    String::from_utf8(json.into_inner()).map_err(broken)
}

/// What the contract says of a message.
///
/// # Errors
/// None but by a bug of this server.
pub(crate) fn descriptor<T: Name>() -> Result<MessageDescriptor, Error> {
    let contract = CONTRACT.as_ref().map_err(broken)?;
    let name = T::full_name();
    contract.get_message_by_name(&name).ok_or_else(|| broken(format!("{name} is not in the contract")))
}

/// What only a bug of this server can bring about.
pub(crate) fn broken(error: impl Display) -> Error {
    let detail = error.to_string();
    let detail = cut(&detail, ERROR_TEXT_BYTES);
    tracing::error!(error = &*detail, "JSON and contract do not fit together");
    Error::internal(detail)
}
