//! The estimated surface of any revision, packed or as a file.

use palpate_core::reconstruction::Surface;
use palpate_proto::v1;
use sha2::{Digest, Sha256};
use tokio::time::Instant;

use super::{Api, Call};
use crate::error::Error;
use crate::mesh_format::{FileFormat, RawArrays, raw, write_file};
use crate::session::{Snapshot, hex};
use crate::wire::to_proto;

/// The formats that a mesh can be had in.
pub(super) const FORMATS: [v1::MeshFormat; 4] =
    [v1::MeshFormat::Raw, v1::MeshFormat::Ply, v1::MeshFormat::Obj, v1::MeshFormat::Stl];

/// A digest is cut to this many bytes in an etag: enough that no two contents ever share one.
const ETAG_BYTES: usize = 12;

#[derive(Clone, Copy, Debug)]
enum Form {
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
            let v1::GetMeshRequest { session_id, revision, format, if_none_match, have_topology } = request;
            let form = form(format)?;
            let snapshot = self.sessions.at_revision(&session_id, revision, deadline).await?;
            let etag = etag(&snapshot, form);
            if if_none_match.trim_matches('"') == etag {
                let revision = snapshot.revision;
                return Ok(v1::Mesh { revision, etag, not_modified: true, ..v1::Mesh::default() });
            }
            self.sessions.pool.run(deadline, move || mesh(&snapshot, form, &have_topology)).await?
        })
        .await
    }

    /// The packed mesh of a snapshot that has one, for streams.
    pub(super) async fn raw_mesh(
        &self,
        session_id: &str,
        revision: i64,
        have_topology: String,
        deadline: Instant,
    ) -> Result<v1::Mesh, Error> {
        let snapshot = self.sessions.at_revision(session_id, revision, deadline).await?;
        self.sessions.pool.run(deadline, move || mesh(&snapshot, Form::Raw, &have_topology)).await?
    }
}

fn form(format: i32) -> Result<Form, Error> {
    match v1::MeshFormat::try_from(format) {
        Ok(v1::MeshFormat::Unspecified | v1::MeshFormat::Raw) => Ok(Form::Raw),
        Ok(v1::MeshFormat::Ply) => Ok(Form::File(FileFormat::Ply)),
        Ok(v1::MeshFormat::Obj) => Ok(Form::File(FileFormat::Obj)),
        Ok(v1::MeshFormat::Stl) => Ok(Form::File(FileFormat::Stl)),
        Ok(v1::MeshFormat::Glb) => {
            Err(Error::unimplemented("format MESH_FORMAT_GLB (RAW, PLY, OBJ and STL are)"))
        }
        Err(_) => Err(Error::field("format", format!("{format} is no format"))),
    }
}

fn etag(snapshot: &Snapshot, form: Form) -> String {
    let suffix = match form {
        Form::Raw => "raw",
        Form::File(FileFormat::Ply) => "ply",
        Form::File(FileFormat::Obj) => "obj",
        Form::File(FileFormat::Stl) => "stl",
    };
    // Files note the revision, so equal states of two revisions are still different bytes.
    format!("{}-{}-{suffix}", snapshot.revision, hex(&snapshot.digest[..ETAG_BYTES]))
}

fn mesh(snapshot: &Snapshot, form: Form, have_topology: &str) -> Result<v1::Mesh, Error> {
    let surface = snapshot.reconstruction.surface().ok_or(Error::NoVisualPrior)?;
    let (content_type, body) = match form {
        Form::Raw => (String::new(), v1::mesh::Body::Raw(raw_mesh(&surface, have_topology))),
        Form::File(format) => {
            let file = write_file(format, &surface, snapshot.revision);
            (format.content_type().to_owned(), v1::mesh::Body::File(file.into()))
        }
    };
    Ok(v1::Mesh {
        revision: snapshot.revision,
        etag: etag(snapshot, form),
        content_type,
        not_modified: false,
        body: Some(body),
        doubted: to_proto::doubted(snapshot),
    })
}

fn raw_mesh(surface: &Surface, have_topology: &str) -> v1::RawMesh {
    let RawArrays { positions_f32_le, faces_u32_le, uncertainty_f32_le, std_m_f32_le } = raw(surface);
    let topology_etag = hex(&Sha256::digest(&faces_u32_le)[..ETAG_BYTES]);
    let count = |items: usize| u32::try_from(items).unwrap_or(u32::MAX);
    v1::RawMesh {
        n_vertices: count(surface.mesh.vertices.len()),
        n_faces: count(surface.mesh.faces.len()),
        positions_f32_le: positions_f32_le.into(),
        faces_u32_le: if have_topology == topology_etag { Vec::new() } else { faces_u32_le }.into(),
        uncertainty_f32_le: uncertainty_f32_le.into(),
        std_m_f32_le: std_m_f32_le.into(),
        topology_etag,
    }
}
