//! The course of the errors over attempts: a line for the mean over seeds, a band for its spread.

use std::path::Path;

use plotters::backend::SVGBackend;
use plotters::chart::{ChartBuilder, SeriesLabelPosition};
use plotters::drawing::IntoDrawingArea;
use plotters::element::Polygon;
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::{BLACK, Color, RGBColor, WHITE};

use super::super::paper;
use super::super::record::{AttemptRow, Run};
use super::super::spread::Spread;
use super::{Area, COLOURS, GREY, add_legend, legend};
use crate::failure::Failure;

const SIZE_PX: (u32, u32) = (1080, 420);

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

/// A level that the curves are compared with.
struct Level {
    name: &'static str,
    at_mm: f64,
    colour: RGBColor,
}

impl Course<'_> {
    /// Draws the surface distance and the chamfer distance side by side into an SVG file.
    pub(in super::super) fn write(&self, path: &Path) -> Result<(), Failure> {
        let page = SVGBackend::new(path, SIZE_PX).into_drawing_area();
        page.fill(&WHITE)?;
        let title = format!("{}: mean ± sd over seeds", self.object.replace('_', " "));
        let page = page.titled(&title, ("sans-serif", 20))?;
        let (left, right) = page.split_horizontally(SIZE_PX.0 / 2);
        let surface = self.curves(|row| row.surface_distance_mm);
        draw(&left, "surface distance, mm", self.attempts, &surface, &[])?;
        let chamfer = self.curves(|row| row.chamfer_sum_mm);
        draw(&right, "chamfer distance (sum), mm", self.attempts, &chamfer, &self.levels())?;
        page.present()?;
        Ok(())
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
    for curve in curves {
        let points = || curve.spreads.iter().enumerate().map(|(attempt, spread)| (attempt as f64, spread));
        let upper = points().map(|(x, spread)| (x, spread.mean + spread.sd));
        let lower = points().rev().map(|(x, spread)| (x, (spread.mean - spread.sd).max(0.0)));
        let band: Vec<_> = upper.chain(lower).collect();
        chart.draw_series(std::iter::once(Polygon::new(band, curve.colour.mix(0.15))))?;
    }
    // Lines after all bands, so that no band hides a line.
    for curve in curves {
        let line = curve.spreads.iter().enumerate().map(|(attempt, spread)| (attempt as f64, spread.mean));
        let style = curve.colour.stroke_width(2);
        chart.draw_series(LineSeries::new(line, style))?.label(&curve.name).legend(legend(style));
    }
    for level in levels {
        let style = level.colour.stroke_width(1);
        let line = [(0.0, level.at_mm), (last, level.at_mm)];
        chart.draw_series(DashedLineSeries::new(line, 5, 4, style))?.label(level.name).legend(legend(style));
    }
    add_legend(&mut chart, SeriesLabelPosition::UpperRight)
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
        for text in ["paper, proactive", "paper, min_uncertainty", "sampling floor", "published, minU"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
