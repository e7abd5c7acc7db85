//! The pictures of an evaluation, and what they have in common.

mod course;
mod reliability;

use plotters::backend::SVGBackend;
use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingArea;
use plotters::element::{DashedPathElement, PathElement, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{BLACK, FontDesc, IntoFont, RGBColor, ShapeStyle, TextStyle};

pub(super) use self::course::Course;
pub(super) use self::reliability::draw_reliability;
use crate::failure::Failure;

/// One a series, distinguishable with any colour vision (Okabe and Ito).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];
/// What is no series.
const GREY: RGBColor = RGBColor(120, 120, 120);
/// Levels that the curves are compared with are dashed.
const DASH_PX: i32 = 5;
const GAP_PX: i32 = 4;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// With more series than this, areas would cover each other until none can be told from another.
const MOST_BANDS: usize = 3;

const ENTRIES_A_ROW: usize = 4;
const ROW_PX: u32 = 22;
const SWATCH_PX: i32 = 26;

/// What a line stands for.
#[derive(Clone, Debug)]
struct Entry {
    name: String,
    style: ShapeStyle,
    is_dashed: bool,
}

/// How much height [`draw_legend`] needs.
fn legend_height_px(entries: usize) -> u32 {
    ROW_PX * entries.div_ceil(ENTRIES_A_ROW) as u32 + 8
}

/// Names what is drawn in an area of its own, where it hides nothing; each line looks as in the chart.
fn draw_legend(area: &Area<'_>, entries: &[Entry]) -> Result<(), Failure> {
    let column_px = area.dim_in_pixel().0 as i32 / ENTRIES_A_ROW as i32;
    let text = small(BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    for (place, Entry { name, style, is_dashed }) in entries.iter().enumerate() {
        let x = 24 + column_px * (place % ENTRIES_A_ROW) as i32;
        let y = ROW_PX as i32 * (place / ENTRIES_A_ROW) as i32 + ROW_PX as i32 / 2;
        let line = [(x, y), (x + SWATCH_PX, y)];
        if *is_dashed {
            area.draw(&DashedPathElement::new(line, DASH_PX, GAP_PX, *style))?;
        } else {
            area.draw(&PathElement::new(line, *style))?;
        }
        area.draw(&Text::new(name.as_str(), (x + SWATCH_PX + 6, y), text.clone()))?;
    }
    Ok(())
}

fn small(colour: RGBColor) -> TextStyle<'static> {
    let font: FontDesc<'static> = ("sans-serif", 13).into_font();
    font.color(&colour)
}
