//! Thinning of visual points: farthest-point sampling, then the mean of each cell.

use super::attractor::{Attractor, Sense};
use crate::geometry::{Point, Vector, farthest_point_sampling};

/// Keeps all touches and at most `most` visual points: farthest-point sampling, then the mean of
/// the points nearest to each sample, since a mean is less noisy, and the farthest points are the
/// noisiest. Without `means` the samples themselves are kept.
pub(crate) fn thin_visual(attractors: &[Attractor], most: usize, means: bool) -> Vec<Attractor> {
    let (seen, touched): (Vec<Attractor>, Vec<Attractor>) =
        attractors.iter().partition(|a| a.sense == Sense::Vision);
    if seen.len() <= most {
        return seen.into_iter().chain(touched).collect();
    }
    let points: Vec<Point> = seen.iter().map(|a| a.point).collect();
    let kept = farthest_point_sampling(&points, most);
    if !means {
        return kept.iter().map(|&index| seen[index]).chain(touched).collect();
    }
    let mut sums = vec![(Vector::zeros(), 0.0); kept.len()];
    for (attractor, point) in seen.iter().zip(&points) {
        // Views may be off against each other, so their points are not mixed.
        let square = |&k: &usize| match seen[kept[k]].provenance.source == attractor.provenance.source {
            true => (points[kept[k]] - point).norm_squared(),
            false => f64::INFINITY,
        };
        let nearest = (0..kept.len()).min_by(|a, b| square(a).total_cmp(&square(b))).unwrap_or(0);
        sums[nearest].0 += point.coords;
        sums[nearest].1 += 1.0;
    }
    let mean = |(&index, (sum, count)): (&usize, &(Vector, f64))| Attractor {
        point: Point::from(sum / *count),
        ..seen[index]
    };
    // A sample at the place of another one of its view has no points of its own: it is a repeat.
    let has_points = |(_, (_, count)): &(&usize, &(Vector, f64))| *count > 0.0;
    kept.iter().zip(&sums).filter(has_points).map(mean).chain(touched).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    fn at(x: f64, sense: Sense) -> Attractor {
        Attractor::new(Point::new(x, 0.0, 0.0), 0.1, sense)
    }

    #[test]
    fn visual_points_are_thinned_evenly_and_touches_are_all_kept() {
        let mut attractors: Vec<_> = (0..101).map(|k| at(0.01 * f64::from(k), Sense::Vision)).collect();
        attractors.extend([at(0.5, Sense::Touch), at(0.5, Sense::Touch)]);
        let kept = thin_visual(&attractors, 5, true);
        let mut places: Vec<f64> =
            kept.iter().filter(|a| a.sense == Sense::Vision).map(|a| a.point.x).collect();
        places.sort_by(f64::total_cmp);
        assert_eq!((kept.len(), places.len()), (7, 5));
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] > 0.1), "{places:?}");
        assert!(places[0] < 0.2 && places[4] > 0.8, "{places:?}");
    }

    #[test]
    fn points_that_were_seen_again_and_again_are_kept_once() {
        let attractors: Vec<_> = (0..60).map(|k| at(0.01 * f64::from(k % 3), Sense::Vision)).collect();
        let mut places: Vec<f64> = thin_visual(&attractors, 5, true).iter().map(|a| a.point.x).collect();
        places.sort_by(f64::total_cmp);
        assert_eq!(places.len(), 3);
        assert!(
            places.iter().zip([0.0, 0.01, 0.02]).all(|(place, x)| (place - x).abs() < 1e-12),
            "{places:?}"
        );
    }

    #[test]
    fn what_is_kept_is_less_noisy_than_what_was_seen() {
        // A plane seen with a millimetre of scatter, up and down in turn.
        let noisy = |k: i32| {
            Point::new(
                0.001 * f64::from(k % 20),
                0.001 * f64::from(k / 20),
                0.001 * f64::from(1 - 2 * ((k / 3) % 2)),
            )
        };
        let seen = |k| Attractor { point: noisy(k), ..at(0.0, Sense::Vision) };
        let attractors: Vec<_> = (0..400).map(seen).collect();
        let scatter_m = |means| {
            let kept = thin_visual(&attractors, 20, means);
            (kept.iter().map(|a| a.point.z.powi(2)).sum::<f64>() / 20.0).sqrt()
        };
        assert!(scatter_m(true) < 0.0005, "{}", scatter_m(true));
        assert!((scatter_m(false) - 0.001).abs() < 1e-12, "{}", scatter_m(false));
    }
}
