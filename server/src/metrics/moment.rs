//! How things are when a scrape asks: lengths of queues, sizes of files, and what is open.

use std::sync::atomic::AtomicU64;

use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;

use super::{Labels, add};

/// What a scrape finds; what could not be found out is left out of it and stays as it was.
#[derive(Clone, Debug, Default)]
pub(crate) struct Moment {
    pub(crate) version: String,
    pub(crate) algorithm_version: String,
    /// The engine of the log and its version.
    pub(crate) engine: Option<(&'static str, String)>,
    pub(crate) is_ready: bool,
    pub(crate) sessions: Option<i64>,
    pub(crate) quarantined: Option<i64>,
    pub(crate) live_sessions: usize,
    pub(crate) missing_events: i64,
    /// Length and running computations of each queue.
    pub(crate) robots: (usize, usize),
    pub(crate) readers: (usize, usize),
    pub(crate) writes: usize,
    pub(crate) streams: usize,
    pub(crate) database_bytes: Option<u64>,
    pub(crate) wal_bytes: Option<u64>,
    pub(crate) checkpoint_bytes: Option<u64>,
    pub(crate) disk_free_bytes: Option<u64>,
    /// Each limit that is a number, and those that are times in seconds.
    pub(crate) limits: Vec<(&'static str, f64)>,
}

/// The series that are set at each scrape.
#[derive(Clone, Debug)]
pub(super) struct Gauges {
    build: Family<Vec<(&'static str, String)>, Gauge>,
    is_ready: Gauge,
    sessions: Gauge,
    quarantined: Gauge,
    live_sessions: Gauge,
    missing_events: Gauge,
    queues: Family<Labels<1>, Gauge>,
    running: Family<Labels<1>, Gauge>,
    streams: Gauge,
    connections: Gauge,
    files: Family<Labels<1>, Gauge>,
    disk_free: Gauge,
    limits: Family<Labels<1>, Gauge<f64, AtomicU64>>,
}

impl Gauges {
    pub(super) fn registered(r: &mut Registry) -> Self {
        Self {
            build: add(
                r,
                "build_info",
                "1, with the versions of the program, the method and SQLite or PostgreSQL",
                Family::default(),
            ),
            is_ready: add(
                r,
                "ready",
                "1 where the server takes work: the log takes a write and is read, and no stop was asked",
                Gauge::default(),
            ),
            sessions: add(r, "sessions", "Sessions in the database", Gauge::default()),
            quarantined: add(
                r,
                "sessions_quarantined",
                "Sessions whose log cannot be trusted",
                Gauge::default(),
            ),
            live_sessions: add(r, "sessions_live", "Sessions that are held in memory", Gauge::default()),
            missing_events: add(
                r,
                "missing_events",
                "Events that were acknowledged and were missing when the server started",
                Gauge::default(),
            ),
            queues: add(
                r,
                "queue_length",
                "What waits: computations of robots and of readers, and writes",
                Family::default(),
            ),
            running: add(
                r,
                "compute_running",
                "Computations that have a thread, of robots and of readers",
                Family::default(),
            ),
            streams: add(r, "streams", "Open watch and exploration streams", Gauge::default()),
            connections: add(r, "connections", "Open connections", Gauge::default()),
            files: add(
                r,
                "file_bytes",
                "Size of the database, of SQLite's log of changes beside it (wal), and of the checkpoints",
                Family::default(),
            ),
            disk_free: add(
                r,
                "disk_free_bytes",
                "Room that is left on the disk of the database",
                Gauge::default(),
            ),
            limits: add(
                r,
                "limit",
                "The limits in force, by their names: bytes, counts, and times in seconds",
                Family::default(),
            ),
        }
    }

    pub(super) fn set(&self, moment: &Moment, open_connections: usize) {
        let Moment {
            version,
            algorithm_version,
            engine,
            is_ready,
            sessions,
            quarantined,
            live_sessions,
            missing_events,
            robots,
            readers,
            writes,
            streams,
            database_bytes,
            wal_bytes,
            checkpoint_bytes,
            disk_free_bytes,
            limits,
        } = moment;
        if let Some((engine, engine_version)) = engine {
            let labels = [("version", version), ("algorithm", algorithm_version), (*engine, engine_version)];
            let labels = labels.map(|(name, value)| (name, value.clone())).to_vec();
            self.build.get_or_create(&labels).set(1);
        }
        self.is_ready.set(i64::from(*is_ready));
        for (gauge, count) in [(&self.sessions, sessions), (&self.quarantined, quarantined)] {
            count.map(|count| gauge.set(count));
        }
        self.live_sessions.set(number(*live_sessions));
        self.missing_events.set(*missing_events);
        for (queue, (waiting, running)) in [("robots", robots), ("readers", readers)] {
            self.queues.get_or_create(&[("queue", queue)]).set(number(*waiting));
            self.running.get_or_create(&[("queue", queue)]).set(number(*running));
        }
        self.queues.get_or_create(&[("queue", "writes")]).set(number(*writes));
        self.streams.set(number(*streams));
        self.connections.set(number(open_connections));
        for (file, bytes) in
            [("database", database_bytes), ("wal", wal_bytes), ("checkpoints", checkpoint_bytes)]
        {
            bytes.map(|bytes| self.files.get_or_create(&[("file", file)]).set(number(bytes)));
        }
        disk_free_bytes.map(|bytes| self.disk_free.set(number(bytes)));
        for (name, value) in limits {
            self.limits.get_or_create(&[("name", name)]).set(*value);
        }
    }
}

fn number(count: impl TryInto<i64>) -> i64 {
    count.try_into().unwrap_or(i64::MAX)
}
