//! What the server counts and measures, for Prometheus: each layer reports what it does, and a scrape adds how things
//! are at that moment.
//!
//! Nothing here is global: each server has a registry of its own. `docs/operation.md` lists every series.

mod moment;

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use palpate_proto::v1;
use palpate_proto::v1::contact_result::Outcome;
use prometheus_client::encoding::prometheus_text;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Metric, Registry};

use crate::compute::{Queue, Work};
use crate::error::Error;
use moment::Gauges;
pub(crate) use moment::Moment;

/// The media type of what a scrape reads.
pub(crate) const CONTENT_TYPE: &str = prometheus_text::CONTENT_TYPE;

/// Bounds of all histograms of times, in seconds: from a proposal on a small mesh to the longest deadline.
const BOUNDS_S: [f64; 15] =
    [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0];

/// Labels, by their names.
type Labels<const N: usize> = [(&'static str, &'static str); N];
type Times<const N: usize> = Family<Labels<N>, Histogram, fn() -> Histogram>;
/// Says how many there are when it is asked.
type Count = Box<dyn Fn() -> usize + Send + Sync>;

/// All series of one server; cheap to clone.
#[derive(Clone)]
pub(crate) struct Metrics {
    contacts: Family<Labels<1>, Counter>,
    views: Counter,
    warnings: Family<Labels<1>, Counter>,
    calls: Family<Labels<2>, Counter>,
    call_times: Times<1>,
    unknown_callers: Family<Labels<1>, Counter>,
    waits: Times<2>,
    computations: Times<1>,
    commits: Histogram,
    failed_commits: Counter,
    changes: Counter,
    gauges: Gauges,
    connections: Arc<OnceLock<Count>>,
    registry: Arc<Registry>,
}

impl std::fmt::Debug for Metrics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Metrics").finish_non_exhaustive()
    }
}

impl Default for Metrics {
    fn default() -> Self {
        let mut registry = Registry::with_prefix("palpate");
        let r = &mut registry;
        let metrics = Self {
            contacts: add(
                r,
                "contacts",
                "Results of approaches that were accepted, by what happened",
                Family::default(),
            ),
            views: add(r, "views", "Views of objects that were accepted", Counter::default()),
            warnings: add(r, "warnings", "Warnings in replies, by kind", Family::default()),
            calls: add(
                r,
                "calls",
                "Calls and messages on streams, by what became of them: OK or the reason of the refusal",
                Family::default(),
            ),
            call_times: add(r, "call_seconds", "Time from a call to its answer, waiting included", times()),
            unknown_callers: add(
                r,
                "unknown_callers",
                "Requests whose callers could not say who they are, by the reason of the refusal",
                Family::default(),
            ),
            waits: add(r, "queue_wait_seconds", "Time that a computation waited for a thread", times()),
            computations: add(r, "compute_seconds", "Time that a computation had a thread", times()),
            commits: add(
                r,
                "commit_seconds",
                "Time of a commit of the event log, until it is on disk",
                histogram(),
            ),
            failed_commits: add(
                r,
                "failed_commits",
                "Commits of the event log that failed",
                Counter::default(),
            ),
            changes: add(r, "committed_changes", "Changes in these commits", Counter::default()),
            gauges: Gauges::registered(r),
            connections: Arc::default(),
            registry: Arc::new(registry),
        };
        // From the start, so that one can be waited for.
        for reason in ["TOKEN_MISSING", "TOKEN_INVALID", "TOKEN_EXPIRED", "CERTIFICATE_NAME"] {
            drop(metrics.unknown_callers.get_or_create(&[("reason", reason)]));
        }
        metrics
    }
}

fn add<M: Metric + Clone>(registry: &mut Registry, name: &str, help: &str, metric: M) -> M {
    registry.register(name, help, metric.clone());
    metric
}

fn histogram() -> Histogram {
    Histogram::new(BOUNDS_S)
}

fn times<const N: usize>() -> Times<N> {
    Family::new_with_constructor(histogram)
}

impl Metrics {
    /// A result that is in the log now, with the reply to it.
    pub(crate) fn contact(&self, outcome: &Outcome, warnings: &[v1::Warning]) {
        let outcome = match outcome {
            Outcome::Contact(_) => "contact",
            Outcome::Contacts(_) => "contacts",
            Outcome::NoContact(_) => "no_contact",
            Outcome::Rejected(_) => "rejected",
            Outcome::InvalidContact(_) => "invalid_contact",
            Outcome::ObjectMoved(_) => "object_moved",
        };
        self.contacts.get_or_create(&[("outcome", outcome)]).inc();
        self.warned(warnings);
    }

    /// A view that is in the log now, with the reply to it.
    pub(crate) fn view(&self, warnings: &[v1::Warning]) {
        self.views.inc();
        self.warned(warnings);
    }

    /// Warnings that a caller was told.
    pub(crate) fn warned(&self, warnings: &[v1::Warning]) {
        for warning in warnings {
            let name = warning.code().as_str_name();
            let kind = name.strip_prefix("WARNING_CODE_").unwrap_or(name);
            self.warnings.get_or_create(&[("kind", kind)]).inc();
        }
    }

    /// A request that was refused before it became a call, as nobody knows who makes it.
    pub(crate) fn unknown_caller(&self, refusal: &Error) {
        self.unknown_callers.get_or_create(&[("reason", refusal.reason())]).inc();
    }

    /// A call, or a message on a stream, that was answered after this time.
    pub(crate) fn call(&self, method: &'static str, refusal: Option<&Error>, took: Duration) {
        let outcome = refusal.map_or("OK", Error::reason);
        self.calls.get_or_create(&[("method", method), ("outcome", outcome)]).inc();
        self.call_times.get_or_create(&[("method", method)]).observe(took.as_secs_f64());
    }

    /// A computation that got its thread after this time.
    pub(crate) fn waited(&self, queue: Queue, work: Work, time: Duration) {
        let queue = if queue.is_of_robots() { "robots" } else { "readers" };
        self.waits.get_or_create(&[("queue", queue), ("work", name(work))]).observe(time.as_secs_f64());
    }

    /// A computation that had its thread for this time.
    pub(crate) fn computed(&self, work: Work, time: Duration) {
        self.computations.get_or_create(&[("work", name(work))]).observe(time.as_secs_f64());
    }

    /// A commit of so many changes, on disk or failed.
    pub(crate) fn committed(&self, changes: usize, is_on_disk: bool, time: Duration) {
        if is_on_disk {
            self.commits.observe(time.as_secs_f64());
            self.changes.inc_by(changes as u64);
        } else {
            self.failed_commits.inc();
        }
    }

    /// What counts the open connections, known once the server listens.
    pub(crate) fn connections_are(&self, count: impl Fn() -> usize + Send + Sync + 'static) {
        // A server listens once.
        let _ = self.connections.set(Box::new(count));
    }

    /// All series as text, with how things are now.
    pub(crate) fn scraped(&self, moment: &Moment) -> String {
        let connections = self.connections.get().map_or(0, |count| count());
        self.gauges.set(moment, connections);
        let mut text = String::new();
        prometheus_text::encode(&mut text, &self.registry).expect("a string grows");
        text
    }
}

fn name(work: Work) -> &'static str {
    match work {
        Work::Contact => "contact",
        Work::View => "view",
        Work::Edit => "edit",
        Work::Proposal => "proposal",
        Work::Fold => "fold",
        Work::Mesh => "mesh",
        Work::Comparison => "comparison",
        Work::File => "file",
        Work::Table => "table",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_reported_is_in_the_text_and_every_series_says_what_it_is() {
        let metrics = Metrics::default();
        metrics.contact(&Outcome::NoContact(v1::NoContact::default()), &[]);
        metrics.call("GetSession", None, Duration::from_millis(3));
        metrics.call("GetSession", Some(&Error::Draining), Duration::from_millis(3));
        metrics.waited(Queue::ROBOTS, Work::Contact, Duration::from_millis(30));
        metrics.committed(3, true, Duration::from_millis(2));
        metrics.connections_are(|| 7);
        let text = metrics.scraped(&Moment { sessions: Some(5), ..Moment::default() });
        for line in [
            "palpate_contacts_total{outcome=\"no_contact\"} 1",
            "palpate_calls_total{method=\"GetSession\",outcome=\"OK\"} 1",
            "palpate_calls_total{method=\"GetSession\",outcome=\"DRAINING\"} 1",
            "palpate_queue_wait_seconds_bucket{queue=\"robots\",work=\"contact\",le=\"0.05\"} 1",
            "palpate_commit_seconds_count 1",
            "palpate_committed_changes_total 3",
            "palpate_connections 7",
            "palpate_sessions 5",
        ] {
            assert!(text.lines().any(|known| known == line), "{line}: {text}");
        }
        let names = text.lines().filter_map(|line| line.strip_prefix("# TYPE ")?.split(' ').next());
        for name in names {
            assert!(text.contains(&format!("# HELP {name} ")), "{name}");
        }
    }

    #[test]
    fn two_servers_of_one_process_count_for_themselves() {
        let (one, other) = (Metrics::default(), Metrics::default());
        one.view(&[]);
        assert!(one.scraped(&Moment::default()).contains("palpate_views_total 1"));
        assert!(other.scraped(&Moment::default()).contains("palpate_views_total 0"));
    }
}
