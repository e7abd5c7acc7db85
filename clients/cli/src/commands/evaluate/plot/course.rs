//! The course of the errors over attempts: a line for the mean over seeds, a band or bars for its spread.

use std::path::Path;

use plotters::backend::SVGBackend;
use plotters::chart::ChartBuilder;
use plotters::drawing::IntoDrawingArea;
use plotters::element::{PathElement, Polygon};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::{BLACK, Color, RGBColor, WHITE};

use super::super::paper;
use super::super::record::{AttemptRow, Run};
use super::super::spread::Spread;
use super::{Area, COLOURS, Chart, DASH_PX, Entry, GAP_PX, GREY, MOST_BANDS, draw_legend, legend_height_px};
use crate::failure::Failure;

const SIZE_PX: (u32, u32) = (1080, 400);
/// With many series the spread is shown by bars at every so many attempts.
const ATTEMPTS_A_BAR: usize = 10;

/// What is drawn of one object.
#[derive(Debug)]
pub(in super::super) struct Course<'a> {
    /// The object's name.
    pub(in super::super) object: &'a str,
    /// Its sampling floor: chamfer sum, mm.
    pub(in super::super) floor_mm: f64,
    /// Attempts of a full run.
    pub(in super::super) attempts: u32,
    /// Methods and strategies, a colour each.
    pub(in super::super) series: &'a [(String, String)],
    /// All runs, of other objects too.
    pub(in super::super) runs: &'a [Run],
}

/// A curve with its spread: what is drawn in one colour.
struct Curve {
    name: String,
    colour: RGBColor,
    spreads: Vec<Spread>,
}

impl Curve {
    fn entry(&self) -> Entry {
        Entry { name: self.name.clone(), style: self.colour.stroke_width(2), is_dashed: false }
    }
}

/// A level that the curves are compared with.
struct Level {
    name: &'static str,
    at_mm: f64,
    colour: RGBColor,
}

impl Level {
    fn entry(&self) -> Entry {
        Entry { name: self.name.to_owned(), style: self.colour.stroke_width(2), is_dashed: true }
    }
}

impl Course<'_> {
    /// Draws the surface distance and the chamfer distance side by side into an SVG file.
    pub(in super::super) fn write(&self, path: &Path) -> Result<(), Failure> {
        let surface = self.curves(|row| row.surface_distance_mm);
        let chamfer = self.curves(|row| row.chamfer_sum_mm);
        let levels = self.levels();
        let entries: Vec<_> =
            surface.iter().map(Curve::entry).chain(levels.iter().map(Level::entry)).collect();
        let height = SIZE_PX.1 + legend_height_px(entries.len());
        let page = SVGBackend::new(path, (SIZE_PX.0, height)).into_drawing_area();
        page.fill(&WHITE)?;
        let page = page.titled(&self.title(&surface), ("sans-serif", 20))?;
        let (charts, legend) = page.split_vertically(page.dim_in_pixel().1 - legend_height_px(entries.len()));
        let (left, right) = charts.split_horizontally(SIZE_PX.0 / 2);
        draw(&left, "surface distance, mm", self.attempts, &surface, &[])?;
        draw(&right, "chamfer distance (sum), mm", self.attempts, &chamfer, &levels)?;
        draw_legend(&legend, &entries)?;
        page.present()?;
        Ok(())
    }

    /// The object, and what lines and shades are.
    fn title(&self, curves: &[Curve]) -> String {
        let object = self.object.replace('_', " ");
        let seeds = curves.iter().flat_map(|curve| &curve.spreads).map(|spread| spread.n).max().unwrap_or(0);
        let shape = if curves.len() > MOST_BANDS { "bars" } else { "shaded" };
        match seeds {
            0 => format!("{object}: no run"),
            1 => format!("{object}: one seed"),
            _ => format!("{object}: mean of {seeds} seeds; {shape}: ± standard deviation"),
        }
    }

    fn curves(&self, value: fn(&AttemptRow) -> f64) -> Vec<Curve> {
        let curve = |((method, strategy), colour): (&(String, String), RGBColor)| {
            let of_curve = |run: &&Run| {
                let case = &run.case;
                (case.object.as_str(), &case.method, &case.strategy) == (self.object, method, strategy)
            };
            let spread_after = |attempt| {
                let rows = self.runs.iter().filter(of_curve).filter_map(|run| run.after(attempt));
                Spread::of(rows.map(value))
            };
            Curve {
                name: format!("{method}, {strategy}"),
                colour,
                spreads: (0..=self.attempts as usize).filter_map(spread_after).collect(),
            }
        };
        self.series.iter().zip(COLOURS.into_iter().cycle()).map(curve).collect()
    }

    /// The floor, and what the paper published where it has the object.
    fn levels(&self) -> Vec<Level> {
        let mut levels = vec![Level { name: "sampling floor", at_mm: self.floor_mm, colour: GREY }];
        if let Some(column) = paper::column(self.object) {
            let [(proactive, _), (baseline, _)] = column.chamfer_mm;
            levels.push(Level { name: "published, OURS", at_mm: proactive, colour: COLOURS[0] });
            levels.push(Level { name: "published, minU", at_mm: baseline, colour: COLOURS[1] });
        }
        levels
    }
}

fn draw(
    area: &Area<'_>,
    title: &str,
    attempts: u32,
    curves: &[Curve],
    levels: &[Level],
) -> Result<(), Failure> {
    let tops = curves.iter().flat_map(|curve| &curve.spreads).map(|spread| spread.mean + spread.sd);
    let top = tops.chain(levels.iter().map(|level| level.at_mm)).fold(0.0, f64::max);
    let last = f64::from(attempts.max(1));
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(46)
        .build_cartesian_2d(0.0..last, 0.0..1.05 * top.max(1e-3))?;
    chart
        .configure_mesh()
        .bold_line_style(BLACK.mix(0.1))
        .light_line_style(WHITE)
        .x_desc("attempts")
        .y_desc(title)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .draw()?;
    if curves.len() > MOST_BANDS {
        draw_bars(&mut chart, curves)?;
    } else {
        draw_bands(&mut chart, curves)?;
    }
    // Lines after all bands, so that no band hides a line.
    for curve in curves {
        let line = curve.spreads.iter().enumerate().map(|(attempt, spread)| (attempt as f64, spread.mean));
        chart.draw_series(LineSeries::new(line, curve.entry().style))?;
    }
    for level in levels {
        let line = [(0.0, level.at_mm), (last, level.at_mm)];
        chart.draw_series(DashedLineSeries::new(line, DASH_PX, GAP_PX, level.entry().style))?;
    }
    Ok(())
}

fn draw_bands(chart: &mut Chart<'_>, curves: &[Curve]) -> Result<(), Failure> {
    for curve in curves {
        let points = || curve.spreads.iter().enumerate().map(|(attempt, spread)| (attempt as f64, spread));
        let upper = points().map(|(x, spread)| (x, spread.mean + spread.sd));
        let lower = points().rev().map(|(x, spread)| (x, (spread.mean - spread.sd).max(0.0)));
        let band: Vec<_> = upper.chain(lower).collect();
        chart.draw_series(std::iter::once(Polygon::new(band, curve.colour.mix(0.12))))?;
    }
    Ok(())
}

/// Bars at some attempts, those of each series a little beside those of the others.
fn draw_bars(chart: &mut Chart<'_>, curves: &[Curve]) -> Result<(), Failure> {
    let apart = ATTEMPTS_A_BAR as f64 / (2 * curves.len()) as f64;
    for (place, curve) in curves.iter().enumerate() {
        let aside = (place as f64 - 0.5 * (curves.len() - 1) as f64) * apart;
        let last = curve.spreads.len().saturating_sub(1);
        let shown = curve.spreads.iter().enumerate().skip(ATTEMPTS_A_BAR).step_by(ATTEMPTS_A_BAR);
        let bars =
            shown.filter(|(attempt, spread)| *attempt < last && spread.n > 1).map(|(attempt, spread)| {
                let x = attempt as f64 + aside;
                let ends = [(spread.mean - spread.sd).max(0.0), spread.mean + spread.sd].map(|y| (x, y));
                PathElement::new(ends.to_vec(), curve.colour.stroke_width(1))
            });
        chart.draw_series(bars)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::Strategy;

    use super::*;

    #[test]
    fn a_plot_has_a_band_and_a_line_for_each_strategy_and_levels_to_compare_with() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lamp.svg");
        let strategies = [Strategy::Proactive, Strategy::MinUncertainty];
        let runs: Vec<_> = strategies
            .into_iter()
            .flat_map(|strategy| [1, 2].map(|seed| Run::example("lamp", strategy, seed, seed as f64)))
            .collect();
        let series = ["proactive", "min_uncertainty"].map(|name| ("paper".to_owned(), name.to_owned()));
        let plot = Course { object: "lamp", floor_mm: 1.05, attempts: 3, series: &series, runs: &runs };
        plot.write(&path).unwrap();
        let svg = std::fs::read_to_string(path).unwrap();
        assert_eq!(svg.matches("<polygon").count(), 4, "two bands in each of two charts");
        assert!(svg.contains("lamp: mean of 2 seeds; shaded: ± standard deviation"), "{svg}");
        for text in ["paper, proactive", "paper, min_uncertainty", "sampling floor", "published, minU"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn one_seed_has_no_spread_and_many_series_have_bars_in_place_of_bands() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lamp.svg");
        let strategies = ["proactive", "min_uncertainty", "uniform", "random"];
        let series = strategies.map(|name| ("paper".to_owned(), name.to_owned()));
        let one = [Run::example("lamp", Strategy::Proactive, 1, 1.0)];
        Course { object: "lamp", floor_mm: 1.0, attempts: 3, series: &series, runs: &one }
            .write(&path)
            .unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().contains("lamp: one seed"));
        let two = [1, 2].map(|seed| Run::example("lamp", Strategy::Proactive, seed, seed as f64));
        Course { object: "lamp", floor_mm: 1.0, attempts: 30, series: &series, runs: &two }
            .write(&path)
            .unwrap();
        let svg = std::fs::read_to_string(&path).unwrap();
        assert!(svg.contains("bars: ± standard deviation") && !svg.contains("<polygon"), "{svg}");
    }

    #[test]
    fn published_levels_are_dashed_in_the_legend_as_in_the_chart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lamp.svg");
        let series = [("paper".to_owned(), "proactive".to_owned())];
        let plot = Course { object: "lamp", floor_mm: 1.05, attempts: 3, series: &series, runs: &[] };
        let dashed: Vec<_> = plot.levels().iter().map(|level| level.entry().is_dashed).collect();
        assert_eq!(dashed, [true; 3]);
        plot.write(&path).unwrap();
        let svg = std::fs::read_to_string(path).unwrap();
        let names = ["sampling floor", "published, OURS", "published, minU"];
        assert!(names.iter().all(|name| svg.contains(name)) && svg.contains("no run"), "{svg}");
    }
}
