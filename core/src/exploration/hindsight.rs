//! What would have come of an approach that nobody made, by a surface that is known now.

use crate::geometry::{Direction, Point, SurfaceIndex};

/// How an approach would have ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hindsight {
    /// It would have touched near its candidate.
    Hit,
    /// It would have touched nothing.
    Miss,
    /// It would have touched further from its candidate than `failure_distance_m`: outright where it begins inside.
    Early,
}

/// The end of the approach from `start` to `end` that aims at `target`, at a surface that was indexed by
/// [`SurfaceIndex::of_solid`]. All points are in one frame, in metres.
pub fn hindsight(
    solid: &SurfaceIndex,
    target: &Point,
    start: &Point,
    end: &Point,
    failure_distance_m: f64,
) -> Hindsight {
    // Asked first: from an inside start the first hit is a back face.
    if solid.contains(start) {
        return Hindsight::Early;
    }
    let way = end - start;
    let hit =
        Direction::try_new(way, 0.0).and_then(|direction| solid.first_hit(start, &direction, way.norm()));
    match hit {
        None => Hindsight::Miss,
        Some(hit) if (hit.point - target).norm() > failure_distance_m => Hindsight::Early,
        Some(_) => Hindsight::Hit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;

    /// What comes of an approach along the x axis to a ball of 50 mm, `d` before and behind a candidate at `x`.
    fn at(x: f64, d: f64) -> Hindsight {
        let ball = Icosphere::get(4).mesh_of(|direction| Point::from(0.05 * direction.into_inner()));
        let solid = SurfaceIndex::of_solid(&ball).unwrap();
        let [start, target, end] = [x + d, x, x - d].map(|x| Point::new(x, 0.0, 0.0));
        hindsight(&solid, &target, &start, &end, 0.015)
    }

    #[test]
    fn an_approach_ends_as_a_robot_would_have_reported_it() {
        assert_eq!(at(0.05, 0.015), Hindsight::Hit);
        assert_eq!(at(0.0645, 0.015), Hindsight::Hit);
        assert_eq!(at(0.066, 0.015), Hindsight::Miss);
        assert_eq!(at(0.03, 0.015), Hindsight::Early, "it begins inside");
        assert_eq!(at(0.03, 0.03), Hindsight::Early, "it touches 20 mm before its candidate");
        assert_eq!(at(0.07, 0.03), Hindsight::Early, "it touches 20 mm behind its candidate");
        assert_eq!(at(0.07, 0.0), Hindsight::Miss, "an approach without a way touches nothing");
    }
}
