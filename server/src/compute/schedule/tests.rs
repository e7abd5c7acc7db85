//! The schedule under simulated load: moments are numbers here, so how fast the machine is changes nothing.

use std::collections::BTreeMap;

use super::*;

const MS: Duration = Duration::from_millis(1);
const MINUTE: Duration = Duration::from_secs(60);

/// A call of a session.
#[derive(Clone, Copy, Debug)]
struct Call {
    session: usize,
    queue: Queue,
    /// How long its caller waits.
    patience: Duration,
    /// What it takes of a thread.
    takes: Duration,
    /// The token of its caller, and the part that it is due.
    token: (usize, f64),
}

impl Call {
    fn of(session: usize) -> Self {
        Self { session, queue: Queue::ROBOTS, patience: MINUTE, takes: 20 * MS, token: (0, 1.0) }
    }

    fn account(&self) -> Account {
        Account { token_id: self.token.0.to_string().into(), share: self.token.1 }
    }

    fn work(&self) -> Work {
        if self.queue.is_of_robots() { Work::Contact } else { Work::Mesh }
    }
}

/// What happened to a call.
#[derive(Clone, Debug)]
struct Answer {
    call: Call,
    /// From when it was sent to when it was answered.
    after: Duration,
    error: Option<Error>,
}

impl Answer {
    fn is_good(&self) -> bool {
        self.error.is_none() && self.after <= self.call.patience
    }

    fn hint(&self) -> Option<Duration> {
        self.error.as_ref().and_then(Error::retry_after)
    }
}

#[derive(Debug)]
enum Event {
    Sent(Call),
    Ended(Call, Instant, Started),
}

/// Threads, and what is sent to them.
struct World {
    schedule: Schedule<bool>,
    start: Instant,
    now: Instant,
    events: BTreeMap<(Instant, u64), Event>,
    waiting: Vec<(Call, Instant, oneshot::Receiver<bool>)>,
    count: u64,
    chance: u64,
    /// How much of the threads was used.
    used: Duration,
}

impl World {
    fn new(threads: usize) -> Self {
        Self::with(threads, &Limits::default())
    }

    fn with(threads: usize, limits: &Limits) -> Self {
        let now = Instant::now();
        Self {
            schedule: Schedule::new(threads, limits),
            start: now,
            now,
            events: BTreeMap::new(),
            waiting: Vec::new(),
            count: 0,
            chance: 1,
            used: Duration::ZERO,
        }
    }

    fn elapsed(&self) -> Duration {
        self.now - self.start
    }

    fn at(&mut self, when: Instant, event: Event) {
        self.count += 1;
        self.events.insert((when, self.count), event);
    }

    fn send(&mut self, call: Call, when: Instant) {
        self.at(when, Event::Sent(call));
    }

    /// A number from 0 to 1, the same in each run.
    fn chance(&mut self) -> f64 {
        self.chance =
            self.chance.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.chance >> 40) as f64 / f64::from(1 << 24)
    }

    /// Goes on until a call is answered; `None` when nothing is left to happen.
    fn answer(&mut self) -> Option<Vec<Answer>> {
        loop {
            let ((when, _), event) = self.events.pop_first()?;
            self.now = when;
            let mut answers = Vec::new();
            match event {
                Event::Sent(call) => {
                    let session_id = call.session.to_string();
                    let deadline = when + call.patience;
                    let (queue, work, account) = (call.queue, call.work(), &call.account());
                    let wanted = Wanted { queue, work, session_id: &session_id, account, deadline };
                    match self.schedule.enter(when, wanted) {
                        Ok(turn) => self.waiting.push((call, when, turn)),
                        Err(error) => {
                            answers.push(Answer { call, after: Duration::ZERO, error: Some(error) });
                        }
                    }
                }
                Event::Ended(call, sent, started) => {
                    self.schedule.ended(when, &started, true);
                    answers.push(Answer { call, after: when - sent, error: None });
                }
            }
            answers.extend(self.hand_on());
            if !answers.is_empty() {
                return Some(answers);
            }
        }
    }

    /// Gives free threads away, and tells who came too late.
    fn hand_on(&mut self) -> Vec<Answer> {
        let mut late = Vec::new();
        let now = self.now;
        self.waiting.retain(|(call, sent, _)| {
            let has_gone = now >= *sent + call.patience;
            if has_gone {
                late.push(Answer { call: *call, after: call.patience, error: Some(Error::DeadlineExceeded) });
            }
            !has_gone
        });
        while let Some(next) = self.schedule.next(now) {
            match next {
                Next::Start(caller, started) => {
                    caller.send(true).unwrap();
                    let (call, sent) = self.told();
                    self.used += call.takes;
                    self.at(now + call.takes, Event::Ended(call, sent, started));
                }
                Next::Late(caller, error) => {
                    caller.send(false).unwrap();
                    let (call, sent) = self.told();
                    late.push(Answer { call, after: now - sent, error: Some(error) });
                }
            }
        }
        late
    }

    /// The call whose caller was told something just now.
    fn told(&mut self) -> (Call, Instant) {
        let told = self.waiting.iter_mut().position(|(_, _, turn)| turn.try_recv().is_ok()).unwrap();
        let (call, sent, _) = self.waiting.remove(told);
        (call, sent)
    }

    /// Answers until this much time is over; `again` says what is sent after each, and when.
    fn run(
        &mut self,
        time: Duration,
        mut again: impl FnMut(&mut Self, &Answer) -> Option<(Call, Instant)>,
    ) -> Vec<Answer> {
        let mut all = Vec::new();
        while self.elapsed() < time {
            let Some(answers) = self.answer() else { break };
            for answer in answers {
                if let Some((call, when)) = again(self, &answer) {
                    self.send(call, when);
                }
                all.push(answer);
            }
        }
        all
    }
}

fn of(answers: &[Answer], session: usize) -> impl Iterator<Item = &Answer> {
    answers.iter().filter(move |answer| answer.call.session == session)
}

fn slowest<'a>(answers: impl Iterator<Item = &'a Answer>) -> Duration {
    answers.map(|answer| answer.after).max().unwrap_or_default()
}

#[test]
fn sixty_four_robots_with_a_minute_are_all_served_and_none_waits_for_more_than_a_round() {
    let mut world = World::new(2);
    for robot in 0..64 {
        world.send(Call::of(robot), world.start);
    }
    let answers = world.run(MINUTE, |world, answer| Some((answer.call, world.now)));
    assert!(answers.iter().all(Answer::is_good));
    let round = 20 * MS * 64 / 2;
    assert!(slowest(answers.iter()) <= round + 20 * MS, "{:?}", slowest(answers.iter()));
    assert!(world.used >= 2 * world.elapsed() - 40 * MS, "no thread is idle");
}

#[test]
fn at_five_times_the_load_the_threads_do_little_that_comes_too_late() {
    for patience in [300 * MS, 1000 * MS] {
        let mut world = World::new(2);
        // Robots send as often as they like, and jobs take from 10 to 30 ms.
        let apart = 2 * MS;
        let time = 20_000 * MS;
        for call in 0..10_000 {
            let takes = MS.mul_f64(10.0 + 20.0 * world.chance());
            let when = world.start + apart.mul_f64(f64::from(call) + world.chance());
            world.send(Call { patience, takes, ..Call::of(call as usize % 64) }, when);
        }
        let answers = world.run(time, |_, _| None);
        let good = answers.iter().filter(|answer| answer.is_good());
        let good: Duration = good.map(|answer| answer.call.takes).sum();
        let of_capacity = good.as_secs_f64() / (2.0 * time.as_secs_f64());
        assert!(of_capacity > 0.95, "{patience:?}: {of_capacity}");
        let refused = answers.iter().filter(|answer| answer.error.is_some());
        let at_once = refused.clone().filter(|answer| answer.after.is_zero()).count();
        println!(
            "{patience:?}: {of_capacity:.3} of capacity, {at_once} of {} refused at once",
            refused.clone().count()
        );
        assert!(at_once * 4 > refused.count() * 3, "most who cannot be served are told at once");
    }
}

/// What each token had of the threads, in seconds.
fn had(answers: &[Answer], token: usize) -> f64 {
    let its = answers.iter().filter(|answer| answer.call.token.0 == token && answer.error.is_none());
    its.map(|answer| answer.call.takes.as_secs_f64()).sum()
}

#[test]
fn a_token_with_many_robots_has_no_more_of_the_threads_than_one_with_few() {
    for (share, times) in [(1.0, 1.0), (3.0, 3.0)] {
        let mut world = World::new(2);
        for robot in 0..60 {
            world.send(Call { token: (1, 1.0), ..Call::of(robot) }, world.start);
        }
        for robot in 60..64 {
            world.send(Call { token: (2, share), ..Call::of(robot) }, world.start);
        }
        let answers = world.run(MINUTE, |world, answer| Some((answer.call, world.now)));
        assert!(answers.iter().all(Answer::is_good));
        let ratio = had(&answers, 2) / had(&answers, 1);
        assert!((ratio / times - 1.0).abs() < 0.1, "{ratio} instead of {times}");
        assert!(world.used >= 2 * world.elapsed() - 40 * MS, "no thread is idle");
    }
}

#[test]
fn a_token_that_comes_late_makes_up_for_nothing_and_one_that_is_alone_has_all() {
    let mut world = World::new(1);
    for robot in 0..4 {
        world.send(Call { token: (1, 1.0), ..Call::of(robot) }, world.start);
    }
    let late = world.start + 10_000 * MS;
    for robot in 4..8 {
        world.send(Call { token: (2, 1.0), ..Call::of(robot) }, late);
    }
    let answers = world.run(20_000 * MS, |world, answer| Some((answer.call, world.now)));
    let (first, second) = (had(&answers, 1), had(&answers, 2));
    assert!((14.5..15.5).contains(&first) && (4.5..5.5).contains(&second), "{first} and {second} s");
}

#[test]
fn a_call_of_a_token_with_little_to_do_is_told_that_it_can_be_served_in_time() {
    let mut world = World::new(1);
    for robot in 0..60 {
        world.send(Call { token: (1, 1.0), ..Call::of(robot) }, world.start);
    }
    // All of them take 1.2 s; whoever is of another token waits for one or two.
    world.send(Call { token: (2, 1.0), patience: 150 * MS, ..Call::of(60) }, world.start + MS);
    let answers = world.run(2000 * MS, |_, _| None);
    assert!(of(&answers, 60).all(Answer::is_good), "{:?}", of(&answers, 60).collect::<Vec<_>>());
}

#[test]
fn a_session_with_many_calls_does_not_delay_one_with_one() {
    let mut world = World::new(1);
    for _ in 0..8 {
        world.send(Call::of(0), world.start);
    }
    for other in 1..=2 {
        world.send(Call::of(other), world.start + 5 * MS);
    }
    let answers = world.run(MINUTE, |_, _| None);
    let order: Vec<usize> = answers.iter().map(|answer| answer.call.session).collect();
    assert_eq!(order, [0, 1, 2, 0, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn whoever_takes_much_more_than_others_has_fewer_turns() {
    let mut world = World::new(1);
    for _ in 0..4 {
        world.send(Call { takes: 200 * MS, ..Call::of(0) }, world.start);
        (1..9).for_each(|other| world.send(Call { takes: 10 * MS, ..Call::of(other) }, world.start));
    }
    let answers = world.run(MINUTE, |world, answer| Some((answer.call, world.now)));
    let [long, short] = [0, 1].map(|session| of(&answers, session).count());
    assert!((3 * long..10 * long).contains(&short), "{long} of 200 ms, {short} of 10 ms");
}

#[test]
fn whoever_takes_a_little_more_than_others_keeps_his_turn() {
    let mut world = World::new(2);
    (0..64).for_each(|robot| world.send(Call::of(robot), world.start));
    let answers = world.run(MINUTE, |world, answer| {
        let takes = MS.mul_f64(10.0 + 20.0 * world.chance());
        Some((Call { takes, ..answer.call }, world.now))
    });
    let round = 20 * MS * 64 / 2;
    assert!(slowest(answers.iter()) < round.mul_f64(1.25), "{:?} of {round:?}", slowest(answers.iter()));
}

#[test]
fn calls_of_one_session_are_served_in_the_order_in_which_they_came() {
    let mut world = World::new(1);
    for call in 1..=5 {
        world.send(Call { takes: call * MS, ..Call::of(0) }, world.start);
    }
    let answers = world.run(MINUTE, |_, _| None);
    assert!(answers.is_sorted_by_key(|answer| answer.call.takes), "{answers:?}");
}

#[test]
fn what_cannot_end_in_time_any_more_is_dropped_before_it_costs_anything() {
    let mut world = World::new(1);
    // What the schedule takes for 15 ms takes 200 ms, so those who were let in come too late.
    let call = |session| Call { takes: 200 * MS, patience: 300 * MS, ..Call::of(session) };
    for session in 0..10 {
        world.send(call(session), world.start);
    }
    let answers = world.run(MINUTE, |_, _| None);
    let told = answers.iter().filter(|answer| answer.hint().is_some() && answer.after < 300 * MS).count();
    assert_eq!((answers.len(), told), (10, 8), "{answers:?}");
    assert!(answers[9].error.is_none(), "nobody else wanted the thread, so the last was tried");
}

#[test]
fn a_call_whose_caller_has_gone_is_forgotten() {
    let mut world = World::new(1);
    world.send(Call::of(0), world.start);
    world.send(Call::of(1), world.start);
    world.send(Call::of(2), world.start + MS);
    while world.waiting.len() < 2 {
        let ((when, _), event) = world.events.pop_first().unwrap();
        let Event::Sent(call) = event else { panic!() };
        let session_id = call.session.to_string();
        let wanted = Wanted {
            queue: call.queue,
            work: call.work(),
            session_id: &session_id,
            account: &call.account(),
            deadline: when + MINUTE,
        };
        let turn = world.schedule.enter(when, wanted).unwrap();
        world.waiting.push((call, when, turn));
        world.hand_on();
    }
    assert_eq!(world.schedule.robots.shares.len(), 2);
    world.waiting.remove(0);
    let answers = world.run(MINUTE, |_, _| None);
    assert_eq!(answers.iter().map(|answer| answer.call.session).collect::<Vec<_>>(), [0, 2]);
}

#[test]
fn a_wrong_estimate_refuses_nobody_for_ever() {
    let mut world = World::new(1);
    world.send(Call { takes: 30_000 * MS, ..Call::of(0) }, world.start);
    world.run(MINUTE, |_, _| None);
    let again = |world: &World| world.now + MS;
    for robot in 0..4 {
        world.send(Call { patience: 1000 * MS, ..Call::of(robot) }, world.now);
    }
    let answers = world.run(2 * MINUTE, |world, answer| Some((answer.call, again(world))));
    let last = &answers[answers.len() - 200..];
    assert!(last.iter().all(Answer::is_good), "ordinary calls teach what they cost");
}

#[test]
fn a_robot_that_obeys_is_served_and_robots_come_back_one_by_one() {
    for (robots, patience) in [(64, 300 * MS), (64, 120 * MS), (256, 300 * MS)] {
        let mut world = World::new(2);
        let call = |session, world: &mut World| {
            let takes = MS.mul_f64(10.0 + 20.0 * world.chance());
            Call { patience, takes, ..Call::of(session) }
        };
        for robot in 0..robots {
            let call = call(robot, &mut world);
            world.send(call, world.start);
        }
        let mut refused_in_a_row = vec![0; robots];
        let mut most_in_a_row = 0;
        let mut returns = Vec::new();
        let answers = world.run(MINUTE, |world, answer| {
            let robot = answer.call.session;
            let Some(hint) = answer.hint() else {
                refused_in_a_row[robot] = 0;
                return Some((call(robot, world), world.now));
            };
            refused_in_a_row[robot] += 1;
            most_in_a_row = most_in_a_row.max(refused_in_a_row[robot]);
            returns.push(world.now + hint);
            Some((answer.call, world.now + hint))
        });
        let served: Vec<usize> =
            (0..robots).map(|robot| of(&answers, robot).filter(|answer| answer.is_good()).count()).collect();
        let (least, most) = (*served.iter().min().unwrap(), *served.iter().max().unwrap());
        println!(
            "{robots} robots, {patience:?}: {least} to {most} each, refused {most_in_a_row} times in a row"
        );
        assert!(most_in_a_row <= 4, "refused {most_in_a_row} times in a row");
        assert!(least * 3 > most, "{least} to {most} calls each");
        returns.sort();
        let together = returns.windows(4).filter(|four| four[3] - four[0] < MS).count();
        assert!(together * 20 < returns.len(), "{together} of {} came back in a crowd", returns.len());
        let used = world.used.as_secs_f64() / (2.0 * world.elapsed().as_secs_f64());
        assert!(used > 0.9, "threads were idle: {used}");
    }
}

#[test]
fn a_robot_never_waits_for_readers_that_wait() {
    let mut world = World::new(2);
    for reader in 0..64 {
        let call = Call { queue: Queue::READERS, takes: 100 * MS, ..Call::of(100 + reader) };
        world.send(call, world.start);
    }
    world.send(Call::of(0), world.start + 5 * MS);
    let answers = world.run(MINUTE, |world, answer| {
        let pause = if answer.call.session == 0 { MS } else { Duration::ZERO };
        Some((answer.call, world.now + pause))
    });
    assert!(
        slowest(of(&answers, 0)) <= 20 * MS,
        "readers have half of the threads: {:?}",
        slowest(of(&answers, 0))
    );
    assert!(answers.iter().filter(|answer| answer.call.session >= 100).count() > 500, "and all of that half");
}

#[test]
fn readers_have_a_part_where_robots_would_take_all() {
    let mut world = World::new(2);
    for session in 0..16 {
        world.send(Call::of(session), world.start);
        world.send(Call { queue: Queue::READERS, ..Call::of(100 + session) }, world.start);
    }
    let answers = world.run(MINUTE, |world, answer| Some((answer.call, world.now)));
    assert!(answers.iter().all(Answer::is_good));
    let reads = answers.iter().filter(|answer| answer.call.session >= 100).count();
    let part = answers.len() / reads;
    assert!((8..=10).contains(&part), "one in {part}");
}

#[test]
fn a_long_fold_is_one_share_and_its_pages_take_turns_with_others() {
    let mut world = World::new(1);
    let page = |session| Call { queue: Queue::ROBOTS.patient(), takes: 80 * MS, ..Call::of(session) };
    world.send(page(0), world.start);
    world.send(Call::of(1), world.start + MS);
    let answers = world.run(MINUTE, |world, answer| {
        let pause = if answer.call.session == 0 { Duration::ZERO } else { 40 * MS };
        Some((answer.call, world.now + pause))
    });
    assert!(slowest(of(&answers, 1)) <= 100 * MS, "never behind more than one page");
}

#[test]
fn what_is_waited_for_in_memory_is_bounded_for_all_and_for_each_session() {
    let limits = Limits { compute_queue: 12, session_queue: 4, ..Limits::default() };
    let mut world = World::with(1, &limits);
    for call in 0..40 {
        world.send(Call::of(call % 2), world.start);
    }
    for other in 2..20 {
        world.send(Call::of(other), world.start);
    }
    let answers = world.run(MINUTE, |_, _| None);
    let good = |answers: &mut dyn Iterator<Item = &Answer>| answers.filter(|answer| answer.is_good()).count();
    // One begins at once, and beside it so many wait.
    assert_eq!(good(&mut of(&answers, 0)), 1 + 4);
    assert_eq!(good(&mut of(&answers, 1)), 4);
    assert_eq!(good(&mut answers.iter()), 1 + 12);
    let refused = answers.iter().filter_map(|answer| answer.error.as_ref());
    assert!(refused.clone().all(|error| matches!(error, Error::QueueFull { queue: "compute", .. })));
    assert_eq!(refused.count(), 58 - 13);
}

#[test]
fn time_for_the_commit_is_left_before_the_deadline() {
    let mut world = World::new(1);
    for _ in 0..50 {
        world.schedule.answered(Work::Contact, 50 * MS);
    }
    world.send(Call::of(0), world.start);
    world.run(MINUTE, |_, _| None);
    let now = world.now;
    world.send(Call::of(0), now);
    world.send(Call { patience: 80 * MS, ..Call::of(1) }, now);
    world.send(Call { patience: 200 * MS, ..Call::of(2) }, now);
    let answers = world.run(MINUTE, |_, _| None);
    let refused = answers.iter().filter(|answer| answer.error.is_some());
    assert_eq!(refused.map(|answer| answer.call.session).collect::<Vec<_>>(), [1], "{answers:?}");
}
