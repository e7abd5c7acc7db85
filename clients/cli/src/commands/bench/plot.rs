//! The plot of a run: which share of the contacts is answered within a time.

use std::path::Path;

use plotters::chart::ChartBuilder;
use plotters::coord::combinators::IntoLogRange;
use plotters::prelude::{IntoDrawingArea, SVGBackend};
use plotters::series::LineSeries;
use plotters::style::{Color, IntoFont, RGBColor, WHITE};

use super::figures::Figures;
use crate::failure::Failure;

const SIZE_PX: (u32, u32) = (720, 420);
const LINE: RGBColor = RGBColor(0, 114, 178);

/// Draws the share of all contacts that are answered within a time, which has a logarithmic axis.
///
/// # Errors
/// The file cannot be written.
pub(super) fn draw(figures: &Figures, path: &Path) -> Result<(), Failure> {
    let waits = figures.waits_ms();
    let all = figures.answers.len().max(1) as f64;
    let (least, most) =
        waits.first().zip(waits.last()).map_or((1.0, 10.0), |(a, b)| (a.max(0.1), b.max(0.2)));
    let area = SVGBackend::new(path, SIZE_PX).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(16)
        .caption("Contacts answered within a time", ("sans-serif", 18).into_font())
        .x_label_area_size(44)
        .y_label_area_size(56)
        .build_cartesian_2d((0.8 * least..1.25 * most).log_scale(), 0.0..100.0)?;
    chart
        .configure_mesh()
        .x_desc("wait, report to next candidate (ms)")
        .y_desc("contacts (%)")
        .x_label_formatter(&|ms| format!("{ms}"))
        .light_line_style(WHITE.mix(0.0))
        .draw()?;
    let shares = waits.iter().enumerate().map(|(place, wait)| (*wait, 100.0 * (place + 1) as f64 / all));
    chart.draw_series(LineSeries::new(shares, LINE.stroke_width(2)))?;
    Ok(area.present()?)
}
