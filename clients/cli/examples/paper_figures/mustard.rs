//! How the error of the mustard bottle falls: the mean over executions as a line, their spread as a band.

use std::path::Path;

use palpate_core::config::Strategy;
use palpate_core::reconstruction::Reconstruction;
use palpate_simulator::objects::{self, Object, Problem};
use palpate_simulator::parallel::in_parallel;
use plotters::backend::SVGBackend;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{DashedPathElement, PathElement, Polygon, Rectangle, Text};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{BLACK, Color, FontDesc, IntoFont, RGBColor, ShapeStyle, TextStyle, WHITE};

use super::work::Work;
use super::{Args, exploration};

const OBJECT: &str = "mustard_bottle";
const ATTEMPTS: u32 = 50;

/// Both strategies of the paper, with what Table I says of them: chamfer distance after all attempts, in mm.
const STRATEGIES: [Compared; 2] = [
    Compared {
        strategy: Strategy::Proactive,
        name: "proactive",
        published: "OURS",
        published_mm: 2.62,
        colour: RGBColor(0, 114, 178),
    },
    Compared {
        strategy: Strategy::MinUncertainty,
        name: "min_uncertainty",
        published: "minU",
        published_mm: 3.18,
        colour: RGBColor(213, 94, 0),
    },
];
const GREY: RGBColor = RGBColor(90, 90, 90);

const BAND_OPACITY: f64 = 0.13;
const EDGE_OPACITY: f64 = 0.4;

const CHART_PX: (u32, u32) = (620, 420);
const LEGEND_PX: u32 = 340;
const ROW_PX: i32 = 24;
const SWATCH_PX: i32 = 34;
/// Lengths of dash and gap, in pixels.
const DASHED: (i32, i32) = (7, 5);
const DOTTED: (i32, i32) = (2, 4);
const UNBROKEN: (i32, i32) = (SWATCH_PX, 0);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// A strategy beside its published result.
struct Compared {
    strategy: Strategy,
    name: &'static str,
    /// What the paper calls it.
    published: &'static str,
    /// Chamfer distance, in mm.
    published_mm: f64,
    colour: RGBColor,
}

/// Mean and sample standard deviation over executions after an attempt, in mm.
#[derive(Clone, Copy)]
struct Spread {
    mean_mm: f64,
    /// None of a single execution.
    deviation_mm: Option<f64>,
}

impl Spread {
    fn of(values_mm: &[f64]) -> Self {
        let count = values_mm.len() as f64;
        let mean_mm = values_mm.iter().sum::<f64>() / count;
        let squares: f64 = values_mm.iter().map(|value| (value - mean_mm).powi(2)).sum();
        let deviation_mm = (values_mm.len() > 1).then(|| (squares / (count - 1.0)).sqrt());
        Self { mean_mm, deviation_mm }
    }

    fn ends_mm(&self) -> [f64; 2] {
        let deviation_mm = self.deviation_mm.unwrap_or(0.0);
        [(self.mean_mm - deviation_mm).max(0.0), self.mean_mm + deviation_mm]
    }
}

/// A strategy's course, from the look to the last attempt.
struct Curve {
    compared: &'static Compared,
    spreads: Vec<Spread>,
}

/// A level that the curves are compared with.
struct Level {
    name: String,
    at_mm: f64,
    colour: RGBColor,
    pattern: (i32, i32),
}

/// The figure before its runs are made.
pub(crate) struct Figure {
    object: Object,
    seeds: u64,
    patch_share: f64,
}

impl Figure {
    pub(crate) fn load(args: &Args) -> Result<Self, Problem> {
        let mut objects = objects::load(Some(&args.meshes), &[OBJECT.to_owned()])
            .map_err(|error| format!("{OBJECT} is needed in the --meshes folder: {error}"))?;
        let object = objects.pop().ok_or("no mustard bottle")?;
        Ok(Self { object, seeds: args.seeds, patch_share: args.patch })
    }

    /// How many there are to make.
    pub(crate) fn attempts(&self) -> u64 {
        STRATEGIES.len() as u64 * self.seeds * u64::from(ATTEMPTS)
    }

    /// Makes the runs and draws them.
    pub(crate) fn write(&self, path: &Path, work: &Work) -> Result<(), Problem> {
        let curves = self.curves(work)?;
        let levels = self.levels()?;
        let page = SVGBackend::new(path, (CHART_PX.0 + LEGEND_PX, CHART_PX.1)).into_drawing_area();
        page.fill(&WHITE)?;
        let page = page.titled(&self.title(), ("sans-serif", 18))?;
        let (chart, legend) = page.split_horizontally(CHART_PX.0);
        draw_chart(&chart, &curves, &levels)?;
        draw_legend(&legend, &curves, &levels)?;
        page.present()?;
        work.say(path.display());
        Ok(())
    }

    fn title(&self) -> String {
        let executions = match self.seeds {
            1 => "one execution".to_owned(),
            seeds => format!("mean of {seeds} executions; shaded: ± standard deviation"),
        };
        format!("mustard bottle, METHOD_PAPER, {:.0} % seen: {executions}", 1e2 * self.patch_share)
    }

    fn curves(&self, work: &Work) -> Result<Vec<Curve>, Problem> {
        let runs: Vec<_> = STRATEGIES
            .iter()
            .flat_map(|compared| (1..=self.seeds).map(move |seed| (compared, seed)))
            .collect();
        let threads = std::thread::available_parallelism()?;
        let courses = in_parallel(&runs, threads, |&(compared, seed)| self.course_mm(compared, seed, work))
            .into_iter()
            .collect::<Result<Vec<_>, _>>()?;
        let of_strategy = courses.chunks(self.seeds as usize);
        Ok(STRATEGIES.iter().zip(of_strategy).map(|(compared, courses)| curve(compared, courses)).collect())
    }

    /// Chamfer distance after the look and after each attempt, in mm.
    fn course_mm(&self, compared: &Compared, seed: u64, work: &Work) -> Result<Vec<f64>, Problem> {
        let Compared { strategy, name, .. } = compared;
        let exploration = exploration(&self.object.body, seed, *strategy, ATTEMPTS, self.patch_share);
        let states = work.explore(format_args!("{OBJECT}, {name}, seed {seed}"), &exploration)?;
        let mut course: Vec<f64> = Vec::new();
        for (attempt, state) in states.iter().enumerate() {
            // A failed attempt leaves the estimate as it was.
            let is_same = attempt > 0 && state.has_surface_of(&states[attempt - 1]);
            course.push(if is_same { course[attempt - 1] } else { self.chamfer_mm(state)? });
        }
        course.resize(ATTEMPTS as usize + 1, course[course.len() - 1]);
        Ok(course)
    }

    fn chamfer_mm(&self, state: &Reconstruction) -> Result<f64, Problem> {
        let mesh = state.surface().ok_or("nothing was seen")?.mesh;
        Ok(1e3 * self.object.reference.chamfer(&mesh)?.sum_m)
    }

    /// What the paper published, and what a perfect estimate would score.
    fn levels(&self) -> Result<Vec<Level>, Problem> {
        let published = |compared: &Compared| Level {
            name: format!(
                "published, {} ({}): {:.2}",
                compared.name, compared.published, compared.published_mm
            ),
            at_mm: compared.published_mm,
            colour: compared.colour,
            pattern: DASHED,
        };
        let mut levels: Vec<_> = STRATEGIES.iter().map(published).collect();
        let floor_mm = 1e3 * self.object.reference.chamfer_floor()?.sum_m;
        let name = format!("sampling floor: {floor_mm:.2}");
        levels.push(Level { name, at_mm: floor_mm, colour: GREY, pattern: DOTTED });
        Ok(levels)
    }
}

fn curve(compared: &'static Compared, courses_mm: &[Vec<f64>]) -> Curve {
    let after = |attempt: usize| courses_mm.iter().map(|course| course[attempt]).collect::<Vec<_>>();
    Curve { compared, spreads: (0..=ATTEMPTS as usize).map(|attempt| Spread::of(&after(attempt))).collect() }
}

fn draw_chart(area: &Area<'_>, curves: &[Curve], levels: &[Level]) -> Result<(), Problem> {
    let highest = curves.iter().flat_map(|curve| &curve.spreads).map(|spread| spread.ends_mm()[1]);
    let top_mm = 1.05 * highest.chain(levels.iter().map(|level| level.at_mm)).fold(0.0, f64::max);
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(50)
        .build_cartesian_2d(0.0..f64::from(ATTEMPTS), 0.0..top_mm)?;
    chart
        .configure_mesh()
        .bold_line_style(BLACK.mix(0.1))
        .light_line_style(WHITE)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 15))
        .x_desc("attempts")
        .y_desc("chamfer distance, mm")
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{}", (10.0 * y).round() / 10.0))
        .draw()?;
    curves.iter().try_for_each(|curve| draw_band(&mut chart, curve))?;
    levels.iter().try_for_each(|level| draw_level(&mut chart, level))?;
    curves.iter().try_for_each(|curve| draw_line(&mut chart, curve))
}

fn draw_band(chart: &mut Chart<'_>, curve: &Curve) -> Result<(), Problem> {
    let points = |end: usize| {
        curve.spreads.iter().enumerate().map(move |(attempt, spread)| (attempt as f64, spread.ends_mm()[end]))
    };
    let band: Vec<_> = points(1).chain(points(0).rev()).collect();
    let colour = curve.compared.colour;
    chart.draw_series([Polygon::new(band, colour.mix(BAND_OPACITY))])?;
    // Edges tell bands apart where they cover each other.
    chart.draw_series(
        [0, 1].map(|end| PathElement::new(points(end).collect::<Vec<_>>(), colour.mix(EDGE_OPACITY))),
    )?;
    Ok(())
}

fn draw_line(chart: &mut Chart<'_>, curve: &Curve) -> Result<(), Problem> {
    let means = curve.spreads.iter().enumerate().map(|(attempt, spread)| (attempt as f64, spread.mean_mm));
    chart.draw_series(LineSeries::new(means, curve.compared.colour.stroke_width(2)))?;
    Ok(())
}

fn draw_level(chart: &mut Chart<'_>, level: &Level) -> Result<(), Problem> {
    let ends = [0.0, f64::from(ATTEMPTS)].map(|attempt| (attempt, level.at_mm));
    let (dash, gap) = level.pattern;
    chart.draw_series(DashedLineSeries::new(ends, dash, gap, level.colour.stroke_width(2)))?;
    Ok(())
}

/// Names what is drawn in an area of its own, where it hides nothing, with what comes of it.
fn draw_legend(area: &Area<'_>, curves: &[Curve], levels: &[Level]) -> Result<(), Problem> {
    area.draw(&Text::new(format!("after {ATTEMPTS} attempts, mm:"), (0, ROW_PX), text_style()))?;
    let mut y = 2 * ROW_PX;
    for curve in curves {
        draw_curve_entry(area, y, curve)?;
        y += ROW_PX;
    }
    for Level { name, colour, pattern, .. } in levels {
        draw_entry(area, y, name, colour.stroke_width(2), *pattern)?;
        y += ROW_PX;
    }
    Ok(())
}

/// A curve's name and its last error, before its band where it has one.
fn draw_curve_entry(area: &Area<'_>, y: i32, Curve { compared, spreads }: &Curve) -> Result<(), Problem> {
    let Compared { name, colour, .. } = compared;
    let Spread { mean_mm, deviation_mm } = spreads[spreads.len() - 1];
    let mut text = format!("{name}: {mean_mm:.2}");
    if let Some(deviation_mm) = deviation_mm {
        text.push_str(&format!(" ± {deviation_mm:.2}"));
        let band = [(0, y - 8), (SWATCH_PX, y + 8)];
        area.draw(&Rectangle::new(band, colour.mix(BAND_OPACITY).filled()))?;
    }
    draw_entry(area, y, &text, colour.stroke_width(2), UNBROKEN)
}

fn draw_entry(
    area: &Area<'_>,
    y: i32,
    name: &str,
    style: ShapeStyle,
    pattern: (i32, i32),
) -> Result<(), Problem> {
    let line = [(0, y), (SWATCH_PX, y)];
    area.draw(&DashedPathElement::new(line, pattern.0, pattern.1, style))?;
    area.draw(&Text::new(name.to_owned(), (SWATCH_PX + 8, y), text_style()))?;
    Ok(())
}

fn text_style() -> TextStyle<'static> {
    let font: FontDesc<'static> = ("sans-serif", 14).into_font();
    font.color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center))
}
