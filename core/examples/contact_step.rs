//! What a contact step costs as a session grows: from a reported contact to the next candidate.
//!
//! ```bash
//! cargo run --release -p palpate-core --example contact_step -- palpate box 50,150,400
//! cargo run --release -p palpate-core --example contact_step -- paper box 300 --attractors
//! ```
//!
//! Prints a line for each of the last four steps up to each number of touches: the number, the costly extra
//! that the fit of METHOD_PALPATE did, and milliseconds, the least of nine runs of that
//! step. With `--attractors` it first prints them all, a line each: x, y and z in metres, uncertainty, and 1
//! for what was touched; `core/benches/contact_step.py` does the same step with them.

use std::error::Error;
use std::time::{Duration, Instant};

use nalgebra::UnitQuaternion;
use palpate_core::config::{Config, Method, Settings};
use palpate_core::evidence::attractor::Sense;
use palpate_core::evidence::{Attempt, Contact, ContactDetail, Evidence, Outcome, Pad, VisualPrior, Wrench};
use palpate_core::exploration::ProposalRequest;
use palpate_core::geometry::{Icosphere, Point, Pose, Vector};
use palpate_core::reconstruction::Reconstruction;
use palpate_core::schedule::Extras;

/// Points of the visual prior, on a patch towards the camera.
const SEEN: usize = 200;
/// Steps that are timed before each number of touches: one with each extra.
const TIMED: usize = 4;
const RUNS: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [method, body, touches, ..] = &args[..] else {
        return Err("usage: contact_step paper|palpate box|bottle TOUCHES[,TOUCHES...] [--attractors]".into());
    };
    let method = if method == "paper" { Method::Paper } else { Method::Palpate };
    let on_body = if body == "bottle" { bottle } else { box_like };
    let touches = touches.split(',').map(str::parse).collect::<Result<Vec<usize>, _>>()?;

    let mut directions = Icosphere::get(5).directions.clone();
    directions.sort_by(|a, b| b.x.total_cmp(&a.x));
    let seen = directions.iter().step_by(6).take(SEEN).map(|direction| on_body(direction)).collect();
    let hidden = &directions[6 * SEEN..];
    let mut state = Reconstruction::new(Config::new(Settings { method, ..Settings::default() })?);
    let prior = VisualPrior::new(seen, None, Some(Point::new(0.6, 0.1, 0.2)))?;
    state = state.absorb(&Evidence::VisualPrior(prior))?.0;
    let mut lines = Vec::new();
    for number in 1..=touches.iter().copied().max().unwrap_or(0) {
        let evidence = contact(&on_body(&hidden[(number - 1) * 7919 % hidden.len()]))?;
        let is_timed = touches.iter().any(|mark| number <= *mark && number + TIMED > *mark);
        let mut least = Duration::MAX;
        let mut next = None;
        for _ in 0..if is_timed { RUNS } else { 1 } {
            let start = Instant::now();
            let absorbed = state.absorb(&evidence)?.0;
            std::hint::black_box(absorbed.propose(&ProposalRequest::best(1)));
            least = least.min(start.elapsed());
            next = Some(absorbed);
        }
        state = next.ok_or("a step is run at least once")?;
        if is_timed {
            lines.push(format!("{number} {} {:.2}", extra(number + 1), 1e3 * least.as_secs_f64()));
        }
    }
    if args.iter().any(|arg| arg == "--attractors") {
        for attractor in state.attractors() {
            let Point { coords: p } = attractor.point;
            let touched = u8::from(attractor.sense == Sense::Touch);
            println!("{} {} {} {} {touched}", p.x, p.y, p.z, attractor.uncertainty);
        }
    }
    lines.iter().for_each(|line| println!("{line}"));
    Ok(())
}

/// The extra of a fit by its number.
fn extra(fit: usize) -> &'static str {
    match Extras::of_fit(fit) {
        Extras { starts: true, .. } => "starts",
        Extras { splits: true, .. } => "splits",
        Extras { readings: true, .. } => "noise and readings",
        _ => "symmetry",
    }
}

/// A box with round edges: one part is enough for it.
fn box_like(direction: &Vector) -> Point {
    let d = direction;
    let gauge = ((d.x / 0.03).powi(4) + (d.y / 0.045).powi(4) + (d.z / 0.08).powi(4)).powf(0.25);
    Point::from(d / gauge)
}

/// A body with a wide neck: more than one part is fitted to it.
fn bottle(direction: &Vector) -> Point {
    let across = direction.x.hypot(direction.y);
    let cylinder = |radius: f64, low: f64, high: f64| {
        let end = if direction.z > 0.0 { high } else { low };
        (radius / across).min(end / direction.z.abs())
    };
    let (body, neck) = (cylinder(0.035, 0.06, 0.02), cylinder(0.02, 0.06, 0.12));
    Point::from(direction * body.max(neck))
}

/// A touch after a free path of the default length, pointing at the middle of the body.
fn contact(point: &Point) -> Result<Evidence, Box<dyn Error>> {
    let outwards = point.coords.normalize();
    let facing = UnitQuaternion::face_towards(&-outwards, &Vector::new(0.1, 0.2, 0.3));
    let swept_from = Some(point + outwards * Settings::default().probe_half_travel_m);
    let detail = ContactDetail { uncertainty: Some(0.1), swept_from, ..ContactDetail::default() };
    let pose = Pose::from_parts((*point).into(), facing);
    let contact = Contact::new(pose, Wrench::default(), Pad::default(), detail)?;
    Ok(Evidence::Attempt(Attempt { target: None, outcome: Outcome::Contact(contact) }))
}
