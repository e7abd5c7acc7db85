//! A rigid square face that is pushed against the mesh: where it stops, where the force acts, and how.
//!
//! ```text
//!            direction ▼ z            The face stops where the first point of the mesh in its column is;
//!      start ─────────────────        what of the mesh lies within LAYER_M of it there is what presses.
//!            │ column │
//!            │     ▁▂▃▅▇ ◄ layer
//! ```
//! Exact for the triangles: each is cut to the column of the face, none is sampled.

use palpate_core::geometry::{Direction, Point, Vector};

use super::{Meeting, PAD_HALF_SIDE_M, facing, outside_start};
use crate::body::Body;

/// How far a soft surface lets the object into the face, in metres: what lies within it presses.
const LAYER_M: f64 = 0.0001;
/// Between the face and the object.
const FRICTION: f64 = 0.3;

/// A part of a triangle, convex, in the frame of the pad at the approach's start.
type Polygon = Vec<Point>;

/// Pushes the face by at most `reach_m`; `None` if it meets nothing.
pub(super) fn meet(body: &Body, start: Point, direction: &Direction, reach_m: f64) -> Option<Meeting> {
    let base_from_pad = facing(direction);
    let column = column(body, &start, &base_from_pad);
    let range = |polygon: &Polygon| {
        let depths = || polygon.iter().map(|corner| corner.z);
        (depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max))
    };
    // The face stands in the object if its edge or its middle does.
    let cuts = |polygon: &Polygon| {
        let (least, most) = range(polygon);
        least < 0.0 && most > 0.0
    };
    let is_early = column.iter().any(cuts) || body.surface().contains(&start);
    // What lies behind a free face at the start is not met any more.
    let ahead = |depth: &f64| is_early || *depth >= 0.0;
    let depth = column.iter().map(|polygon| range(polygon).0).filter(ahead).min_by(f64::total_cmp)?;
    if depth > reach_m {
        return None;
    }
    let pressed = Pressed::of(&column, depth);
    Some(Meeting {
        is_early,
        direction: *direction,
        swept_from: if is_early { outside_start(body, &start, direction) } else { start },
        centre: start + direction.into_inner() * depth,
        offset: Vector::new(pressed.centre.x, pressed.centre.y, 0.0),
        normal: base_from_pad * pressed.normal,
    })
}

/// The direction of the force on the face, in the sensor's frame: within the friction's cone about the surface's
/// normal, as near to the face's own axis as that allows.
pub(super) fn push_back(normal: &Direction) -> Direction {
    let axis = -Vector::z_axis();
    let (cone, tilt) = (FRICTION.atan(), normal.angle(&axis));
    if tilt <= cone {
        return axis;
    }
    let aside = axis.into_inner() - normal.into_inner() * normal.dot(&axis);
    Direction::new_normalize(normal.into_inner() * cone.cos() + aside.normalize() * cone.sin())
}

/// What of the mesh lies before or behind the face, cut to it.
fn column(body: &Body, start: &Point, base_from_pad: &nalgebra::UnitQuaternion<f64>) -> Vec<Polygon> {
    let pad_from_base = base_from_pad.inverse();
    let mesh = body.mesh();
    let corners: Vec<Point> =
        mesh.vertices.iter().map(|vertex| Point::from(pad_from_base * (vertex - start))).collect();
    let triangles = mesh.faces.iter().map(|face| face.map(|corner| corners[corner as usize]));
    triangles.filter(may_be_within).map(cut_to_face).filter(|polygon| !polygon.is_empty()).collect()
}

fn may_be_within(triangle: &[Point; 3]) -> bool {
    let [a, b, c] = triangle;
    (0..2).all(|axis| {
        let low = a[axis].min(b[axis]).min(c[axis]);
        let high = a[axis].max(b[axis]).max(c[axis]);
        low <= PAD_HALF_SIDE_M && high >= -PAD_HALF_SIDE_M
    })
}

fn cut_to_face(triangle: [Point; 3]) -> Polygon {
    let mut polygon = triangle.to_vec();
    for axis in 0..2 {
        polygon = cut(&polygon, |corner| PAD_HALF_SIDE_M - corner[axis]);
        polygon = cut(&polygon, |corner| PAD_HALF_SIDE_M + corner[axis]);
    }
    polygon
}

/// The part of a convex polygon where `inside`, which is linear, is not negative (Sutherland and Hodgman).
fn cut(polygon: &[Point], inside: impl Fn(&Point) -> f64) -> Polygon {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (index, corner) in polygon.iter().enumerate() {
        let next = &polygon[(index + 1) % polygon.len()];
        let (here, there) = (inside(corner), inside(next));
        if here >= 0.0 {
            part.push(*corner);
        }
        if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
            part.push(corner + (next - corner) * (here / (here - there)));
        }
    }
    part
}

/// What presses against the face.
#[derive(Debug)]
struct Pressed {
    /// The middle of its area as the face sees it.
    centre: Point,
    /// Its mean outward normal, weighted likewise.
    normal: Direction,
}

impl Pressed {
    fn of(column: &[Polygon], depth: f64) -> Self {
        let (mut area, mut moment, mut normal) = (0.0, Vector::zeros(), Vector::zeros());
        let mut deepest = Point::new(0.0, 0.0, f64::INFINITY);
        for polygon in column.iter().filter(|polygon| polygon.iter().all(|corner| corner.z >= depth)) {
            let part = cut(polygon, |corner| depth + LAYER_M - corner.z);
            if let Some(corner) = part.iter().min_by(|a, b| a.z.total_cmp(&b.z))
                && corner.z < deepest.z
            {
                deepest = *corner;
            }
            for pair in part.windows(2).skip(1) {
                let (a, b, c) = (part[0], pair[0], pair[1]);
                let area_normal = 0.5 * (b - a).cross(&(c - a));
                // What turns away from the face or stands upright on it does not press.
                let seen = -area_normal.z;
                if seen > 0.0 {
                    area += seen;
                    moment += seen * (a.coords + b.coords + c.coords) / 3.0;
                    normal += seen * area_normal.normalize();
                }
            }
        }
        match Direction::try_new(normal, 0.0) {
            Some(normal) => Self { centre: Point::from(moment / area), normal },
            // A bare edge or tip that stands upright.
            None => Self { centre: deepest, normal: -Vector::z_axis() },
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::geometry::{Icosphere, TriangleMesh};

    use super::*;

    const RADIUS_M: f64 = 0.04;

    fn ball() -> Body {
        let ball = Icosphere::get(6).mesh_of(|direction| Point::from(RADIUS_M * direction.into_inner()));
        Body::new(&ball).unwrap()
    }

    /// A box of six flat faces about the origin.
    fn cuboid(half_m: Vector) -> Body {
        let corner = |bits: usize| {
            let sign = |axis: usize| if bits >> axis & 1 == 1 { half_m[axis] } else { -half_m[axis] };
            Point::new(sign(0), sign(1), sign(2))
        };
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Body::new(&TriangleMesh { vertices: (0..8).map(corner).collect(), faces }).unwrap()
    }

    /// Pushed down by at most 100 mm.
    fn pushed_down(body: &Body, start: Point) -> Option<Meeting> {
        meet(body, start, &-Vector::z_axis(), 0.1)
    }

    /// Where the middle of the pressed area lies.
    fn pressed_at(meeting: &Meeting, direction: Direction) -> Point {
        meeting.centre + facing(&direction) * meeting.offset
    }

    #[test]
    fn a_ball_is_touched_at_its_top_wherever_on_the_face_that_is() {
        let body = ball();
        for (x, y) in [(0.0, 0.0), (0.005, 0.0), (-0.003, 0.006), (0.006, 0.006)] {
            let met = pushed_down(&body, Point::new(x, y, 0.06)).unwrap();
            assert!((met.centre - Point::new(x, y, RADIUS_M)).norm() < 5e-6, "{met:?}");
            let top = pressed_at(&met, -Vector::z_axis());
            assert!((top - Point::new(0.0, 0.0, RADIUS_M)).norm() < 2e-4, "{top}");
            assert!(met.normal.angle(&Vector::z()) < 0.01);
            assert!(!met.is_early);
        }
    }

    #[test]
    fn a_ball_beside_the_face_is_touched_by_its_rim_as_deep_as_the_ball_is_round() {
        let body = ball();
        // The rim passes the axis at half the radius, where the ball falls off by 30 degrees.
        let met = pushed_down(&body, Point::new(PAD_HALF_SIDE_M + 0.5 * RADIUS_M, 0.0, 0.06)).unwrap();
        assert!((met.centre.z - RADIUS_M * 0.75_f64.sqrt()).abs() < 2e-5, "{met:?}");
        let touched = pressed_at(&met, -Vector::z_axis());
        assert!((touched.x - 0.5 * RADIUS_M).abs() < 2e-4 && touched.y.abs() < 2e-4, "{touched}");
        assert!((met.normal.angle(&Vector::z()) - 30_f64.to_radians()).abs() < 0.02, "{:?}", met.normal);
        assert!(pushed_down(&body, Point::new(RADIUS_M + 1.01 * PAD_HALF_SIDE_M, 0.0, 0.06)).is_none());
    }

    #[test]
    fn face_on_face_presses_in_the_middle_of_what_overlaps() {
        let body = cuboid(Vector::new(0.03, 0.04, 0.05));
        for (x, middle) in [(0.0, 0.0), (0.026, 0.0235), (0.034, 0.0275)] {
            let met = pushed_down(&body, Point::new(x, 0.01, 0.07)).unwrap();
            assert!((met.centre.z - 0.05).abs() < 1e-12);
            let pressed = pressed_at(&met, -Vector::z_axis());
            assert!((pressed - Point::new(middle, 0.01, 0.05)).norm() < 1e-9, "{pressed}");
            assert!(met.normal.angle(&Vector::z()) < 1e-6);
        }
    }

    #[test]
    fn an_edge_that_points_at_the_face_is_touched_along_its_line() {
        let half_m = 0.03;
        let body = cuboid(Vector::repeat(half_m));
        // Along the diagonal between x and z, and aside of the edge by 4 mm, across the direction and along y.
        let direction = -Direction::new_normalize(Vector::new(1.0, 0.0, 1.0));
        let aside = 0.004 * Vector::new(1.0, 0.0, -1.0).normalize();
        let edge = Point::new(half_m, 0.002, half_m);
        let met = meet(&body, edge + aside - 0.01 * direction.into_inner(), &direction, 0.03).unwrap();
        assert!((met.centre - (edge + aside)).norm() < 1e-9, "{}", met.centre);
        assert!((pressed_at(&met, direction) - edge).norm() < 1e-9, "{:?}", met.offset);
        assert!(met.normal.dot(&direction) < -1.0 + 1e-9, "both sides press alike");
    }

    #[test]
    fn a_tip_is_touched_at_the_tip() {
        let body = cuboid(Vector::repeat(0.03));
        let direction = -Direction::new_normalize(Vector::repeat(1.0));
        let tip = Point::new(0.03, 0.03, 0.03);
        let aside = Vector::new(0.003, -0.003, 0.0);
        let met = meet(&body, tip + aside - 0.01 * direction.into_inner(), &direction, 0.03).unwrap();
        assert!((pressed_at(&met, direction) - tip).norm() < 1e-9);
        assert!((met.centre - (tip + aside)).norm() < 1e-9);
    }

    #[test]
    fn a_face_that_stands_in_the_object_at_the_start_came_to_it_before() {
        let body = cuboid(Vector::new(0.03, 0.04, 0.05));
        // Only a corner of the face is in the object.
        let met = pushed_down(&body, Point::new(0.036, 0.0, 0.03)).unwrap();
        assert!(met.is_early && (met.centre - Point::new(0.036, 0.0, 0.05)).norm() < 1e-12, "{met:?}");
        assert!((met.swept_from - body.centre()).norm() > body.radius_m());
        // All of it is.
        let met = pushed_down(&body, Point::new(0.0, 0.0, 0.03)).unwrap();
        assert!(met.is_early && (met.centre.z - 0.05).abs() < 1e-12);
    }

    #[test]
    fn what_is_behind_a_free_face_or_beyond_the_end_is_not_met() {
        let body = cuboid(Vector::new(0.03, 0.04, 0.005));
        assert!(pushed_down(&body, Point::new(0.0, 0.0, -0.006)).is_none());
        assert!(pushed_down(&body, Point::new(0.0, 0.0, 0.1051)).is_none());
        assert!(pushed_down(&body, Point::new(0.0, 0.0, 0.1049)).is_some());
    }

    #[test]
    fn friction_lets_the_force_lean_by_sixteen_degrees_and_no_more() {
        let tilted = |degrees: f64| {
            let angle = degrees.to_radians();
            Direction::new_normalize(Vector::new(angle.sin(), 0.0, -angle.cos()))
        };
        assert_eq!(push_back(&tilted(16.0)), -Vector::z_axis());
        for degrees in [17.0, 30.0, 80.0] {
            let force = push_back(&tilted(degrees));
            assert!((force.angle(&tilted(degrees)).tan() - FRICTION).abs() < 1e-9);
            let leans = force.angle(&-Vector::z_axis()).to_degrees();
            assert!((leans - (degrees - FRICTION.atan().to_degrees())).abs() < 1e-9, "{leans}");
            assert!(force.x > 0.0 && force.y.abs() < 1e-12);
        }
    }
}
