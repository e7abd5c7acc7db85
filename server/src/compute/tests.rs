//! That a queue refuses or lets wait as it should, and that readers keep no robot waiting.

use std::sync::mpsc;

use tokio::task::JoinSet;

use super::*;

fn soon() -> Instant {
    Instant::now() + Duration::from_secs(20)
}

fn pool(threads: usize, limits: &Limits) -> Arc<Pool> {
    Arc::new(Pool::new(threads, limits))
}

/// One further job waits for each thread, whoever's it is.
fn short_queues() -> Limits {
    Limits { compute_queue_per_core: 1, reader_queue_per_core: 1, ..Limits::default() }
}

/// Jobs that run or wait until they are told to finish, `count` of them.
async fn hold(pool: &Arc<Pool>, queue: Queue, session_id: &'static str, count: usize) -> Held {
    let line = if queue.is_reading { &pool.readers } else { &pool.robots };
    let all = line.slots.available_permits();
    let expected = count.min(all).min(line.per_session);
    let (release, _) = tokio::sync::watch::channel(());
    let mut jobs = JoinSet::new();
    for _ in 0..count {
        let (pool, mut released) = (pool.clone(), release.subscribe());
        jobs.spawn(async move {
            let handle = tokio::runtime::Handle::current();
            let wait = move || handle.block_on(async move { released.changed().await.is_err() });
            pool.run(queue, session_id, soon(), wait).await
        });
    }
    while line.slots.available_permits() > all - expected {
        tokio::task::yield_now().await;
    }
    Held { release, jobs }
}

struct Held {
    release: tokio::sync::watch::Sender<()>,
    jobs: JoinSet<Result<bool, Error>>,
}

impl Held {
    async fn finish(self) -> Vec<Result<bool, Error>> {
        drop(self.release);
        self.jobs.join_all().await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_refuses_at_once_and_says_when_to_try_again() {
    let pool = pool(1, &short_queues());
    let held = hold(&pool, Queue::ROBOTS, "ball", 2).await;
    let refused = pool.run(Queue::ROBOTS, "mug", soon(), || 8).await.unwrap_err();
    assert_eq!(refused.reason(), "QUEUE_FULL");
    assert!(refused.retry_after().is_some_and(|after| after > Duration::ZERO));
    assert_eq!(held.finish().await, [Ok(true), Ok(true)]);
    assert_eq!(pool.run(Queue::ROBOTS, "mug", soon(), || 8).await, Ok(8));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_waits_for_room_in_a_full_queue() {
    let pool = pool(1, &short_queues());
    let held = hold(&pool, Queue::READERS, "ball", 2).await;
    assert_eq!(pool.run(Queue::READERS, "mug", soon(), || 8).await.unwrap_err().reason(), "QUEUE_FULL");
    let waiting = tokio::spawn({
        let pool = pool.clone();
        async move { pool.run(Queue::WATCHERS, "mug", soon(), || 9).await }
    });
    tokio::task::yield_now().await;
    assert_eq!(held.finish().await, [Ok(true), Ok(true)]);
    assert_eq!(waiting.await.unwrap(), Ok(9));
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_are_neither_refused_nor_kept_waiting_by_readers() {
    let pool = pool(2, &short_queues());
    let held = hold(&pool, Queue::WATCHERS, "ball", 12).await;
    for _ in 0..20 {
        assert_eq!(pool.run(Queue::ROBOTS, "ball", soon(), || 7).await, Ok(7), "one thread is the robots'");
    }
    assert_eq!(held.finish().await.len(), 12);
}

#[tokio::test(flavor = "multi_thread")]
async fn one_session_cannot_take_the_whole_queue() {
    let limits = Limits { compute_queue_per_session: 2, reader_queue_per_session: 2, ..Limits::default() };
    let pool = pool(1, &limits);
    for queue in [Queue::ROBOTS, Queue::READERS] {
        let held = hold(&pool, queue, "noisy", 2).await;
        let refused = pool.run(queue, "noisy", soon(), || 1).await.unwrap_err();
        assert!(refused.to_string().contains("session's"), "{refused}");
        let quiet = tokio::spawn({
            let pool = pool.clone();
            async move { pool.run(queue, "quiet", soon(), || 2).await }
        });
        assert_eq!(held.finish().await, [Ok(true), Ok(true)]);
        assert_eq!(quiet.await.unwrap(), Ok(2));
    }
    pool.robots.of_session("other");
    let known = pool.robots.of_sessions.lock().unwrap().len();
    assert_eq!(known, 1, "sessions without jobs are forgotten");
}

#[tokio::test]
async fn a_panic_ends_one_job_and_leaves_the_pool_usable() {
    let pool = pool(1, &short_queues());
    let broken = || assert_eq!(1, 2, "on purpose");
    let failed = pool.run(Queue::ROBOTS, "ball", soon(), broken).await.unwrap_err();
    assert_eq!(failed.reason(), "INTERNAL");
    assert_eq!(pool.run(Queue::ROBOTS, "ball", soon(), || 5).await, Ok(5));
}

#[tokio::test]
async fn a_job_whose_deadline_has_passed_never_runs() {
    let pool = pool(1, &short_queues());
    let (ran, observed) = mpsc::channel();
    let late = pool.run(Queue::ROBOTS, "ball", Instant::now(), move || ran.send(())).await;
    assert_eq!(late.unwrap_err(), Error::DeadlineExceeded);
    assert!(observed.recv().is_err(), "the job was dropped, and its channel with it");
}
