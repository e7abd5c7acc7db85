-- The log proves itself: each event carries a link, the hash of all that it says and of the link before it; a session
-- knows the link of its last event, and what lists show of it is sealed by a hash of its own.
-- A log of before this migration is linked when it is opened: SQLite cannot compute the hashes.

alter table sessions add column link blob; -- of the event at head; null until the log is linked
alter table sessions add column seal blob; -- hash of the session's row, summary included
alter table sessions add column damage text; -- why the log cannot be trusted; null where it can
alter table sessions add column sound integer; -- the last event before the damage, 0 for none

alter table events add column link blob;

create index sessions_damaged on sessions (created_us, session_id) where damage is not null;

drop trigger events_are_never_changed;

create trigger events_are_never_changed before update on events when old.link is not null
begin
    select raise(abort, 'events are never changed');
end;

-- What the log as a whole says of itself, for the witness beside it.
create table log (
    id integer not null,
    identity text not null, -- tells this log from another one in its place
    appended integer not null, -- events that were ever appended
    missing integer not null, -- events that were acknowledged and found missing at a start
    checked_us integer not null, -- when it was last asked whether it can be written
    constraint log_pk primary key (id),
    constraint log_is_one_row check (id = 1)
) strict;
