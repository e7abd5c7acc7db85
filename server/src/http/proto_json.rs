//! Messages of the contract as JSON, by their descriptors: names as in the `.proto` files, enums by name,
//! bytes in base64, 64-bit integers as numbers.
//!
//! Reading is strict: a field that does not exist is an error, because a misspelt one would be ignored in silence.

use axum::extract::{FromRequest, Request};
use axum::response::{IntoResponse, Response};
use http::header::CONTENT_TYPE;
use prost::{Message, Name};
use prost_reflect::{DynamicMessage, Kind, MessageDescriptor};
use serde_json::Value;

use super::extract::{json_body, require_json};
use super::problem::Problem;
use crate::api::Api;
use crate::error::Error;
use crate::limits::ECHO_BYTES;
use crate::text::cut;
pub(super) use crate::wire::json::to_json;
use crate::wire::json::{broken, descriptor};

/// A message as the JSON body of a request or a response.
pub(super) struct ProtoJson<T>(pub(super) T);

impl<T: Message + Name + Default + 'static> FromRequest<Api> for ProtoJson<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, api: &Api) -> Result<Self, Problem> {
        require_json(request.headers())?;
        Ok(Self(json_body(request, api.limits(), |body| from_json(&body)).await?))
    }
}

impl<T: Message + Name> IntoResponse for ProtoJson<T> {
    fn into_response(self) -> Response {
        match to_json(&self.0) {
            // The line break keeps a terminal readable.
            Ok(json) => ([(CONTENT_TYPE, "application/json")], json + "\n").into_response(),
            Err(error) => Problem::from(error).into_response(),
        }
    }
}

/// Reads a message.
///
/// # Errors
/// A field that does not exist or has the wrong type, by its path.
pub(super) fn from_json<T: Message + Name + Default>(json: &Value) -> Result<T, Error> {
    let descriptor = descriptor::<T>()?;
    let mut track = serde_path_to_error::Track::new();
    let tracked = serde_path_to_error::Deserializer::new(json, &mut track);
    DynamicMessage::deserialize(descriptor.clone(), tracked)
        .map_err(|error| {
            unknown_field(json, &descriptor, "")
                .unwrap_or_else(|| Error::field(track.path().to_string(), error.to_string()))
        })?
        .transcode_to()
        .map_err(broken)
}

/// The first field of `json` that the message does not have, with those that it has.
fn unknown_field(json: &Value, message: &MessageDescriptor, path: &str) -> Option<Error> {
    // Messages of another package, such as Timestamp, are written in a way of their own.
    if message.package_name() != "palpate.v1" || message.is_map_entry() {
        return None;
    }
    json.as_object()?.iter().find_map(|(name, value)| {
        // A name may be as long as the body.
        let shown = cut(name, ECHO_BYTES);
        let path = if path.is_empty() { shown.into_owned() } else { format!("{path}.{shown}") };
        let field = message.get_field_by_name(name).or_else(|| message.get_field_by_json_name(name));
        let Some(field) = field else {
            let known: Vec<String> = message.fields().map(|field| field.name().to_owned()).collect();
            let known = if known.is_empty() { "there are none".into() } else { known.join(", ") };
            return Some(Error::field(path, format!("there is no such field here; known are: {known}")));
        };
        match (field.kind(), value) {
            (Kind::Message(inner), Value::Array(items)) => items
                .iter()
                .enumerate()
                .find_map(|(index, item)| unknown_field(item, &inner, &format!("{path}[{index}]"))),
            (Kind::Message(inner), value) => unknown_field(value, &inner, &path),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use palpate_proto::v1;
    use serde_json::json;

    use super::*;

    fn refused<T: Message + Name + Default>(json: &Value) -> (String, String) {
        let error = from_json::<T>(json).err().unwrap();
        let violation = &error.fields()[0];
        (violation.field.clone(), violation.description.clone())
    }

    #[test]
    fn names_are_those_of_the_contract_and_zeros_are_written() {
        let session = v1::Session {
            session_id: "a-cup".into(),
            state: v1::SessionState::Active.into(),
            revision: i64::MAX,
            stats: Some(v1::SessionStats::default()),
            ..v1::Session::default()
        };
        let value: Value = serde_json::from_str(&to_json(&session).unwrap()).unwrap();
        assert_eq!(value["session_id"], "a-cup");
        assert_eq!(value["state"], "SESSION_STATE_ACTIVE");
        assert_eq!(value["revision"], i64::MAX);
        assert_eq!(value["stats"]["contacts"], 0);
        assert_eq!(value["labels"], json!({}));
        assert!(value.get("config").is_none(), "what is unset is left out");
    }

    #[test]
    fn a_message_survives_the_way_to_json_and_back() {
        let contact = v1::Contact {
            sensor_pose: Some(v1::Pose {
                position: Some(v1::Vector3 { x: 0.1, y: -2e-7, z: 1.0 / 3.0 }),
                orientation: Some(v1::Quaternion { w: 1.0, ..v1::Quaternion::default() }),
            }),
            uncertainty: Some(0.0),
            ..v1::Contact::default()
        };
        let request = v1::ReportContactRequest {
            session_id: "s".into(),
            expected_revision: Some(0),
            result: Some(v1::ContactResult {
                observe_time: Some(palpate_proto::Timestamp { seconds: 1_700_000_000, nanos: 5_000_000 }),
                outcome: Some(v1::contact_result::Outcome::Contact(contact)),
                ..v1::ContactResult::default()
            }),
            ..v1::ReportContactRequest::default()
        };
        let value: Value = serde_json::from_str(&to_json(&request).unwrap()).unwrap();
        assert_eq!(value["result"]["contact"]["uncertainty"], 0.0);
        assert_eq!(from_json::<v1::ReportContactRequest>(&value).unwrap(), request);
    }

    #[test]
    fn a_misspelt_field_is_refused_by_its_path() {
        let json = json!({ "result": { "contact": { "sensor_pose": { "positon": { "x": 1 } } } } });
        let (field, description) = refused::<v1::ReportContactRequest>(&json);
        assert_eq!(field, "result.contact.sensor_pose.positon");
        assert!(description.ends_with("known are: position, orientation"), "{description}");
        let json = json!({ "config": { "sensors": [{ "id": "a" }, { "pad": 1 }] } });
        assert_eq!(refused::<v1::CreateSessionRequest>(&json).0, "config.sensors[1].pad");
    }

    #[test]
    fn a_name_of_megabytes_is_not_sent_back() {
        let long = "k".repeat(4 << 20);
        for json in [json!({ &long: 1 }), json!({ "result": { &long: { "a": 1 } } })] {
            let (field, description) = refused::<v1::ReportContactRequest>(&json);
            assert!(field.ends_with("k…") && field.len() < 100, "{}", field.len());
            assert!(description.contains("known are: "), "{description}");
        }
        for json in [json!({ "labels": { &long: 1 } }), json!({ "config": { "method": &long } })] {
            let (field, description) = refused::<v1::CreateSessionRequest>(&json);
            assert!(field.len() < 300 && description.len() < 1100, "{} {}", field.len(), description.len());
        }
    }

    #[test]
    fn a_value_of_the_wrong_type_is_refused_by_its_path() {
        let json = json!({ "config": { "alpha_geodesic": [1] } });
        assert_eq!(refused::<v1::CreateSessionRequest>(&json).0, "config.alpha_geodesic");
        let json = json!({ "config": { "method": "METHOD_MAGIC" } });
        let (field, description) = refused::<v1::CreateSessionRequest>(&json);
        assert_eq!((field.as_str(), description.contains("METHOD_MAGIC")), ("config.method", true));
        assert!(from_json::<v1::CreateSessionRequest>(&json!([1, 2])).is_err());
    }

    #[test]
    fn free_labels_are_not_taken_for_fields() {
        let json = json!({ "labels": { "anything": "goes" }, "frame_id": 7 });
        assert_eq!(refused::<v1::CreateSessionRequest>(&json).0, "frame_id");
    }
}
