//! The wire contract of Palpate and nothing else: messages, clients and server traits of `palpate.v1`.
//!
//! Everything here is generated from `proto/palpate/v1/*.proto`, whose comments are the reference for units,
//! frames and signs. `bytes` fields are [`Bytes`]; maps are ordered, so that equal messages encode equally.

pub use prost::bytes::Bytes;
pub use prost_types::{Duration, FieldMask, Timestamp};

/// The generated code of package `palpate.v1`.
#[expect(clippy::large_enum_variant, reason = "generated; streams carry few of the small variants")]
pub mod v1 {
    tonic::include_proto!("palpate.v1");
}

/// The encoded `FileDescriptorSet` of the contract with its imports and comments, for reflection and for schemas.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/palpate_descriptor.bin"));

#[cfg(test)]
mod tests {
    use prost_reflect::{DescriptorPool, FileDescriptor};

    use super::FILE_DESCRIPTOR_SET;

    fn contract() -> DescriptorPool {
        DescriptorPool::decode(FILE_DESCRIPTOR_SET).expect("the descriptor set decodes")
    }

    /// Whether the declaration at `path` of its file carries a comment.
    fn is_commented(file: &FileDescriptor, path: &[i32]) -> bool {
        let info = file.file_descriptor_proto().source_code_info.as_ref();
        info.into_iter().flat_map(|info| &info.location).filter(|location| location.path == path).any(
            |location| {
                !location.leading_comments().trim().is_empty()
                    || !location.trailing_comments().trim().is_empty()
            },
        )
    }

    #[test]
    fn the_contract_names_its_three_services() {
        let pool = contract();
        let mut services: Vec<_> = pool.services().map(|s| s.full_name().to_owned()).collect();
        services.sort();
        let expected =
            ["Exploration", "Reconstruction", "Session"].map(|topic| format!("palpate.v1.{topic}Service"));
        assert_eq!(services, expected);
    }

    #[test]
    fn every_declaration_is_commented() {
        let pool = contract();
        let mut declarations = Vec::new();
        for service in pool.services() {
            for method in service.methods() {
                let name = method.full_name().to_owned();
                declarations.push((name, service.parent_file(), method.path().to_vec()));
            }
            let name = service.full_name().to_owned();
            declarations.push((name, service.parent_file(), service.path().to_vec()));
        }
        // The entries of maps are messages that nobody wrote.
        for message in pool.all_messages().filter(|m| !m.is_map_entry()) {
            let file = message.parent_file();
            for field in message.fields() {
                let name = field.full_name().to_owned();
                declarations.push((name, file.clone(), field.path().to_vec()));
            }
            let written = message.oneofs().filter(|oneof| !oneof.is_synthetic());
            for oneof in written {
                let name = oneof.full_name().to_owned();
                declarations.push((name, file.clone(), oneof.path().to_vec()));
            }
            let name = message.full_name().to_owned();
            declarations.push((name, file, message.path().to_vec()));
        }
        for enumeration in pool.all_enums() {
            let file = enumeration.parent_file();
            for value in enumeration.values() {
                let name = value.full_name().to_owned();
                declarations.push((name, file.clone(), value.path().to_vec()));
            }
            let name = enumeration.full_name().to_owned();
            declarations.push((name, file, enumeration.path().to_vec()));
        }
        declarations.retain(|(name, _, _)| name.starts_with("palpate.v1."));
        assert!(declarations.len() > 300, "the contract is all there");

        let silent: Vec<_> = declarations
            .iter()
            .filter(|(_, file, path)| !is_commented(file, path))
            .map(|(name, _, _)| name)
            .collect();
        assert!(silent.is_empty(), "not commented: {silent:?}");
    }
}
