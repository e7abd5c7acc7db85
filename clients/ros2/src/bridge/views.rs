//! Clouds and depth images as views of the object.

use nalgebra::Isometry3;
use palpate_client::proto::v1::{PointEncoding, VisualPrior};
use palpate_client::visual_prior;

use super::{Bridge, Unready};
use crate::messages::{CameraInfo, Image, PointCloud2, Pose, frame};
use crate::outbox::Command;
use crate::{cloud, depth};

/// A view of fewer points is refused by the server, whose words know nothing of a crop.
const LEAST_POINTS: usize = 4;

impl Bridge {
    pub(super) fn cloud(&self, message: &PointCloud2) -> Result<Command, Unready> {
        let stamp_ns = message.header.stamp.as_ns();
        let (base, source) = (frame(&self.parameters.frame_id), frame(&message.header.frame_id));
        if source.is_empty() {
            return Err(Unready::Wrong("header.frame_id is empty: set it to the camera's frame".to_owned()));
        }
        let cloud::Points { points, non_finite } = cloud::read(message).map_err(Unready::Wrong)?;
        let base_from_source = self.transforms.lookup(base, source, stamp_ns)?;
        let mut in_base = cloud::transformed(&points, &base_from_source);
        in_base.retain(|point| self.parameters.crop.has(point));
        if in_base.len() < LEAST_POINTS {
            return Err(Unready::Wrong(format!(
                "{} of its points are finite and inside of crop, {non_finite} are NaN: at least {LEAST_POINTS} are needed",
                in_base.len()
            )));
        }
        let viewpoint = self.viewpoint(source, &base_from_source, stamp_ns)?;
        Ok(self.view(visual_prior(&in_base, viewpoint), message.header.stamp.to_proto()))
    }

    /// Where the camera is in the session's frame. A cloud that comes in that frame already does not say it.
    fn viewpoint(
        &self,
        source: &str,
        base_from_source: &Isometry3<f64>,
        stamp_ns: i64,
    ) -> Result<Option<[f64; 3]>, Unready> {
        let (base, camera) = (frame(&self.parameters.frame_id), frame(&self.parameters.camera_frame));
        if !camera.is_empty() {
            let base_from_camera = self.transforms.lookup(base, camera, stamp_ns)?;
            return Ok(Some(base_from_camera.translation.vector.into()));
        }
        Ok((source != base).then(|| base_from_source.translation.vector.into()))
    }

    pub(super) fn depth_image(&self, image: &Image, camera: &CameraInfo) -> Result<Command, Unready> {
        let source = [&image.header.frame_id, &camera.header.frame_id].map(|name| frame(name));
        let Some(source) = source.into_iter().find(|source| !source.is_empty()) else {
            let nameless = "header.frame_id is empty: set it to the camera's optical frame";
            return Err(Unready::Wrong(nameless.to_owned()));
        };
        let (values, mut depth) = depth::read(image, camera).map_err(Unready::Wrong)?;
        let stamp_ns = image.header.stamp.as_ns();
        let base_from_camera = self.transforms.lookup(&self.parameters.frame_id, source, stamp_ns)?;
        if !self.parameters.crop.is_everywhere() {
            depth.mask_u8 = self.parameters.crop.mask(&values, &depth, &base_from_camera).into();
        }
        depth.base_from_camera = Some(Pose::from_isometry(&base_from_camera).to_proto());
        (depth.min_depth_m, depth.max_depth_m) = (self.parameters.depth.min_m, self.parameters.depth.max_m);
        let prior = VisualPrior {
            encoding: PointEncoding::DepthU16.into(),
            points: values.into(),
            depth: Some(depth),
            ..Default::default()
        };
        Ok(self.view(prior, image.header.stamp.to_proto()))
    }

    fn view(&self, prior: VisualPrior, captured: palpate_client::proto::Timestamp) -> Command {
        let voxel_m = Some(self.parameters.voxel_m).filter(|&edge| edge > 0.0);
        Command::View(Box::new(VisualPrior { voxel_m, capture_time: Some(captured), ..prior }))
    }
}
