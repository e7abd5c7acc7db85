//! What is explored: meshes of a folder, generated objects, or both.

use std::path::{Path, PathBuf};

use crate::body::Body;
use crate::mesh_file::EXTENSIONS;
use crate::{mesh_file, shapes};
use palpate_core::metrics::{Reference, Sampling};

/// Why there are no objects.
pub type Problem = Box<dyn std::error::Error + Send + Sync>;

/// An object with its truth.
#[derive(Debug)]
pub struct Object {
    /// A file's name without its ending, or that of the generator.
    pub name: String,
    /// What is seen and touched.
    pub body: Body,
    /// What the estimate is compared with.
    pub reference: Reference,
}

/// The objects of these names: files of the folder before generated ones. Without names all files,
/// or all that can be generated where there is no folder.
///
/// # Errors
/// A folder or file that cannot be read, or a name that is neither a file nor an object.
pub fn load(folder: Option<&Path>, names: &[String]) -> Result<Vec<Object>, Problem> {
    let files = folder.map(mesh_files).transpose()?.unwrap_or_default();
    let names: Vec<String> = match (names, folder) {
        ([], Some(_)) => files.iter().map(|(name, _)| name.clone()).collect(),
        ([], None) => shapes::OBJECTS.iter().map(|object| object.name.to_owned()).collect(),
        (names, _) => names.to_vec(),
    };
    let load = |name: String| {
        let body = match files.iter().find(|(file, _)| *file == name) {
            Some((_, path)) => mesh_file::read(path, 1.0)?,
            None => shapes::generate(&name)?,
        };
        let reference = Reference::new(body.mesh().clone(), Sampling::default())?;
        Ok(Object { name, body, reference })
    };
    names.into_iter().map(load).collect()
}

/// Names and paths, in the order of the names.
fn mesh_files(folder: &Path) -> Result<Vec<(String, PathBuf)>, Problem> {
    let explain = |error: std::io::Error| format!("--meshes {}: {error}", folder.display());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(explain)? {
        let path = entry.map_err(explain)?.path();
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if EXTENSIONS.contains(&ending.as_str()) {
            files.push((path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), path));
        }
    }
    if files.is_empty() {
        return Err(format!("--meshes {}: no .ply, .stl or .obj file in it", folder.display()).into());
    }
    files.sort();
    Ok(files)
}
