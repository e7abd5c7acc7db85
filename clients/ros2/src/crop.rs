//! The box around the object, in the session's frame: what a camera sees outside of it is left out.

use nalgebra::{Isometry3, Point3};
use palpate_client::proto::v1::DepthImage;
use serde::Deserialize;

/// Two opposite corners of a box, in m, in the session's frame; both empty = everywhere.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Crop {
    /// The least x, y and z.
    pub min_m: Vec<f64>,
    /// The greatest x, y and z.
    pub max_m: Vec<f64>,
}

impl Crop {
    /// What is wrong with it, in words that name the parameter.
    pub(crate) fn problem(&self) -> Option<String> {
        let Self { min_m, max_m } = self;
        let is_box =
            min_m.len() == 3 && max_m.len() == 3 && min_m.iter().zip(max_m).all(|(min, max)| min < max);
        (!(self.is_everywhere() || is_box)).then(|| {
            "crop: min_m and max_m are x, y and z in m, each of min_m below that of max_m".to_owned()
        })
    }

    /// Whether nothing is left out.
    pub fn is_everywhere(&self) -> bool {
        self.min_m.is_empty() && self.max_m.is_empty()
    }

    /// Whether a point is inside.
    pub fn has(&self, point: &[f64; 3]) -> bool {
        let bounds = self.min_m.iter().zip(&self.max_m);
        bounds.zip(point).all(|((min, max), at)| (min..=max).contains(&at))
    }

    /// One octet for each pixel of a 16-bit depth image, not 0 where what it saw is inside.
    pub fn mask(&self, values: &[u8], depth: &DepthImage, base_from_camera: &Isometry3<f64>) -> Vec<u8> {
        let pixels = values.as_chunks::<2>().0.iter().map(|&pair| f64::from(u16::from_le_bytes(pair)));
        let is_inside = |(at, value): (usize, f64)| {
            let (row, column) = (at / depth.width as usize, at % depth.width as usize);
            let z = value * depth.depth_scale_m;
            let x = (column as f64 - depth.cx) / depth.fx * z;
            let y = (row as f64 - depth.cy) / depth.fy * z;
            let in_base = base_from_camera * Point3::new(x, y, z);
            u8::from(value > 0.0 && self.has(&in_base.coords.into()))
        };
        pixels.enumerate().map(is_inside).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    use super::*;

    fn crop() -> Crop {
        Crop { min_m: vec![-0.1, -0.1, 0.0], max_m: vec![0.1, 0.1, 0.3] }
    }

    #[test]
    fn points_inside_and_on_the_box_are_kept() {
        assert!(crop().has(&[0.0, 0.1, 0.3]));
        assert!(!crop().has(&[0.0, 0.1, -0.001]));
        assert!(Crop::default().has(&[9.0, 9.0, 9.0]));
    }

    #[test]
    fn the_mask_of_an_image_keeps_what_its_pixels_saw_inside() {
        // A camera half a metre above the frame's origin that looks down; 100 pixels are 45 degrees.
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let camera = Isometry3::from_parts(Translation3::new(0.0, 0.0, 0.5), down);
        let depth = DepthImage {
            width: 4,
            height: 1,
            fx: 100.0,
            fy: 100.0,
            cx: 0.5,
            cy: 0.5,
            depth_scale_m: 0.001,
            ..Default::default()
        };
        // On the box's floor, in the air above it, no measurement, below the floor.
        let values: Vec<u8> = [500_u16, 150, 0, 501].into_iter().flat_map(u16::to_le_bytes).collect();
        assert_eq!(crop().mask(&values, &depth, &camera), [1, 0, 0, 0]);
    }

    #[test]
    fn a_box_that_is_none_is_named() {
        assert_eq!((crop().problem(), Crop::default().problem()), (None, None));
        let inverted = Crop { min_m: crop().max_m, max_m: crop().min_m };
        assert!(inverted.problem().unwrap().contains("min_m"));
        assert!(Crop { min_m: vec![0.0], ..crop() }.problem().is_some());
    }
}
