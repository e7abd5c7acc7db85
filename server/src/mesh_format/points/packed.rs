//! Points of a fixed size in bytes with x, y, z somewhere in each, as in `sensor_msgs/PointCloud2`.

use palpate_core::error::FieldError;
use palpate_core::geometry::Point;

use super::column::{self, Column};

/// Where x, y and z are in each point: within it, and beside each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    columns: [Column; 3],
    point_step: usize,
    /// Points in a row with the bytes that it takes, where rows are padded.
    rows: Option<(usize, usize)>,
}

/// A layout as somebody declares it, in bytes and points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Declared {
    pub(crate) point_step: u32,
    /// Where x, y and z begin in a point.
    pub(crate) offsets: [u32; 3],
    /// 64-bit floats, not 32-bit ones.
    pub(crate) is_double: bool,
    pub(crate) is_bigendian: bool,
    /// Points in a row; 0 where all are one row.
    pub(crate) width: u32,
    /// Bytes from one row to the next; 0 where rows have no padding.
    pub(crate) row_step: u32,
}

impl Layout {
    /// Little-endian `f32` x, y, z, x, y, z, ...
    pub(super) const XYZ_F32_LE: Self =
        Self { columns: [column(0), column(4), column(8)], point_step: 12, rows: None };

    /// # Errors
    /// Numbers that do not fit into each other; the error names the field of `PackedPoints`.
    pub(crate) fn new(declared: &Declared) -> Result<Self, FieldError> {
        let &Declared { point_step, offsets, is_double, is_bigendian, width, row_step } = declared;
        let size = if is_double { 8 } else { 4 };
        let fields = ["packed.x_offset", "packed.y_offset", "packed.z_offset"];
        if point_step < 3 * size {
            let reason = format!("{point_step} bytes have no room for x, y and z of {size} bytes each");
            return Err(FieldError::invalid("packed.point_step", reason));
        }
        for (axis, offset) in offsets.into_iter().enumerate() {
            if offset > point_step - size {
                let reason =
                    format!("{size} bytes from {offset} on are not within a point of {point_step} bytes");
                return Err(FieldError::invalid(fields[axis], reason));
            }
            if let Some(other) = offsets[..axis].iter().find(|other| other.abs_diff(offset) < size) {
                let reason = format!(
                    "{size} bytes from {offset} on are in part those from {other} on: each coordinate has its own"
                );
                return Err(FieldError::invalid(fields[axis], reason));
            }
        }
        let columns = offsets.map(|offset| Column {
            offset: offset as usize,
            step: point_step as usize,
            is_double,
            is_bigendian,
        });
        let rows = rows(point_step, width, row_step)?;
        Ok(Self { columns, point_step: point_step as usize, rows })
    }

    /// The points, not finite ones included.
    ///
    /// # Errors
    /// The bytes break off inside a point or a row.
    pub(super) fn read(&self, bytes: &[u8]) -> Result<Vec<Point>, String> {
        let Some((width, row_step)) = self.rows else {
            return self.read_row(bytes);
        };
        let row_bytes = width * self.point_step;
        // The padding of the last row may be missing.
        let last = bytes.len() % row_step;
        if last != 0 && last < row_bytes {
            let whole = bytes.len() / row_step;
            return Err(format!(
                "{} bytes are no whole number of rows: after {whole} rows of {row_step} bytes {last} bytes are left, \
                 fewer than {width} points take",
                bytes.len()
            ));
        }
        let mut points = Vec::with_capacity(bytes.len().div_ceil(row_step) * width);
        for row in bytes.chunks(row_step) {
            points.extend(self.read_row(&row[..row_bytes])?);
        }
        Ok(points)
    }

    fn read_row(&self, bytes: &[u8]) -> Result<Vec<Point>, String> {
        let (count, step) = (bytes.len() / self.point_step, self.point_step);
        let mut points = Vec::with_capacity(count);
        let whole = bytes.len().is_multiple_of(step);
        match column::read(&self.columns, bytes, count, &mut points) {
            Some(()) if whole => Ok(points),
            _ => Err(format!(
                "{} bytes are no whole number of points: each takes {step} bytes{}",
                bytes.len(),
                if *self == Self::XYZ_F32_LE { ", x, y, z as f32" } else { "" }
            )),
        }
    }
}

const fn column(offset: usize) -> Column {
    Column { offset, step: 12, is_double: false, is_bigendian: false }
}

/// The points and bytes of a row where rows are padded.
fn rows(point_step: u32, width: u32, row_step: u32) -> Result<Option<(usize, usize)>, FieldError> {
    if row_step == 0 {
        return Ok(None);
    }
    if width == 0 {
        let reason = "is missing: with row_step, say how many points a row has";
        return Err(FieldError::invalid("packed.width", reason));
    }
    if u64::from(width) * u64::from(point_step) > u64::from(row_step) {
        let reason = format!("{row_step} bytes have no room for {width} points of {point_step} bytes");
        return Err(FieldError::invalid("packed.row_step", reason));
    }
    Ok(Some((width as usize, row_step as usize)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64) -> Point {
        Point::new(x, -x, 2.0 * x)
    }

    #[test]
    fn coordinates_are_found_in_any_order_size_and_endianness() {
        let declared =
            Declared { point_step: 32, offsets: [20, 4, 12], is_double: true, ..Declared::default() };
        for is_bigendian in [false, true] {
            let layout = Layout::new(&Declared { is_bigendian, ..declared }).unwrap();
            let mut bytes = Vec::new();
            for i in 0..5 {
                let Point { coords } = point(0.1 * f64::from(i));
                bytes.extend([0xff; 4]);
                for x in [coords.y, coords.z, coords.x] {
                    bytes.extend(if is_bigendian { x.to_be_bytes() } else { x.to_le_bytes() });
                }
                bytes.extend([0xff; 4]);
            }
            let points = layout.read(&bytes).unwrap();
            assert_eq!(points, (0..5).map(|i| point(0.1 * f64::from(i))).collect::<Vec<_>>());
            assert!(layout.read(&bytes[1..]).unwrap_err().contains("whole number of points"));
        }
    }

    #[test]
    fn the_padding_of_rows_is_left_out_and_may_be_missing_at_the_end() {
        let declared =
            Declared { point_step: 16, offsets: [0, 4, 8], width: 2, row_step: 40, ..Declared::default() };
        let layout = Layout::new(&declared).unwrap();
        let bytes: Vec<u8> = (0..80_u8).map(|i| if i % 40 < 32 { 0 } else { 0xff }).collect();
        for length in [80, 72] {
            assert_eq!(layout.read(&bytes[..length]).unwrap(), [Point::origin(); 4]);
        }
        for length in [41, 71] {
            assert!(layout.read(&bytes[..length]).unwrap_err().contains("whole number of rows"));
        }
        assert_eq!(layout.read(&[]).unwrap(), []);
    }

    #[test]
    fn a_layout_that_cannot_be_is_refused_by_its_field() {
        let fine = Declared { point_step: 16, offsets: [0, 4, 8], ..Declared::default() };
        let field = |declared: Declared| Layout::new(&declared).unwrap_err().field;
        assert_eq!(field(Declared::default()), "packed.point_step");
        assert_eq!(field(Declared { is_double: true, ..fine }), "packed.point_step");
        assert_eq!(field(Declared { offsets: [0, 0, 8], ..fine }), "packed.y_offset");
        assert_eq!(field(Declared { offsets: [0, 4, 13], ..fine }), "packed.z_offset");
        assert_eq!(field(Declared { offsets: [u32::MAX, 4, 8], ..fine }), "packed.x_offset");
        assert_eq!(field(Declared { row_step: 64, ..fine }), "packed.width");
        assert_eq!(field(Declared { row_step: 64, width: 5, ..fine }), "packed.row_step");
        assert_eq!(field(Declared { row_step: 64, width: u32::MAX, ..fine }), "packed.row_step");
    }
}
