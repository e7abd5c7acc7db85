//! What the methods stated against what was true: on the diagonal they know how good they are.

use std::path::Path;

use palpate_core::metrics::{RiskBin, StatedError, coverage, normal_coverage};
use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::drawing::IntoDrawingArea;
use plotters::element::{Circle, EmptyElement, PathElement, Polygon, Text};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{BLACK, Color, RGBColor, WHITE};

use super::super::reliability::{RISK_EDGES, Statements};
use super::{Area, COLOURS, Chart, Entry, GREY, MOST_BANDS, draw_legend, legend_height_px, small};
use crate::failure::Failure;

const SIZE_PX: (u32, u32) = (1080, 560);
/// The lines are drawn through the coverage at every so many standard deviations.
const STEP_SIGMAS: f64 = 0.05;
/// Every tenth of these steps is marked with a dot.
const STEPS_A_DOT: usize = 10;
/// Up to four standard deviations: there is nothing to see beyond.
const STEPS: usize = 80;
/// The height of a line of counts above the risks, as a share of the chart.
const COUNTS_HEIGHT: f64 = 0.045;
/// How far the risks of one series are drawn beside those of the next, as a share of the chart.
const ASIDE: f64 = 0.008;

/// Draws the stated deviations on the left and the stated risks on the right into an SVG file.
pub(in super::super) fn draw_reliability(statements: &[Statements], path: &Path) -> Result<(), Failure> {
    let entries: Vec<_> = statements
        .iter()
        .map(|statements| Entry {
            name: statements.name.clone(),
            style: colour_of(statements).stroke_width(2),
            is_dashed: false,
        })
        .collect();
    let below = legend_height_px(entries.len());
    let page = SVGBackend::new(path, (SIZE_PX.0, SIZE_PX.1 + below)).into_drawing_area();
    page.fill(&WHITE)?;
    let page =
        page.titled("stated uncertainty against the truth, all objects and seeds", ("sans-serif", 20))?;
    let (charts, legend) = page.split_vertically(page.dim_in_pixel().1 - below);
    let (left, right) = charts.split_horizontally(SIZE_PX.0 / 2);
    draw_deviations(&left, statements)?;
    draw_risks(&right, statements)?;
    draw_legend(&legend, &entries)?;
    page.present()?;
    Ok(())
}

fn colour_of(statements: &Statements) -> RGBColor {
    COLOURS[statements.series % COLOURS.len()]
}

/// Expected and found coverage at each step; `None` of no vertices.
fn coverages(errors: &[StatedError]) -> Option<Vec<(f64, f64)>> {
    let at = |step: usize| {
        let sigmas = step as f64 * STEP_SIGMAS;
        (normal_coverage(sigmas), coverage(errors, sigmas))
    };
    (!errors.is_empty()).then(|| (0..=STEPS).map(at).collect())
}

/// The mean curve over objects, and the area between the least and the greatest of them.
struct Band {
    mean: Vec<(f64, f64)>,
    outline: Vec<(f64, f64)>,
}

impl Band {
    fn of(statements: &Statements) -> Option<Self> {
        let objects: Vec<_> =
            statements.errors_by_object.iter().filter_map(|errors| coverages(errors)).collect();
        let expected: Vec<f64> = objects.first()?.iter().map(|&(expected, _)| expected).collect();
        let found = |step: usize| objects.iter().map(move |curve| curve[step].1);
        let points = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
            expected.iter().enumerate().map(|(step, &expected)| (expected, value(step))).collect()
        };
        let upper = points(&|step| found(step).fold(0.0, f64::max));
        let lower = points(&|step| found(step).fold(1.0, f64::min));
        Some(Self {
            mean: points(&|step| found(step).sum::<f64>() / objects.len() as f64),
            outline: upper.into_iter().chain(lower.into_iter().rev()).collect(),
        })
    }
}

fn draw_deviations(area: &Area<'_>, statements: &[Statements]) -> Result<(), Failure> {
    let axes = [
        "vertices expected within z stated deviations, if normal",
        "vertices found within z stated deviations",
    ];
    let is_shaded = statements.len() <= MOST_BANDS;
    let hint =
        if is_shaded { "above: too cautious; shaded: from object to object" } else { "above: too cautious" };
    let mut chart = square(area, hint, axes, |share| share, 1.0)?;
    for sigmas in [1.0, 2.0] {
        let at = normal_coverage(sigmas);
        chart.draw_series(DashedLineSeries::new([(at, 0.0), (at, 1.0)], 2, 3, GREY.stroke_width(1)))?;
        let label = Text::new(format!("z = {sigmas:.0}"), (-38, 0), small(GREY));
        chart.draw_series(std::iter::once(EmptyElement::at((at, 0.25)) + label))?;
    }
    let bands: Vec<_> =
        statements.iter().filter_map(|statements| Some((statements, Band::of(statements)?))).collect();
    for (statements, band) in bands.iter().filter(|_| is_shaded) {
        let shade = colour_of(statements).mix(0.12);
        chart.draw_series(std::iter::once(Polygon::new(band.outline.clone(), shade)))?;
    }
    for (statements, band) in &bands {
        let style = colour_of(statements).stroke_width(2);
        chart.draw_series(LineSeries::new(band.mean.iter().copied(), style))?;
        let dots = band.mean.iter().step_by(STEPS_A_DOT).skip(1);
        chart.draw_series(dots.map(|&at| Circle::new(at, 3, colour_of(statements).filled())))?;
    }
    Ok(())
}

/// Both axes show the square root of a share: small risks are told apart, and the diagonal stays one.
fn draw_risks(area: &Area<'_>, statements: &[Statements]) -> Result<(), Failure> {
    let axes = ["stated risk of failure (root scale)", "attempts that failed (root scale)"];
    let hint = "above: fails more often than stated; bars: 95 % confidence; on top: attempts";
    let top = 1.0 + COUNTS_HEIGHT * (statements.len() as f64 + 0.5);
    let mut chart = square(area, hint, axes, |root| root * root, top)?;
    let series = statements.len();
    for (line, statements) in statements.iter().enumerate() {
        // A little beside those of the others, as all state much the same.
        let aside = ASIDE * (line as f64 - 0.5 * (series - 1) as f64);
        let at = |bin: &RiskBin, share: f64| (bin.mean_risk.sqrt() + aside, share.sqrt());
        let bins = statements.risk_bins();
        let colour = colour_of(statements);
        let bar = |bin: &RiskBin| {
            PathElement::new(bin.failed_95.map(|share| at(bin, share)).to_vec(), colour.stroke_width(2))
        };
        chart.draw_series(bins.iter().map(bar))?;
        chart.draw_series(LineSeries::new(bins.iter().map(|bin| at(bin, bin.failed)), colour.mix(0.5)))?;
        chart.draw_series(bins.iter().map(|bin| Circle::new(at(bin, bin.failed), 4, colour.filled())))?;
        // A line of counts for each series, above the groups that they are of, so that none covers another.
        let y = 1.0 + COUNTS_HEIGHT * ((series - 1 - line) as f64 + 0.5);
        let middle = small(colour).pos(Pos::new(HPos::Center, VPos::Center));
        let count = |bin: &RiskBin| {
            let x = 0.5 * bin.range.map(f64::sqrt).iter().sum::<f64>();
            Text::new(bin.count.to_string(), (x, y), middle.clone())
        };
        chart.draw_series(bins.iter().map(count))?;
    }
    for edge in RISK_EDGES {
        let line = [(edge.sqrt(), 1.0), (edge.sqrt(), top)];
        chart.draw_series(LineSeries::new(line, BLACK.mix(0.2)))?;
    }
    Ok(())
}

/// Two equal axes with the diagonal between them, under a hint how to read them; `share_at` tells
/// the share at a place on an axis, and `top` where the upright one ends: above 1 there is room for more.
fn square<'a>(
    area: &Area<'a>,
    hint: &str,
    [x, y]: [&str; 2],
    share_at: fn(f64) -> f64,
    top: f64,
) -> Result<Chart<'a>, Failure> {
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .caption(hint, small(GREY))
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d(0.0..1.0, 0.0..top)?;
    let percent = |place: &f64| {
        if *place > 1.0 { String::new() } else { format!("{:.0} %", 100.0 * share_at(*place)) }
    };
    chart
        .configure_mesh()
        .bold_line_style(BLACK.mix(0.1))
        .light_line_style(WHITE)
        .x_desc(x)
        .y_desc(y)
        .x_label_formatter(&percent)
        .y_label_formatter(&percent)
        .draw()?;
    chart.draw_series(LineSeries::new([(0.0, 0.0), (1.0, 1.0)], BLACK.stroke_width(1)))?;
    Ok(chart)
}

#[cfg(test)]
mod tests {
    use palpate_core::metrics::StatedRisk;

    use super::*;

    fn errors(std_m: f64) -> Vec<StatedError> {
        (1..=100).map(|error| StatedError { std_m, error_m: 1e-5 * f64::from(error) }).collect()
    }

    #[test]
    fn the_band_reaches_from_the_least_object_to_the_greatest_and_the_line_runs_between() {
        let statements = Statements {
            name: "palpate, proactive".to_owned(),
            series: 0,
            errors_by_object: vec![errors(0.0005), errors(0.0002)],
            risks: Vec::new(),
            early_risks: Vec::new(),
        };
        let band = Band::of(&statements).unwrap();
        let one_sigma = 20;
        let (expected, found) = band.mean[one_sigma];
        assert!((expected - normal_coverage(1.0)).abs() < 1e-12);
        assert!((found - 0.35).abs() < 1e-12, "{found}");
        assert!((band.outline[one_sigma].1 - 0.5).abs() < 1e-12);
        let back = band.outline[band.outline.len() - 1 - one_sigma];
        assert!((back.0 - expected).abs() < 1e-12 && (back.1 - 0.2).abs() < 1e-12);
        assert!(Band::of(&Statements { errors_by_object: Vec::new(), ..statements }).is_none());
    }

    #[test]
    fn the_picture_has_a_band_a_method_and_a_bar_and_a_count_a_group_of_risks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("reliability.svg");
        let stated = |risk, failed| StatedRisk { risk, failed };
        let risks = [vec![stated(0.002, false); 41], vec![stated(0.2, true); 7]].concat();
        let statements = |series, name: &str| Statements {
            name: name.to_owned(),
            series,
            errors_by_object: vec![errors(0.0005), errors(0.0002)],
            risks: risks.clone(),
            early_risks: Vec::new(),
        };
        let all = [statements(0, "palpate, proactive"), statements(3, "palpate, random")];
        draw_reliability(&all, &path).unwrap();
        let svg = std::fs::read_to_string(path).unwrap();
        assert_eq!(svg.matches("<polygon").count(), 2);
        for text in ["palpate, proactive", "palpate, random", "root scale", "\n41\n", "\n7\n"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
