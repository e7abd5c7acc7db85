//! Every bound on what comes from the network, in one place.
//!
//! Reaching one is answered with an error that names the limit and says what to do.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Visual points of one session: more are thinned to it. A constant, because replaying a log thins by it too.
pub(crate) const VISUAL_POINTS: usize = 2000;

/// Pixels of a depth image; constants from here on, because replaying a log reads its clouds again.
pub(crate) const DEPTH_PIXELS: usize = 4 << 20;

/// Bytes that a decoder of PNG files may take beside the image itself.
pub(crate) const PNG_DECODER_BYTES: usize = 16 << 20;

/// Bytes of a cloud once it is decompressed.
pub(crate) const CLOUD_BYTES: usize = 32 << 20;

/// Lines of the header of a PLY or PCD file, comments included.
pub(crate) const FILE_HEADER_LINES: usize = 1024;

/// Bytes of one line of such a header, comments included.
pub(crate) const FILE_HEADER_LINE_BYTES: usize = 4096;

/// Elements that such a header declares.
pub(crate) const FILE_ELEMENTS: usize = 64;

/// Properties of an element, or fields of a point.
pub(crate) const FILE_PROPERTIES: usize = 256;

/// Bytes of a caller's text that an error echoes.
pub(crate) const ECHO_BYTES: usize = 64;

/// Bytes of the path of a field that an error names, and of what it says about it: both have to fit into the headers
/// of a gRPC status.
pub(crate) const FIELD_PATH_BYTES: usize = 256;
pub(crate) const ERROR_TEXT_BYTES: usize = 1024;

/// Bytes of what this service makes and callers give back: candidate ids, page tokens and etags have some 100 at most.
pub(crate) const OPAQUE_BYTES: usize = 256;

/// Bytes of the longest session id; a UUID has 36.
pub(crate) const SESSION_ID_BYTES: usize = 63;

/// Bytes of a JSON body that is parsed at once; a larger one is handed to a thread that may block.
pub(crate) const INLINE_JSON_BYTES: usize = 64 << 10;

/// Extent of the smallest cloud that is an object, in metres: no sensor resolves less, and no pad touches it. Asked
/// where a cloud is sent, not where a log is replayed.
pub(crate) const SMALLEST_CLOUD_M: f64 = 1e-5;

/// The largest number that a limit may be, 1 EiB: what waits is counted in somewhat less than 64 bits.
const MOST: u64 = 1 << 60;
/// The longest time that a limit may be: clocks overflow far beyond.
const LONGEST: Duration = Duration::from_secs(366 * 24 * 3600);
/// The shortest time that a limit may be: clocks that tick more often do nothing else.
const SHORTEST: Duration = Duration::from_millis(1);
/// The limits that may be 0, which turns off what they bound.
const MAY_BE_ZERO: [&str; 8] = [
    "checkpoint_bytes",
    "explained_vertices",
    "keep_out",
    "labels",
    "leased_places",
    "mesh_bytes",
    "past_states",
    "shadow",
];

/// Declares the struct as it is written, and beside it what is said of each field, for those who configure a server.
macro_rules! with_meanings {
    (
        $(#[$attribute:meta])*
        pub struct $name:ident { $($(#[doc = $line:literal])+ pub $field:ident: $type:ty,)+ }
    ) => {
        $(#[$attribute])*
        pub struct $name { $($(#[doc = $line])+ pub $field: $type,)+ }

        impl $name {
            /// The name of each field, with what is said of it.
            pub const MEANINGS: &[(&str, &str)] = &[$((stringify!($field), concat!($($line),+))),+];
        }
    };
}

with_meanings! {
/// The bounds of one server; the defaults suit one machine and a few robots.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Largest request message, in bytes.
    pub message_bytes: usize,
    /// Largest JSON body, in bytes: parsed, it takes many times its size.
    pub json_bytes: usize,
    /// Objects and their fields in a JSON body: parsed, an empty one takes a hundred times its size.
    pub json_fields: usize,
    /// Arrays and their values in a JSON body: numbers of points, above all.
    pub json_values: usize,
    /// Vertices, and triangles, of a reference mesh.
    pub reference_faces: usize,
    /// Revisions that one call compares with a reference mesh.
    pub evaluated_revisions: usize,
    /// Samples of each surface for one comparison.
    pub samples: u32,
    /// Sessions in the summary of an experiment.
    pub summarized_sessions: usize,
    /// Contact results of one session, failures included.
    pub contacts: u32,
    /// Candidates in one reply.
    pub top_k: u32,
    /// Vertices whose score one request asks.
    pub explained_vertices: usize,
    /// Keep-out regions in one request.
    pub keep_out: usize,
    /// Strategies that one session asks beside its own.
    pub shadow: usize,
    /// Declared pads of one session, and contacts of one result.
    pub pads: usize,
    /// Longest lease of a candidate.
    pub lease_max: Duration,
    /// Leased places of one session that are in force at once.
    pub leased_places: usize,
    /// Page size where the caller names none.
    pub page_size: u32,
    /// Largest page; larger requests are capped.
    pub page_size_max: u32,
    /// Labels of one session.
    pub labels: usize,
    /// Bytes of a label's key or value, of a name or of a request id.
    pub name_bytes: usize,
    /// Bytes of a free text such as a detail or a note.
    pub text_bytes: usize,
    /// Bytes that the events of one session may take.
    pub session_bytes: u64,
    /// Bytes of a bundle that is imported: a session of `session_bytes` with all that goes with it.
    pub archive_bytes: u64,
    /// Members of a bundle, most of which are events.
    pub archive_members: usize,
    /// Bytes of all bundles that are being imported at once.
    pub import_bytes: u64,
    /// Bytes that the database may hold.
    pub database_bytes: u64,
    /// Bytes of the file beside the database that sessions open from quickly; the oldest of it gives way.
    pub checkpoint_bytes: u64,
    /// Connections to PostgreSQL, where that holds the log: half of them read, and half of them write.
    pub database_connections: u32,
    /// How long PostgreSQL may take for a statement, a commit or a new connection.
    pub database_timeout: Duration,
    /// Where other servers write the same log: for how long a session in memory may be shown without a look at it.
    pub staleness: Duration,
    /// The same for sessions that somebody watches, which are looked after all together.
    pub follow: Duration,
    /// How fast logs are proved in the background, in bytes a second.
    pub proof_bytes_per_s: u64,
    /// Pause between two rounds of that.
    pub proof_pause: Duration,
    /// Whether names, labels and ids may have control characters and bidirectional marks; logs of earlier versions do.
    pub unprintable_names: bool,
    /// Sessions in the database.
    pub sessions: u64,
    /// Sessions whose state is held in memory; the least recently used are dropped first.
    pub live_sessions: usize,
    /// Bytes that they take, roughly.
    pub live_bytes: usize,
    /// How long one stays there that nobody asks for or watches.
    pub session_idle: Duration,
    /// Past states held in memory for meshes of earlier revisions.
    pub past_states: usize,
    /// Computations for robots that may wait. Like the next two it bounds memory alone: a call waits as long as its
    /// deadline allows, and is refused where that is known to be too short.
    pub compute_queue: usize,
    /// Computations for readers, such as meshes and earlier revisions, that may wait.
    pub reader_queue: usize,
    /// Calls that may wait to change one session, or for its earlier states; in each queue above, also its computations.
    pub session_queue: usize,
    /// Bytes of computed meshes that are kept in memory, so that all who look at one share it.
    pub mesh_bytes: usize,
    /// Writes that may wait for the event log.
    pub write_queue: usize,
    /// Writes in one commit.
    pub write_batch: usize,
    /// Open watch and exploration streams, over all connections.
    pub streams: usize,
    /// Open streams of one session.
    pub streams_per_session: usize,
    /// Open streams from one address; behind a proxy, which all callers share, it may have to be as high as `streams`.
    pub streams_per_peer: usize,
    /// Bytes that wait in a stream for its reader; a larger message waits alone.
    pub stream_bytes: usize,
    /// How long a stream waits for a reader who takes nothing; then it is ended and its place is free.
    pub stream_stall: Duration,
    /// Bytes of the log that a reader holds at once; a larger event is read alone.
    pub read_bytes: usize,
    /// How long the answer to a call without a valid token waits at most: longer with each that a machine has made.
    pub refused_wait: Duration,
    /// Open connections; fewer where the process may not open so many files.
    pub connections: usize,
    /// How long a connection may be without an open request before it is closed.
    pub idle: Duration,
    /// How long the head of a request over HTTP/1 may take to arrive, the wait for it included.
    pub head_timeout: Duration,
    /// How long the body of a request may take to arrive; streams of messages take as long as they like.
    pub body_timeout: Duration,
    /// How long a peer may take nothing of what is sent to it before its connection is cut.
    pub send_timeout: Duration,
    /// Bytes of bodies that are being received or answered, over all connections, after decompression.
    pub body_bytes: usize,
    /// Concurrent streams of one HTTP/2 connection.
    pub connection_streams: u32,
    /// Bytes of all headers of one request and of what it asks for, as HTTP/2 counts them.
    pub header_bytes: u32,
    /// Sign of life on a silent watch stream where the caller names none.
    pub heartbeat: Duration,
    /// Shortest heartbeat; shorter ones are refused.
    pub heartbeat_min: Duration,
    /// Longest heartbeat; longer ones are refused.
    pub heartbeat_max: Duration,
    /// How long a call may take where the caller names no deadline.
    pub call_timeout: Duration,
    /// How long a session may take to be computed anew, for a fork, an import or a retraction: longer than its caller
    /// waits, who asks again.
    pub recompute_timeout: Duration,
    /// How long open connections may take to finish when the server stops.
    pub drain: Duration,
}
}

impl Limits {
    /// The limits that are numbers by their names, and those that are times in seconds.
    pub fn numbers(&self) -> Vec<(&'static str, f64)> {
        let values = serde_json::to_value(self).unwrap_or_default();
        let number = |name: &'static str| match &values[name] {
            Value::Number(number) => Some((name, number.as_f64()?)),
            time @ Value::Object(_) => Some((name, Duration::deserialize(time).ok()?.as_secs_f64())),
            _ => None,
        };
        Self::MEANINGS.iter().filter_map(|(name, _)| number(name)).collect()
    }

    /// Whether a server can run within these bounds.
    ///
    /// # Errors
    /// Which of them it cannot keep, and why.
    pub fn check(&self) -> Result<(), String> {
        let values = serde_json::to_value(self).map_err(|error| error.to_string())?;
        for (name, _) in Self::MEANINGS {
            let (number, is_long) = match &values[*name] {
                Value::Number(number) => (number.as_u64().unwrap_or(u64::MAX), false),
                time @ Value::Object(_) => {
                    let time = Duration::deserialize(time).map_err(|error| error.to_string())?;
                    (u64::from(time >= SHORTEST), time > LONGEST)
                }
                _ => continue,
            };
            if number == 0 && !MAY_BE_ZERO.contains(name) {
                return Err(format!(
                    "{name} is 0, or shorter than 1 ms, with which nothing would work: choose more"
                ));
            }
            if number > MOST || is_long {
                return Err(format!("{name} is too large: at most 1 EiB, or 366 days"));
            }
        }
        if self.heartbeat_min > self.heartbeat {
            return Err("heartbeat_min is longer than heartbeat".to_owned());
        }
        if self.heartbeat > self.heartbeat_max {
            return Err("heartbeat is longer than heartbeat_max".to_owned());
        }
        if self.page_size > self.page_size_max {
            return Err("page_size is larger than page_size_max".to_owned());
        }
        Ok(())
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            message_bytes: 16 << 20,
            json_bytes: 4 << 20,
            json_fields: 20_000,
            json_values: 800_000,
            reference_faces: 1_000_000,
            evaluated_revisions: 64,
            samples: 50_000,
            summarized_sessions: 2000,
            contacts: 1000,
            top_k: 64,
            explained_vertices: 64,
            keep_out: 64,
            shadow: 4,
            pads: 8,
            lease_max: Duration::from_secs(600),
            leased_places: 256,
            page_size: 50,
            page_size_max: 1000,
            labels: 64,
            name_bytes: 256,
            text_bytes: 4096,
            session_bytes: 256 << 20,
            archive_bytes: 288 << 20,
            archive_members: 100_000,
            import_bytes: 320 << 20,
            database_bytes: 64 << 30,
            checkpoint_bytes: 1 << 30,
            database_connections: 16,
            database_timeout: Duration::from_secs(10),
            staleness: Duration::from_millis(200),
            follow: Duration::from_millis(100),
            proof_bytes_per_s: 64 << 20,
            proof_pause: Duration::from_secs(6 * 3600),
            unprintable_names: false,
            sessions: 100_000,
            live_sessions: 256,
            live_bytes: 128 << 20,
            session_idle: Duration::from_secs(120),
            past_states: 32,
            compute_queue: 8192,
            reader_queue: 8192,
            session_queue: 1024,
            mesh_bytes: 64 << 20,
            write_queue: 1024,
            write_batch: 256,
            streams: 256,
            streams_per_session: 64,
            streams_per_peer: 64,
            stream_bytes: 1 << 20,
            stream_stall: Duration::from_secs(30),
            read_bytes: 1 << 20,
            refused_wait: Duration::from_secs(2),
            connections: 1024,
            idle: Duration::from_secs(120),
            head_timeout: Duration::from_secs(30),
            body_timeout: Duration::from_secs(30),
            send_timeout: Duration::from_secs(30),
            body_bytes: 256 << 20,
            connection_streams: 64,
            header_bytes: 16 << 10,
            heartbeat: Duration::from_secs(15),
            heartbeat_min: Duration::from_secs(1),
            heartbeat_max: Duration::from_secs(3600),
            call_timeout: Duration::from_secs(60),
            recompute_timeout: Duration::from_secs(600),
            drain: Duration::from_secs(10),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_says_what_it_is_and_a_server_runs_within_the_defaults() {
        let values = serde_json::to_value(Limits::default()).unwrap();
        assert_eq!(values.as_object().unwrap().len(), Limits::MEANINGS.len());
        for (name, meaning) in Limits::MEANINGS {
            assert!(values.get(*name).is_some() && meaning.trim().len() > 10, "{name}: {meaning}");
        }
        Limits::default().check().unwrap();
    }

    #[test]
    fn limits_that_contradict_each_other_or_leave_no_room_are_refused() {
        let s = Duration::from_secs;
        for (limits, named) in [
            (Limits { write_queue: 0, ..Limits::default() }, "write_queue is 0"),
            (
                Limits { session_idle: Duration::from_nanos(3), ..Limits::default() },
                "session_idle is 0, or shorter",
            ),
            (Limits { drain: s(u64::MAX), ..Limits::default() }, "drain is too large"),
            (Limits { session_queue: usize::MAX, ..Limits::default() }, "session_queue is too large"),
            (Limits { heartbeat_min: s(20), ..Limits::default() }, "heartbeat_min is longer than heartbeat"),
            (Limits { page_size: 2000, ..Limits::default() }, "page_size is larger than page_size_max"),
        ] {
            let refusal = limits.check().unwrap_err();
            assert!(refusal.starts_with(named), "{refusal}");
        }
        Limits { past_states: 0, mesh_bytes: 0, ..Limits::default() }.check().unwrap();
    }
}
