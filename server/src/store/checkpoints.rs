//! Checkpoints: what folds go on from, and what readers are shown of each state, in a file beside the log or, where
//! several servers share the log, in tables beside it.
//!
//! They are a cache. Each can be computed again from the log, and is compared with what the log recorded when it is
//! used. The file may be deleted at any time, is emptied when the method's version changes, and is made anew where it
//! cannot be read; in the tables servers of several versions keep theirs beside each other. So nothing here waits for
//! the disk, and nothing here fails a call.

mod keeper;

use std::path::Path;

use sqlx::FromRow;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use self::keeper::{ENDING, Keeper, Place};
use super::engine::Pool;
use super::files;

/// Jobs that may wait.
const QUEUE: usize = 256;

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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use sqlx::sqlite::SqliteConnectOptions;
    use sqlx::{ConnectOptions, Connection as _};

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
