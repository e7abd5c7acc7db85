-- The event log: each session is the fold of its events, in the order of seq.
-- Rows of `events` are the truth; everything in `sessions` but the key can be derived from them.

create table sessions (
    session_id text not null,
    experiment text not null,
    state integer not null,
    created_us integer not null, -- microseconds since 1970, UTC
    head integer not null, -- seq of the last event
    summary blob not null, -- the session as callers see it, at head
    constraint sessions_pk primary key (session_id),
    constraint sessions_head_counts_events check (head >= 1)
) strict, without rowid;

create index sessions_newest_first on sessions (created_us, session_id);
create index sessions_by_experiment on sessions (experiment, created_us, session_id);

create table session_labels (
    session_id text not null,
    name text not null,
    value text not null,
    constraint session_labels_pk primary key (session_id, name),
    constraint session_labels_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade
) strict, without rowid;

create index session_labels_by_value on session_labels (name, value);

create table events (
    session_id text not null,
    seq integer not null, -- 1 is the creation; no gaps
    request_id text, -- null where the caller gave none
    request_digest blob not null, -- tells a retry from another request under the same request_id
    kind text not null,
    payload blob not null,
    reply blob not null, -- what the caller was told, and is told again on a retry
    state_hash text not null, -- digest of the state after this event
    stats_after blob not null,
    algorithm_version text not null, -- under which state_hash was computed
    append_us integer not null, -- microseconds since 1970, UTC
    actor text not null,
    constraint events_pk primary key (session_id, seq),
    constraint events_request unique (session_id, request_id),
    constraint events_seq_from_one check (seq >= 1),
    constraint events_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade
) strict;

-- Retries of a creation that left the choice of the id to the server.
create table creations (
    request_id text not null,
    session_id text not null,
    constraint creations_pk primary key (request_id)
) strict, without rowid;

-- Retries of a deletion find the deletion here when the session is gone.
create table deletions (
    session_id text not null,
    request_id text not null,
    request_digest blob not null,
    constraint deletions_pk primary key (session_id, request_id)
) strict, without rowid;

-- The log is append only: events go with their session or not at all.
create trigger events_are_never_changed before update on events
begin
    select raise(abort, 'events are never changed');
end;

create trigger events_are_never_removed before delete on events
when exists (select 1 from sessions where session_id = old.session_id)
begin
    select raise(abort, 'events are removed only with their session');
end;
