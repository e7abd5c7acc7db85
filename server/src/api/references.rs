//! Reference meshes: the true surfaces that sessions keep, and those that come with a question.
//!
//! One is read and indexed off the async executor, once for all who compare with it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use palpate_core::mesh_file::MeshFormat;
use palpate_core::metrics::{MetricsError, Reference, Sampling};
use palpate_proto::{Bytes, v1};
use sha2::{Digest, Sha256};
use tokio::time::Instant;

use super::{Api, Call};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::session::hex;
use crate::store::{KeptReference, NewReference, ReferenceKey, SessionRow};
use crate::wire::from_proto::{self, ReferenceFile, ReferenceNames};

/// Triangles of all references together that are kept ready; one that is larger is kept alone.
const READY_FACES: usize = 1 << 20;

const NAMES: ReferenceNames = ReferenceNames { mesh: "mesh", format: "format" };

/// A reference mesh, ready to compare with.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    pub(super) kept: KeptReference,
    /// Indexed, and sampled as by default.
    pub(super) surface: Arc<Reference>,
}

/// The references that were compared with last, the newest use in front.
#[derive(Debug, Default)]
pub(super) struct ReadyReferences {
    recent: Mutex<VecDeque<Truth>>,
}

impl ReadyReferences {
    fn get(&self, key: &ReferenceKey) -> Option<Truth> {
        let mut recent = self.lock();
        let at = recent.iter().position(|ready| ready.kept.key == *key)?;
        let ready = recent.remove(at)?;
        recent.push_front(ready.clone());
        Some(ready)
    }

    fn keep(&self, truth: Truth) {
        let mut recent = self.lock();
        recent.retain(|ready| ready.kept.key != truth.kept.key);
        recent.push_front(truth);
        let mut faces = 0;
        let kept = recent.iter().take_while(|ready| {
            let is_first = faces == 0;
            faces += ready.surface.truth().faces.len();
            is_first || faces <= READY_FACES
        });
        let kept = kept.count();
        recent.truncate(kept);
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Truth>> {
        // Nothing panics while it is held.
        self.recent.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Api {
    /// Keeps a reference mesh with a session, in place of an earlier one.
    ///
    /// # Errors
    /// No such session, or the file gives no surface.
    pub(crate) async fn set_reference(
        &self,
        request: v1::SetReferenceRequest,
        call: Call,
    ) -> Result<v1::Reference, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("SetReference", &session_id, &call, async |deadline| {
            let v1::SetReferenceRequest { session_id, mesh, format, metres_per_unit } = request;
            let file = from_proto::reference_file(mesh, format, metres_per_unit, NAMES)?;
            let row = self.row(&session_id).await?;
            let truth = self.read_reference(file.clone(), NAMES, &session_id, deadline).await?;
            self.keep_reference(&session_id, row.created_us, &truth, &file.bytes).await?;
            Ok(reference(&truth.kept, Bytes::new()))
        })
        .await
    }

    /// The reference mesh that a session keeps.
    ///
    /// # Errors
    /// No such session, or it keeps none.
    pub(crate) async fn get_reference(
        &self,
        request: v1::GetReferenceRequest,
        call: Call,
    ) -> Result<v1::Reference, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("GetReference", &session_id, &call, async |_| {
            let v1::GetReferenceRequest { session_id, without_mesh } = request;
            self.row(&session_id).await?;
            let kept = self.sessions.store.reference(&session_id).await?.ok_or(Error::NoReference)?;
            let bytes = match without_mesh {
                true => Bytes::new(),
                false => self.reference_bytes(&session_id, &kept).await?,
            };
            Ok(reference(&kept, bytes))
        })
        .await
    }

    /// Forgets the reference mesh of a session, if there is one.
    ///
    /// # Errors
    /// No such session.
    pub(crate) async fn delete_reference(
        &self,
        request: v1::DeleteReferenceRequest,
        call: Call,
    ) -> Result<v1::DeleteReferenceResponse, Error> {
        let v1::DeleteReferenceRequest { session_id } = request;
        self.run_on_session("DeleteReference", &session_id, &call, async |_| {
            self.row(&session_id).await?;
            self.refuse_while_stopping()?;
            self.sessions.store.forget_reference(&session_id).await?;
            Ok(v1::DeleteReferenceResponse {})
        })
        .await
    }

    /// The reference mesh that a session keeps, ready to compare with.
    ///
    /// # Errors
    /// It keeps none, or that could not be read in time.
    pub(super) async fn kept_truth(
        &self,
        session_id: &str,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Truth, Error> {
        let kept = self.sessions.store.reference(session_id).await?.ok_or(Error::NoReference)?;
        if let Some(ready) = self.references.get(&kept.key) {
            return Ok(ready);
        }
        let bytes = self.reference_bytes(session_id, &kept).await?;
        let format = v1::MeshFormat::try_from(kept.key.format).unwrap_or_default();
        let file = from_proto::reference_file(bytes, format.into(), kept.key.metres_per_unit, NAMES)?;
        let most = self.limits.reference_faces;
        let read = move || ready(&file, most, NAMES.mesh);
        let truth = self.sessions.pool.run(queue, Work::File, session_id, deadline, read).await??;
        self.references.keep(truth.clone());
        Ok(truth)
    }

    /// Reads a file that a caller sent and makes it ready to compare with.
    ///
    /// # Errors
    /// The file gives no surface, or could not be read in time.
    pub(super) async fn read_reference(
        &self,
        file: ReferenceFile,
        names: ReferenceNames,
        session_id: &str,
        deadline: Instant,
    ) -> Result<Truth, Error> {
        let most = self.limits.reference_faces;
        let read = move || ready(&file, most, names.mesh);
        self.sessions.pool.run(Queue::READERS, Work::File, session_id, deadline, read).await?
    }

    /// Keeps a reference that was read with the session that was created at `created_us`.
    ///
    /// # Errors
    /// The session is gone, or nothing can be written.
    pub(super) async fn keep_reference(
        &self,
        session_id: &str,
        created_us: i64,
        truth: &Truth,
        bytes: &Bytes,
    ) -> Result<(), Error> {
        self.refuse_while_stopping()?;
        let before = self.sessions.store.reference(session_id).await?;
        // The errors against the same one are worth keeping.
        if before.is_none_or(|before| before.key != truth.kept.key) {
            let session_id = session_id.to_owned();
            let (kept, bytes) = (truth.kept.clone(), bytes.to_vec());
            let new = NewReference { session_id, created_us, kept, bytes };
            self.sessions.store.keep_reference(new).await?;
        }
        self.references.keep(truth.clone());
        Ok(())
    }

    /// A session as the table has it.
    ///
    /// # Errors
    /// There is no such session.
    pub(super) async fn row(&self, session_id: &str) -> Result<SessionRow, Error> {
        let row = self.sessions.store.session(session_id).await?;
        row.ok_or_else(|| Error::SessionNotFound { session_id: session_id.to_owned() })
    }

    async fn reference_bytes(&self, session_id: &str, kept: &KeptReference) -> Result<Bytes, Error> {
        // It is gone if the session was removed meanwhile.
        let bytes = self.sessions.store.reference_file(session_id, &kept.key.sha256).await?;
        let bytes = bytes.ok_or(Error::NoReference)?;
        if Sha256::digest(&bytes).as_slice() != kept.key.sha256 {
            return Err(Error::internal(format!("the reference mesh {} was changed", hex(&kept.key.sha256))));
        }
        Ok(bytes.into())
    }

    fn refuse_while_stopping(&self) -> Result<(), Error> {
        if self.stopping.is_cancelled() { Err(Error::Draining) } else { Ok(()) }
    }
}

/// What a refusal says of a surface that nothing can be compared with.
pub(super) fn no_surface(error: MetricsError, field: &str) -> Error {
    Error::field(field, error.to_string())
}

fn ready(file: &ReferenceFile, most: usize, field: &str) -> Result<Truth, Error> {
    let mesh = from_proto::reference_mesh(file, most, field)?;
    let count = |items: usize| i64::try_from(items).unwrap_or(i64::MAX);
    let format = match file.format {
        MeshFormat::Ply => v1::MeshFormat::Ply,
        MeshFormat::Stl => v1::MeshFormat::Stl,
        MeshFormat::Obj => v1::MeshFormat::Obj,
    };
    let kept = KeptReference {
        key: ReferenceKey {
            sha256: Sha256::digest(&file.bytes).to_vec(),
            format: format.into(),
            metres_per_unit: file.metres_per_unit,
        },
        n_vertices: count(mesh.vertices.len()),
        n_faces: count(mesh.faces.len()),
    };
    let surface = Reference::new(mesh, Sampling::default()).map_err(|error| no_surface(error, field))?;
    Ok(Truth { kept, surface: Arc::new(surface) })
}

fn reference(kept: &KeptReference, mesh: Bytes) -> v1::Reference {
    let KeptReference { key: ReferenceKey { sha256, format, metres_per_unit }, n_vertices, n_faces } = kept;
    let count = |items: i64| u32::try_from(items).unwrap_or(u32::MAX);
    v1::Reference {
        sha256: hex(sha256),
        mesh,
        format: *format,
        metres_per_unit: *metres_per_unit,
        n_vertices: count(*n_vertices),
        n_faces: count(*n_faces),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(name: u8) -> Truth {
        let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        let file = ReferenceFile { bytes: Bytes::from(obj), format: MeshFormat::Obj, metres_per_unit: 1.0 };
        let mut truth = ready(&file, 100, "mesh").unwrap();
        truth.kept.key.sha256 = vec![name];
        truth
    }

    #[test]
    fn what_was_compared_with_last_is_kept_ready() {
        let references = ReadyReferences::default();
        references.keep(truth(1));
        references.keep(truth(2));
        references.keep(truth(2));
        assert!(references.get(&truth(1).kept.key).is_some());
        assert_eq!(references.lock().len(), 2);
        assert_eq!(references.lock()[0].kept.key.sha256, [1], "it was used last");
        let in_millimetres = ReferenceKey { metres_per_unit: 0.001, ..truth(1).kept.key };
        assert!(references.get(&in_millimetres).is_none(), "another scale is another surface");
    }
}
