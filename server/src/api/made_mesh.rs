//! Meshes that were made once for all who look at them: packed, written as a file, as JSON of a stream.
//!
//! Making one costs far more than sending it, and all who watch a session want the same one at the same
//! moment: the first makes it, the others wait for that. What was used last is kept, within a bound.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use palpate_proto::{Bytes, v1};
use sha2::{Digest, Sha256};
use tokio::sync::OnceCell;

use super::mesh::Form;

/// Meshes that are kept at most, however small they are: they are looked for one by one.
const MOST: usize = 1024;

/// The text that a transport makes of an update, where all readers get the same.
pub(crate) type Rendering = Arc<OnceLock<String>>;

/// Which mesh: of which session, also where an id is used again, at which revision, and how written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Key {
    pub(super) revision: i64,
    pub(super) created_us: i64,
    pub(super) session_id: String,
    pub(super) form: Form,
}

/// A mesh, with what is made of it for streams.
#[derive(Debug)]
pub(super) struct MadeMesh {
    mesh: v1::Mesh,
    /// The digest of the arrays: equal surfaces have equal ones.
    pub(super) surface: [u8; 32],
    with_faces: Rendering,
    without_faces: Rendering,
}

impl MadeMesh {
    pub(super) fn new(mesh: v1::Mesh) -> Self {
        let mut surface = Sha256::new();
        if let Some(v1::mesh::Body::Raw(raw)) = &mesh.body {
            surface.update(&raw.topology_etag);
            surface.update(&raw.positions_f32_le);
            surface.update(&raw.uncertainty_f32_le);
            surface.update(&raw.std_m_f32_le);
        }
        let surface = surface.finalize().into();
        Self { mesh, surface, with_faces: Rendering::default(), without_faces: Rendering::default() }
    }

    pub(super) fn etag(&self) -> &str {
        &self.mesh.etag
    }

    /// The mesh for a caller who has these faces: they are not sent again. Its bytes are shared, not copied.
    pub(super) fn for_caller_with(&self, topology: &str) -> (v1::Mesh, Rendering) {
        let mut mesh = self.mesh.clone();
        if let Some(v1::mesh::Body::Raw(raw)) = &mut mesh.body
            && raw.topology_etag == topology
        {
            raw.faces_u32_le = Bytes::new();
            return (mesh, self.without_faces.clone());
        }
        (mesh, self.with_faces.clone())
    }

    /// The etag of the faces; empty for a file.
    pub(super) fn topology(&self) -> &str {
        match &self.mesh.body {
            Some(v1::mesh::Body::Raw(raw)) => &raw.topology_etag,
            Some(v1::mesh::Body::File(_)) | None => "",
        }
    }

    /// Roughly what it takes in memory, the JSON that may be made of it included.
    fn bytes(&self) -> usize {
        match &self.mesh.body {
            Some(v1::mesh::Body::Raw(raw)) => {
                let each_time =
                    raw.positions_f32_le.len() + raw.uncertainty_f32_le.len() + raw.std_m_f32_le.len();
                // Once packed and twice in base64, of which one has the faces.
                4 * each_time + 3 * raw.faces_u32_le.len()
            }
            Some(v1::mesh::Body::File(file)) => file.len(),
            None => 0,
        }
    }
}

/// The mesh of one key: made by the first who asks, while the others wait.
pub(super) type Cell = Arc<OnceCell<Arc<MadeMesh>>>;

/// The meshes used last, the newest use in front.
#[derive(Debug)]
pub(super) struct MadeMeshes {
    recent: Mutex<VecDeque<(Key, Cell)>>,
    most_bytes: usize,
}

impl MadeMeshes {
    pub(super) fn new(most_bytes: usize) -> Self {
        Self { recent: Mutex::default(), most_bytes }
    }

    /// The place of this mesh, which is empty where nobody has made it yet.
    pub(super) fn cell(&self, key: &Key) -> Cell {
        let mut recent = self.lock();
        let known = recent.iter().position(|(known, _)| known == key);
        let cell = known.and_then(|place| recent.remove(place)).map(|(_, cell)| cell).unwrap_or_default();
        recent.push_front((key.clone(), cell.clone()));
        recent.truncate(MOST);
        cell
    }

    /// Drops what is beyond the bound; called whenever a mesh was made. The one used last always stays.
    pub(super) fn trim(&self) {
        let mut recent = self.lock();
        let mut bytes = 0;
        let kept = recent.iter().take_while(|(_, cell)| {
            let before = bytes;
            bytes += cell.get().map_or(0, |made| made.bytes());
            before == 0 || bytes <= self.most_bytes
        });
        let kept = kept.count();
        recent.truncate(kept);
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<(Key, Cell)>> {
        self.recent.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(revision: i64) -> Key {
        Key { revision, created_us: 1, session_id: "ball".into(), form: Form::Raw }
    }

    fn mesh(vertices: usize) -> v1::Mesh {
        let raw = v1::RawMesh {
            positions_f32_le: vec![7; vertices * 12].into(),
            faces_u32_le: vec![1; 12].into(),
            topology_etag: "faces".into(),
            ..Default::default()
        };
        v1::Mesh { body: Some(v1::mesh::Body::Raw(raw)), ..Default::default() }
    }

    #[test]
    fn what_was_used_last_is_kept_within_the_bound() {
        let meshes = MadeMeshes::new(5000);
        for revision in 1..=3 {
            meshes.cell(&key(revision)).set(Arc::new(MadeMesh::new(mesh(40)))).unwrap();
            meshes.cell(&key(1));
            meshes.trim();
        }
        let has = |revision| meshes.cell(&key(revision)).get().is_some();
        assert_eq!([1, 2, 3].map(has), [true, false, true]);
        meshes.cell(&key(4)).set(Arc::new(MadeMesh::new(mesh(4000)))).unwrap();
        meshes.trim();
        assert_eq!([4, 1].map(has), [true, false], "one that is larger than the bound is alone");
        (0..2 * MOST as i64).for_each(|revision| drop(meshes.cell(&key(revision))));
        assert_eq!(meshes.lock().len(), MOST);
    }

    #[test]
    fn faces_that_the_caller_has_are_left_out_and_the_arrays_are_shared() {
        let made = MadeMesh::new(mesh(2));
        let (whole, with_faces) = made.for_caller_with("");
        let (rest, without_faces) = made.for_caller_with(made.topology());
        let (Some(v1::mesh::Body::Raw(whole)), Some(v1::mesh::Body::Raw(rest))) = (whole.body, rest.body)
        else {
            panic!("raw meshes")
        };
        assert_eq!(whole.positions_f32_le.as_ptr(), rest.positions_f32_le.as_ptr(), "nothing is copied");
        assert_eq!((whole.faces_u32_le.len(), rest.faces_u32_le.len()), (12, 0));
        assert!(!Arc::ptr_eq(&with_faces, &without_faces));
        assert_ne!(made.surface, MadeMesh::new(mesh(3)).surface);
    }
}
