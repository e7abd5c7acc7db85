//! The estimated surface of any revision, packed or as a file.

use std::sync::Arc;

use palpate_core::reconstruction::Surface;
use palpate_proto::v1;
use sha2::{Digest, Sha256};
use tokio::time::Instant;

use super::made_mesh::{Key, MadeMesh};
use super::{Api, Call};
use crate::compute::{Queue, Work};
use crate::error::Error;
use crate::mesh_format::{Colormap, FileFormat, RawArrays, Remark, raw, write_file};
use crate::session::{Shown, Snapshot, hex};
use crate::sessions::Aggregate;
use crate::wire::to_proto;

/// The formats that a mesh can be had in.
pub(super) const FORMATS: [v1::MeshFormat; 5] =
    [v1::MeshFormat::Raw, v1::MeshFormat::Ply, v1::MeshFormat::Obj, v1::MeshFormat::Stl, v1::MeshFormat::Glb];

/// A digest is cut to this many bytes in an etag: enough that no two contents ever share one.
const ETAG_BYTES: usize = 12;

/// How a mesh is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Raw,
    File(FileFormat),
}

impl Api {
    /// The estimated surface at any revision.
    ///
    /// # Errors
    /// No such session, revision or format, or nothing was seen yet.
    pub(crate) async fn get_mesh(&self, request: v1::GetMeshRequest, call: Call) -> Result<v1::Mesh, Error> {
        let session_id = request.session_id.clone();
        self.run_on_session("GetMesh", &session_id, &call, async |deadline| {
            let v1::GetMeshRequest { session_id, revision, format, if_none_match, have_topology, colormap } =
                request;
            let form = form(format, colormap)?;
            let known = if_none_match.trim_matches('"');
            // An earlier revision needs no state, and a session that is not in memory is not opened for it.
            let made = match self.sessions.shown_unopened(&session_id, revision).await {
                Some(kept) => {
                    self.unpacked((&session_id, revision, form), kept, Queue::READERS, deadline).await?
                }
                None => None,
            };
            let made = match made {
                Some(made) => made,
                None => {
                    let newest = self.sessions.at_revision(&session_id, 0, Queue::READERS, deadline).await?;
                    let is_newest = revision == 0 || revision == newest.revision;
                    if is_newest && known == etag(newest.revision, &newest.state_hash(), form) {
                        return Ok(not_modified(newest.revision, known));
                    }
                    self.made_mesh(&newest, revision, form, Queue::READERS, deadline).await?
                }
            };
            if known == made.etag() {
                return Ok(not_modified(revision, known));
            }
            Ok(made.for_caller_with(&have_topology).0)
        })
        .await
    }

    /// The mesh of this session at a revision, 0 being the newest; made once for all who ask.
    ///
    /// # Errors
    /// No such revision, nothing was seen yet, or it could not be made in time.
    pub(super) async fn made_mesh(
        &self,
        newest: &Snapshot,
        revision: i64,
        form: Form,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Arc<MadeMesh>, Error> {
        let revision = if revision == 0 { newest.revision } else { revision };
        let (session_id, created_us) = newest.identity();
        let key = Key { revision, created_us, session_id: session_id.to_owned(), form };
        let cell = self.meshes.cell(&key);
        let make = || self.make_mesh(newest, revision, form, queue, deadline);
        let made = if queue.is_of_robots() {
            // A robot does not wait for what stands in the readers' queue.
            match cell.get() {
                Some(made) => Ok(made.clone()),
                None => make().await.inspect(|made| drop(cell.set(made.clone()))),
            }
        } else {
            cell.get_or_try_init(make).await.cloned()
        };
        self.meshes.trim();
        made
    }

    async fn make_mesh(
        &self,
        newest: &Snapshot,
        revision: i64,
        form: Form,
        queue: Queue,
        deadline: Instant,
    ) -> Result<Arc<MadeMesh>, Error> {
        let (session_id, _) = newest.identity();
        if let Some(kept) = self.sessions.shown_at(newest, revision).await
            && let Some(made) = self.unpacked((session_id, revision, form), kept, queue, deadline).await?
        {
            return Ok(made);
        }
        let snapshot = self.sessions.at_revision(session_id, revision, queue, deadline).await?;
        if snapshot.identity() != newest.identity() {
            return Err(Error::SessionNotFound { session_id: session_id.to_owned() });
        }
        if snapshot.reconstruction.last_estimate().is_none() {
            return Err(Error::NoVisualPrior);
        }
        let make = move || {
            let shown = Shown::of(&snapshot).ok_or(Error::NoVisualPrior)?;
            let (session_id, _) = snapshot.identity();
            let mesh = mesh(&shown, session_id, snapshot.revision, &snapshot.state_hash(), form);
            Ok(Arc::new(MadeMesh::new(mesh)))
        };
        self.sessions.pool.run(queue, Work::Mesh, session_id, deadline, make).await?
    }

    /// The mesh of what was kept of a state; nothing where that cannot be read.
    ///
    /// # Errors
    /// It could not be made in time.
    async fn unpacked(
        &self,
        (session_id, revision, form): (&str, i64, Form),
        (state_hash, bytes): (String, Vec<u8>),
        queue: Queue,
        deadline: Instant,
    ) -> Result<Option<Arc<MadeMesh>>, Error> {
        let id = session_id.to_owned();
        let make = move || {
            let shown = Shown::unpacked(&bytes)?;
            Some(Arc::new(MadeMesh::new(mesh(&shown, &id, revision, &state_hash, form))))
        };
        self.sessions.pool.run(queue, Work::Mesh, session_id, deadline, make).await
    }
}

fn not_modified(revision: i64, etag: &str) -> v1::Mesh {
    v1::Mesh { revision, etag: etag.to_owned(), not_modified: true, ..v1::Mesh::default() }
}

fn form(format: i32, colormap: i32) -> Result<Form, Error> {
    let unknown = |field: &str, number: i32| Error::field(field, format!("{number} is no {field}"));
    let wanted = v1::Colormap::try_from(colormap).map_err(|_| unknown("colormap", colormap))?;
    let form = match v1::MeshFormat::try_from(format).map_err(|_| unknown("format", format))? {
        v1::MeshFormat::Unspecified | v1::MeshFormat::Raw => Form::Raw,
        v1::MeshFormat::Ply => Form::File(FileFormat::Ply),
        v1::MeshFormat::Obj => Form::File(FileFormat::Obj),
        v1::MeshFormat::Stl => Form::File(FileFormat::Stl),
        v1::MeshFormat::Glb => {
            return Ok(Form::File(FileFormat::Glb(match wanted {
                v1::Colormap::Unspecified | v1::Colormap::Paper => Colormap::Paper,
                v1::Colormap::Cividis => Colormap::Cividis,
            })));
        }
    };
    if wanted != v1::Colormap::Unspecified {
        return Err(Error::field("colormap", "is for GLB: leave it out, or ask for that format"));
    }
    Ok(form)
}

fn etag(revision: i64, state_hash: &str, form: Form) -> String {
    let suffix = match form {
        Form::Raw => "raw",
        Form::File(FileFormat::Ply) => "ply",
        Form::File(FileFormat::Obj) => "obj",
        Form::File(FileFormat::Stl) => "stl",
        Form::File(FileFormat::Glb(Colormap::Paper)) => "glb-paper",
        Form::File(FileFormat::Glb(Colormap::Cividis)) => "glb-cividis",
    };
    // Files note the revision, so equal states of two revisions are still different bytes.
    let digest = state_hash.get(..2 * ETAG_BYTES).unwrap_or(state_hash);
    format!("{revision}-{digest}-{suffix}")
}

/// What is shown of a session at a revision, in a form.
fn mesh(shown: &Shown, session_id: &str, revision: i64, state_hash: &str, form: Form) -> v1::Mesh {
    let Shown { frame_id, surface, doubted } = shown;
    let remark = Remark { session_id, frame_id, revision };
    let (content_type, body) = match form {
        Form::Raw => (String::new(), v1::mesh::Body::Raw(raw_mesh(surface))),
        Form::File(format) => {
            let file = write_file(format, surface, &remark);
            (format.content_type().to_owned(), v1::mesh::Body::File(file.into()))
        }
    };
    v1::Mesh {
        revision,
        etag: etag(revision, state_hash, form),
        content_type,
        not_modified: false,
        body: Some(body),
        doubted: to_proto::doubted(doubted),
    }
}

fn raw_mesh(surface: &Surface) -> v1::RawMesh {
    let RawArrays { positions_f32_le, faces_u32_le, uncertainty_f32_le, std_m_f32_le } = raw(surface);
    let topology_etag = hex(&Sha256::digest(&faces_u32_le)[..ETAG_BYTES]);
    let count = |items: usize| u32::try_from(items).unwrap_or(u32::MAX);
    v1::RawMesh {
        n_vertices: count(surface.mesh.vertices.len()),
        n_faces: count(surface.mesh.faces.len()),
        positions_f32_le: positions_f32_le.into(),
        faces_u32_le: faces_u32_le.into(),
        uncertainty_f32_le: uncertainty_f32_le.into(),
        std_m_f32_le: std_m_f32_le.into(),
        topology_etag,
    }
}
