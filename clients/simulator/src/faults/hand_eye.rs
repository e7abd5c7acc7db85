//! A camera that stands elsewhere, or looks elsewhere, than the robot believes.

use nalgebra::Rotation3;

use crate::camera::View;
use crate::random::{Stream, any_direction, generator};

/// Moves all that was seen, and the viewpoint with it, by `offset_m` in the direction that belongs to `seed`.
pub(crate) fn shift(view: &mut View, offset_m: f64, seed: u64) {
    // Nothing is added where nothing is wrong: even a zero has a sign to change.
    if offset_m == 0.0 {
        return;
    }
    let offset = offset_m * any_direction(&mut generator(seed, Stream::HandEye)).into_inner();
    view.viewpoint += offset;
    view.points.iter_mut().for_each(|point| *point += offset);
}

/// Turns all that was seen about the viewpoint by `angle` radians, about the axis that belongs to `seed`.
pub(crate) fn turn(view: &mut View, angle: f64, seed: u64) {
    if angle == 0.0 {
        return;
    }
    let axis = any_direction(&mut generator(seed, Stream::HandEyeTurn));
    let rotation = Rotation3::from_axis_angle(&axis, angle);
    let camera = view.viewpoint;
    view.points.iter_mut().for_each(|point| *point = camera + rotation * (*point - camera));
}

#[cfg(test)]
mod tests {
    use palpate_core::geometry::{Point, Vector};

    use super::super::Faults;
    use crate::camera::Camera;
    use crate::shapes;

    #[test]
    fn all_that_is_seen_is_off_by_the_same_vector_of_that_length_in_any_direction() {
        let body = shapes::generate("box").unwrap();
        let mut mean = Vector::zeros();
        for seed in 0..30 {
            let camera = Camera { depth_noise_m: 0.001, ..Camera::default() };
            let right = camera.look(&body, seed);
            let wrong = camera.look_with(&body, seed, &Faults { hand_eye_m: 0.008, ..Faults::default() });
            let offset = wrong.viewpoint - right.viewpoint;
            assert!((offset.norm() - 0.008).abs() < 1e-12);
            assert_eq!(right.points.len(), wrong.points.len());
            for (right, wrong) in right.points.iter().zip(&wrong.points) {
                assert!((wrong - right - offset).norm() < 1e-15);
            }
            mean += offset / 0.008 / 30.0;
        }
        assert!(mean.norm() < 0.5, "{mean}");
    }

    #[test]
    fn a_camera_that_looks_elsewhere_keeps_its_place_and_all_distances() {
        let body = shapes::generate("box").unwrap();
        let right = Camera::default().look(&body, 4);
        let faults = Faults { hand_eye_turn: 0.02, ..Faults::default() };
        let wrong = Camera::default().look_with(&body, 4, &faults);
        assert_eq!(right.viewpoint, wrong.viewpoint);
        let camera = right.viewpoint;
        let angle = |(right, wrong): (&Point, &Point)| {
            let (right, wrong) = (right - camera, wrong - camera);
            assert!((right.norm() - wrong.norm()).abs() < 1e-12);
            right.angle(&wrong)
        };
        let widest = right.points.iter().zip(&wrong.points).map(angle).fold(0.0, f64::max);
        assert!((0.002..=0.0201).contains(&widest), "{widest}");
    }
}
