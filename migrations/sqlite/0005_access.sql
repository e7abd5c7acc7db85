-- Who may call: tokens, of which only the hash is kept, and whose sessions are whose where tokens have limits.

create table tokens (
    id text not null, -- public: it is a part of the token, and names it in lists and events
    name text not null, -- what people call the caller
    secret_sha256 blob not null,
    scope text not null, -- read, robot, operate or admin
    experiments text, -- only experiments whose names begin with this; null for all
    created_us integer not null, -- microseconds since 1970, UTC
    expires_us integer, -- null for never
    revoked_us integer, -- null while it is in force
    most_sessions integer, -- that it may have created at a time; null for no bound
    most_bytes integer, -- that their events may take; null for no bound
    compute_share real not null, -- of the threads where all want them, as others have 1
    constraint tokens_pk primary key (id),
    constraint tokens_scope check (scope in ('read', 'robot', 'operate', 'admin')),
    constraint tokens_share check (compute_share > 0)
) strict, without rowid;

create table session_owners (
    session_id text not null,
    token_id text not null,
    bytes integer not null, -- of the session's events
    constraint session_owners_pk primary key (session_id),
    constraint session_owners_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade
) strict, without rowid;

create index session_owners_by_token on session_owners (token_id, bytes);
