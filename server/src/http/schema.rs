//! JSON schemas of the contract's messages, made from its descriptors: the comments of the `.proto` files are the
//! descriptions, so nothing is documented twice.

use prost_reflect::{DescriptorPool, EnumDescriptor, FieldDescriptor, Kind, MessageDescriptor};
use serde_json::{Map, Value, json};

/// The package whose messages and enums become schemas.
const PACKAGE: &str = "palpate.v1";

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

fn message_schema(message: &MessageDescriptor) -> Value {
    let properties: Map<String, Value> =
        message.fields().map(|field| (field.name().to_owned(), field_schema(&field))).collect();
    json!({
        "type": "object",
        "description": comment(message.parent_file().file_descriptor_proto(), message.path()),
        "properties": properties,
        "additionalProperties": false,
    })
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
    } else {
        kind_schema(&field.kind())
    };
    let mut description = comment(field.parent_message().parent_file().file_descriptor_proto(), field.path());
    if let Some(oneof) = field.containing_oneof().filter(|oneof| oneof.fields().len() > 1) {
        let names: Vec<String> = oneof.fields().map(|field| format!("`{}`", field.name())).collect();
        description = format!("{description} (Only one of {}.)", names.join(", "));
    }
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
    use crate::http::proto_json::CONTRACT;

    fn contract() -> Map<String, Value> {
        schemas(CONTRACT.as_ref().unwrap())
    }

    #[test]
    fn every_message_and_field_is_described_by_its_comment() {
        for (name, schema) in &contract() {
            assert!(!schema["description"].as_str().unwrap().is_empty(), "{name}");
            for (field, schema) in schema["properties"].as_object().into_iter().flatten() {
                assert!(!schema["description"].as_str().unwrap().is_empty(), "{name}.{field}");
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
    fn a_choice_says_what_excludes_what() {
        let outcome = &contract()["ContactResult"]["properties"]["no_contact"];
        assert!(outcome["description"].as_str().unwrap().contains("Only one of `contact`, `no_contact`"));
    }
}
