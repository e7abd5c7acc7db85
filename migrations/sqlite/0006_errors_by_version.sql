-- Errors of each version of the method beside each other, as in PostgreSQL, where servers of two versions share a log.
-- What was there is a cache, and is computed again.
drop table reference_errors;

-- How far the estimate after an event is from the reference that the session keeps now: a cache.
create table reference_errors (
    session_id text not null,
    seq integer not null,
    algorithm_version text not null, -- under which the estimate was computed
    surface_distance_m real, -- null where the estimate cannot be compared
    constraint reference_errors_pk primary key (session_id, seq, algorithm_version),
    constraint reference_errors_of_a_reference foreign key (session_id) references session_references (session_id) on delete cascade
) strict, without rowid;
