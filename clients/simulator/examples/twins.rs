//! Whether an exploration and its rotated twin stay together.
//!
//! An object is explored; all that the method was told is rotated about the session's origin and told
//! to a second session. Where the two propose places that are not each other's rotated image, they
//! have parted: a choice hung on rounding.
//!
//! ```bash
//! cargo run --release --locked -p palpate-simulator --example twins -- --meshes ../shared/meshes
//! ```

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use nalgebra::{Rotation3, UnitQuaternion};
use palpate_core::evidence::{
    Attempt, Contact, ContactDetail, Evidence, Outcome, Sweep, Target, VisualPrior,
};
use palpate_core::exploration::ProposalRequest;
use palpate_core::geometry::{Point, Pose, SurfaceIndex, Vector};
use palpate_core::reconstruction::Reconstruction;
use palpate_simulator::in_process::Exploration;
use palpate_simulator::objects::{self, Object, Problem};
use palpate_simulator::parallel::in_parallel;

/// Candidates of twins further apart than this are different ones, in metres.
const PARTED_M: f64 = 1e-4;

/// Measure how often an exploration and its rotated twin part.
#[derive(Debug, Parser)]
#[command(name = "twins")]
struct Args {
    /// Folder of closed meshes (.ply, .stl, .obj) in metres; generated objects without it.
    #[arg(long)]
    meshes: Option<PathBuf>,
    /// Names of objects, comma separated; all without it.
    #[arg(long, value_delimiter = ',')]
    objects: Vec<String>,
    /// Attempts of each exploration.
    #[arg(long, default_value_t = 30)]
    attempts: u32,
    /// Seed of each exploration.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Round the twin's cloud to single precision, as on the wire.
    #[arg(long)]
    single: bool,
}

/// What became of one pair.
struct Pair {
    object: String,
    rotation: &'static str,
    /// The attempt before which they proposed different places, if they did.
    parted: Option<usize>,
    /// How far their surfaces lie apart at most after 15 attempts and at the end, in millimetres.
    apart_mm: [f64; 2],
}

fn rotations() -> [(&'static str, Rotation3<f64>); 5] {
    let quarter = |columns: [[f64; 3]; 3]| Rotation3::from_basis_unchecked(&columns.map(Vector::from));
    [
        ("a quarter turn about x", quarter([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])),
        ("a quarter turn about y", quarter([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])),
        ("a quarter turn about z", quarter([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])),
        ("0.7 rad about (1, 2, 3)", Rotation3::new(Vector::new(1.0, 2.0, 3.0).normalize() * 0.7)),
        ("2.3 rad about (-2, 1, 1)", Rotation3::new(Vector::new(-2.0, 1.0, 1.0).normalize() * 2.3)),
    ]
}

fn main() -> ExitCode {
    match measure(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure(args: &Args) -> Result<(), Problem> {
    let objects = objects::load(args.meshes.as_deref(), &args.objects)?;
    let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let pairs = in_parallel(&objects, threads, |object| pairs_of(object, args));
    let pairs = pairs.into_iter().collect::<Result<Vec<_>, _>>()?;
    let pairs: Vec<Pair> = pairs.into_iter().flatten().collect();
    println!(
        "| object | rotation | parted before attempt | apart after 15 attempts, mm | after {}, mm |",
        args.attempts
    );
    println!("|---|---|---|---|---|");
    for Pair { object, rotation, parted, apart_mm: [early, late] } in &pairs {
        let parted = parted.map_or("never".to_owned(), |attempt| attempt.to_string());
        println!("| {object} | {rotation} | {parted} | {early:.4} | {late:.4} |");
    }
    let count = pairs.iter().filter(|pair| pair.parted.is_some()).count();
    println!("\n{count} of {} pairs parted.", pairs.len());
    Ok(())
}

/// One exploration with all its twins.
fn pairs_of(object: &Object, args: &Args) -> Result<Vec<Pair>, Problem> {
    let exploration = Exploration { attempts: args.attempts, ..Exploration::new(&object.body, args.seed) };
    let mut log = vec![exploration.view()?];
    let (mut candidates, mut states) = (Vec::new(), Vec::new());
    exploration.run(|step| {
        candidates.push(step.candidate.point);
        log.push(step.evidence.clone());
        states.push(step.state.clone());
    })?;
    let mut pairs = Vec::new();
    for (rotation, matrix) in rotations() {
        let motion = Pose::from_parts(Vector::zeros().into(), UnitQuaternion::from(matrix));
        let config = states[0].config().clone();
        let mut twin = Reconstruction::new(config);
        let (mut parted, mut apart_mm) = (None, [0.0; 2]);
        for (number, evidence) in log.iter().enumerate() {
            twin = twin.absorb(&rotated(evidence, &matrix, &motion, args.single)?)?.0;
            if number > 0 {
                let state = &states[number - 1];
                if number == 15 {
                    apart_mm[0] = 1e3 * apart_m(state, &twin, &matrix)?;
                }
                apart_mm[1] =
                    if number + 1 == log.len() { 1e3 * apart_m(state, &twin, &matrix)? } else { 0.0 };
            }
            if parted.is_none()
                && let Some(wanted) = candidates.get(number)
            {
                let proposed = twin.propose(&ProposalRequest::best(1));
                let off = |point: &Point| (point - matrix * wanted).norm();
                if proposed.candidates.first().is_none_or(|c| off(&c.point) > PARTED_M) {
                    parted = Some(number + 1);
                }
            }
        }
        pairs.push(Pair { object: object.name.clone(), rotation, parted, apart_mm });
    }
    Ok(pairs)
}

/// The farthest that a vertex lies from the surface of its rotated twin, in metres.
fn apart_m(state: &Reconstruction, twin: &Reconstruction, matrix: &Rotation3<f64>) -> Result<f64, Problem> {
    let (surface, twin) = (state.surface().ok_or("no surface")?, twin.surface().ok_or("no surface")?);
    let index = SurfaceIndex::new(&twin.mesh).ok_or("no faces")?;
    Ok(surface.mesh.vertices.iter().map(|v| index.closest(&(matrix * v)).distance_m).fold(0.0, f64::max))
}

/// The same evidence in a rotated scene. Points are rotated by the matrix: a quarter turn is exact.
fn rotated(
    evidence: &Evidence,
    matrix: &Rotation3<f64>,
    motion: &Pose,
    single: bool,
) -> Result<Evidence, Problem> {
    let point = |p: &Point| matrix * p;
    let narrow = |p: Point| if single { p.map(|x| f64::from(x as f32)) } else { p };
    let pose = |pose: &Pose| {
        let position = matrix * pose.translation.vector;
        Pose::from_parts(position.into(), motion.rotation * pose.rotation)
    };
    let attempt = match evidence {
        Evidence::VisualPrior(prior) => {
            let points = prior.points().iter().map(|p| narrow(point(p))).collect();
            let viewpoint = prior.viewpoint().map(point);
            return Ok(Evidence::VisualPrior(VisualPrior::new(points, prior.uncertainty(), viewpoint)?));
        }
        Evidence::Attempt(attempt) => attempt,
        Evidence::Moved(_) => return Ok(evidence.clone()),
    };
    let target = attempt.target.map(|t| Target::new(point(t.point()), matrix * t.normal().into_inner()));
    let touch = |contact: &Contact| {
        let detail = ContactDetail {
            uncertainty: contact.uncertainty(),
            swept_from: contact.swept_from().map(point),
            normal: contact.normal().map(|normal| matrix * normal.into_inner()),
            rest_wrench: None,
        };
        let centre = contact.point();
        let facing = UnitQuaternion::rotation_between(&Vector::z(), &contact.approach());
        let sensor = Pose::from_parts(centre.coords.into(), facing.unwrap_or_default());
        Contact::new(pose(&sensor), *contact.wrench(), *contact.pad(), detail)
    };
    let outcome = match &attempt.outcome {
        Outcome::Contact(contact) => Outcome::Contact(touch(contact)?),
        Outcome::Contacts { aimed, others } => {
            let others = others.iter().map(touch).collect::<Result<_, _>>()?;
            Outcome::Contacts { aimed: touch(aimed)?, others }
        }
        Outcome::NoContact(sweep) => {
            Outcome::NoContact(Sweep::new(point(sweep.from()), point(sweep.to()), sweep.radius_m())?)
        }
        Outcome::Rejected(reason) => Outcome::Rejected(*reason),
        Outcome::InvalidContact(sensor) => Outcome::InvalidContact(pose(sensor)),
    };
    Ok(Evidence::Attempt(Attempt { target: target.transpose()?, outcome }))
}
