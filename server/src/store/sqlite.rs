//! The log in a file of SQLite: one writer that commits in groups, and the witness beside the file.

use std::path::PathBuf;
use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use super::change::Change;
use super::open::Opened;
use super::readable::Readable;
use super::write::{Job, Writer};
use super::{StoreError, files};
use crate::limits::Limits;
use crate::metrics::Metrics;

/// What becomes of a change.
pub(super) type Outcome = oneshot::Receiver<Result<(), StoreError>>;

/// The way to the writer, and what is known of the file.
#[derive(Debug)]
pub(super) struct SqliteLog {
    jobs: mpsc::Sender<Job>,
    /// Asks the writer to finish what is queued and to close the file.
    closing: CancellationToken,
    /// Cancelled when the writer has done so.
    closed: CancellationToken,
    /// Events that were acknowledged and are not there.
    pub(super) missing: i64,
    /// What the disk does not read.
    pub(super) readable: Arc<Readable>,
    database: PathBuf,
}

impl SqliteLog {
    /// Starts the writer of a log that is open.
    pub(super) fn start(opened: Opened, limits: &Limits, metrics: Metrics) -> Self {
        let (jobs, queue) = mpsc::channel(limits.write_queue);
        let (closing, closed) = (CancellationToken::new(), CancellationToken::new());
        let missing = opened.missing;
        let readable = Arc::new(Readable::of(&opened.database));
        let database = opened.database.clone();
        let writer = Writer::new(opened, limits.database_bytes, metrics);
        let writer = writer.run(queue, limits.write_batch, closing.clone());
        let announce = closed.clone().drop_guard();
        tokio::spawn(async move {
            writer.await;
            drop(announce);
        });
        Self { jobs, closing, closed, missing, readable, database }
    }

    /// Queues a change.
    ///
    /// # Errors
    /// Too many wait, or the writer has stopped.
    pub(super) fn enqueue(&self, change: Change) -> Result<Outcome, StoreError> {
        let (done, outcome) = oneshot::channel();
        self.jobs.try_send(Job { change, done }).map_err(|refused| match refused {
            mpsc::error::TrySendError::Full(_) => StoreError::QueueFull,
            mpsc::error::TrySendError::Closed(_) => StoreError::Down("the writer has stopped".into()),
        })?;
        Ok(outcome)
    }

    /// How many changes wait.
    pub(super) fn waiting(&self) -> usize {
        self.jobs.max_capacity() - self.jobs.capacity()
    }

    /// Ends once what was queued is on disk and the file is closed.
    pub(super) async fn close(&self) {
        self.closing.cancel();
        self.closed.cancelled().await;
    }

    /// The sizes of the database, of its log of changes and of the checkpoints, and the room that their disk has left,
    /// each as far as the system tells.
    pub(super) fn sizes(&self) -> [Option<u64>; 4] {
        let size = |ending: &str| Some(std::fs::metadata(files::beside(&self.database, ending)).ok()?.len());
        [size(""), size("-wal"), size("-checkpoints"), files::free_bytes(&self.database)]
    }
}
