//! How estimates come about: a row for each object, with the target and the estimate after some attempts.
//!
//! A drawing unit is a tenth of a pixel, so that whole numbers are exact enough.

use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::Path;

use palpate_core::config::Strategy;
use palpate_core::evidence::attractor::Sense;
use palpate_core::geometry::{Direction, Point, TriangleMesh, Vector};
use palpate_core::reconstruction::Reconstruction;
use palpate_simulator::body::Body;
use palpate_simulator::objects::{self, Object, Problem};
use palpate_simulator::parallel::in_parallel;

use super::drawing::{Eye, Ramp, Solid};
use super::work::Work;
use super::{Args, exploration};

/// The estimate is drawn after this many attempts.
const DRAWN_AFTER: [u32; 6] = [0, 1, 2, 5, 10, 30];
const SEED: u64 = 1;
/// 642 vertices in place of the 2562 of a session as it comes: the file stays small.
const SUBDIVISIONS: u32 = 3;

/// The eye stands this far to the left or right of the seen patch, wherever more touches are to be seen.
const ASIDE_DEG: [f64; 2] = [-70.0, 70.0];
const ELEVATION_DEG: f64 = 15.0;
/// What lies no further than this behind the true surface is on it, in metres.
const ON_SURFACE_M: f64 = 5e-4;

/// Green, yellow, red.
const RAMP: Ramp = Ramp(&[[60.0, 170.0, 75.0], [250.0, 215.0, 80.0], [214.0, 40.0, 40.0]]);
const VISUAL: Dot = Dot { colour: "#00d8f0", edge: "#075a68", width: 28, edge_width: 42 };
const TOUCH: Dot = Dot { colour: "#1238e0", edge: "#fff", width: 80, edge_width: 112 };

/// Width and height of a panel, in drawing units as all that follows.
const CELL: (i32, i32) = (1440, 2400);
/// On the left and right within a panel.
const MARGIN: i32 = 90;
/// Above and below within a panel; the number of touches is below.
const MARGIN_TALL: i32 = 230;
/// On the left of all panels: what the object is, and how large.
const NAME_WIDTH: i32 = 1300;
const HEAD: i32 = 320;
const LEGEND: i32 = 900;
const BAR_STEPS: i32 = 13;
const SCALE_BAR_M: f64 = 0.05;

/// How points of one sense are drawn; widths in drawing units.
struct Dot {
    colour: &'static str,
    edge: &'static str,
    width: i32,
    edge_width: i32,
}

impl Dot {
    /// One for each place.
    fn draw(&self, svg: &mut String, places: &[(i32, i32)]) -> std::fmt::Result {
        let mut path = String::new();
        for (x, y) in places {
            write!(path, "M{x} {y}h0")?;
        }
        for (colour, width) in [(self.edge, self.edge_width), (self.colour, self.width)] {
            writeln!(svg, "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>")?;
        }
        Ok(())
    }
}

/// An estimate with what it was made from.
struct Panel {
    mesh: TriangleMesh,
    /// Of each vertex, in [0, 1].
    uncertainty: Vec<f64>,
    visual_points: Vec<Point>,
    touches: Vec<Point>,
}

impl Panel {
    fn of(state: &Reconstruction) -> Result<Self, Problem> {
        let surface = state.surface().ok_or("nothing was seen")?;
        // The paper's method works in the session's frame, in which everything is drawn.
        let of_sense = |sense: Sense| {
            let attractors = state.attractors().into_iter();
            attractors.filter(|attractor| attractor.sense == sense).map(|attractor| attractor.point).collect()
        };
        Ok(Self {
            mesh: surface.mesh,
            uncertainty: surface.uncertainty,
            visual_points: of_sense(Sense::Vision),
            touches: of_sense(Sense::Touch),
        })
    }
}

/// An object with its estimates, and where they are looked at from.
struct Row<'a> {
    object: &'a Object,
    panels: Vec<Panel>,
    eye: Eye,
    units_a_metre: f64,
    /// Where the middle of all that is drawn lies from the session's origin, in drawing units.
    middle: (f64, f64),
}

impl<'a> Row<'a> {
    fn new(object: &'a Object, panels: Vec<Panel>) -> Self {
        let azimuth_deg = azimuth_deg(&object.body, &panels);
        let (low, high) = extent(&Eye::new(azimuth_deg, ELEVATION_DEG, 1.0), &object.body, &panels);
        let fit = |room: i32, low: f64, high: f64| f64::from(room) / (high - low);
        let units_a_metre =
            fit(CELL.0 - 2 * MARGIN, low.0, high.0).min(fit(CELL.1 - 2 * MARGIN_TALL, low.1, high.1));
        let middle = |low: f64, high: f64| 0.5 * units_a_metre * (low + high);
        Self {
            object,
            panels,
            eye: Eye::new(azimuth_deg, ELEVATION_DEG, units_a_metre),
            units_a_metre,
            middle: (middle(low.0, high.0), middle(low.1, high.1)),
        }
    }

    /// Draws the row's panels, the row itself being this far down.
    fn draw(&self, svg: &mut String, top: i32) -> std::fmt::Result {
        let target = Solid { mesh: self.object.body.mesh(), uncertainty: None, ramp: RAMP };
        target.draw(svg, &self.eye, self.origin(0, top))?;
        for (column, panel) in (1..).zip(&self.panels) {
            let origin = self.origin(column, top);
            let solid = Solid { mesh: &panel.mesh, uncertainty: Some(&panel.uncertainty), ramp: RAMP };
            solid.draw(svg, &self.eye, origin)?;
            VISUAL.draw(svg, &self.places(&panel.visual_points, origin))?;
            TOUCH.draw(svg, &self.places(&panel.touches, origin))?;
            draw_count(svg, panel, (centre(column), top + CELL.1 - MARGIN / 2))?;
        }
        self.draw_name(svg, top)
    }

    /// The object's name, and a bar to measure it with.
    fn draw_name(&self, svg: &mut String, top: i32) -> std::fmt::Result {
        let (middle, y) = (NAME_WIDTH / 2, top + CELL.1 / 2);
        let half = (0.5 * SCALE_BAR_M * self.units_a_metre).round() as i32;
        let (left, right) = (middle - half, middle + half);
        writeln!(svg, "<text x=\"{middle}\" y=\"{}\">{}</text>", y - 100, spaced(&self.object.name))?;
        let bar = format!("M{left} {0}v80m0 -40H{right}m0 -40v80", y + 110);
        writeln!(
            svg,
            "<path d=\"{bar}\" stroke=\"#222\" stroke-width=\"16\" stroke-linecap=\"butt\" fill=\"none\"/>"
        )?;
        let length_mm = 1e3 * SCALE_BAR_M;
        writeln!(svg, "<text x=\"{middle}\" y=\"{}\" font-size=\"130\">{length_mm:.0} mm</text>", y + 360)
    }

    /// Where the session's origin is drawn.
    fn origin(&self, column: i32, top: i32) -> (i32, i32) {
        let (right, down) = self.middle;
        (centre(column) - right.round() as i32, top + CELL.1 / 2 - down.round() as i32)
    }

    /// Where the points are drawn that the true object does not hide.
    fn places(&self, points: &[Point], origin: (i32, i32)) -> Vec<(i32, i32)> {
        let seen = points.iter().filter(|point| is_seen(&self.object.body, point, &self.eye));
        let place = |point: &Point| {
            let (right, down) = self.eye.place(point);
            (origin.0 + right.round() as i32, origin.1 + down.round() as i32)
        };
        seen.map(place).collect()
    }
}

/// How many touches there are, also behind the object: a failed attempt is none.
fn draw_count(svg: &mut String, panel: &Panel, (x, y): (i32, i32)) -> std::fmt::Result {
    let text = match panel.touches.len() {
        0 => "no touch".to_owned(),
        1 => "1 touch".to_owned(),
        more => format!("{more} touches"),
    };
    writeln!(svg, "<text x=\"{x}\" y=\"{y}\" font-size=\"120\" fill=\"#555\">{text}</text>")
}

/// The middle of a column of panels.
fn centre(column: i32) -> i32 {
    NAME_WIDTH + CELL.0 * column + CELL.0 / 2
}

fn spaced(name: &str) -> String {
    name.replace('_', " ")
}

/// Whether nothing of the object is between the point, which is on its surface, and the eye.
fn is_seen(body: &Body, point: &Point, eye: &Eye) -> bool {
    let far_m = 4.0 * body.radius_m();
    let sight = Direction::new_normalize(-eye.towards);
    body.surface().first_hit(&(point + far_m * eye.towards), &sight, far_m - ON_SURFACE_M).is_none()
}

/// From the side of the seen patch where more touches are to be seen, those counting more that came
/// early and are in more panels.
fn azimuth_deg(body: &Body, panels: &[Panel]) -> f64 {
    let seen = panels.iter().flat_map(|panel| &panel.visual_points);
    let patch = seen.fold(Vector::zeros(), |sum, point| sum + (point - body.centre()));
    let towards_patch_deg = patch.y.atan2(patch.x).to_degrees();
    let visible = |azimuth_deg: &f64| {
        let eye = Eye::new(*azimuth_deg, ELEVATION_DEG, 1.0);
        panels.iter().flat_map(|panel| &panel.touches).filter(|touch| is_seen(body, touch, &eye)).count()
    };
    let choices = ASIDE_DEG.map(|aside| towards_patch_deg + aside);
    choices.into_iter().max_by_key(visible).unwrap_or(towards_patch_deg)
}

/// The corners of the rectangle in which the target and all estimates are drawn.
fn extent(eye: &Eye, body: &Body, panels: &[Panel]) -> ((f64, f64), (f64, f64)) {
    let meshes = panels.iter().map(|panel| &panel.mesh).chain([body.mesh()]);
    let places = meshes.flat_map(|mesh| &mesh.vertices).map(|vertex| eye.place(vertex));
    let nothing = ((f64::INFINITY, f64::INFINITY), (f64::NEG_INFINITY, f64::NEG_INFINITY));
    places.fold(nothing, |(low, high), (x, y)| ((low.0.min(x), low.1.min(y)), (high.0.max(x), high.1.max(y))))
}

/// The figure before its runs are made.
pub(crate) struct Figure {
    objects: Vec<Object>,
    patch_share: f64,
}

impl Figure {
    pub(crate) fn load(args: &Args) -> Result<Self, Problem> {
        Ok(Self { objects: objects::load(Some(&args.meshes), &args.objects)?, patch_share: args.patch })
    }

    /// How many there are to make.
    pub(crate) fn attempts(&self) -> u64 {
        self.objects.len() as u64 * u64::from(last())
    }

    /// Makes the runs and draws them.
    pub(crate) fn write(&self, path: &Path, work: &Work) -> Result<(), Problem> {
        let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let panels = in_parallel(&self.objects, threads, |object| self.panels(object, work));
        let panels = panels.into_iter().collect::<Result<Vec<_>, _>>()?;
        let rows: Vec<_> =
            self.objects.iter().zip(panels).map(|(object, panels)| Row::new(object, panels)).collect();
        std::fs::write(path, draw(&rows)?)?;
        work.say(path.display());
        Ok(())
    }

    fn panels(&self, object: &Object, work: &Work) -> Result<Vec<Panel>, Problem> {
        let mut exploration = exploration(&object.body, SEED, Strategy::Proactive, last(), self.patch_share);
        exploration.settings.icosphere_subdivisions = SUBDIVISIONS;
        let states = work.explore(format_args!("{}, seed {SEED}", object.name), &exploration)?;
        let after = |attempts: u32| &states[(attempts as usize).min(states.len() - 1)];
        DRAWN_AFTER.iter().map(|&attempts| Panel::of(after(attempts))).collect()
    }
}

/// The attempts of a run.
fn last() -> u32 {
    DRAWN_AFTER[DRAWN_AFTER.len() - 1]
}

fn draw(rows: &[Row<'_>]) -> Result<String, std::fmt::Error> {
    let columns = 1 + DRAWN_AFTER.len() as i32;
    let below = HEAD + CELL.1 * rows.len() as i32;
    let (width, height) = (NAME_WIDTH + CELL.0 * columns, below + LEGEND);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{}\" height=\"{}\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <g font-family=\"sans-serif\" font-size=\"150\" text-anchor=\"middle\" fill=\"#222\" stroke-width=\"5\" \
         stroke-linejoin=\"round\" stroke-linecap=\"round\">\n",
        width / 10,
        height / 10
    );
    draw_head(&mut svg)?;
    for (place, row) in (0..).zip(rows) {
        row.draw(&mut svg, HEAD + CELL.1 * place)?;
    }
    draw_legend(&mut svg, width / 2, below)?;
    svg.push_str("</g>\n</svg>\n");
    Ok(svg)
}

fn draw_head(svg: &mut String) -> std::fmt::Result {
    let after = |attempts| match attempts {
        0 => "initial".to_owned(),
        1 => "1 attempt".to_owned(),
        more => format!("{more} attempts"),
    };
    let heads = std::iter::once("target".to_owned()).chain(DRAWN_AFTER.map(after));
    for (column, head) in (0..).zip(heads) {
        writeln!(svg, "<text x=\"{}\" y=\"{}\">{head}</text>", centre(column), HEAD - 40)?;
    }
    Ok(())
}

/// What the colours and the dots mean, about `middle`.
fn draw_legend(svg: &mut String, middle: i32, top: i32) -> std::fmt::Result {
    let (step, height, y) = (240, 170, top + 250);
    let left = middle - 2800;
    for place in 0..BAR_STEPS {
        let colour = RAMP.colour(Some(f64::from(place) / f64::from(BAR_STEPS - 1)), 1.0);
        let x = left + step * place;
        writeln!(svg, "<rect x=\"{x}\" y=\"{y}\" width=\"{step}\" height=\"{height}\" fill=\"{colour}\"/>")?;
    }
    let last = left + step * (BAR_STEPS - 1);
    for (x, number) in [(left, "0"), ((left + last) / 2, "0.5"), (last, "1")] {
        writeln!(svg, "<text x=\"{}\" y=\"{}\">{number}</text>", x + step / 2, y + height + 170)?;
    }
    let text_y = y + height / 2 + 50;
    writeln!(svg, "<text x=\"{}\" y=\"{text_y}\" text-anchor=\"end\">uncertainty</text>", left - 130)?;
    for (dot, x, name) in
        [(VISUAL, middle + 1100, "visual points"), (TOUCH, middle + 2600, "touches on this side")]
    {
        let beside = dot.edge_width * 3 / 4;
        dot.draw(
            svg,
            &[(x - beside, y + height / 4), (x, y + height * 3 / 4), (x + beside, y + height / 4)],
        )?;
        writeln!(svg, "<text x=\"{}\" y=\"{text_y}\" text-anchor=\"start\">{name}</text>", x + 220)?;
    }
    Ok(())
}
