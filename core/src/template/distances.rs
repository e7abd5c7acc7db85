//! How far the data are from a template: the nearest of its parts counts.

use super::field::Field;
use super::fit_data::FitData;
use super::part::Part;
use super::samples::{LANES, Lanes, Side};

/// For every block of the data the signed distances of its points to the nearest of some parts; infinite for
/// none, and for free points outside the boxes around all of them.
#[derive(Clone, Debug)]
pub(super) struct Distances {
    pub(super) blocks: Vec<Lanes>,
}

impl Distances {
    pub(super) fn to<'a>(parts: impl Iterator<Item = &'a Part>, data: &FitData) -> Self {
        let parts: Vec<Field<'_>> = parts.map(Part::field).collect();
        let nearest = |points: &[Lanes; 3], side: Side| {
            let is_near =
                |part: &&Field<'_>| side != Side::Outside || !part.beyond(points).iter().all(|b| *b);
            let near = parts.iter().filter(is_near);
            near.map(|part| part.distances(points)).fold([f64::INFINITY; LANES], |least, other| {
                std::array::from_fn(|lane| least[lane].min(other[lane]))
            })
        };
        Self { blocks: data.blocks.iter().map(|block| nearest(&block.points, block.side)).collect() }
    }

    /// The cost of a template at these distances, without its priors.
    pub(super) fn cost(&self, data: &FitData) -> f64 {
        data.blocks.iter().zip(&self.blocks).map(|(block, residuals)| block.cost(residuals).0).sum()
    }
}
