//! Thinning: of many points those that lie farthest from each other.

use crate::attractor::{Attractor, Sense};
use crate::geometry::Point;

/// Keeps all touches and at most `most` visual points, each the farthest from those before it.
pub(crate) fn thin_visual(attractors: &[Attractor], most: usize) -> Vec<Attractor> {
    let (seen, touched): (Vec<Attractor>, Vec<Attractor>) =
        attractors.iter().partition(|a| a.sense == Sense::Vision);
    if seen.len() <= most {
        return seen.into_iter().chain(touched).collect();
    }
    let points: Vec<Point> = seen.iter().map(|a| a.point).collect();
    farthest_first(&points, most).into_iter().map(|index| seen[index]).chain(touched).collect()
}

/// The indices of at most `most` points, each the farthest from those before it; the first first.
pub(crate) fn farthest_first(points: &[Point], most: usize) -> Vec<usize> {
    let mut kept = Vec::with_capacity(most);
    let mut distance = vec![f64::INFINITY; points.len()];
    let mut next = 0;
    while kept.len() < most.min(points.len()) {
        kept.push(next);
        for (distance, other) in distance.iter_mut().zip(points) {
            *distance = distance.min((other - points[next]).norm_squared());
        }
        // Of equals the last, as good as any and always the same.
        next = (0..points.len()).max_by(|&a, &b| distance[a].total_cmp(&distance[b])).unwrap_or(0);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    fn at(x: f64, sense: Sense) -> Attractor {
        Attractor { point: Point::new(x, 0.0, 0.0), uncertainty: 0.1, sense }
    }

    #[test]
    fn visual_points_are_thinned_evenly_and_touches_are_all_kept() {
        let mut attractors: Vec<_> = (0..101).map(|k| at(0.01 * f64::from(k), Sense::Vision)).collect();
        attractors.extend([at(0.5, Sense::Touch), at(0.5, Sense::Touch)]);
        let kept = thin_visual(&attractors, 5);
        let mut places: Vec<f64> = kept.iter().map(|a| a.point.x).collect();
        places.sort_by(f64::total_cmp);
        assert_eq!(kept.iter().filter(|a| a.sense == Sense::Touch).count(), 2);
        assert!((places[0], places[6]) == (0.0, 1.0) && places[1] > 0.2 && places[5] < 0.8);
    }
}
