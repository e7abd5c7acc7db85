//! Experiments: the sessions that name one, and what they amount to, group by group.

use std::collections::BTreeMap;

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use palpate_proto::v1;
use tokio::time::Instant;

use super::{Api, Call, bad_page_token, page_size};
use crate::compute::Queue;
use crate::error::Error;
use crate::limits::{Limits, OPAQUE_BYTES};
use crate::store::{ExperimentPart, Filter, SessionRow};
use crate::text::quoted;
use crate::wire::{from_proto, to_proto};

/// Sessions that are looked up at once.
const PAGE: i64 = 100;
/// Properties that make a group.
const KEYS: usize = 8;

impl Api {
    /// A page of experiments, by name.
    ///
    /// # Errors
    /// The page cannot be named so.
    pub(crate) async fn list_experiments(
        &self,
        request: v1::ListExperimentsRequest,
        call: Call,
    ) -> Result<v1::ListExperimentsResponse, Error> {
        self.run("ListExperiments", "", &call, async |_| {
            let v1::ListExperimentsRequest { page_size: wanted, page_token } = request;
            // A name of any script, in base64.
            from_proto::check_text("page_token", &page_token, OPAQUE_BYTES + 2 * self.limits.name_bytes)?;
            let count = page_size(wanted, &self.limits)? as usize;
            let after = (!page_token.is_empty()).then(|| decode_token(&page_token)).transpose()?;
            // One more than requested shows whether there is a next page.
            let wanted = i64::try_from(count + 1).unwrap_or(i64::MAX);
            let prefix = call.caller.experiments().unwrap_or_default();
            let parts = self.sessions.store.experiments(prefix, after.as_deref(), wanted).await?;
            let mut experiments = experiments(parts);
            let has_more = experiments.len() > count;
            experiments.truncate(count);
            let last = experiments.last().filter(|_| has_more);
            let next_page_token = last.map(|last| encode_token(&last.experiment)).unwrap_or_default();
            Ok(v1::ListExperimentsResponse { experiments, next_page_token })
        })
        .await
    }

    /// The sessions of an experiment in groups, with mean and spread of each.
    ///
    /// # Errors
    /// A field cannot be used, too many sessions match, or it could not be computed in time; the next call goes on.
    pub(crate) async fn summarize_experiment(
        &self,
        request: v1::SummarizeExperimentRequest,
        call: Call,
    ) -> Result<v1::ExperimentSummary, Error> {
        self.run("SummarizeExperiment", "", &call, async |deadline| {
            let v1::SummarizeExperimentRequest { experiment, by, labels } = request;
            from_proto::check_name("experiment", &experiment, &self.limits)?;
            from_proto::check_labels(&labels, &self.limits)?;
            let keys = keys(&by, &self.limits)?;
            call.caller.check_experiment(&experiment)?;
            let filter = Filter { experiment: Some(experiment.clone()), labels, ..Filter::default() };
            let mut groups: BTreeMap<Vec<String>, Group> = BTreeMap::new();
            let mut quarantined_session_ids = Vec::new();
            for row in self.sessions_of(&filter).await? {
                match self.member(&row, deadline).await? {
                    Some(member) => {
                        let key = keys.iter().map(|key| key.of(&member.session)).collect();
                        groups.entry(key).or_default().add(member);
                    }
                    None => quarantined_session_ids.push(row.session_id),
                }
            }
            let groups = groups.into_iter().map(|(key, group)| group.summary(key)).collect();
            Ok(v1::ExperimentSummary { experiment, by, groups, quarantined_session_ids })
        })
        .await
    }

    /// All sessions that match, the oldest first.
    async fn sessions_of(&self, filter: &Filter) -> Result<Vec<SessionRow>, Error> {
        let most = self.limits.summarized_sessions;
        let mut rows: Vec<SessionRow> = Vec::new();
        loop {
            let after = rows.last().map(SessionRow::page_end);
            let page = self.sessions.store.list(filter, after.as_ref(), PAGE).await?;
            if page.is_empty() {
                rows.reverse();
                return Ok(rows);
            }
            rows.extend(page);
            if rows.len() > most {
                let what = format!("an experiment of more than {most} sessions");
                let hint = "give labels that fewer sessions carry";
                return Err(Error::TooLarge { what, limit: format!("{most} sessions"), hint });
            }
        }
    }

    /// A session with its error; nothing where its log is damaged.
    async fn member(&self, row: &SessionRow, deadline: Instant) -> Result<Option<Member>, Error> {
        let session = self.session_of(row, deadline).await?;
        if session.state() == v1::SessionState::Quarantined {
            return Ok(None);
        }
        match self.newest_error(&session, row, deadline).await {
            Ok(surface_distance_m) => Ok(Some(Member { session, surface_distance_m })),
            Err(Error::SessionQuarantined { .. }) => Ok(None),
            Err(other) => Err(other),
        }
    }

    /// The error at the newest revision, computed if nobody has asked for it yet; nothing without a reference mesh.
    async fn newest_error(
        &self,
        session: &v1::Session,
        row: &SessionRow,
        deadline: Instant,
    ) -> Result<Option<f64>, Error> {
        let session_id = session.session_id.as_str();
        if self.sessions.store.reference(session_id).await?.is_none() {
            return Ok(None);
        }
        if let Some(known) = self.known_errors(session_id).await?.get(&session.revision) {
            return Ok(*known);
        }
        let truth = match self.kept_truth(session_id, Queue::READERS, deadline).await {
            Err(Error::NoReference) => return Ok(None),
            truth => truth?,
        };
        let state = self.sessions.at_revision(session_id, session.revision, Queue::READERS, deadline).await?;
        state.check_sound()?;
        let error = self.surface_error(&state, &truth, Queue::READERS, deadline).await?;
        self.note_errors(session_id, row.created_us, &truth, vec![(session.revision, error)]).await?;
        Ok(error)
    }
}

/// A session of a group.
struct Member {
    session: v1::Session,
    surface_distance_m: Option<f64>,
}

/// Sessions that agree in what makes a group, figure by figure.
#[derive(Default)]
struct Group {
    attempts: Vec<f64>,
    failures: Vec<f64>,
    mean_uncertainty: Vec<f64>,
    mean_std_m: Vec<f64>,
    surface_distance_m: Vec<f64>,
    session_ids: Vec<String>,
}

impl Group {
    fn add(&mut self, Member { session, surface_distance_m }: Member) {
        let stats = session.stats.unwrap_or_default();
        self.attempts.push(stats.attempts.into());
        self.failures.push(stats.failures.into());
        self.mean_uncertainty.push(stats.mean_uncertainty);
        self.mean_std_m.extend(stats.mean_std_m);
        self.surface_distance_m.extend(surface_distance_m);
        self.session_ids.push(session.session_id);
    }

    fn summary(self, key: Vec<String>) -> v1::SummaryGroup {
        v1::SummaryGroup {
            key,
            n: u32::try_from(self.session_ids.len()).unwrap_or(u32::MAX),
            attempts: Some(spread(&self.attempts)),
            failures: Some(spread(&self.failures)),
            mean_uncertainty: Some(spread(&self.mean_uncertainty)),
            mean_std_m: Some(spread(&self.mean_std_m)),
            surface_distance_m: Some(spread(&self.surface_distance_m)),
            session_ids: self.session_ids,
        }
    }
}

/// Mean, sample standard deviation and range; all zero of nothing.
fn spread(values: &[f64]) -> v1::Spread {
    if values.is_empty() {
        return v1::Spread::default();
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    v1::Spread {
        n: u32::try_from(values.len()).unwrap_or(u32::MAX),
        mean,
        sd: if values.len() < 2 { 0.0 } else { (squares / (n - 1.0)).sqrt() },
        min: values.iter().copied().fold(f64::INFINITY, f64::min),
        max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    }
}

/// What sessions of a group agree in.
#[derive(Debug, PartialEq)]
enum GroupKey {
    Label(String),
    Method,
    Strategy,
    Template,
    State,
}

impl GroupKey {
    fn of(&self, session: &v1::Session) -> String {
        match self {
            Self::Label(name) => session.labels.get(name).cloned(),
            Self::Method => session.config.as_ref().map(|config| config.method().as_str_name().to_owned()),
            Self::Strategy => {
                session.config.as_ref().map(|config| config.strategy().as_str_name().to_owned())
            }
            Self::Template => session.stats.as_ref().map(|stats| stats.template.clone()),
            Self::State => Some(session.state().as_str_name().to_owned()),
        }
        .unwrap_or_default()
    }
}

fn keys(by: &[String], limits: &Limits) -> Result<Vec<GroupKey>, Error> {
    if by.len() > KEYS {
        return Err(Error::field("by", format!("{} properties are more than the limit of {KEYS}", by.len())));
    }
    let key = |(index, name): (usize, &String)| {
        let field = format!("by[{index}]");
        from_proto::check_text(&field, name, "labels.".len() + limits.name_bytes)?;
        match name.as_str() {
            "method" => Ok(GroupKey::Method),
            "strategy" => Ok(GroupKey::Strategy),
            "template" => Ok(GroupKey::Template),
            "state" => Ok(GroupKey::State),
            other => match other.strip_prefix("labels.").filter(|label| !label.is_empty()) {
                Some(label) => Ok(GroupKey::Label(label.to_owned())),
                None => {
                    let known = "labels.NAME, method, strategy, template, state";
                    Err(Error::field(field, format!("{} is none of {known}", quoted(other))))
                }
            },
        }
    };
    by.iter().enumerate().map(key).collect()
}

/// Experiments out of their parts, which are in the order of their names.
fn experiments(parts: Vec<ExperimentPart>) -> Vec<v1::Experiment> {
    let mut experiments: Vec<v1::Experiment> = Vec::new();
    let mut times: Vec<(i64, i64)> = Vec::new();
    for part in parts {
        let ExperimentPart { experiment, state, is_damaged, sessions, first_us, last_us } = part;
        let sessions = u32::try_from(sessions).unwrap_or(u32::MAX);
        if experiments.last().is_none_or(|last| last.experiment != experiment) {
            experiments.push(v1::Experiment { experiment, ..Default::default() });
            times.push((i64::MAX, i64::MIN));
        }
        let (Some(last), Some((first, newest))) = (experiments.last_mut(), times.last_mut()) else {
            continue;
        };
        last.sessions += sessions;
        let counter = match v1::SessionState::try_from(state).unwrap_or_default() {
            _ if is_damaged => &mut last.quarantined,
            v1::SessionState::AwaitingPrior => &mut last.awaiting_prior,
            v1::SessionState::Finished => &mut last.finished,
            v1::SessionState::Active | v1::SessionState::Unspecified => &mut last.active,
            v1::SessionState::Quarantined => &mut last.quarantined,
        };
        *counter += sessions;
        (*first, *newest) = ((*first).min(first_us), (*newest).max(last_us));
        last.create_time = Some(to_proto::timestamp(*first));
        last.last_create_time = Some(to_proto::timestamp(*newest));
    }
    experiments
}

/// Marked, so that also the experiment without a name has a token.
fn encode_token(experiment: &str) -> String {
    URL_SAFE_NO_PAD.encode(format!("={experiment}"))
}

fn decode_token(token: &str) -> Result<String, Error> {
    let bytes = URL_SAFE_NO_PAD.decode(token).ok();
    let text = bytes.and_then(|bytes| String::from_utf8(bytes).ok());
    text.and_then(|text| text.strip_prefix('=').map(str::to_owned)).ok_or_else(bad_page_token)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_that_of_a_sample() {
        let found = spread(&[1.0, 2.0, 6.0]);
        assert_eq!((found.n, found.mean, found.min, found.max), (3, 3.0, 1.0, 6.0));
        assert!((found.sd - 7.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(spread(&[4.0]).sd, 0.0);
        assert_eq!(spread(&[]), v1::Spread::default());
    }

    #[test]
    fn groups_are_made_by_known_properties_only() {
        let limits = Limits::default();
        let by =
            |names: &[&str]| keys(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>(), &limits);
        assert_eq!(by(&["labels.a.b", "method"]).unwrap(), [GroupKey::Label("a.b".into()), GroupKey::Method]);
        for wrong in ["label.a", "labels.", "", "seed"] {
            assert_eq!(by(&["state", wrong]).unwrap_err().fields()[0].field, "by[1]", "{wrong}");
        }
        assert_eq!(by(&["state"; 9]).unwrap_err().fields()[0].field, "by");
    }

    #[test]
    fn experiments_are_counted_by_the_states_of_their_sessions() {
        let part = |experiment: &str, state: v1::SessionState, is_damaged, sessions, at_us| ExperimentPart {
            experiment: experiment.into(),
            state: state.into(),
            is_damaged,
            sessions,
            first_us: at_us,
            last_us: at_us + 1,
        };
        let found = experiments(vec![
            part("", v1::SessionState::AwaitingPrior, false, 1, 5),
            part("grasps", v1::SessionState::Active, false, 2, 7),
            part("grasps", v1::SessionState::Active, true, 1, 3),
            part("grasps", v1::SessionState::Finished, false, 4, 9),
        ]);
        assert_eq!(found.len(), 2);
        let v1::Experiment { sessions, active, finished, quarantined, awaiting_prior, .. } = &found[1];
        assert_eq!((*sessions, *active, *finished, *quarantined, *awaiting_prior), (7, 2, 4, 1, 0));
        assert_eq!(found[1].create_time, Some(to_proto::timestamp(3)));
        assert_eq!(found[1].last_create_time, Some(to_proto::timestamp(10)));
    }

    #[test]
    fn a_page_token_is_read_back_and_a_foreign_one_refused() {
        for name in ["", "grasps", "süß"] {
            assert_eq!(decode_token(&encode_token(name)).unwrap(), name);
        }
        for foreign in ["x", "!!!", "MTc"] {
            assert_eq!(decode_token(foreign), Err(bad_page_token()));
        }
    }
}
