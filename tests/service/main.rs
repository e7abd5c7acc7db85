//! The running service from outside: real sockets, a real database, a real process to kill.
//!
//! Each file is a promise of the service; [`harness`] starts servers and calls them.
//! Nothing rests on timing: the only bound on a wait is one after which something is surely broken.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed, and says where")]

mod access;
mod agreement;
mod archives;
mod arms;
mod backups;
mod bad_input;
mod browsers;
mod clouds;
mod clutter;
mod commands;
mod concurrency;
mod configuration;
mod connections;
mod contact_faults;
mod contract;
mod crash;
mod damage;
mod deletion;
mod depth;
mod disk;
mod doctor;
mod door;
mod doubts;
mod encodings;
mod evaluation;
mod experiments;
mod explore;
mod field;
mod forks;
mod formats;
mod harness;
mod history;
mod hostile_archives;
mod hostile_numbers;
mod hostile_texts;
mod http_only;
mod kills;
mod leases;
mod lifecycle;
mod limits;
mod log_level;
mod meshes;
mod metrics;
mod migrations;
mod motions;
mod openapi;
mod opening;
mod operations;
mod outcomes;
mod power_loss;
mod program;
mod proposals;
mod raw_damage;
mod readers;
mod recordings;
mod references;
mod replicas;
mod restarts;
mod retries;
mod series;
mod shared_log;
mod sse;
mod strategies;
mod streams;
mod tls;
mod tokens;
mod touched_points;
mod watch;
