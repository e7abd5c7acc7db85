//! JSON schemas of the contract's messages, made from its descriptors: the comments of the `.proto` files are the
//! descriptions, so nothing is documented twice.

use prost_reflect::{DescriptorPool, EnumDescriptor, FieldDescriptor, Kind, MessageDescriptor};
use serde_json::{Map, Value, json};

/// The package whose messages and enums become schemas.
pub(super) const PACKAGE: &str = "palpate.v1";

/// A schema for every message and enum of the contract, by its short name.
pub(super) fn schemas(contract: &DescriptorPool) -> Map<String, Value> {
    let messages = contract
        .all_messages()
        .filter(|message| message.package_name() == PACKAGE && !message.is_map_entry())
        .map(|message| (message.name().to_owned(), message_schema(&message)));
    let enums = contract
        .all_enums()
        .filter(|an_enum| an_enum.package_name() == PACKAGE)
        .map(|an_enum| (an_enum.name().to_owned(), enum_schema(&an_enum)));
    messages.chain(enums).collect()
}

/// What a new session may be called, or nothing for a UUID, which the log then has here.
const NEW_SESSION_ID: &str = "^([a-z0-9][a-z0-9-]{2,62})?$";

/// Messages that are always set in what the server sends, and the fields that it insists on in a request.
const REQUIRED: [(&str, &[&str]); 19] = [
    ("Session", &["config", "stats", "create_time", "update_time"]),
    ("SessionStats", &["last_update"]),
    ("Candidate", &["point", "normal", "probe_start", "probe_end", "tool_pose"]),
    ("AddVisualPriorResponse", &["session", "set_aside"]),
    ("ProposeContactsResponse", &["excluded"]),
    ("ReportContactResponse", &["session"]),
    ("Event", &["append_time", "stats_after"]),
    ("SeriesRow", &["append_time", "duration"]),
    ("Experiment", &["create_time", "last_create_time"]),
    ("SummaryGroup", &["attempts", "failures", "mean_uncertainty", "mean_std_m", "surface_distance_m"]),
    ("AddVisualPriorRequest", &["prior"]),
    ("VisualPrior", &["points"]),
    ("ReportContactRequest", &["result"]),
    ("Contact", &["sensor_pose"]),
    ("NoContact", &["swept_from", "swept_to"]),
    ("InvalidContact", &["sensor_pose"]),
    ("Pose", &["position", "orientation"]),
    ("HalfSpace", &["normal"]),
    ("Ball", &["center", "radius_m"]),
];

/// The schema of a message. With a choice it is one of as many objects as there are choices.
fn message_schema(message: &MessageDescriptor) -> Value {
    let description = comment(message.parent_file().file_descriptor_proto(), message.path());
    let choice = message.oneofs().find(|oneof| !oneof.is_synthetic());
    let Some(choice) = choice else {
        let mut schema = object_schema(message, None);
        schema["description"] = description.into();
        return schema;
    };
    let variants: Vec<Value> = choice.fields().map(|chosen| object_schema(message, Some(&chosen))).collect();
    json!({ "description": description, "oneOf": variants })
}

/// The object of a message, in which of a choice only `chosen` may be.
fn object_schema(message: &MessageDescriptor, chosen: Option<&FieldDescriptor>) -> Value {
    let is_choice =
        |field: &FieldDescriptor| field.containing_oneof().is_some_and(|oneof| !oneof.is_synthetic());
    let fields = message.fields().filter(|field| !is_choice(field) || Some(field) == chosen);
    let properties: Map<String, Value> =
        fields.map(|field| (field.name().to_owned(), field_schema(&field))).collect();
    let listed = REQUIRED.iter().find(|(name, _)| *name == message.name());
    let mut required: Vec<&str> = listed.map_or_else(Vec::new, |(_, fields)| fields.to_vec());
    required.extend(chosen.map(FieldDescriptor::name));
    let mut schema = json!({ "type": "object", "properties": properties, "additionalProperties": false });
    if let Some(chosen) = chosen {
        schema["title"] = pascal_case(message.name(), chosen.name()).into();
    }
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

/// Declares as required what the server always writes: everything but what can be told from being unset.
pub(super) fn require_what_is_sent(schema: &mut Value, message: &MessageDescriptor) {
    let variants = match schema.get_mut("oneOf").and_then(Value::as_array_mut) {
        Some(variants) => variants.iter_mut().collect(),
        None => vec![schema],
    };
    for variant in variants {
        let mut required: Vec<Value> = variant["required"].as_array().cloned().unwrap_or_default();
        let sent = message.fields().filter(|field| !field.supports_presence());
        for name in sent.map(|field| Value::from(field.name())) {
            if !required.contains(&name) {
                required.push(name);
            }
        }
        if !required.is_empty() {
            variant["required"] = required.into();
        }
    }
}

/// `ContactResult` and `no_contact` make `ContactResultNoContact`.
fn pascal_case(message: &str, field: &str) -> String {
    let words = field.split('_').map(|word| word[..1].to_ascii_uppercase() + &word[1..]);
    words.fold(message.to_owned(), |name, word| name + &word)
}

fn enum_schema(an_enum: &EnumDescriptor) -> Value {
    let file = an_enum.parent_file();
    let proto = file.file_descriptor_proto();
    let names: Vec<String> = an_enum.values().map(|value| value.name().to_owned()).collect();
    let values: Vec<String> = an_enum
        .values()
        .map(|value| format!("- `{}`: {}", value.name(), comment(proto, value.path())))
        .collect();
    let description = format!("{}\n\n{}", comment(proto, an_enum.path()), values.join("\n"));
    json!({ "type": "string", "enum": names, "description": description })
}

fn field_schema(field: &FieldDescriptor) -> Value {
    let mut schema = if field.is_map() {
        json!({ "type": "object", "additionalProperties": { "type": "string" } })
    } else if field.is_list() {
        json!({ "type": "array", "items": kind_schema(&field.kind()) })
    } else if field.full_name() == "palpate.v1.VisualPrior.points" {
        points_schema()
    } else if field.full_name() == "palpate.v1.CreateSessionRequest.session_id" {
        json!({ "type": "string", "pattern": NEW_SESSION_ID })
    } else {
        kind_schema(&field.kind())
    };
    let description = comment(field.parent_message().parent_file().file_descriptor_proto(), field.path());
    schema["description"] = description.into();
    schema
}

/// What HTTP takes beyond base64.
fn points_schema() -> Value {
    let number = json!({ "type": "number" });
    let triple = json!({ "type": "array", "items": number, "minItems": 3, "maxItems": 3 });
    json!({ "anyOf": [
        { "type": "string", "contentEncoding": "base64" },
        { "type": "array", "items": triple },
        { "type": "array", "items": number },
    ]})
}

fn kind_schema(kind: &Kind) -> Value {
    match kind {
        Kind::Double => json!({ "type": "number", "format": "double" }),
        Kind::Float => json!({ "type": "number", "format": "float" }),
        Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => json!({ "type": "integer", "format": "int32" }),
        Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => json!({ "type": "integer", "format": "int64" }),
        Kind::Uint32 | Kind::Fixed32 => json!({ "type": "integer", "format": "uint32", "minimum": 0 }),
        Kind::Uint64 | Kind::Fixed64 => json!({ "type": "integer", "format": "uint64", "minimum": 0 }),
        Kind::Bool => json!({ "type": "boolean" }),
        Kind::String => json!({ "type": "string" }),
        Kind::Bytes => json!({ "type": "string", "contentEncoding": "base64" }),
        Kind::Message(message) => match message.full_name() {
            "google.protobuf.Timestamp" => json!({ "type": "string", "format": "date-time" }),
            "google.protobuf.Duration" => json!({ "type": "string", "examples": ["0.25s"] }),
            "google.protobuf.FieldMask" => json!({ "type": "string", "examples": ["displayName,labels"] }),
            _ => reference(message.name()),
        },
        Kind::Enum(an_enum) => reference(an_enum.name()),
    }
}

fn reference(name: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{name}") })
}

/// The comment above the declaration at `path`, without the blanks that every line begins with.
fn comment(file: &prost_types::FileDescriptorProto, path: &[i32]) -> String {
    let locations = file.source_code_info.iter().flat_map(|info| &info.location);
    let text = locations
        .filter(|location| location.path == path)
        .find_map(|location| location.leading_comments.as_deref());
    let lines: Vec<&str> = text.unwrap_or_default().lines().map(str::trim).collect();
    lines.join("\n").trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::CONTRACT;

    fn contract() -> Map<String, Value> {
        schemas(CONTRACT.as_ref().unwrap())
    }

    #[test]
    fn every_message_and_field_is_described_by_its_comment() {
        for (name, schema) in &contract() {
            assert!(!schema["description"].as_str().unwrap().is_empty(), "{name}");
            let variants = schema["oneOf"].as_array().cloned().unwrap_or_else(|| vec![schema.clone()]);
            for properties in variants.iter().filter_map(|variant| variant["properties"].as_object()) {
                for (field, schema) in properties {
                    assert!(!schema["description"].as_str().unwrap().is_empty(), "{name}.{field}");
                }
            }
        }
    }

    #[test]
    fn fields_have_the_types_that_json_has_for_them() {
        let contract = contract();
        let session = &contract["Session"]["properties"];
        assert_eq!(session["revision"]["type"], "integer");
        assert_eq!(session["state"]["$ref"], "#/components/schemas/SessionState");
        assert_eq!(session["labels"]["additionalProperties"]["type"], "string");
        assert_eq!(session["create_time"]["format"], "date-time");
        assert_eq!(contract["ProposeContactsResponse"]["properties"]["candidates"]["type"], "array");
        assert!(contract["VisualPrior"]["properties"]["points"]["anyOf"].is_array());
    }

    #[test]
    fn enums_list_their_names_with_their_meaning() {
        let strategy = &contract()["Strategy"];
        assert!(strategy["enum"].as_array().unwrap().contains(&json!("STRATEGY_PROACTIVE")));
        assert!(strategy["description"].as_str().unwrap().contains("- `STRATEGY_RANDOM`: "));
    }

    #[test]
    fn a_choice_is_one_of_several_objects() {
        let contract = contract();
        let variants = contract["ContactResult"]["oneOf"].as_array().unwrap();
        let titles: Vec<&str> = variants.iter().map(|variant| variant["title"].as_str().unwrap()).collect();
        assert_eq!(titles[..2], ["ContactResultContact", "ContactResultNoContact"]);
        let missed = &variants[1];
        assert_eq!(missed["required"], json!(["no_contact"]));
        assert!(
            missed["properties"]["candidate_id"].is_object() && missed["properties"]["contact"].is_null()
        );
        assert!(contract["SessionConfig"]["oneOf"].is_null(), "an optional number is no choice");
    }

    #[test]
    fn what_is_always_sent_is_required() {
        let contract = contract();
        let message = CONTRACT.as_ref().unwrap().get_message_by_name("palpate.v1.Session").unwrap();
        let mut session = contract["Session"].clone();
        require_what_is_sent(&mut session, &message);
        for name in ["session_id", "labels", "revision", "config", "should_stop"] {
            assert!(session["required"].as_array().unwrap().contains(&json!(name)), "{name}");
        }
        for (name, fields) in REQUIRED {
            let message = format!("palpate.v1.{name}");
            let message = CONTRACT.as_ref().unwrap().get_message_by_name(&message).unwrap();
            assert!(fields.iter().all(|field| message.get_field_by_name(field).is_some()), "{name}");
        }
    }
}
