//! Queries on the log.

use std::collections::BTreeMap;

use sqlx::FromRow;

use super::change::Damage;
use super::engine::sql;
use super::event::Event;
use super::link::{self, Link, Sealed};
use super::readable::Unread;
use super::{Store, StoreError, open};

/// A session as `sessions` has it.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct SessionRow {
    pub(crate) session_id: String,
    pub(crate) created_us: i64,
    pub(crate) head: i64,
    pub(crate) state: i32,
    pub(crate) summary: Vec<u8>,
    /// The link of the event at the head, if the row is right.
    pub(crate) link: Option<Vec<u8>>,
    pub(crate) seal: Option<Vec<u8>>,
    pub(crate) damage: Option<String>,
    pub(crate) sound: Option<i64>,
}

impl SessionRow {
    /// The session as callers saw it last; nothing where the row is not as it was written.
    pub(crate) fn summary(&self) -> Option<&[u8]> {
        let Self { session_id, created_us, head, state, summary, link, .. } = self;
        let (created_us, head, state) = (*created_us, *head, *state);
        let sealed = Sealed { session_id, created_us, state, head, link: link.as_deref()?, summary };
        (self.seal.as_deref() == Some(link::seal(&sealed).as_slice())).then_some(summary.as_slice())
    }

    /// Where a page ends that ends with this session.
    pub(crate) fn page_end(&self) -> PageEnd {
        PageEnd { created_us: self.created_us, session_id: self.session_id.clone() }
    }

    /// Why the log that ends with this event is not the one that the row knows; nothing where it is.
    pub(crate) fn disagreement(&self, last: i64, link: &Link) -> Option<String> {
        if last != self.head {
            return Some(format!("the log ends at event {last}, and should go on to event {}", self.head));
        }
        (self.link.as_deref() != Some(link.as_slice()))
            .then(|| format!("event {last} is not the last one that was appended: the log was put back"))
    }

    /// Why the session is set aside, if it is.
    pub(crate) fn damage(&self) -> Option<Damage> {
        let reason = self.damage.clone()?;
        Some(Damage { session_id: self.session_id.clone(), sound: self.sound.unwrap_or(0), reason })
    }
}

/// Where the log of a session ends.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct SessionEnd {
    pub(crate) session_id: String,
    pub(crate) created_us: i64,
    pub(crate) head: i64,
    /// Whether it is set aside.
    pub(crate) is_damaged: bool,
}

/// An event with its link and the one before it.
#[derive(Debug, FromRow)]
pub(super) struct EventRow {
    #[sqlx(flatten)]
    pub(super) event: Event,
    link: Option<Vec<u8>>,
    link_before: Option<Vec<u8>>,
}

impl EventRow {
    /// Whether the event says what it said when it was appended, after the event that was there then.
    pub(super) fn is_sound(&self, session_id: &str) -> bool {
        let before = match (self.event.seq, self.link_before.as_deref()) {
            (1, None) => link::first(session_id),
            (_, Some(before)) => match before.try_into() {
                Ok(before) => before,
                Err(_) => return false,
            },
            (_, None) => return false,
        };
        self.link.as_deref() == Some(self.event.link(&before).as_slice())
    }
}

/// The request that made a session.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct FirstRequest {
    pub(crate) session_id: String,
    /// Nothing where the session's own first event has it.
    pub(crate) request_digest: Option<Vec<u8>>,
    pub(crate) reply: Option<Vec<u8>>,
}

/// Which sessions to list; all that is given must match.
#[derive(Clone, Debug, Default)]
pub(crate) struct Filter {
    /// Experiments whose names begin so.
    pub(crate) experiments: Option<String>,
    pub(crate) experiment: Option<String>,
    pub(crate) state: Option<StateFilter>,
    pub(crate) labels: BTreeMap<String, String>,
}

/// Which states to list.
#[derive(Clone, Copy, Debug)]
pub(crate) enum StateFilter {
    /// Sessions whose log cannot be trusted.
    SetAside,
    /// All others in this state.
    Is(i32),
}

/// The sessions of an experiment that are in the same state.
#[derive(Clone, Debug, FromRow)]
pub(crate) struct ExperimentPart {
    pub(crate) experiment: String,
    pub(crate) state: i32,
    /// Whether they are set aside.
    pub(crate) is_damaged: bool,
    pub(crate) sessions: i64,
    pub(crate) first_us: i64,
    pub(crate) last_us: i64,
}

/// The last session of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PageEnd {
    pub(crate) created_us: i64,
    pub(crate) session_id: String,
}

/// Events that are read at once when a log is proved.
const PROVED_AT_ONCE: i64 = 64;
/// Bytes of events that are read at once.
const READ_BYTES: usize = 16 << 20;

pub(super) const SESSION_COLUMNS: &str =
    "session_id, created_us, head, state, summary, link, seal, damage, sound from sessions";
pub(super) const EVENT_COLUMNS: &str = "e.seq, e.request_id, e.request_digest, e.kind, e.payload, e.reply, e.state_hash, \
    e.stats_after, e.algorithm_version, e.append_us, e.actor, e.link, before.link as link_before \
    from events e left join events before on before.session_id = e.session_id and before.seq = e.seq - 1";

impl Store {
    /// One session.
    pub(crate) async fn session(&self, session_id: &str) -> Result<Option<SessionRow>, StoreError> {
        let mut query = sql("select ");
        query.push(SESSION_COLUMNS).push(" where session_id = ").push_bind(session_id);
        let row = self.readers.optional(query).await;
        Ok(row.inspect_err(|_| self.note_unread(Unread::session(session_id)))?)
    }

    /// Where the logs of these sessions end, of those that there are.
    pub(crate) async fn ends(&self, session_ids: &[&str]) -> Result<Vec<SessionEnd>, StoreError> {
        let mut query =
            sql("select session_id, created_us, head, damage is not null as is_damaged from sessions
             where session_id in (");
        for (index, session_id) in session_ids.iter().enumerate() {
            query.push(if index == 0 { "" } else { ", " }).push_bind(*session_id);
        }
        query.push(")");
        Ok(self.readers.all(query).await?)
    }

    /// How many sessions are set aside because their log cannot be trusted.
    pub(crate) async fn damaged_count(&self) -> Result<i64, StoreError> {
        Ok(self.readers.one(sql("select count(*) from sessions where damage is not null")).await?)
    }

    /// How many sessions there are.
    pub(crate) async fn session_count(&self) -> Result<i64, StoreError> {
        Ok(self.readers.one(sql("select count(*) from sessions")).await?)
    }

    /// The experiment of a session; nothing where there is no such session.
    pub(crate) async fn experiment_of(&self, session_id: &str) -> Result<Option<String>, StoreError> {
        let query = sql("select experiment from sessions where session_id = $1");
        Ok(self.readers.scalar(query.bind(session_id)).await?)
    }

    /// Up to `count` experiments whose names begin with `prefix` after the one called `after`, by name, each in as many
    /// parts as its sessions have states.
    pub(crate) async fn experiments(
        &self,
        prefix: &str,
        after: Option<&str>,
        count: i64,
    ) -> Result<Vec<ExperimentPart>, StoreError> {
        let query = sql("select experiment, state, damage is not null as is_damaged, count(*) as sessions,
                 min(created_us) as first_us, max(created_us) as last_us
             from sessions
             where experiment in (
                 select distinct experiment from sessions
                 where ($1 is null or experiment > $1) and substr(experiment, 1, length($3)) = $3
                 order by experiment limit $2
             )
             group by experiment, state, damage is not null order by experiment");
        Ok(self.readers.all(query.bind(after).bind(count).bind(prefix)).await?)
    }

    /// Up to `count` sessions after `after`, newest first.
    pub(crate) async fn list(
        &self,
        filter: &Filter,
        after: Option<&PageEnd>,
        count: i64,
    ) -> Result<Vec<SessionRow>, StoreError> {
        let Filter { experiments, experiment, state, labels } = filter;
        let mut query = sql("select ");
        query.push(SESSION_COLUMNS).push(" where 1 = 1");
        if let Some(prefix) = experiments {
            query
                .push(" and substr(experiment, 1, length(")
                .push_bind(prefix)
                .push(")) = ")
                .push_bind(prefix);
        }
        if let Some(experiment) = experiment {
            query.push(" and experiment = ").push_bind(experiment);
        }
        match state {
            Some(StateFilter::SetAside) => {
                query.push(" and damage is not null");
            }
            Some(StateFilter::Is(state)) => {
                query.push(" and damage is null and state = ").push_bind(state);
            }
            None => {}
        }
        for (name, value) in labels {
            query.push(" and session_id in (select session_id from session_labels where name = ");
            query.push_bind(name).push(" and value = ").push_bind(value);
            // An index of PostgreSQL takes no longer ones.
            query.push(" and substr(value, 1, 200) = substr(").push_bind(value).push(", 1, 200))");
        }
        if let Some(PageEnd { created_us, session_id }) = after {
            query.push(" and (created_us, session_id) < (").push_bind(created_us);
            query.push(", ").push_bind(session_id).push(")");
        }
        query.push(" order by created_us desc, session_id desc limit ").push_bind(count);
        Ok(self.readers.all(query).await?)
    }

    /// Up to `count` events with a seq above `after`, oldest first, each as it was appended. Fewer come where they are
    /// large, and before one that is not as it was.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] when already the first is not the event that was appended after `after`;
    /// [`StoreError::Down`] when the disk does not read it.
    pub(crate) async fn events(
        &self,
        session_id: &str,
        after: i64,
        count: i64,
    ) -> Result<Vec<Event>, StoreError> {
        self.events_within(session_id, after, count, READ_BYTES).await
    }

    /// The same, and of them only the first few that have up to `bytes` together. The first one comes whatever its
    /// size.
    ///
    /// # Errors
    /// The same.
    pub(crate) async fn events_within(
        &self,
        session_id: &str,
        after: i64,
        count: i64,
        bytes: usize,
    ) -> Result<Vec<Event>, StoreError> {
        let damaged = |reason: String| {
            let damage = Damage { session_id: session_id.to_owned(), sound: after, reason };
            self.set_aside(damage.clone());
            StoreError::Damaged(damage)
        };
        let rows = match self.rows(session_id, after, count, bytes).await {
            // One of them cannot be read: those before it can.
            Err(error) if is_unreadable(&error) && count > 1 => self.rows(session_id, after, 1, bytes).await,
            other => other,
        };
        let mut rows = match rows {
            Err(error) if is_unreadable(&error) => {
                self.insist(&error, Unread::event_after(session_id, after)).await?;
                return Err(damaged(format!("event {} cannot be read: {error}", after + 1)));
            }
            other => other.inspect_err(|_| self.note_unread(Unread::event_after(session_id, after)))?,
        };
        let expected = |index: usize| after + 1 + index as i64;
        let is_sound =
            |(index, row): (usize, &EventRow)| row.event.seq == expected(index) && row.is_sound(session_id);
        let sound = rows.iter().enumerate().take_while(|numbered| is_sound(*numbered)).count();
        if sound == 0
            && let Some(first) = rows.first()
        {
            let wanted = after + 1;
            return Err(damaged(if first.event.seq == wanted {
                format!("event {wanted} is not as it was appended")
            } else {
                format!("event {wanted} is missing")
            }));
        }
        rows.truncate(sound);
        Ok(rows.into_iter().map(|row| row.event).collect())
    }

    async fn rows(
        &self,
        session_id: &str,
        after: i64,
        count: i64,
        bytes: usize,
    ) -> Result<Vec<EventRow>, sqlx::Error> {
        // The sizes are in the rows' heads, so what is too large is not read to find that out.
        let mut query = sql(
            "with sized as (select seq, length(payload) + length(reply) as size from events where session_id = ",
        );
        query.push_bind(session_id).push(" and seq > ").push_bind(after);
        query.push(" order by seq limit ").push_bind(count);
        query.push("), summed as (select seq, sum(size) over (order by seq) as total from sized) select ");
        query.push(EVENT_COLUMNS).push(" where e.session_id = ").push_bind(session_id);
        query.push(" and e.seq > ").push_bind(after);
        query.push(" and e.seq <= (select coalesce(max(case when total <= ");
        query.push_bind(i64::try_from(bytes).unwrap_or(i64::MAX));
        query.push(" then seq end), min(seq)) from summed) order by e.seq");
        self.readers.all(query).await
    }

    /// The event of the first request under this id, if there was one, as it was appended.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] when it is not.
    pub(crate) async fn first_under(
        &self,
        session_id: &str,
        request_id: &str,
    ) -> Result<Option<Event>, StoreError> {
        let mut query = sql("select ");
        query.push(EVENT_COLUMNS).push(" where e.session_id = ").push_bind(session_id);
        query.push(" and e.request_id = ").push_bind(request_id);
        let row: Option<EventRow> = self.readers.optional(query).await?;
        match row {
            Some(row) if !row.is_sound(session_id) => {
                let reason = format!("event {} is not as it was appended", row.event.seq);
                let damage = Damage { session_id: session_id.to_owned(), sound: row.event.seq - 1, reason };
                self.set_aside(damage.clone());
                Err(StoreError::Damaged(damage))
            }
            row => Ok(row.map(|row| row.event)),
        }
    }

    /// Reads all events of a session and compares them with what its row says, without looking into them: the bytes
    /// that were read, or the damage that was found.
    ///
    /// # Errors
    /// The database cannot be read.
    pub(crate) async fn prove(&self, row: &SessionRow) -> Result<Result<u64, Damage>, StoreError> {
        let (mut last, mut link, mut bytes) = (0, link::first(&row.session_id), 0);
        while last < row.head {
            let rows = match self.events(&row.session_id, last, PROVED_AT_ONCE.min(row.head - last)).await {
                Err(StoreError::Damaged(damage)) => return Ok(Err(damage)),
                other => other?,
            };
            let Some(newest) = rows.last() else { break };
            last = newest.seq;
            link = rows.iter().fold(link, |before, event| event.link(&before));
            bytes += rows.iter().map(Event::bytes).sum::<u64>();
        }
        let Some(reason) = row.disagreement(last, &link) else { return Ok(Ok(bytes)) };
        // A session that was deleted or went on meanwhile is not damaged.
        let now = self.session(&row.session_id).await?;
        if now.is_none_or(|now| (now.created_us, now.head) != (row.created_us, row.head)) {
            return Ok(Ok(bytes));
        }
        let damage = Damage { session_id: row.session_id.clone(), sound: last, reason };
        self.set_aside(damage.clone());
        Ok(Err(damage))
    }

    /// What a creation under this request id made, if there was one; the session may be deleted by now. The request is
    /// for the session `chosen`.
    pub(crate) async fn created_by(
        &self,
        chosen: &str,
        request_id: &str,
    ) -> Result<Option<FirstRequest>, StoreError> {
        if !self.readers.is_shared() {
            let query = sql("select session_id, request_digest, reply from creations where request_id = $1");
            return Ok(self.readers.optional(query.bind(request_id)).await?);
        }
        let made = |session_id: &str| {
            let query = sql("select session_id, request_digest, reply from creations
                 where session_id = $1 and request_id = $2");
            self.readers.optional(query.bind(session_id).bind(request_id))
        };
        if let Some(first) = made(chosen).await? {
            return Ok(Some(first));
        }
        let query = sql("select session_id from created_requests where request_id = $1");
        let other: Option<String> = self.readers.scalar(query.bind(request_id)).await?;
        match other {
            Some(session_id) => Ok(made(&session_id).await?),
            None => Ok(None),
        }
    }

    /// The events of one kind up to the event `to`, oldest first. What they say is to be checked with the log that they
    /// are of.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] when one of the events up to `to` cannot be read; [`StoreError::Down`] when that is the
    /// disk's fault.
    pub(crate) async fn of_kind(
        &self,
        session_id: &str,
        kind: &'static str,
        to: i64,
    ) -> Result<Vec<Event>, StoreError> {
        let mut query = sql("select ");
        query.push(EVENT_COLUMNS).push(" where e.session_id = ").push_bind(session_id);
        // Written out, so that an index of the events of this kind can be used.
        query.push(" and e.kind = '").push(kind).push("' and e.seq <= ").push_bind(to);
        query.push(" order by e.seq");
        match self.readers.all::<EventRow>(query).await {
            Ok(rows) => Ok(rows.into_iter().map(|row| row.event).collect()),
            // The index or one of the events: reading all of them in their order tells which.
            Err(error) if is_unreadable(&error) => self.of_kind_without_index(session_id, kind, to).await,
            Err(error) => Err(error.into()),
        }
    }

    async fn of_kind_without_index(
        &self,
        session_id: &str,
        kind: &'static str,
        to: i64,
    ) -> Result<Vec<Event>, StoreError> {
        let (mut last, mut found) = (0, Vec::new());
        while last < to {
            let events = self.events(session_id, last, PROVED_AT_ONCE.min(to - last)).await?;
            let Some(newest) = events.last() else { break };
            last = newest.seq;
            found.extend(events.into_iter().filter(|event| event.kind == kind));
        }
        Ok(found)
    }

    /// The digest of the request that deleted the session under this request id, if there was one.
    pub(crate) async fn deleted_by(
        &self,
        session_id: &str,
        request_id: &str,
    ) -> Result<Option<Vec<u8>>, StoreError> {
        let query = sql("select request_digest from deletions where session_id = $1 and request_id = $2");
        Ok(self.readers.scalar(query.bind(session_id).bind(request_id)).await?)
    }
}

/// Whether an error says that what is on disk is no row of its table.
pub(super) fn is_unreadable(error: &sqlx::Error) -> bool {
    matches!(error, sqlx::Error::ColumnDecode { .. })
        || open::primary_code(error) == Some(open::SQLITE_CORRUPT)
}
