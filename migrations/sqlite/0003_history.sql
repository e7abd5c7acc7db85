-- Retries of an import find its reply here: the events of an imported session carry the requests of the server that it
-- comes from.

alter table creations add column request_digest blob; -- null where the session's own first event has it
alter table creations add column reply blob;

-- What is retracted is to be known before a log is folded.
create index events_retractions on events (session_id, seq) where kind = 'retracted';
