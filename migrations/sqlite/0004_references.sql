-- True surfaces that sessions are compared with. They are no evidence, so they are not in the log: a session keeps one
-- or none, and several may keep the same file.

create table reference_files (
    sha256 blob not null, -- of the bytes
    bytes blob not null, -- as they were sent
    constraint reference_files_pk primary key (sha256)
) strict;

create table session_references (
    session_id text not null,
    sha256 blob not null,
    format integer not null, -- how the bytes are to be read
    metres_per_unit real not null,
    n_vertices integer not null,
    n_faces integer not null,
    constraint session_references_pk primary key (session_id),
    constraint session_references_of_a_session foreign key (session_id) references sessions (session_id) on delete cascade,
    constraint session_references_to_a_file foreign key (sha256) references reference_files (sha256)
) strict, without rowid;

create index session_references_by_file on session_references (sha256);

-- How far the estimate after an event is from the reference that the session keeps now: a cache.
create table reference_errors (
    session_id text not null,
    seq integer not null,
    algorithm_version text not null, -- under which the estimate was computed
    surface_distance_m real, -- null where the estimate cannot be compared
    constraint reference_errors_pk primary key (session_id, seq),
    constraint reference_errors_of_a_reference foreign key (session_id) references session_references (session_id) on delete cascade
) strict, without rowid;

-- A file goes with the last session that keeps it.
create trigger reference_files_go_with_their_last_session after delete on session_references
begin
    delete from reference_files
    where sha256 = old.sha256 and not exists (select 1 from session_references where sha256 = old.sha256);
end;

-- Another reference in place of an earlier one: what was computed against that one is worth nothing.
create trigger reference_errors_go_with_their_reference after update on session_references
begin
    delete from reference_errors where session_id = old.session_id;
    delete from reference_files
    where sha256 = old.sha256 and not exists (select 1 from session_references where sha256 = old.sha256);
end;
