//! Any sequence of operations, against a model that fits on a page: real store, real pool, toy state.
//!
//! Sessions, request ids and bodies come from a handful, so that retries, reuse of ids, deletions and
//! creations anew meet all the time; two states fit into memory, so that sessions are replayed as often.

use std::cell::RefCell;
use std::collections::BTreeMap;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};
use tempfile::TempDir;
use tokio::runtime::Runtime;

use super::*;
use crate::session::{etag, now_us};
use crate::store::Event;

/// The bytes of all events so far, which are thus the state, its hash and every reply.
#[derive(Clone, Debug)]
struct Toy {
    id: String,
    created_us: i64,
    bytes: Vec<u8>,
}

impl Aggregate for Toy {
    fn algorithm_version() -> &'static str {
        "toy"
    }

    fn identity(&self) -> (&str, i64) {
        (&self.id, self.created_us)
    }

    fn revision(&self) -> i64 {
        self.bytes.len() as i64
    }

    fn bytes(&self) -> usize {
        self.bytes.len()
    }

    fn state_hash(&self) -> String {
        format!("{:?}", self.bytes)
    }

    fn check_open(&self) -> Result<(), Error> {
        Ok(())
    }

    fn without_event(&self, _row: &Event) -> Self {
        let mut after = self.clone();
        after.bytes.push(LEFT_OUT);
        after
    }

    fn deferring(&self) -> Self {
        Self { bytes: vec![LOST; self.bytes.len()], ..self.clone() }
    }

    fn checkpoint(&self) -> Option<Vec<u8>> {
        Some(self.bytes.clone())
    }

    fn shown(&self) -> Option<Vec<u8>> {
        Some(self.bytes.iter().rev().copied().collect())
    }

    /// Every other state has a checkpoint of its own only.
    fn shares_checkpoint_with(&self, _before: &Self) -> bool {
        self.bytes.len().is_multiple_of(2)
    }

    fn restored(&self, checkpoint: &[u8]) -> Option<Self> {
        let is_of_this = checkpoint.len() == self.bytes.len();
        is_of_this.then(|| Self { bytes: checkpoint.to_vec(), ..self.clone() })
    }

    fn quarantined(&self, _reason: &str, _head: i64) -> Self {
        panic!("every log of this test can be replayed")
    }
}

fn fold(before: Option<&Toy>, row: &Event) -> Result<Toy, FoldError> {
    let [id @ .., byte] = row.payload.as_slice() else { panic!("an event has a byte") };
    let created =
        || Toy { id: String::from_utf8_lossy(id).into_owned(), created_us: row.append_us, bytes: Vec::new() };
    let byte = if row.kind == RETRACTED { RETRACTION } else { *byte };
    Ok(before.map_or_else(created, Toy::clone).with(byte))
}

const RETRACTED: &str = "retracted";

fn retracts(row: &Event) -> Option<i64> {
    (row.kind == RETRACTED).then(|| i64::from(row.payload[0]))
}

const FOLDING: Folding<Toy> = Folding { fold, retracts, retraction: RETRACTED };

impl Toy {
    fn with(mut self, byte: u8) -> Self {
        self.bytes.push(byte);
        self
    }

    fn computed(self) -> Computed<Self> {
        Computed {
            reply: self.bytes.clone(),
            state: 0,
            summary: Vec::new(),
            stats_after: Vec::new(),
            state_hash: self.state_hash(),
            append_us: self.created_us,
            new_labels: None,
            after: self,
        }
    }
}

/// What is in the place of an event that was retracted, and of the retraction.
const LEFT_OUT: u8 = 5;
const RETRACTION: u8 = 6;
/// What is in the place of an event whose state is left out.
const LOST: u8 = 7;
/// The body of a request that the method refuses.
const REFUSED: u8 = 3;
/// The body of a request that is answered and changes nothing.
const ANSWERED: u8 = 4;
/// The request id that is none.
const NO_ID: u8 = 0;

#[derive(Clone, Copy, Debug)]
enum Guard {
    None,
    Right,
    Stale,
}

#[derive(Clone, Debug)]
enum Op {
    Create {
        session: u8,
        request: u8,
        body: u8,
    },
    Append {
        session: u8,
        request: u8,
        body: u8,
        guard: Guard,
    },
    /// The same request, sent twice at once.
    AppendTwice {
        session: u8,
        request: u8,
        body: u8,
    },
    Retract {
        session: u8,
        request: u8,
        seq: u8,
    },
    Delete {
        session: u8,
        request: u8,
        body: u8,
        guard: Guard,
    },
    Read {
        session: u8,
        back: i64,
    },
    /// The process is gone, with all that it had in memory.
    Crash,
}

fn op() -> impl Strategy<Value = Op> {
    let key = || (0..3_u8, 0..5_u8, 0..=ANSWERED);
    let guard = || prop_oneof![3 => Just(Guard::None), 1 => Just(Guard::Right), 1 => Just(Guard::Stale)];
    prop_oneof![
        20 => (0..3_u8, prop_oneof![Just(NO_ID), 0..5_u8], 0..=ANSWERED)
            .prop_map(|(session, request, body)| Op::Create { session, request, body }),
        60 => (key(), guard())
            .prop_map(|((session, request, body), guard)| Op::Append { session, request, body, guard }),
        10 => key().prop_map(|(session, request, body)| Op::AppendTwice { session, request, body }),
        20 => (0..3_u8, 0..5_u8, 1..9_u8)
            .prop_map(|(session, request, seq)| Op::Retract { session, request, seq }),
        15 => (key(), guard())
            .prop_map(|((session, request, body), guard)| Op::Delete { session, request, body, guard }),
        30 => (0..3_u8, 0..4_i64).prop_map(|(session, back)| Op::Read { session, back }),
        1 => Just(Op::Crash),
    ]
}

/// One operation, or a session that is replaced by a grown one of the same id and looked back into.
fn ops() -> impl Strategy<Value = Vec<Op>> {
    let append = |session| Op::Append { session, request: NO_ID, body: 1, guard: Guard::None };
    let replace = move |(session, body): (u8, u8)| {
        let delete = Op::Delete { session, request: NO_ID, body, guard: Guard::None };
        let create = Op::Create { session, request: NO_ID, body };
        let back = Op::Read { session, back: 1 };
        vec![back.clone(), delete, create, append(session), append(session), back]
    };
    prop_oneof![20 => op().prop_map(|op| vec![op]), 1 => (0..3_u8, 0..3_u8).prop_map(replace)]
}

/// The bytes of a reply and whether it is a repeated one, or the reason of a refusal.
type Outcome = Result<(Vec<u8>, bool), &'static str>;

/// A request's kind, session and body.
type Digest = (char, u8, u8);

/// What must be true.
#[derive(Debug, Default)]
struct Model {
    /// The state at each revision.
    sessions: BTreeMap<u8, Vec<Vec<u8>>>,
    /// By session and request id.
    replies: BTreeMap<(u8, u8), (Digest, Vec<u8>)>,
    deletions: BTreeMap<(u8, u8), u8>,
    /// By request id, deleted sessions included.
    creations: BTreeMap<u8, u8>,
}

impl Model {
    fn create(&mut self, session: u8, request: u8, body: u8) -> Outcome {
        let first = self.creations.get(&request).copied();
        match (self.first_reply(first.unwrap_or(session), request, ('c', session, body)), first) {
            (Some(outcome), _) => outcome,
            (None, Some(first)) if first == session => Err("SESSION_NOT_FOUND"),
            (None, Some(_)) => Err("REQUEST_ID_REUSED"),
            (None, None) if self.sessions.contains_key(&session) => Err("SESSION_EXISTS"),
            (None, None) => {
                if request != NO_ID {
                    self.creations.insert(request, session);
                }
                self.accept(session, request, ('c', session, body))
            }
        }
    }

    fn append(&mut self, session: u8, request: u8, body: u8, guard: Guard) -> Outcome {
        match (self.sessions.get(&session), self.first_reply(session, request, ('a', session, body)), guard) {
            (None, ..) => Err("SESSION_NOT_FOUND"),
            (_, Some(outcome), _) => outcome,
            (_, None, Guard::Stale) => Err("REVISION_MISMATCH"),
            _ if body == REFUSED => Err("NO_VISUAL_PRIOR"),
            (Some(states), ..) if body == ANSWERED => Ok((states[states.len() - 1].clone(), false)),
            _ => self.accept(session, request, ('a', session, body)),
        }
    }

    fn retract(&mut self, session: u8, request: u8, seq: u8) -> Outcome {
        let digest = ('r', session, seq);
        let Some(states) = self.sessions.get(&session) else { return Err("SESSION_NOT_FOUND") };
        if let Some(outcome) = self.first_reply(session, request, digest) {
            return outcome;
        }
        let mut bytes = states[states.len() - 1].clone();
        if !is_evidence(&bytes, seq) {
            return Err("FIELD_INVALID");
        }
        bytes[usize::from(seq) - 1] = LEFT_OUT;
        bytes.push(RETRACTION);
        self.note(session, request, digest, bytes)
    }

    fn first_reply(&self, session: u8, request: u8, digest: Digest) -> Option<Outcome> {
        let (first, reply) = self.replies.get(&(session, request))?;
        Some(if *first == digest { Ok((reply.clone(), true)) } else { Err("REQUEST_ID_REUSED") })
    }

    fn accept(&mut self, session: u8, request: u8, digest: Digest) -> Outcome {
        let mut bytes =
            self.sessions.get(&session).and_then(|states| states.last()).cloned().unwrap_or_default();
        bytes.push(digest.2);
        self.note(session, request, digest, bytes)
    }

    fn note(&mut self, session: u8, request: u8, digest: Digest, bytes: Vec<u8>) -> Outcome {
        self.sessions.entry(session).or_default().push(bytes.clone());
        if request != NO_ID {
            self.replies.insert((session, request), (digest, bytes.clone()));
        }
        Ok((bytes, false))
    }

    fn delete(&mut self, session: u8, request: u8, body: u8, guard: Guard) -> Result<(), &'static str> {
        match (self.deletions.get(&(session, request)), guard) {
            (Some(first), _) if *first == body => return Ok(()),
            (Some(_), _) => return Err("REQUEST_ID_REUSED"),
            (None, _) if !self.sessions.contains_key(&session) => return Err("SESSION_NOT_FOUND"),
            (None, Guard::Stale) => return Err("ETAG_MISMATCH"),
            _ => {}
        }
        self.sessions.remove(&session);
        self.replies.retain(|(of, _), _| *of != session);
        if request != NO_ID {
            self.deletions.insert((session, request), body);
        }
        Ok(())
    }

    fn read(&self, session: u8, back: i64) -> Result<&[u8], &'static str> {
        let states = self.sessions.get(&session).ok_or("SESSION_NOT_FOUND")?;
        // Revision 0 is the newest, as in the contract.
        let revision = usize::try_from(states.len() as i64 - back).map_err(|_| "FIELD_INVALID")?;
        Ok(&states[if revision == 0 { states.len() } else { revision } - 1])
    }
}

/// Whether the event `seq` of a state can be retracted: an appended one that counts.
fn is_evidence(bytes: &[u8], seq: u8) -> bool {
    let appended = (2..=bytes.len()).contains(&usize::from(seq));
    appended && !matches!(bytes[usize::from(seq) - 1], LEFT_OUT | RETRACTION)
}

/// The sessions under test, over a database that all sequences share; each has ids of its own in it.
struct World {
    runtime: Runtime,
    folder: TempDir,
    sessions: Arc<Sessions<Toy>>,
    sequence: usize,
}

impl World {
    fn new() -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let sessions = runtime.block_on(open(&folder));
        Self { runtime, folder, sessions, sequence: 0 }
    }

    fn id(&self, session: u8) -> String {
        format!("toy-{}-{session}", self.sequence)
    }

    fn key(&self, (kind, session, body): Digest, request: u8) -> RequestKey {
        let id = if request == NO_ID { String::new() } else { format!("{}-{request}", self.sequence) };
        RequestKey { id, digest: vec![kind as u8, session, body] }
    }

    fn create(&self, session: u8, request: u8, body: u8) -> Outcome {
        let create = Arc::new(move |id: &str, created_us| {
            let toy = Toy { id: id.to_owned(), created_us, bytes: Vec::new() }.with(body);
            Ok(Created {
                event: ("toy", [id.as_bytes(), &[body]].concat()),
                computed: toy.computed(),
                experiment: String::new(),
                labels: BTreeMap::new(),
            })
        });
        let request = self.key(('c', session, body), request);
        let creation =
            Creation { session_id: self.id(session), request, actor: String::new(), owner: None, create };
        outcome(self.runtime.block_on(self.sessions.create(creation)))
    }

    fn append(&self, session: u8, request: u8, body: u8, expected_revision: Option<i64>) -> Change<Toy> {
        let compute = Arc::new(move |before: &Toy| match body {
            REFUSED => Err(Error::NoVisualPrior),
            ANSWERED => Ok(Decision::Answer(before.bytes.clone())),
            _ => Ok(Decision::Append(("toy", vec![body]), before.clone().with(body).computed())),
        });
        let request = self.key(('a', session, body), request);
        let (session_id, actor) = (self.id(session), String::new());
        Change { session_id, request, expected_revision, actor, work: Work::Edit, compute }
    }

    fn retract(&self, session: u8, request: u8, seq: u8) -> Change<Toy> {
        let compute = Arc::new(move |before: &Toy| {
            if !is_evidence(&before.bytes, seq) {
                return Err(Error::field("seq", "is no evidence"));
            }
            let compute =
                move |without: &Toy| ((RETRACTED, vec![seq]), without.clone().with(RETRACTION).computed());
            Ok(Decision::Retract(i64::from(seq), Box::new(compute)))
        });
        let request = self.key(('r', session, seq), request);
        Change {
            session_id: self.id(session),
            request,
            expected_revision: None,
            actor: String::new(),
            work: Work::Edit,
            compute,
        }
    }

    fn delete(&self, session: u8, request: u8, body: u8, guard: Guard) -> Result<(), &'static str> {
        let (id, request) = (self.id(session), self.key(('d', session, body), request));
        self.runtime.block_on(async {
            let wanted_etag = match guard {
                Guard::None => String::new(),
                Guard::Stale => "stale".to_owned(),
                Guard::Right => {
                    let row = self.sessions.store.session(&id).await.unwrap();
                    row.map_or_else(String::new, |row| etag(row.created_us, row.head))
                }
            };
            let deleted = self.sessions.delete(id, wanted_etag, request, soon()).await;
            deleted.map_err(|refusal| refusal.reason())
        })
    }

    /// Runs `op` on both, and says where they part.
    fn check(&mut self, model: &mut Model, op: &Op) -> Result<(), TestCaseError> {
        match *op {
            Op::Create { session, request, body } => {
                prop_assert_eq!(self.create(session, request, body), model.create(session, request, body));
            }
            Op::Append { session, request, body, guard } => {
                let head = model.sessions.get(&session).map_or(0, |bytes| bytes.len() as i64);
                let expected = match guard {
                    Guard::None => None,
                    Guard::Right => Some(head),
                    Guard::Stale => Some(head - 1),
                };
                let change = self.append(session, request, body, expected);
                let outcome = outcome(self.runtime.block_on(self.sessions.change(change, soon())));
                prop_assert_eq!(outcome, model.append(session, request, body, guard));
            }
            Op::AppendTwice { session, request, body } => {
                let [one, other] = [(); 2].map(|()| self.append(session, request, body, None));
                let both = async {
                    tokio::join!(self.sessions.change(one, soon()), self.sessions.change(other, soon()))
                };
                let (one, other) = self.runtime.block_on(both);
                let mut outcomes = [outcome(one), outcome(other)];
                let mut expected = [(); 2].map(|()| model.append(session, request, body, Guard::None));
                outcomes.sort();
                expected.sort();
                prop_assert_eq!(outcomes, expected);
            }
            Op::Retract { session, request, seq } => {
                let change = self.retract(session, request, seq);
                let outcome = outcome(self.runtime.block_on(self.sessions.change(change, soon())));
                prop_assert_eq!(outcome, model.retract(session, request, seq));
            }
            Op::Delete { session, request, body, guard } => {
                let deleted = self.delete(session, request, body, guard);
                prop_assert_eq!(deleted, model.delete(session, request, body, guard));
            }
            Op::Read { session, back } => {
                let head = model.sessions.get(&session).map_or(0, |bytes| bytes.len() as i64);
                let id = self.id(session);
                let read = self.runtime.block_on(self.sessions.at_revision(
                    &id,
                    head - back,
                    Queue::READERS,
                    soon(),
                ));
                let read = read.as_ref().map(|toy| toy.bytes.as_slice()).map_err(Error::reason);
                prop_assert_eq!(read, model.read(session, back));
            }
            Op::Crash => self.sessions = self.runtime.block_on(open(&self.folder)),
        }
        Ok(())
    }
}

async fn open(folder: &TempDir) -> Arc<Sessions<Toy>> {
    let limits = Limits { live_sessions: 2, past_states: 2, ..Limits::default() };
    let store = Store::open_beside(&folder.path().join("log.db"), &limits).await.unwrap();
    let pool = Pool::new(2, &limits, store.metrics.clone());
    Arc::new(Sessions::new(store, pool, FOLDING, Arc::new(limits), CancellationToken::new()))
}

fn outcome(reply: Result<Reply, Error>) -> Outcome {
    reply.map(|Reply { bytes, duplicate }| (bytes, duplicate)).map_err(|refusal| refusal.reason())
}

fn soon() -> Instant {
    Instant::now() + Duration::from_secs(60)
}

#[test]
fn any_sequence_of_operations_ends_as_the_model_says() {
    /// Each with a database of its own: they mostly wait for the disk.
    const THREADS: u64 = 4;
    const SEQUENCES_EACH: u32 = 500;
    let given = std::env::var("PALPATE_TEST_SEED").ok().and_then(|seed| seed.parse().ok());
    let seed: u64 = given.unwrap_or_else(|| now_us() as u64);
    let run = move |thread: u64| {
        let rng_seed = RngSeed::Fixed(seed + thread);
        let config =
            Config { cases: SEQUENCES_EACH, rng_seed, failure_persistence: None, ..Config::default() };
        let world = RefCell::new(World::new());
        TestRunner::new(config).run(&proptest::collection::vec(ops(), 8..24), |ops| {
            let (mut world, mut model) = (world.borrow_mut(), Model::default());
            world.sequence += 1;
            ops.iter().flatten().try_for_each(|op| world.check(&mut model, op))
        })
    };
    let outcomes = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|thread| scope.spawn(move || run(thread))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect::<Vec<_>>()
    });
    let failures: Vec<String> =
        outcomes.into_iter().filter_map(Result::err).map(|failure| failure.to_string()).collect();
    assert!(failures.is_empty(), "PALPATE_TEST_SEED={seed} runs this again: {}", failures.join("\n"));
}

/// How far a fold towards the event `end` comes at once.
async fn jumped_to(sessions: &Sessions<Toy>, id: &str, end: i64) -> (i64, Option<Vec<u8>>) {
    let row = sessions.store.session(id).await.unwrap().unwrap();
    let retractions = sessions.retractions(id, end).await.unwrap();
    let task = replay::Task { row: &row, retractions: &retractions, queue: Queue::READERS, deadline: soon() };
    let start = replay::Folded { state: None, head: Head::empty(id), damage: None };
    let jumped = sessions.jumped(task, start, end).await.unwrap();
    (jumped.revision(), jumped.state.map(|toy| toy.bytes.clone()))
}

#[test]
fn a_fold_goes_on_from_the_latest_checkpoint_and_from_none_that_is_not_of_the_log() {
    let mut world = World::new();
    world.create(0, NO_ID, 1).unwrap();
    for body in [0, 1, 2, 0, 1, 2, 0, 1, 2] {
        let change = world.append(0, NO_ID, body, None);
        world.runtime.block_on(world.sessions.change(change, soon())).unwrap();
    }
    let id = world.id(0);
    world.sessions = world.runtime.block_on(open(&world.folder));
    let World { runtime, sessions, .. } = &world;
    let jumped = |end| runtime.block_on(jumped_to(sessions, &id, end));
    // Every other state has a checkpoint.
    assert_eq!(jumped(8), (7, Some(vec![1, 0, 1, 2, 0, 1, 2])));
    assert_eq!(jumped(10).0, 9);
    assert_eq!(jumped(2), (1, Some(vec![1])));
    // One of another log: the right length, and another state.
    let state = runtime.block_on(sessions.newest(&id, soon())).unwrap();
    let wrong = Toy { bytes: vec![0; 9], ..(*state).clone() };
    let checkpoint = Some(wrong.bytes.clone());
    let kept = crate::store::Kept { seq: 9, state_hash: wrong.state_hash(), checkpoint, shown: None };
    sessions.store.checkpoints.keep(wrong.identity(), kept);
    assert_eq!(jumped(10), (0, None));
    assert_eq!(jumped(10), (0, None), "none of them is believed any more");
    let read = runtime.block_on(sessions.at_revision(&id, 9, Queue::READERS, soon())).unwrap();
    assert_eq!(read.bytes, [1, 0, 1, 2, 0, 1, 2, 0, 1]);
}
