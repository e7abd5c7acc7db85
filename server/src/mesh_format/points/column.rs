//! One coordinate of all points, wherever it is in the bytes.

use palpate_core::geometry::Point;

/// A floating-point number in every point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Column {
    /// Where that of the first point begins.
    pub(super) offset: usize,
    /// Bytes from one point's to the next one's.
    pub(super) step: usize,
    /// 64 bits, not 32.
    pub(super) is_double: bool,
    pub(super) is_bigendian: bool,
}

impl Column {
    /// The number of point `index`; `None` where the bytes do not reach so far.
    fn value(&self, bytes: &[u8], index: usize) -> Option<f64> {
        let rest = bytes.get(index.checked_mul(self.step)?.checked_add(self.offset)?..)?;
        if self.is_double {
            let eight = *rest.first_chunk::<8>()?;
            Some(if self.is_bigendian { f64::from_be_bytes(eight) } else { f64::from_le_bytes(eight) })
        } else {
            let four = *rest.first_chunk::<4>()?;
            Some(f64::from(if self.is_bigendian {
                f32::from_be_bytes(four)
            } else {
                f32::from_le_bytes(four)
            }))
        }
    }
}

/// Appends `count` points; `None` where the bytes do not reach so far.
pub(super) fn read(columns: &[Column; 3], bytes: &[u8], count: usize, points: &mut Vec<Point>) -> Option<()> {
    for index in 0..count {
        let [x, y, z] = columns.map(|column| column.value(bytes, index));
        points.push(Point::new(x?, y?, z?));
    }
    Some(())
}
