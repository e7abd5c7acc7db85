//! Few points in place of many: farthest-point sampling, and directions around an axis.

use super::{Direction, Point, Vector};

/// `count` unit vectors across a direction, spread evenly around it.
pub(crate) fn around(direction: &Direction, count: usize) -> impl Iterator<Item = Vector> + use<> {
    // Any axis that is not the direction's own gives two vectors across it.
    let axis = if direction.x.abs() < 0.6 { Vector::x() } else { Vector::y() };
    let first = direction.cross(&axis).normalize();
    let second = direction.cross(&first);
    (0..count).map(move |step| {
        let (sin, cos) = (step as f64 * std::f64::consts::TAU / count as f64).sin_cos();
        first * cos + second * sin
    })
}

/// Farthest-point sampling: the indices of at most `most` points, each the farthest from all before
/// it, in the order of selection, which begins with the first point.
pub(crate) fn farthest_point_sampling(points: &[Point], most: usize) -> Vec<usize> {
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
