//! Who writes and reads checkpoints, one job after the other: in a file of its own, or in tables of the log's database.

use std::path::PathBuf;
use std::time::Duration;

use sha2::{Digest, Sha256};
use sqlx::ConnectOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use tokio::sync::mpsc;
use tokio::time::Instant;

use super::{Job, Kept};
use crate::session::now_us;
use crate::store::engine::{Connection, Pool, sql};
use crate::store::files;

/// What the name of the file has after that of the database.
pub(super) const ENDING: &str = "-checkpoints";
/// Jobs that are done in one transaction.
const BATCH: usize = 64;
/// The part that is given up, the oldest first, where more is kept than may be.
const GIVEN_UP: i64 = 8;

/// How often it is measured how much is kept, where that takes reading it.
const MEASURE_AGAIN: Duration = Duration::from_secs(5);
/// How long a broken connection is left alone.
const PAUSE: Duration = Duration::from_secs(1);

/// The tables of the file; those of PostgreSQL are in its migrations.
const TABLES: [&str; 4] = [
    "create table if not exists checkpoints (
    session_id text not null,
    created_us integer not null, -- of the session
    seq integer not null, -- the event that the state is after
    algorithm_version text not null,
    state_hash text not null,
    bytes blob, -- null where they are those of the event before
    shown blob, -- the digest of what readers see, in the other table
    size integer not null, -- of the bytes
    kept_us integer not null, -- microseconds since 1970, UTC
    constraint checkpoints_pk primary key (session_id, seq, algorithm_version)
) strict",
    // Equal ones of a session are kept once: many events leave the surface as it was.
    "create table if not exists shown (
    session_id text not null,
    digest blob not null, -- SHA-256
    bytes blob not null,
    size integer not null, -- of the bytes
    kept_us integer not null, -- microseconds since 1970, UTC
    constraint shown_pk primary key (session_id, digest)
) strict",
    "create index if not exists checkpoints_oldest_first on checkpoints (kept_us)",
    "create index if not exists shown_oldest_first on shown (kept_us)",
];

/// Where checkpoints are.
#[derive(Debug)]
pub(super) enum Place {
    File(PathBuf),
    Tables(Pool),
}

/// Whoever writes and reads them.
#[derive(Debug)]
pub(super) struct Keeper {
    pub(super) place: Place,
    /// Of the method.
    pub(super) version: &'static str,
    pub(super) most_bytes: u64,
    /// When it was last measured how much is kept.
    pub(super) measured: Option<Instant>,
}

impl Keeper {
    /// Does the jobs, until none can come any more or it is to close.
    pub(super) async fn serve(mut self, mut queue: mpsc::Receiver<Job>) {
        let mut connection = self.opened().await;
        let mut broken_at = connection.is_none().then(Instant::now);
        let mut jobs = Vec::with_capacity(BATCH);
        while queue.recv_many(&mut jobs, BATCH).await > 0 {
            let ends = jobs.iter().any(|job| matches!(job, Job::Close));
            if connection.is_none() && broken_at.is_some_and(|at| at.elapsed() >= PAUSE) {
                connection = self.opened().await;
                broken_at = connection.is_none().then(Instant::now);
            }
            if let Some(mut open) = connection.take() {
                match self.serve_all(&mut open, &mut jobs).await {
                    Ok(()) => connection = Some(open),
                    Err(failure) => (connection, broken_at) = self.recover(open, &failure).await,
                }
            }
            // Who asked is told that there is none.
            jobs.clear();
            if ends {
                break;
            }
        }
        if let Some(connection) = connection {
            let _ = connection.close().await;
        }
        if let Place::Tables(keepers) = &self.place {
            keepers.close().await;
        }
    }

    /// After a failure: a file is made anew, and a connection is opened again in a while.
    async fn recover(
        &self,
        broken: Connection,
        failure: &sqlx::Error,
    ) -> (Option<Connection>, Option<Instant>) {
        match &self.place {
            Place::File(path) => {
                tracing::warn!(%failure, path = %path.display(), "checkpoints are made anew: sessions open slower");
                drop(broken);
                (self.anew().await, None)
            }
            Place::Tables(keepers) => {
                tracing::warn!(%failure, "checkpoints are neither kept nor found for a moment: sessions open slower");
                keepers.discard(broken);
                (None, Some(Instant::now()))
            }
        }
    }

    async fn opened(&self) -> Option<Connection> {
        match self.open().await {
            Ok(connection) => Some(connection),
            Err(_) => self.anew().await,
        }
    }

    async fn anew(&self) -> Option<Connection> {
        if let Place::File(path) = &self.place {
            for ending in ["", "-wal", "-shm"] {
                let _ = std::fs::remove_file(files::beside(path, ending));
            }
        }
        let complain =
            |failure: &sqlx::Error| tracing::warn!(%failure, "no checkpoints are kept: sessions open slower");
        self.open().await.inspect_err(complain).ok()
    }

    async fn open(&self) -> Result<Connection, sqlx::Error> {
        let path = match &self.place {
            Place::File(path) => path,
            Place::Tables(keepers) => {
                let mut connection = keepers.acquire().await?;
                // What a crash takes of a cache is computed again.
                sql("set synchronous_commit = off").execute(&mut connection).await?;
                return Ok(connection);
            }
        };
        files::create_private(path)?;
        // What a crash leaves half written is found, and then made anew.
        let options = SqliteConnectOptions::new()
            .filename(path)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Off);
        let mut connection = Connection::Sqlite(options.connect().await?);
        for table in TABLES {
            sql(table).execute(&mut connection).await?;
        }
        let others = sql("delete from checkpoints where algorithm_version <> $1");
        others.bind(self.version).execute(&mut connection).await?;
        // Those of another version, and of sessions that were deleted.
        let unused = "delete from shown where not exists (
            select 1 from checkpoints c where c.session_id = shown.session_id and c.shown = shown.digest)";
        sql(unused).execute(&mut connection).await?;
        Ok(connection)
    }

    async fn serve_all(
        &mut self,
        connection: &mut Connection,
        jobs: &mut Vec<Job>,
    ) -> Result<(), sqlx::Error> {
        sql("begin").execute(connection).await?;
        let mut has_grown = false;
        for job in jobs.drain(..) {
            has_grown |= matches!(job, Job::Keep { .. });
            self.serve_one(connection, job).await?;
        }
        if has_grown {
            self.keep_within_bounds(connection).await?;
        }
        sql("commit").execute(connection).await?;
        Ok(())
    }

    async fn serve_one(&self, connection: &mut Connection, job: Job) -> Result<(), sqlx::Error> {
        match job {
            Job::Keep { session_id, created_us, kept: Kept { seq, state_hash, checkpoint, shown } } => {
                let digest = shown.as_ref().map(|shown| Sha256::digest(shown).to_vec());
                let now = now_us();
                if let Some((digest, shown)) = digest.as_ref().zip(shown) {
                    let query = sql("insert into shown (session_id, digest, bytes, size, kept_us)
                         values ($1, $2, $3, $4, $5) on conflict (session_id, digest) do nothing");
                    let size = shown.len() as i64;
                    query
                        .bind(&session_id)
                        .bind(digest)
                        .bind(shown)
                        .bind(size)
                        .bind(now)
                        .execute(connection)
                        .await?;
                }
                let size = checkpoint.as_ref().map_or(0, Vec::len) as i64;
                sql("insert into checkpoints
                         (session_id, created_us, seq, algorithm_version, state_hash, bytes, shown, size, kept_us)
                     values ($1, $2, $3, $4, $5, $6, $7, $8, $9)
                     on conflict (session_id, seq, algorithm_version) do update set
                         created_us = excluded.created_us, state_hash = excluded.state_hash,
                         bytes = excluded.bytes, shown = excluded.shown, size = excluded.size,
                         kept_us = excluded.kept_us")
                .bind(session_id)
                .bind(created_us)
                .bind(seq)
                .bind(self.version)
                .bind(state_hash)
                .bind(checkpoint)
                .bind(digest)
                .bind(size)
                .bind(now)
                .execute(connection)
                .await?;
            }
            Job::Seqs { session_id, created_us, after, to, found } => {
                let query = sql("select seq from checkpoints
                     where session_id = $1 and created_us = $2 and seq > $3 and seq <= $4
                         and algorithm_version = $5 and bytes is not null
                     order by seq desc");
                let query = query.bind(session_id).bind(created_us).bind(after).bind(to).bind(self.version);
                let seqs: Vec<(i64,)> = query.all(connection).await?;
                let _ = found.send(seqs.into_iter().map(|(seq,)| seq).collect());
            }
            Job::Get { session_id, seq, found } => {
                let query = sql("select seq, state_hash, bytes from checkpoints
                     where session_id = $1 and seq = $2 and algorithm_version = $3 and bytes is not null");
                let query = query.bind(session_id).bind(seq).bind(self.version);
                let _ = found.send(query.optional(connection).await?);
            }
            Job::Shown { session_id, created_us, seq, state_hash, found } => {
                let query = sql("select s.digest, s.bytes
                     from checkpoints c join shown s on s.session_id = c.session_id and s.digest = c.shown
                     where c.session_id = $1 and c.created_us = $2 and c.seq = $3 and c.state_hash = $4
                         and c.algorithm_version = $5");
                let query =
                    query.bind(session_id).bind(created_us).bind(seq).bind(state_hash).bind(self.version);
                let kept: Option<(Vec<u8>, Vec<u8>)> = query.optional(connection).await?;
                // Damaged bytes are none: who asked is told so by the channel's end.
                if let Some((_, bytes)) =
                    kept.filter(|(digest, bytes)| Sha256::digest(bytes)[..] == digest[..])
                {
                    let _ = found.send(bytes);
                }
            }
            Job::Forget { session_id } => {
                for table in ["checkpoints", "shown"] {
                    let query = sql(format!("delete from {table} where session_id = $1"));
                    query.bind(&session_id).execute(connection).await?;
                }
            }
            Job::Close => {}
        }
        Ok(())
    }

    async fn keep_within_bounds(&mut self, connection: &mut Connection) -> Result<(), sqlx::Error> {
        let is_shared = connection.is_shared();
        if is_shared && self.measured.is_some_and(|at| at.elapsed() < MEASURE_AGAIN) {
            return Ok(());
        }
        self.measured = Some(Instant::now());
        let used = if is_shared {
            "select cast(coalesce((select sum(size) from checkpoints), 0)
                 + coalesce((select sum(size) from shown), 0) as bigint)"
        } else {
            "select (page_count - freelist_count) * page_size
             from pragma_page_count, pragma_freelist_count, pragma_page_size"
        };
        let used: Option<i64> = sql(used).scalar(connection).await?;
        if used.and_then(|used| u64::try_from(used).ok()).unwrap_or(0) <= self.most_bytes {
            return Ok(());
        }
        // What is shown takes most, and is computed again from a checkpoint.
        for table in ["shown", "checkpoints"] {
            let query = sql(format!(
                "delete from {table} where kept_us <= (
                     select kept_us from {table} order by kept_us
                     limit 1 offset (select count(*) / $1 from {table}))"
            ));
            if query.bind(GIVEN_UP).execute(connection).await? > 0 {
                return Ok(());
            }
        }
        Ok(())
    }
}
