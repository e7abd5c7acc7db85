//! That what was scheduled is carried out: threads given and given back, whatever becomes of jobs and callers.

use std::sync::mpsc;

use tokio::task::JoinSet;

use super::*;

fn soon() -> Instant {
    Instant::now() + Duration::from_secs(60)
}

fn pool(threads: usize, limits: &Limits) -> Pool {
    Pool::new(threads, limits, Metrics::default())
}

/// Jobs that run until they are told to finish, on as many threads.
struct Held {
    release: tokio::sync::watch::Sender<()>,
    jobs: JoinSet<Result<bool, Error>>,
}

impl Held {
    async fn begin(pool: &Pool, queue: Queue, count: usize) -> Self {
        let (release, _) = tokio::sync::watch::channel(());
        let (begun, mut running) = tokio::sync::mpsc::channel(count);
        let mut jobs = JoinSet::new();
        for _ in 0..count {
            let (pool, mut released, begun) = (pool.clone(), release.subscribe(), begun.clone());
            jobs.spawn(async move {
                let handle = tokio::runtime::Handle::current();
                let wait = move || {
                    handle.block_on(async move {
                        begun.send(()).await.unwrap();
                        released.changed().await.is_err()
                    })
                };
                pool.run(queue, Work::Contact, "held", soon(), wait).await
            });
        }
        for _ in 0..count {
            running.recv().await.unwrap();
        }
        Self { release, jobs }
    }

    async fn finish(self) {
        drop(self.release);
        assert!(self.jobs.join_all().await.into_iter().all(|outcome| outcome == Ok(true)));
    }
}

async fn quick(pool: &Pool, queue: Queue, limit: Duration) -> Result<i32, Error> {
    pool.run(queue, Work::Contact, "quick", Instant::now() + limit, || 8).await
}

const MINUTE: Duration = Duration::from_secs(60);

#[tokio::test(flavor = "multi_thread")]
async fn hundreds_wait_for_one_thread_and_all_are_served() {
    let pool = pool(1, &Limits::default());
    let held = Held::begin(&pool, Queue::ROBOTS, 1).await;
    let mut waiting = JoinSet::new();
    for _ in 0..400 {
        let pool = pool.clone();
        waiting.spawn(async move { quick(&pool, Queue::ROBOTS, MINUTE).await });
    }
    tokio::task::yield_now().await;
    held.finish().await;
    assert!(waiting.join_all().await.into_iter().all(|outcome| outcome == Ok(8)));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_refuses_at_once_and_says_when_to_try_again_and_a_stream_waits() {
    let limits = Limits { compute_queue: 0, reader_queue: 0, ..Limits::default() };
    let pool = pool(1, &limits);
    for (queue, name) in [(Queue::ROBOTS, "compute"), (Queue::READERS, "reader")] {
        let held = Held::begin(&pool, queue, 1).await;
        let refused = quick(&pool, queue, MINUTE).await.unwrap_err();
        assert_eq!(refused.reason(), "QUEUE_FULL");
        assert!(refused.to_string().contains(name), "{refused}");
        assert!(refused.retry_after().is_some_and(|after| after > Duration::ZERO));
        let stream = tokio::spawn({
            let pool = pool.clone();
            async move { quick(&pool, queue.patient(), MINUTE).await }
        });
        tokio::task::yield_now().await;
        held.finish().await;
        assert_eq!(stream.await.unwrap(), Ok(8));
        assert_eq!(quick(&pool, queue, MINUTE).await, Ok(8));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_are_served_while_readers_keep_all_the_threads_they_may_have() {
    let pool = pool(2, &Limits::default());
    let held = Held::begin(&pool, Queue::READERS, 1).await;
    let (_release, blocked) = mpsc::channel::<()>();
    let reader = tokio::spawn({
        let pool = pool.clone();
        async move { pool.run(Queue::READERS, Work::Mesh, "ball", soon(), move || blocked.recv().is_err()).await }
    });
    for _ in 0..20 {
        assert_eq!(quick(&pool, Queue::ROBOTS, MINUTE).await, Ok(8), "one thread is the robots'");
    }
    assert!(!reader.is_finished());
    drop(_release);
    held.finish().await;
    assert_eq!(reader.await.unwrap(), Ok(true));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_who_leaves_gives_his_turn_to_the_next() {
    let pool = pool(1, &Limits::default());
    let held = Held::begin(&pool, Queue::ROBOTS, 1).await;
    let (ran, observed) = mpsc::channel();
    for _ in 0..20 {
        let ran = ran.clone();
        let left = pool.run(Queue::ROBOTS, Work::Contact, "left", soon(), move || ran.send(()));
        assert!(tokio::time::timeout(Duration::from_millis(1), left).await.is_err());
    }
    let stays = tokio::spawn({
        let pool = pool.clone();
        async move { quick(&pool, Queue::ROBOTS, MINUTE).await }
    });
    tokio::task::yield_now().await;
    held.finish().await;
    assert_eq!(stays.await.unwrap(), Ok(8));
    drop(ran);
    assert!(observed.recv().is_err(), "nobody waits for those jobs, so they never ran");
}

#[tokio::test]
async fn a_panic_ends_one_job_and_leaves_the_pool_usable() {
    let pool = pool(1, &Limits::default());
    for _ in 0..3 {
        let broken = || assert_eq!(1, 2, "on purpose");
        let failed = pool.run(Queue::ROBOTS, Work::Contact, "ball", soon(), broken).await.unwrap_err();
        assert_eq!(failed.reason(), "INTERNAL");
    }
    assert_eq!(quick(&pool, Queue::ROBOTS, MINUTE).await, Ok(8));
}

#[tokio::test]
async fn a_job_whose_deadline_has_passed_never_runs() {
    let pool = pool(1, &Limits::default());
    let (ran, observed) = mpsc::channel();
    let late = pool.run(Queue::ROBOTS, Work::Contact, "ball", Instant::now(), move || ran.send(())).await;
    assert_eq!(late.unwrap_err(), Error::DeadlineExceeded);
    assert!(observed.recv().is_err(), "the job was dropped, and its channel with it");
}
