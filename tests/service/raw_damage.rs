//! A database whose bytes were changed while no server ran: refused at the start, quarantined, or as it was.
//!
//! `PALPATE_TEST_DAMAGES=1000 cargo test -p palpate-tests --test service -- raw_damage --nocapture` damages as many
//! copies as that and prints the figures; `PALPATE_TEST_SEED` chooses the places.

use std::collections::BTreeMap;
use std::fmt;

use palpate_proto::v1;
use tempfile::TempDir;

use crate::harness::ball::{CENTRE, met, plausible};
use crate::harness::{Caller, Random, Server, creation, given, report, without_timing};

/// The newest revision of each session: the creation, a view, and contacts.
const HEAD: i64 = 6;
const NAMES: [&str; 3] = ["cup", "mug", "pot"];
const SECTOR_BYTES: usize = 512;
const PAGE_BYTES: usize = 4096;

/// What a server says of a session.
#[derive(Clone, Debug, PartialEq)]
struct Said {
    session: v1::Session,
    log: Vec<v1::Event>,
    /// The surface of each revision that has one.
    surfaces: BTreeMap<i64, v1::Mesh>,
}

fn config() -> Option<v1::SessionConfig> {
    let method = v1::Method::Paper.into();
    Some(v1::SessionConfig { method, icosphere_subdivisions: Some(2), ..Default::default() })
}

fn created(name: &str) -> v1::CreateSessionRequest {
    v1::CreateSessionRequest { config: config(), ..creation(name) }
}

async fn explored(caller: &Caller, name: &str) -> Vec<v1::ReportContactRequest> {
    caller.create(created(name)).await.unwrap();
    let mut next = caller.add_prior(crate::harness::prior(name)).await.unwrap().candidates.remove(0);
    let mut told = Vec::new();
    for number in 0..HEAD as usize - 2 {
        let request = report(name, met(&next, CENTRE, plausible(number)), &format!("touch-{number}"));
        next = caller.report(request.clone()).await.unwrap().candidates.remove(0);
        told.push(request);
    }
    told
}

async fn surface(caller: &Caller, name: &str, revision: i64) -> v1::Mesh {
    let session_id = name.into();
    caller.mesh(v1::GetMeshRequest { session_id, revision, ..Default::default() }).await.unwrap()
}

/// All that a server says of a session up to a revision.
async fn said(caller: &Caller, name: &str, revision: i64) -> Said {
    let session = without_timing(caller.get(name).await.unwrap());
    let request = v1::ListEventsRequest { session_id: name.into(), ..Default::default() };
    let log = if revision > 0 { caller.events(request).await.unwrap().events } else { Vec::new() };
    let mut surfaces = BTreeMap::new();
    for revision in 2..=revision {
        surfaces.insert(revision, surface(caller, name, revision).await);
    }
    Said { session, log, surfaces }
}

/// A kind of damage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Bits,
    Zeroes,
    Noise,
    AnotherPage,
    Cut,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bits => "one to eight bits",
            Self::Zeroes => "a sector of zeroes",
            Self::Noise => "a sector of noise",
            Self::AnotherPage => "a page in another's place",
            Self::Cut => "a file cut short",
        })
    }
}

const KINDS: [Kind; 5] = [Kind::Bits, Kind::Zeroes, Kind::Noise, Kind::AnotherPage, Kind::Cut];

fn damage(bytes: &mut Vec<u8>, kind: Kind, random: &mut Random) {
    let sector = random.below(bytes.len() / SECTOR_BYTES) * SECTOR_BYTES;
    match kind {
        Kind::Bits => {
            for _ in 0..=random.below(8) {
                let place = random.below(bytes.len());
                bytes[place] ^= 1 << random.below(8);
            }
        }
        Kind::Zeroes => bytes[sector..][..SECTOR_BYTES].fill(0),
        Kind::Noise => bytes[sector..][..SECTOR_BYTES].fill_with(|| random.below(256) as u8),
        Kind::AnotherPage => {
            let mut page = || random.below(bytes.len() / PAGE_BYTES) * PAGE_BYTES;
            let (from, to) = (page(), page());
            bytes.copy_within(from..from + PAGE_BYTES, to);
        }
        Kind::Cut => bytes.truncate(random.below(bytes.len())),
    }
}

/// What became of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Outcome {
    Refused,
    Quarantined,
    AsBefore,
}

/// What was prepared: the files of a server that has stopped, what it said, and the contacts that it was told.
struct Prepared {
    folder: TempDir,
    bytes: Vec<u8>,
    said: Vec<Said>,
    told: Vec<Vec<v1::ReportContactRequest>>,
}

impl Prepared {
    async fn new() -> Self {
        let server = Server::start().await;
        let caller = server.grpc();
        let (mut all, mut told) = (Vec::new(), Vec::new());
        for name in NAMES {
            told.push(explored(&caller, name).await);
            all.push(said(&caller, name, HEAD).await);
        }
        let folder = server.stop().await;
        let bytes = std::fs::read(folder.path().join("palpate.db")).unwrap();
        Self { folder, bytes, said: all, told }
    }

    /// A folder with a copy of the files, the database as given.
    fn copy(&self, bytes: &[u8]) -> TempDir {
        let copy = tempfile::tempdir().unwrap();
        for entry in std::fs::read_dir(self.folder.path()).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), copy.path().join(entry.file_name())).unwrap();
        }
        std::fs::write(copy.path().join("palpate.db"), bytes).unwrap();
        copy
    }

    async fn outcome(&self, bytes: &[u8], what: &str) -> Outcome {
        let server = match Server::over_folder(self.copy(bytes)).await {
            Ok(server) => server,
            Err(refusal) => {
                assert!(refusal.contains("database") || refusal.contains("SQLite"), "{what}: {refusal}");
                return Outcome::Refused;
            }
        };
        let caller = server.grpc();
        let listed = caller.list(v1::ListSessionsRequest::default()).await.unwrap().sessions;
        assert_eq!(listed.len(), NAMES.len(), "{what}: all are listed");
        let mut outcome = Outcome::AsBefore;
        for (number, name) in NAMES.into_iter().enumerate() {
            let before = &self.said[number];
            let session =
                caller.get(name).await.unwrap_or_else(|refused| panic!("{what}: {name}: {refused:?}"));
            if session.state() == v1::SessionState::Quarantined {
                outcome = Outcome::Quarantined;
                self.check_sound_part(&caller, name, before, what).await;
            } else {
                assert_eq!(&said(&caller, name, HEAD).await, before, "{what}: {name}");
                self.check_retries(&caller, number, what).await;
            }
        }
        server.stop().await;
        outcome
    }

    /// What is served of a damaged session is what was there.
    async fn check_sound_part(&self, caller: &Caller, name: &str, before: &Said, what: &str) {
        let session = caller.get(name).await.unwrap();
        let sound = session.quarantine.clone().unwrap().sound_revision;
        assert!((0..=HEAD).contains(&sound), "{what}: {name}: {session:?}");
        let now = said(caller, name, sound).await;
        assert_eq!(now.log, before.log[..sound as usize], "{what}: {name}");
        for (revision, mesh) in now.surfaces {
            assert_eq!(mesh, before.surfaces[&revision], "{what}: {name} at {revision}");
        }
    }

    /// Nothing is carried out twice.
    async fn check_retries(&self, caller: &Caller, number: usize, what: &str) {
        for request in &self.told[number] {
            let reply = caller.report(request.clone()).await.unwrap();
            assert!(reply.duplicate, "{what}: {}", request.request_id);
        }
    }
}

#[tokio::test]
async fn a_database_with_changed_bytes_is_refused_quarantined_or_as_it_was() {
    let (damages, seed) = (given("PALPATE_TEST_DAMAGES", 40), given("PALPATE_TEST_SEED", 1));
    let mut random = Random::new(seed);
    let prepared = Prepared::new().await;
    assert_eq!(prepared.outcome(&prepared.bytes, "no damage").await, Outcome::AsBefore);
    let mut outcomes: BTreeMap<(Kind, Outcome), usize> = BTreeMap::new();
    for number in 0..damages as usize {
        let kind = KINDS[number % KINDS.len()];
        let mut bytes = prepared.bytes.clone();
        damage(&mut bytes, kind, &mut random);
        let what = format!("seed {seed}, image {number}, {kind}");
        *outcomes.entry((kind, prepared.outcome(&bytes, &what).await)).or_default() += 1;
    }
    let count = |kind: Option<Kind>, outcome: Outcome| -> usize {
        let counted =
            outcomes.iter().filter(|((of, was), _)| kind.is_none_or(|kind| kind == *of) && *was == outcome);
        counted.map(|(_, count)| count).sum()
    };
    let line = |kind: Option<Kind>| {
        let [refused, quarantined, as_before] =
            [Outcome::Refused, Outcome::Quarantined, Outcome::AsBefore].map(|outcome| count(kind, outcome));
        format!("{refused} refused at the start, {quarantined} quarantined, {as_before} as before")
    };
    println!("seed {seed}: {damages} images of {} bytes: {}", prepared.bytes.len(), line(None));
    for kind in KINDS {
        println!("{kind}: {}", line(Some(kind)));
    }
    assert!(count(None, Outcome::Refused) > 0 && count(None, Outcome::Quarantined) > 0, "{outcomes:?}");
}
