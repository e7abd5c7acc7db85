//! Surfaces of revolution about the z axis, closed by a pole at either end.

use palpate_core::geometry::{Point, TriangleMesh};

const SECTORS: u32 = 64;
/// Longest step along the profile.
const STEP_MM: f64 = 4.0;

/// Turns a profile of (radius, height) in millimetres into a mesh in metres.
///
/// The first and the last point lie on the axis, every other off it, bottom first.
pub(super) fn revolve_mm(profile: &[(f64, f64)]) -> TriangleMesh {
    let profile = subdivided(&rounded(&rounded(profile)));
    let last = profile.len() - 1;
    let mut mesh = TriangleMesh::default();
    for &(radius, height) in &profile[1..last] {
        for sector in 0..SECTORS {
            let angle = std::f64::consts::TAU * f64::from(sector) / f64::from(SECTORS);
            mesh.vertices.push(point_m(radius * angle.cos(), radius * angle.sin(), height));
        }
    }
    let rings = (last - 1) as u32;
    let bottom = rings * SECTORS;
    let top = bottom + 1;
    mesh.vertices.push(point_m(0.0, 0.0, profile[0].1));
    mesh.vertices.push(point_m(0.0, 0.0, profile[last].1));
    let at = |ring: u32, sector: u32| ring * SECTORS + sector % SECTORS;
    for sector in 0..SECTORS {
        mesh.faces.push([bottom, at(0, sector + 1), at(0, sector)]);
        mesh.faces.push([top, at(rings - 1, sector), at(rings - 1, sector + 1)]);
        for ring in 1..rings {
            let (below, beside) = (at(ring - 1, sector), at(ring - 1, sector + 1));
            let (above, across) = (at(ring, sector), at(ring, sector + 1));
            mesh.faces.push([below, beside, across]);
            mesh.faces.push([below, across, above]);
        }
    }
    mesh
}

fn point_m(x_mm: f64, y_mm: f64, z_mm: f64) -> Point {
    Point::new(x_mm, y_mm, z_mm) * 1e-3
}

fn between(a: (f64, f64), b: (f64, f64), share: f64) -> (f64, f64) {
    (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share)
}

/// Chaikin's corner cutting: every corner gives way to two points, the ends stay.
fn rounded(profile: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let last = profile.len() - 1;
    let mut cut = vec![profile[0]];
    for (step, pair) in profile.windows(2).enumerate() {
        if step > 0 {
            cut.push(between(pair[0], pair[1], 0.25));
        }
        if step + 1 < last {
            cut.push(between(pair[0], pair[1], 0.75));
        }
    }
    cut.push(profile[last]);
    cut
}

fn subdivided(profile: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut fine = vec![profile[0]];
    for pair in profile.windows(2) {
        let length = (pair[1].0 - pair[0].0).hypot(pair[1].1 - pair[0].1);
        let steps = (length / STEP_MM).ceil().max(1.0) as u32;
        fine.extend((1..=steps).map(|i| between(pair[0], pair[1], f64::from(i) / f64::from(steps))));
    }
    fine
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_circle_becomes_a_ball() {
        let half_circle: Vec<(f64, f64)> = (0..=60)
            .map(|i| std::f64::consts::PI * (f64::from(i) / 60.0 - 0.5))
            .map(|angle| (50.0 * angle.cos(), 50.0 * angle.sin()))
            .collect();
        let volume = revolve_mm(&half_circle).volume();
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3);
        assert!((volume / ball - 1.0).abs() < 5e-3, "{}", volume / ball);
    }

    #[test]
    fn rounding_keeps_the_ends_and_stays_inside_the_corners() {
        let cut = rounded(&[(0.0, 0.0), (10.0, 0.0), (10.0, 20.0), (0.0, 20.0)]);
        assert_eq!(cut.first(), Some(&(0.0, 0.0)));
        assert_eq!(cut.last(), Some(&(0.0, 20.0)));
        assert!(cut.contains(&(10.0, 5.0)) && cut.contains(&(10.0, 15.0)));
        assert!(!cut.contains(&(10.0, 0.0)));
    }
}
