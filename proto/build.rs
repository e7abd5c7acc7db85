//! Compiles the contract without `protoc` and keeps its comments: the `OpenAPI` schemas are made from them.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

use prost::Message;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=palpate");

    let root = Path::new(".");
    let files = contract_files(&root.join("palpate/v1"))?;
    let mut compiler = protox::Compiler::new([root])?;
    compiler.include_imports(true).include_source_info(true).open_files(files)?;
    let descriptors = compiler.file_descriptor_set();

    let out_dir = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out_dir.join("palpate_descriptor.bin"), descriptors.encode_to_vec())?;

    let mut config = tonic_prost_build::Config::new();
    // `prost::Name` gives each message its full name, which dynamic JSON looks up.
    config.enable_type_names();
    // Clouds and meshes are shared between a snapshot and its replies: `Bytes` makes that a reference count.
    config.bytes(["."]);
    // An ordered map makes equal messages equal on the wire, so that a digest of a request means something.
    config.btree_map(["."]);
    tonic_prost_build::configure()
        .build_client(true)
        .build_server(true)
        .compile_fds_with_config(descriptors, config)?;
    Ok(())
}

/// Every `.proto` file of `folder`, sorted, so that the descriptor set is the same on every machine.
fn contract_files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut files =
        fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, std::io::Error>>()?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "proto"));
    files.sort();
    Ok(files)
}
