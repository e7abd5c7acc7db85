//! The part of the contract that explains one of its messages to a reader who does not have the contract.

use std::collections::BTreeMap;

use prost::{Message, Name};
use prost_reflect::FileDescriptor;
use prost_types::{FileDescriptorProto, FileDescriptorSet};

use crate::error::Error;
use crate::wire::json::descriptor;

/// The file that declares `M` and all that it imports, encoded, without comments.
///
/// # Errors
/// None but by a bug of this server.
pub(super) fn descriptors<M: Name>() -> Result<Vec<u8>, Error> {
    let mut files = BTreeMap::new();
    collect(&descriptor::<M>()?.parent_file(), &mut files);
    Ok(FileDescriptorSet { file: files.into_values().collect() }.encode_to_vec())
}

fn collect(file: &FileDescriptor, files: &mut BTreeMap<String, FileDescriptorProto>) {
    if files.contains_key(file.name()) {
        return;
    }
    let mut plain = file.file_descriptor_proto().clone();
    plain.source_code_info = None;
    files.insert(file.name().to_owned(), plain);
    file.dependencies().for_each(|imported| collect(&imported, files));
}
