//! What an operator reads: the metrics, with how things are at this moment.

use super::Api;
use crate::compute::Queue;
use crate::metrics::Moment;

impl Api {
    /// All metrics as text. It is answered also where the database is not, since that is when it is read.
    pub(crate) async fn scrape(&self) -> String {
        let (sessions, store) = (&self.sessions, &self.sessions.store);
        let info = self.server_info();
        let [database_bytes, wal_bytes, checkpoint_bytes, disk_free_bytes] = store.sizes();
        let moment = Moment {
            version: info.version,
            algorithm_version: info.algorithm_version,
            engine: store.engine().await.ok(),
            is_ready: self.ready().await.is_ok(),
            sessions: store.session_count().await.ok(),
            quarantined: store.damaged_count().await.ok(),
            live_sessions: sessions.live_count(),
            missing_events: store.missing(),
            robots: sessions.pool.load(Queue::ROBOTS),
            readers: sessions.pool.load(Queue::READERS),
            writes: store.waiting_writes(),
            streams: self.places.taken(),
            database_bytes,
            wal_bytes,
            checkpoint_bytes,
            disk_free_bytes,
            limits: self.limits.numbers(),
        };
        self.metrics().scraped(&moment)
    }
}
