//! `sensor_msgs/PointCloud2` in any layout to points.
//!
//! x, y and z may be 32- or 64-bit floats at any offsets, in either byte order, in rows with padding, organised or not.
//! Points with a NaN or an infinity are left out: organised clouds have one where nothing was measured.

use nalgebra::{Isometry3, Point3};

use crate::messages::{PointCloud2, datatype};

/// Points of a cloud, in metres, in the frame of its header.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// Those that are finite.
    pub points: Vec<Point3<f64>>,
    /// How many were not.
    pub non_finite: usize,
}

/// Reads a cloud.
///
/// # Errors
/// Names the field of the message that is wrong, and what would be right.
pub fn read(cloud: &PointCloud2) -> Result<Points, String> {
    let (width, height) = (cloud.width as usize, cloud.height as usize);
    let (point_step, row_step) = (cloud.point_step as usize, cloud.row_step as usize);
    if width == 0 || height == 0 {
        return Err(format!("width is {width} and height {height}: the cloud has no points"));
    }
    let coordinates = ["x", "y", "z"].map(|name| Coordinate::find(cloud, name));
    let [x, y, z] = coordinates;
    let coordinates = [x?, y?, z?];
    let row_bytes = width.checked_mul(point_step).ok_or("point_step times width is beyond all memory")?;
    // Some drivers leave row_step at 0 where there is one row.
    let row_step = if row_step == 0 { row_bytes } else { row_step };
    if row_step < row_bytes {
        return Err(format!("row_step is {row_step}, less than the {row_bytes} bytes of {width} points"));
    }
    let needed = (height - 1).checked_mul(row_step).and_then(|bytes| bytes.checked_add(row_bytes));
    if needed.is_none_or(|needed| cloud.data.len() < needed) {
        let have = cloud.data.len();
        return Err(format!(
            "data has {have} bytes, too few for {height} rows of {width} points: was it cut?"
        ));
    }
    let mut points = Vec::with_capacity(width * height);
    for row in cloud.data.chunks(row_step).take(height) {
        for point in row[..row_bytes].chunks_exact(point_step) {
            let position = coordinates.map(|coordinate| coordinate.read(point, cloud.is_bigendian));
            if position.iter().all(|part| part.is_finite()) {
                points.push(Point3::from(position));
            }
        }
    }
    let non_finite = width * height - points.len();
    Ok(Points { points, non_finite })
}

/// Where one coordinate is in a point.
#[derive(Debug, Clone, Copy)]
struct Coordinate {
    offset: usize,
    is_double: bool,
}

impl Coordinate {
    fn find(cloud: &PointCloud2, name: &str) -> Result<Self, String> {
        let field = cloud.fields.iter().find(|field| field.name == name).ok_or_else(|| {
            let names: Vec<_> = cloud.fields.iter().map(|field| field.name.as_str()).collect();
            format!("fields has no {name:?}, only [{}]: give a cloud with x, y and z", names.join(", "))
        })?;
        let is_double = match field.datatype {
            datatype::FLOAT32 => false,
            datatype::FLOAT64 => true,
            other => {
                return Err(format!(
                    "fields: {name:?} has datatype {other}; a coordinate is FLOAT32 (7) or FLOAT64 (8)"
                ));
            }
        };
        let (offset, size) = (field.offset as usize, if is_double { 8 } else { 4 });
        if offset + size > cloud.point_step as usize {
            return Err(format!(
                "fields: {name:?} begins at byte {offset} of a point, and point_step is {}",
                cloud.point_step
            ));
        }
        Ok(Self { offset, is_double })
    }

    fn read(self, point: &[u8], is_bigendian: bool) -> f64 {
        if self.is_double {
            let bytes = array::<8>(point, self.offset);
            if is_bigendian { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) }
        } else {
            let bytes = array::<4>(point, self.offset);
            f64::from(if is_bigendian { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) })
        }
    }
}

/// `N` bytes from an offset on, which was checked.
fn array<const N: usize>(bytes: &[u8], offset: usize) -> [u8; N] {
    std::array::from_fn(|at| bytes[offset + at])
}

/// The points in another frame.
pub fn transformed(points: &[Point3<f64>], target_from_source: &Isometry3<f64>) -> Vec<[f64; 3]> {
    points.iter().map(|point| (target_from_source * point).coords.into()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::PointField;

    const NAN: f64 = f64::NAN;

    /// Four points in two rows, with z first, a hole before it, four bytes after each point and some after each row.
    fn organised(is_double: bool, is_bigendian: bool, row_padding: usize) -> PointCloud2 {
        let size: u32 = if is_double { 8 } else { 4 };
        let offsets = [2 * size + 3, size + 3, 3];
        let point_step = 3 * size + 7;
        let mut data = Vec::new();
        for row in [[[0.1, 0.2, 0.3], [NAN, NAN, NAN]], [[-1.0, 2.0, 0.5], [0.0, f64::INFINITY, 1.0]]] {
            for point in row {
                let mut bytes = vec![0xee; point_step as usize];
                for (value, offset) in point.into_iter().zip(offsets) {
                    let value: f64 = value;
                    let packed = match (is_double, is_bigendian) {
                        (true, true) => value.to_be_bytes().to_vec(),
                        (true, false) => value.to_le_bytes().to_vec(),
                        (false, true) => (value as f32).to_be_bytes().to_vec(),
                        (false, false) => (value as f32).to_le_bytes().to_vec(),
                    };
                    bytes[offset as usize..offset as usize + packed.len()].copy_from_slice(&packed);
                }
                data.extend(bytes);
            }
            data.extend(vec![0xdd; row_padding]);
        }
        let datatype = if is_double { datatype::FLOAT64 } else { datatype::FLOAT32 };
        let fields = ["x", "y", "z"].into_iter().zip(offsets).map(|(name, offset)| PointField {
            name: name.to_owned(),
            offset,
            datatype,
            count: 1,
        });
        PointCloud2 {
            height: 2,
            width: 2,
            fields: fields.collect(),
            is_bigendian,
            point_step,
            row_step: 2 * point_step + row_padding as u32,
            data,
            ..PointCloud2::default()
        }
    }

    #[test]
    fn every_layout_of_the_same_points_is_read_alike() {
        for is_double in [false, true] {
            for is_bigendian in [false, true] {
                for row_padding in [0, 5] {
                    let Points { points, non_finite } =
                        read(&organised(is_double, is_bigendian, row_padding)).unwrap();
                    assert_eq!((points.len(), non_finite), (2, 2));
                    assert!((points[0] - Point3::new(0.1, 0.2, 0.3)).norm() < 1e-7);
                    assert_eq!(points[1], Point3::new(-1.0, 2.0, 0.5));
                }
            }
        }
    }

    #[test]
    fn padding_after_the_last_row_may_be_left_out_and_a_missing_row_step_is_that_of_the_points() {
        let mut cloud = organised(false, false, 5);
        cloud.data.truncate(cloud.data.len() - 5);
        assert_eq!(read(&cloud).unwrap().points.len(), 2);
        let mut cloud = organised(false, false, 0);
        cloud.row_step = 0;
        assert_eq!(read(&cloud).unwrap().points.len(), 2);
    }

    #[test]
    fn what_is_wrong_is_named_by_field() {
        let wrong = |change: fn(&mut PointCloud2)| {
            let mut cloud = organised(false, false, 0);
            change(&mut cloud);
            read(&cloud).unwrap_err()
        };
        assert!(wrong(|cloud| cloud.data.truncate(70)).starts_with("data has 70 bytes"));
        assert!(wrong(|cloud| cloud.point_step = 9).contains("point_step is 9"));
        assert!(wrong(|cloud| cloud.row_step = 9).starts_with("row_step is 9"));
        assert!(wrong(|cloud| cloud.fields[1].datatype = datatype::INT16).contains("\"y\" has datatype 3"));
        assert!(
            wrong(|cloud| cloud.fields[2].name = "depth".to_owned()).contains("no \"z\", only [x, y, depth]")
        );
        assert!(wrong(|cloud| cloud.width = 0).contains("no points"));
        assert!(
            wrong(|cloud| (cloud.width, cloud.point_step) = (u32::MAX, u32::MAX))
                .starts_with("row_step is 38")
        );
    }
}
