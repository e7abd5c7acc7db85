//! The data of a fit in blocks: points whose distances from a part are evaluated together.

use super::least_squares::huber;
use crate::geometry::Vector;

/// Points of a block.
pub(super) const LANES: usize = 16;
/// Points of the surface farther than this from the template count linearly, in lengths of the patch.
const HUBER: f64 = 0.1;

/// One number for each point of a block.
pub(super) type Lanes = [f64; LANES];

/// Which side of the template a point may lie on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Neither: it belongs to the surface.
    Surface,
    /// Outside only.
    Outside,
    /// Inside only.
    Inside,
}

/// Some points of one side.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub(super) side: Side,
    /// Their coordinates, in lengths of the patch.
    pub(super) points: [Lanes; 3],
    /// Their squared weights; zero for those that fill up the last block.
    squares: Lanes,
}

impl Block {
    /// Blocks of points of one side with the weights of their residuals.
    pub(super) fn of(side: Side, points: &[(Vector, f64)]) -> impl Iterator<Item = Self> + '_ {
        points.chunks(LANES).map(move |points| {
            let point = |lane: usize| &points[lane.min(points.len() - 1)].0;
            Self {
                side,
                points: std::array::from_fn(|axis| std::array::from_fn(|lane| point(lane)[axis])),
                squares: std::array::from_fn(|lane| {
                    points.get(lane).map_or(0.0, |(_, weight)| weight * weight)
                }),
            }
        })
    }

    /// What is left of blocks of one side where only some of their points are looked at, `chosen`: fewer blocks, each
    /// with the numbers that come with its points.
    pub(super) fn packed(
        blocks: &[(&Self, &Lanes)],
        chosen: impl Fn(&Self, &Lanes) -> [bool; LANES],
    ) -> Vec<(Self, Lanes)> {
        let mut packed: Vec<(Self, Lanes)> = Vec::new();
        let mut filled = LANES;
        for (block, numbers) in blocks {
            let chosen = chosen(block, numbers);
            for lane in (0..LANES).filter(|lane| chosen[*lane] && block.squares[*lane] > 0.0) {
                if filled == LANES {
                    // Until it is full, all of its points are this one, without weight.
                    let points = block.points.map(|axis| [axis[lane]; LANES]);
                    packed.push((
                        Self { side: block.side, points, squares: [0.0; LANES] },
                        [numbers[lane]; LANES],
                    ));
                    filled = 0;
                }
                if let Some((last, last_numbers)) = packed.last_mut() {
                    (0..3).for_each(|axis| last.points[axis][filled] = block.points[axis][lane]);
                    (last.squares[filled], last_numbers[filled]) = (block.squares[lane], numbers[lane]);
                }
                filled += 1;
            }
        }
        packed
    }

    /// The cost of some residuals, and by how much each is multiplied in the slope of the cost.
    pub(super) fn cost(&self, residuals: &Lanes) -> (f64, Lanes) {
        let (mut cost, mut slopes) = (0.0, [0.0; LANES]);
        for ((residual, square), slope) in residuals.iter().zip(&self.squares).zip(&mut slopes) {
            let counts = match self.side {
                Side::Surface => true,
                Side::Outside => *residual < 0.0,
                Side::Inside => *residual > 0.0,
            };
            if *square > 0.0 && counts {
                let threshold = if self.side == Side::Surface { HUBER } else { f64::INFINITY };
                cost += square * huber(*residual, threshold);
                *slope = square * (threshold / residual.abs()).min(1.0);
            }
        }
        (cost, slopes)
    }
}
