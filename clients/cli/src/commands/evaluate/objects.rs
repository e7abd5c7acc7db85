//! Which objects are evaluated: a folder of meshes, generated ones, or both.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use palpate_core::metrics::{Chamfer, Reference, Sampling};
use palpate_simulator::body::Body;
use palpate_simulator::mesh_file::EXTENSIONS;
use palpate_simulator::{mesh_file, shapes};

use super::paper;
use crate::failure::Failure;

/// What `--objects` calls all generated objects together.
pub(super) const ALL_GENERATED: &str = "generated";
/// Random superquadrics among them.
const SUPERQUADRICS: u64 = 3;

/// An object with its prepared truth; cheap to clone.
#[derive(Clone, Debug)]
pub(super) struct EvaluatedObject {
    /// A file's name without its ending, or `generated-` and the name of the generator.
    pub(super) name: String,
    /// What the robot touches.
    pub(super) body: Arc<Body>,
    /// What the estimate is compared with.
    pub(super) reference: Arc<Reference>,
    /// What a perfect estimate would score.
    pub(super) floor: Chamfer,
}

impl EvaluatedObject {
    fn new(name: String, body: Body) -> Result<Self, Failure> {
        let reference = Reference::new(body.mesh().clone(), Sampling::default())?;
        let floor = reference.chamfer_floor()?;
        Ok(Self { name, body: Arc::new(body), reference: Arc::new(reference), floor })
    }
}

/// Loads the meshes of a folder, those of the paper first and in its order, then generates.
pub(super) fn load(
    folder: Option<&Path>,
    scale: f64,
    generated: &[String],
) -> Result<Vec<EvaluatedObject>, Failure> {
    let mut objects = Vec::new();
    for (name, path) in folder.map(mesh_files).transpose()?.unwrap_or_default() {
        objects.push(EvaluatedObject::new(name, mesh_file::read(&path, scale)?)?);
    }
    for name in generated_names(generated, folder.is_some()) {
        let body = shapes::generate(&name)?;
        objects.push(EvaluatedObject::new(format!("generated-{name}"), body)?);
    }
    Ok(objects)
}

/// The names to generate: those asked for, or all when nothing at all was asked for.
fn generated_names(asked: &[String], has_folder: bool) -> Vec<String> {
    let all = || {
        let random = (1..=SUPERQUADRICS).map(|seed| format!("{}{seed}", shapes::SUPERQUADRIC_PREFIX));
        shapes::OBJECTS.iter().map(|object| object.name.to_owned()).chain(random)
    };
    if asked.is_empty() && !has_folder {
        return all().collect();
    }
    let mut names = Vec::new();
    for name in asked.iter().map(|name| name.to_lowercase()) {
        if name == ALL_GENERATED {
            names.extend(all());
        } else {
            names.push(name);
        }
    }
    let mut seen = std::collections::HashSet::new();
    names.retain(|name| seen.insert(name.clone()));
    names
}

fn mesh_files(folder: &Path) -> Result<Vec<(String, PathBuf)>, Failure> {
    let explain = |error: std::io::Error| format!("--meshes {}: {error}", folder.display());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(explain)? {
        let path = entry.map_err(explain)?.path();
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        if EXTENSIONS.contains(&ending.to_ascii_lowercase().as_str()) {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            files.push((name, path));
        }
    }
    if files.is_empty() {
        return Err(format!("--meshes {}: no .ply, .stl or .obj file in it", folder.display()).into());
    }
    let rank = |name: &str| {
        let published = paper::TABLE_I.iter().position(|column| column.object == name);
        published.unwrap_or(usize::MAX)
    };
    files.sort_by(|(a, a_path), (b, b_path)| (rank(a), a, a_path).cmp(&(rank(b), b, b_path)));
    match files.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => {
            Err(format!("{} and {} have the same name", pair[0].1.display(), pair[1].1.display()).into())
        }
        None => Ok(files),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_any_wish_everything_is_generated_and_with_a_folder_nothing() {
        assert_eq!(generated_names(&[], false).len(), shapes::OBJECTS.len() + 3);
        assert!(generated_names(&[], true).is_empty());
        let asked = ["Can", "generated", "can"].map(str::to_owned);
        let names = generated_names(&asked, true);
        assert_eq!(names.len(), shapes::OBJECTS.len() + 3);
        assert_eq!(names[0], "can");
    }

    #[test]
    fn files_come_in_the_order_of_the_paper_then_by_name() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["zebra.obj", "apple.stl", "pear.ply", "lamp.PLY", "notes.txt"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let names: Vec<_> = mesh_files(folder.path()).unwrap().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["lamp", "pear", "apple", "zebra"]);
        std::fs::write(folder.path().join("zebra.ply"), "").unwrap();
        assert!(mesh_files(folder.path()).unwrap_err().to_string().contains("same name"));
    }

    #[test]
    fn a_folder_without_meshes_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(mesh_files(folder.path()).unwrap_err().to_string().contains("no .ply"));
        assert!(mesh_files(&folder.path().join("missing")).is_err());
    }
}
