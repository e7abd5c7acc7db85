//! Reference meshes that sessions keep, and the errors against them: beside the log, and no part of it.

use std::collections::BTreeMap;

use sqlx::FromRow;

use super::apply::Failure;
use super::change::Change;
use super::engine::{Connection, Pool, sql};
use super::{Store, StoreError};

/// How a file of a reference mesh is to be read, and which one it is: two that agree in all of it are the same surface.
#[derive(Clone, Debug, PartialEq, FromRow)]
pub(crate) struct ReferenceKey {
    /// Of the bytes.
    pub(crate) sha256: Vec<u8>,
    /// How the bytes are to be read.
    pub(crate) format: i32,
    pub(crate) metres_per_unit: f64,
}

/// A reference mesh that a session keeps.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct KeptReference {
    #[sqlx(flatten)]
    pub(crate) key: ReferenceKey,
    pub(crate) n_vertices: i64,
    pub(crate) n_faces: i64,
}

/// A reference mesh to keep with a session, in place of an earlier one.
#[derive(Debug)]
pub(crate) struct NewReference {
    pub(crate) session_id: String,
    /// Tells the session from an earlier one of the same id.
    pub(crate) created_us: i64,
    pub(crate) kept: KeptReference,
    pub(crate) bytes: Vec<u8>,
}

/// Errors of some revisions against the reference mesh that a session keeps, if it still keeps that one.
#[derive(Debug)]
pub(crate) struct NewErrors {
    pub(crate) session_id: String,
    /// Tells the session from an earlier one of the same id.
    pub(crate) created_us: i64,
    pub(crate) reference: ReferenceKey,
    pub(crate) algorithm_version: &'static str,
    /// Each with its revision.
    pub(crate) errors: Vec<(i64, SurfaceError)>,
}

/// Distance of an estimate from the reference, in metres; nothing where it cannot be compared.
pub(crate) type SurfaceError = Option<f64>;

const REFERENCE: &str = "select sha256, format, metres_per_unit, n_vertices, n_faces from session_references
    where session_id = $1";
/// The bytes of a session's reference mesh, where sessions may share a file, and where each has its own.
const BYTES: &str = "select bytes from session_references join reference_files using (sha256)
    where session_id = $1 and sha256 = $2";
const SHARED_BYTES: &str = "select bytes from session_references where session_id = $1 and sha256 = $2";

impl Store {
    /// The reference mesh that a session keeps, but for its bytes.
    pub(crate) async fn reference(&self, session_id: &str) -> Result<Option<KeptReference>, StoreError> {
        Ok(of(&self.readers, session_id).await?)
    }

    /// The bytes of the reference mesh that a session keeps; nothing where it keeps that one no more.
    pub(crate) async fn reference_file(
        &self,
        session_id: &str,
        sha256: &[u8],
    ) -> Result<Option<Vec<u8>>, StoreError> {
        let query = if self.readers.is_shared() { SHARED_BYTES } else { BYTES };
        Ok(self.readers.scalar(sql(query).bind(session_id).bind(sha256)).await?)
    }

    /// The errors that are known, by their revision.
    pub(crate) async fn surface_errors(
        &self,
        session_id: &str,
        algorithm_version: &str,
    ) -> Result<BTreeMap<i64, SurfaceError>, StoreError> {
        let query = sql("select seq, surface_distance_m from reference_errors
             where session_id = $1 and algorithm_version = $2");
        let rows: Vec<(i64, SurfaceError)> =
            self.readers.all(query.bind(session_id).bind(algorithm_version)).await?;
        Ok(rows.into_iter().collect())
    }

    /// Keeps a reference mesh with a session.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] when the session is gone.
    pub(crate) async fn keep_reference(&self, reference: NewReference) -> Result<(), StoreError> {
        self.write(Change::KeepReference(Box::new(reference))).await
    }

    /// Forgets the reference mesh of a session, if it keeps one.
    pub(crate) async fn forget_reference(&self, session_id: &str) -> Result<(), StoreError> {
        self.write(Change::ForgetReference(session_id.to_owned())).await
    }

    /// Notes errors that were computed.
    pub(crate) async fn note_errors(&self, errors: NewErrors) -> Result<(), StoreError> {
        self.write(Change::NoteErrors(errors)).await
    }
}

/// The reference mesh that a session keeps, but for its bytes.
pub(super) async fn of(readers: &Pool, session_id: &str) -> Result<Option<KeptReference>, sqlx::Error> {
    readers.optional(sql(REFERENCE).bind(session_id)).await
}

/// The reference mesh that a session keeps, as another one is to keep it.
pub(super) async fn whole(
    connection: &mut Connection,
    session_id: String,
    created_us: i64,
) -> Result<Option<NewReference>, sqlx::Error> {
    let Some(kept) = sql(REFERENCE).bind(&session_id).optional::<KeptReference>(connection).await? else {
        return Ok(None);
    };
    let query = sql(if connection.is_shared() { SHARED_BYTES } else { BYTES });
    let bytes = query.bind(&session_id).bind(&kept.key.sha256).scalar(connection).await?;
    Ok(bytes.map(|bytes| NewReference { session_id, created_us, kept, bytes }))
}

pub(super) async fn keep(connection: &mut Connection, new: &NewReference) -> Result<(), Failure> {
    let NewReference { session_id, created_us, kept, bytes } = new;
    let KeptReference { key: ReferenceKey { sha256, format, metres_per_unit }, n_vertices, n_faces } = kept;
    let keep = if connection.is_shared() {
        // What was computed against another one is worth nothing. In SQLite, where sessions may share a file, triggers
        // see to this and to files that nobody keeps.
        sql("delete from reference_errors where session_id = $1")
            .bind(session_id)
            .execute(connection)
            .await?;
        "insert into session_references
             (session_id, sha256, format, metres_per_unit, n_vertices, n_faces, bytes)
         select session_id, $3, $4, $5, $6, $7, $8 from sessions where session_id = $1 and created_us = $2
         on conflict (session_id) do update set
             sha256 = excluded.sha256, format = excluded.format, metres_per_unit = excluded.metres_per_unit,
             n_vertices = excluded.n_vertices, n_faces = excluded.n_faces, bytes = excluded.bytes"
    } else {
        sql("insert into reference_files (sha256, bytes) values ($1, $2) on conflict (sha256) do nothing")
            .bind(sha256)
            .bind(bytes)
            .execute(connection)
            .await?;
        "insert into session_references (session_id, sha256, format, metres_per_unit, n_vertices, n_faces)
         select session_id, $3, $4, $5, $6, $7 from sessions where session_id = $1 and created_us = $2
         on conflict (session_id) do update set
             sha256 = excluded.sha256, format = excluded.format, metres_per_unit = excluded.metres_per_unit,
             n_vertices = excluded.n_vertices, n_faces = excluded.n_faces"
    };
    let mut keep = sql(keep)
        .bind(session_id)
        .bind(created_us)
        .bind(sha256)
        .bind(format)
        .bind(metres_per_unit)
        .bind(n_vertices)
        .bind(n_faces);
    if connection.is_shared() {
        keep = keep.bind(bytes);
    }
    if keep.execute(connection).await? == 1 { Ok(()) } else { Err(StoreError::Conflict.into()) }
}

pub(super) async fn forget(connection: &mut Connection, session_id: &str) -> Result<(), Failure> {
    sql("delete from session_references where session_id = $1").bind(session_id).execute(connection).await?;
    Ok(())
}

/// A session that is made of another one keeps the reference mesh that this one keeps: it is of the same object.
pub(super) async fn keep_that_of(
    connection: &mut Connection,
    session_id: &str,
    origin: &str,
) -> Result<(), Failure> {
    sql("insert into session_references (session_id, sha256, format, metres_per_unit, n_vertices, n_faces)
         select $1, sha256, format, metres_per_unit, n_vertices, n_faces from session_references
         where session_id = $2")
    .bind(session_id)
    .bind(origin)
    .execute(connection)
    .await?;
    Ok(())
}

pub(super) async fn note(connection: &mut Connection, new: &NewErrors) -> Result<(), Failure> {
    let NewErrors { session_id, created_us, reference, algorithm_version, errors } = new;
    let ReferenceKey { sha256, format, metres_per_unit } = reference;
    for (seq, error) in errors {
        // Nothing where the session or its reference is another one by now.
        sql(
            "insert into reference_errors (session_id, seq, algorithm_version, surface_distance_m)
             select session_references.session_id, $1, $2, $3 from session_references join sessions using (session_id)
             where session_references.session_id = $4 and created_us = $5
                 and sha256 = $6 and format = $7 and metres_per_unit = $8
             on conflict (session_id, seq, algorithm_version)
                 do update set surface_distance_m = excluded.surface_distance_m",
        )
        .bind(seq)
        .bind(*algorithm_version)
        .bind(error)
        .bind(session_id)
        .bind(created_us)
        .bind(sha256)
        .bind(format)
        .bind(metres_per_unit)
        .execute(connection)
        .await?;
    }
    Ok(())
}
