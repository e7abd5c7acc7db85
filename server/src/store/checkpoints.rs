//! Checkpoints: what folds go on from, and what readers are shown of each state, in a file beside the log or, where
//! several servers share the log, in tables beside it.
//!
//! They are a cache. Each can be computed again from the log, and is compared with what the log recorded when it is
//! used. The file may be deleted at any time, is emptied when the method's version changes, and is made anew where it
//! cannot be read; in the tables servers of several versions keep theirs beside each other. So nothing here waits for
//! the disk, and nothing here fails a call.

use std::path::{Path, PathBuf};
use std::time::Duration;

use sha2::{Digest, Sha256};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{ConnectOptions, FromRow};
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use super::engine::{Connection, Pool, sql};
use super::files;
use crate::session::now_us;

/// What the name of the file has after that of the database.
const ENDING: &str = "-checkpoints";
/// Jobs that may wait, and that are done in one transaction.
const QUEUE: usize = 256;
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

/// Which session, and which one of its id: when it was created, in microseconds since 1970, UTC.
pub(crate) type Identity<'a> = (&'a str, i64);

/// What gives a state back.
#[derive(Clone, Debug, PartialEq, Eq, FromRow)]
pub(crate) struct Checkpoint {
    /// The event that the state is after.
    pub(crate) seq: i64,
    /// Of that state.
    pub(crate) state_hash: String,
    pub(crate) bytes: Vec<u8>,
}

/// What is kept of the state after an event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Kept {
    pub(crate) seq: i64,
    /// Of that state.
    pub(crate) state_hash: String,
    /// What gives it back, where that is not what gives back the state before.
    pub(crate) checkpoint: Option<Vec<u8>>,
    /// What readers are shown of it.
    pub(crate) shown: Option<Vec<u8>>,
}

/// The checkpoints of all sessions of a log.
#[derive(Debug)]
pub(crate) struct Checkpoints {
    jobs: mpsc::Sender<Job>,
    /// Cancelled when the file is closed.
    closed: CancellationToken,
}

#[derive(Debug)]
enum Job {
    Keep {
        session_id: String,
        created_us: i64,
        kept: Kept,
    },
    Seqs {
        session_id: String,
        created_us: i64,
        after: i64,
        to: i64,
        found: oneshot::Sender<Vec<i64>>,
    },
    Get {
        session_id: String,
        seq: i64,
        found: oneshot::Sender<Option<Checkpoint>>,
    },
    Shown {
        session_id: String,
        created_us: i64,
        seq: i64,
        state_hash: String,
        found: oneshot::Sender<Vec<u8>>,
    },
    Forget {
        session_id: String,
    },
    Close,
}

impl Checkpoints {
    /// Opens the file beside a database, whose checkpoints hold for one version of the method and take up to
    /// `most_bytes`.
    pub(crate) fn beside(database: &Path, version: &'static str, most_bytes: u64) -> Self {
        Self::at(Place::File(files::beside(database, ENDING)), version, most_bytes)
    }

    /// The same in tables that several servers share, whose checkpoints take up to `most_bytes` together.
    pub(super) fn on(keepers: Pool, version: &'static str, most_bytes: u64) -> Self {
        Self::at(Place::Tables(keepers), version, most_bytes)
    }

    fn at(place: Place, version: &'static str, most_bytes: u64) -> Self {
        let (jobs, queue) = mpsc::channel(QUEUE);
        let closed = CancellationToken::new();
        let keeper = Keeper { place, version, most_bytes, measured: None };
        let announce = closed.clone().drop_guard();
        tokio::spawn(async move {
            keeper.serve(queue).await;
            drop(announce);
        });
        Self { jobs, closed }
    }

    /// Keeps what there is to be kept of a state, unless too much waits already.
    pub(crate) fn keep(&self, (session_id, created_us): Identity<'_>, kept: Kept) {
        if kept.checkpoint.is_some() || kept.shown.is_some() {
            let _ = self.jobs.try_send(Job::Keep { session_id: session_id.to_owned(), created_us, kept });
        }
    }

    /// What readers are shown of the state after an event, where it is that of this hash.
    pub(crate) async fn shown(
        &self,
        (session_id, created_us): Identity<'_>,
        seq: i64,
        state_hash: &str,
    ) -> Option<Vec<u8>> {
        let (session_id, state_hash) = (session_id.to_owned(), state_hash.to_owned());
        let (found, shown) = oneshot::channel();
        self.jobs.send(Job::Shown { session_id, created_us, seq, state_hash, found }).await.ok()?;
        shown.await.ok()
    }

    /// The latest checkpoint after one event, up to another, of those that are `usable`.
    pub(crate) async fn latest(
        &self,
        (session_id, created_us): Identity<'_>,
        after: i64,
        to: i64,
        usable: impl Fn(i64) -> bool,
    ) -> Option<Checkpoint> {
        let session_id = || session_id.to_owned();
        let (found, seqs) = oneshot::channel();
        self.jobs.send(Job::Seqs { session_id: session_id(), created_us, after, to, found }).await.ok()?;
        let seq = seqs.await.ok()?.into_iter().find(|seq| usable(*seq))?;
        let (found, checkpoint) = oneshot::channel();
        self.jobs.send(Job::Get { session_id: session_id(), seq, found }).await.ok()?;
        checkpoint.await.ok()?
    }

    /// Forgets the checkpoints of a session.
    pub(crate) fn forget(&self, session_id: &str) {
        let _ = self.jobs.try_send(Job::Forget { session_id: session_id.to_owned() });
    }

    /// Ends once what was given before is written.
    pub(super) async fn close(&self) {
        let _ = self.jobs.send(Job::Close).await;
        self.closed.cancelled().await;
    }
}

/// Where checkpoints are.
#[derive(Debug)]
enum Place {
    File(PathBuf),
    Tables(Pool),
}

/// Whoever writes and reads them.
#[derive(Debug)]
struct Keeper {
    place: Place,
    version: &'static str,
    most_bytes: u64,
    /// When it was last measured how much is kept.
    measured: Option<Instant>,
}

impl Keeper {
    async fn serve(mut self, mut queue: mpsc::Receiver<Job>) {
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

#[cfg(test)]
mod tests {
    use sqlx::Connection as _;

    use super::*;

    const MOST_BYTES: u64 = 1 << 20;

    fn checkpoint(seq: i64, size: usize) -> Checkpoint {
        Checkpoint { seq, state_hash: format!("hash of {seq}"), bytes: vec![seq as u8; size] }
    }

    fn kept(seq: i64, size: usize) -> Kept {
        let Checkpoint { seq, state_hash, bytes } = checkpoint(seq, size);
        Kept { seq, state_hash, checkpoint: Some(bytes), shown: None }
    }

    struct Folder(tempfile::TempDir);

    impl Folder {
        fn new() -> Self {
            Self(tempfile::tempdir().unwrap())
        }

        fn database(&self) -> PathBuf {
            self.0.path().join("palpate.db")
        }

        fn open(&self, version: &'static str) -> Checkpoints {
            Checkpoints::beside(&self.database(), version, MOST_BYTES)
        }
    }

    async fn seqs(checkpoints: &Checkpoints, identity: Identity<'_>) -> Vec<i64> {
        let mut found = Vec::new();
        let mut to = i64::MAX;
        while let Some(latest) = checkpoints.latest(identity, 0, to, |_| true).await {
            found.push(latest.seq);
            to = latest.seq - 1;
        }
        found
    }

    #[tokio::test]
    async fn the_latest_usable_one_of_the_right_session_is_found_also_after_a_restart() {
        let folder = Folder::new();
        let checkpoints = folder.open("1");
        (2..9).for_each(|seq| checkpoints.keep(("ball", 7), kept(seq, 10)));
        checkpoints.close().await;
        let checkpoints = folder.open("1");
        assert_eq!(checkpoints.latest(("ball", 7), 0, 6, |_| true).await, Some(checkpoint(6, 10)));
        assert_eq!(checkpoints.latest(("ball", 7), 0, 6, |seq| seq < 4).await, Some(checkpoint(3, 10)));
        assert_eq!(checkpoints.latest(("ball", 7), 6, 6, |_| true).await, None);
        assert_eq!(checkpoints.latest(("ball", 8), 0, 6, |_| true).await, None, "created at another time");
        assert_eq!(checkpoints.latest(("mug", 7), 0, 6, |_| true).await, None);
        checkpoints.forget("ball");
        assert!(seqs(&checkpoints, ("ball", 7)).await.is_empty());
    }

    #[tokio::test]
    async fn those_of_another_version_are_dropped() {
        let folder = Folder::new();
        let checkpoints = folder.open("1");
        checkpoints.keep(("ball", 7), kept(2, 10));
        checkpoints.close().await;
        let checkpoints = folder.open("2");
        assert!(seqs(&checkpoints, ("ball", 7)).await.is_empty());
    }

    #[tokio::test]
    async fn a_file_that_is_none_is_made_anew() {
        let folder = Folder::new();
        std::fs::write(files::beside(&folder.database(), ENDING), vec![0x5a; 9000]).unwrap();
        let checkpoints = folder.open("1");
        checkpoints.keep(("ball", 7), kept(2, 10));
        assert_eq!(seqs(&checkpoints, ("ball", 7)).await, [2]);
    }

    #[tokio::test]
    async fn the_oldest_are_given_up_where_they_take_too_much() {
        let folder = Folder::new();
        let checkpoints = folder.open("1");
        for seq in 2..402 {
            checkpoints.keep(("ball", 7), kept(seq, 10_000));
            // All are given to the file, however slow it is.
            assert!(checkpoints.latest(("ball", 7), seq - 1, seq, |_| true).await.is_some());
        }
        let left = seqs(&checkpoints, ("ball", 7)).await;
        assert_eq!(left[0], 401);
        assert!((40..=110).contains(&left.len()), "{} of 10 kB in 1 MiB", left.len());
        checkpoints.close().await;
        let bytes = std::fs::metadata(files::beside(&folder.database(), ENDING)).unwrap().len();
        assert!(bytes < 2 * MOST_BYTES, "{bytes}");
    }

    #[tokio::test]
    async fn what_is_shown_is_kept_once_and_only_found_as_it_was_and_for_its_state() {
        let folder = Folder::new();
        let checkpoints = folder.open("1");
        for seq in 2..9 {
            // The surface changes with every other event.
            let shown = Some(vec![seq as u8 / 2; 5000]);
            checkpoints.keep(("ball", 7), Kept { checkpoint: None, shown, ..kept(seq, 0) });
        }
        for seq in 2..9 {
            let shown = checkpoints.shown(("ball", 7), seq, &format!("hash of {seq}")).await;
            assert_eq!(shown, Some(vec![seq as u8 / 2; 5000]), "{seq}");
        }
        assert_eq!(checkpoints.shown(("ball", 7), 3, "hash of 4").await, None, "another state");
        assert_eq!(checkpoints.shown(("ball", 8), 3, "hash of 3").await, None, "created at another time");
        assert_eq!(checkpoints.shown(("ball", 7), 9, "hash of 9").await, None);
        assert!(seqs(&checkpoints, ("ball", 7)).await.is_empty(), "nothing to go on from");
        checkpoints.close().await;

        let path = folder.database().with_file_name("palpate.db-checkpoints");
        let mut file = SqliteConnectOptions::new().filename(&path).connect().await.unwrap();
        let count: i64 = sqlx::query_scalar("select count(*) from shown").fetch_one(&mut file).await.unwrap();
        assert_eq!(count, 4);
        sqlx::query(
            "update shown set bytes = zeroblob(5000) where kept_us = (select min(kept_us) from shown)",
        )
        .execute(&mut file)
        .await
        .unwrap();
        file.close().await.unwrap();
        let checkpoints = folder.open("1");
        assert_eq!(checkpoints.shown(("ball", 7), 2, "hash of 2").await, None, "damaged");
        assert!(checkpoints.shown(("ball", 7), 4, "hash of 4").await.is_some());
        checkpoints.close().await;
        let checkpoints = folder.open("2");
        assert_eq!(checkpoints.shown(("ball", 7), 4, "hash of 4").await, None, "of another version");
    }

    #[tokio::test]
    async fn a_file_with_other_tables_is_made_anew() {
        let folder = Folder::new();
        let path = folder.database().with_file_name("palpate.db-checkpoints");
        let options = SqliteConnectOptions::new().filename(&path).create_if_missing(true);
        let mut file = options.connect().await.unwrap();
        let table =
            "create table checkpoints (id integer primary key, session_id text, algorithm_version text)";
        sqlx::query(table).execute(&mut file).await.unwrap();
        file.close().await.unwrap();
        let checkpoints = folder.open("1");
        checkpoints.keep(("ball", 7), kept(2, 10));
        assert_eq!(seqs(&checkpoints, ("ball", 7)).await, [2]);
    }

    #[tokio::test]
    async fn what_is_shown_gives_way_before_checkpoints_do() {
        let folder = Folder::new();
        let checkpoints = folder.open("1");
        for seq in 2..102 {
            let shown = Some(vec![seq as u8; 50_000]);
            checkpoints.keep(("ball", 7), Kept { shown, ..kept(seq, 100) });
            assert!(checkpoints.latest(("ball", 7), seq - 1, seq, |_| true).await.is_some());
        }
        assert_eq!(seqs(&checkpoints, ("ball", 7)).await.len(), 100);
        assert!(checkpoints.shown(("ball", 7), 101, "hash of 101").await.is_some());
        assert_eq!(checkpoints.shown(("ball", 7), 2, "hash of 2").await, None);
    }
}
