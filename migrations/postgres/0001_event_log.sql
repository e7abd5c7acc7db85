-- The event log on PostgreSQL, or on what speaks its protocol: each session is the fold of its events, in the order of
-- seq. What each table is for is said in ../sqlite, where it grew step by step.
--
-- Every key begins with the session, and so an engine that shards by session_id keeps each change of a session on one
-- shard. The others (created_requests, tokens, tickets, log) are written by statements of their own. There are no
-- sequences, no triggers and no types of PostgreSQL's own. That events are only appended is kept by the server, which
-- never updates them, proved by their links, and enforced by who takes the right to update from the server's role.

create table sessions (
    session_id text collate "C" not null,
    experiment text collate "C" not null,
    state integer not null,
    created_us bigint not null, -- microseconds since 1970, UTC
    head bigint not null, -- seq of the last event
    summary bytea not null, -- the session as callers see it, at head
    link bytea not null, -- of the event at head
    seal bytea not null, -- hash of the session's row, summary included
    damage text, -- why the log cannot be trusted; null where it can
    sound bigint, -- the last event before the damage, 0 for none
    constraint sessions_pk primary key (session_id),
    constraint sessions_head_counts_events check (head >= 1)
);

create index sessions_newest_first on sessions (created_us, session_id);
create index sessions_by_experiment on sessions (experiment, created_us, session_id);
create index sessions_damaged on sessions (created_us, session_id) where damage is not null;

create table session_labels (
    session_id text collate "C" not null,
    name text collate "C" not null,
    value text collate "C" not null,
    constraint session_labels_pk primary key (session_id, name),
    constraint session_labels_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade
);

create index session_labels_by_value on session_labels (name, substr(value, 1, 200)); -- longer ones fit into no index

create table events (
    session_id text collate "C" not null,
    seq bigint not null, -- 1 is the creation; no gaps
    request_id text collate "C", -- null where the caller gave none
    request_digest bytea not null, -- tells a retry from another request under the same request_id
    kind text collate "C" not null,
    payload bytea not null,
    reply bytea not null, -- what the caller was told, and is told again on a retry
    state_hash text not null, -- digest of the state after this event
    stats_after bytea not null,
    algorithm_version text not null, -- under which state_hash was computed
    append_us bigint not null, -- microseconds since 1970, UTC
    actor text not null,
    link bytea not null, -- the hash of all that the event says and of the link before it
    constraint events_pk primary key (session_id, seq),
    constraint events_request unique (session_id, request_id),
    constraint events_seq_from_one check (seq >= 1),
    constraint events_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade
);

create index events_retractions on events (session_id, seq) where kind = 'retracted';

-- The request that made a session; it stays when the session is deleted, so that a late retry does not bring it back.
create table creations (
    session_id text collate "C" not null,
    request_id text collate "C" not null,
    request_digest bytea, -- null where the session's own first event has it
    reply bytea,
    constraint creations_pk primary key (session_id, request_id)
);

-- The same by the request, so that one that names another session is found out. It is written after the creation, in a
-- transaction of its own.
create table created_requests (
    request_id text collate "C" not null,
    session_id text collate "C" not null,
    constraint created_requests_pk primary key (request_id)
);

-- Retries of a deletion find the deletion here when the session is gone.
create table deletions (
    session_id text collate "C" not null,
    request_id text collate "C" not null,
    request_digest bytea not null,
    constraint deletions_pk primary key (session_id, request_id)
);

-- True surfaces that sessions are compared with; each session has a file of its own.
create table session_references (
    session_id text collate "C" not null,
    sha256 bytea not null, -- of the bytes
    format integer not null, -- how the bytes are to be read
    metres_per_unit double precision not null,
    n_vertices bigint not null,
    n_faces bigint not null,
    bytes bytea not null, -- as they were sent
    constraint session_references_pk primary key (session_id),
    constraint session_references_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade
);

-- How far the estimate after an event is from the reference that the session keeps now: a cache.
create table reference_errors (
    session_id text collate "C" not null,
    seq bigint not null,
    algorithm_version text not null, -- under which the estimate was computed
    surface_distance_m double precision, -- null where the estimate cannot be compared
    constraint reference_errors_pk primary key (session_id, seq, algorithm_version),
    constraint reference_errors_of_a_reference foreign key (session_id) references session_references (session_id) on delete cascade
);

-- Who may call.
create table tokens (
    id text collate "C" not null, -- public: it is a part of the token, and names it in lists and events
    name text not null, -- what people call the caller
    secret_sha256 bytea not null,
    scope text not null, -- read, robot, operate or admin
    experiments text, -- only experiments whose names begin with this; null for all
    created_us bigint not null, -- microseconds since 1970, UTC
    expires_us bigint, -- null for never
    revoked_us bigint, -- null while it is in force
    most_sessions bigint, -- that it may have created at a time; null for no bound
    most_bytes bigint, -- that their events may take; null for no bound
    compute_share double precision not null, -- of the threads where all want them, as others have 1
    constraint tokens_pk primary key (id),
    constraint tokens_scope check (scope in ('read', 'robot', 'operate', 'admin')),
    constraint tokens_share check (compute_share > 0)
);

create table session_owners (
    session_id text collate "C" not null,
    token_id text collate "C" not null,
    bytes bigint not null, -- of the session's events
    constraint session_owners_pk primary key (session_id),
    constraint session_owners_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade
);

create index session_owners_by_token on session_owners (token_id, bytes);

-- Tickets that were given out and not used: whichever server one is shown to finds it here.
create table tickets (
    ticket_sha256 bytea not null,
    actor text not null,
    scope text not null,
    experiments text,
    token_id text not null, -- empty where there is none
    compute_share double precision not null,
    until_us bigint not null, -- microseconds since 1970, UTC
    constraint tickets_pk primary key (ticket_sha256)
);

-- Tells this log from another one, and takes the write that shows whether it can be written.
create table log (
    id integer not null,
    identity text not null,
    checked_us bigint not null,
    constraint log_pk primary key (id),
    constraint log_is_one_row check (id = 1)
);

-- What folds go on from, and what readers are shown of each state: caches, never trusted over the log. Servers of
-- several versions keep theirs beside each other.
create table checkpoints (
    session_id text collate "C" not null,
    created_us bigint not null, -- of the session
    seq bigint not null, -- the event that the state is after
    algorithm_version text collate "C" not null,
    state_hash text not null,
    bytes bytea, -- null where they are those of the event before
    shown bytea, -- the digest of what readers see, in the other table
    size bigint not null, -- of the bytes
    kept_us bigint not null, -- microseconds since 1970, UTC
    constraint checkpoints_pk primary key (session_id, seq, algorithm_version)
);

create index checkpoints_oldest_first on checkpoints (kept_us);

-- The largest of what is kept, some 50 kB for each contact, and the easiest to compute again: it goes to no standby, and
-- is empty after a crash of the database.
create unlogged table shown (
    session_id text collate "C" not null,
    digest bytea not null, -- SHA-256
    bytes bytea not null,
    size bigint not null, -- of the bytes
    kept_us bigint not null, -- microseconds since 1970, UTC
    constraint shown_pk primary key (session_id, digest)
);

create index shown_oldest_first on shown (kept_us);
