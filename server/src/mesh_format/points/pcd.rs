//! PCD, as robots store clouds: text, binary or compressed, with x, y and z among any other fields.
//!
//! ```text
//! FIELDS rgb x y z      binary:             rgb0 x0 y0 z0 rgb1 x1 y1 z1 ...
//! SIZE 4 4 4 4          binary_compressed:  rgb0 rgb1 ... x0 x1 ... y0 y1 ... z0 z1 ..., by LZF
//! TYPE U F F F          ascii:              words in the order of binary
//! COUNT 1 1 1 1
//! ```

mod header;

use palpate_core::geometry::Point;

use super::column::{self, Column};
use super::lzf;
use super::text::{HeaderLines, Tokens};
use crate::limits::CLOUD_BYTES;
use header::{Data, Header};

/// The points of a file with the place that they were seen from, where it says one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pcd {
    /// Not finite ones included.
    pub(super) points: Vec<Point>,
    pub(super) viewpoint: Option<Point>,
}

/// Reads a file in any of its three forms.
///
/// # Errors
/// The bytes are no such file, or promise more than they hold.
pub(super) fn read(bytes: &[u8]) -> Result<Pcd, String> {
    let mut lines = HeaderLines::new(bytes);
    let (header, data) = header::read(&mut lines)?;
    let count = header.count()?;
    let axes = header.axes()?;
    let body = lines.rest();
    let points = match data {
        Data::Ascii => read_ascii(&header, axes, count, Tokens::new(body, lines.line() + 1)),
        Data::Binary => read_columns(&header.columns(axes, None), body, count),
        Data::Compressed => {
            let body = decompress(body, count.checked_mul(header.point_bytes()))?;
            read_columns(&header.columns(axes, Some(count)), &body, count)
        }
    };
    Ok(Pcd { points: points?, viewpoint: header.viewpoint })
}

fn read_ascii(
    header: &Header,
    axes: [usize; 3],
    count: usize,
    mut tokens: Tokens,
) -> Result<Vec<Point>, String> {
    // Each number takes a digit, and a blank but for the last one.
    let words: usize = header.fields.iter().map(|field| field.count).sum();
    let least = count.checked_mul(2 * words);
    if least.is_none_or(|least| least > tokens.bytes() + 1) {
        return Err(too_few(count, tokens.bytes()));
    }
    let mut points = Vec::with_capacity(count);
    for index in 0..count {
        let mut point = Point::origin();
        for (place, field) in header.fields.iter().enumerate() {
            let read = match axes.iter().position(|&axis| axis == place) {
                Some(axis) => tokens.number(field.size == 8).map(|number| point[axis] = number),
                None => (0..field.count).try_for_each(|_| tokens.word().map(drop)),
            };
            read.map_err(|reason| format!("point {index} of {count} in the PCD file: {reason}"))?;
        }
        points.push(point);
    }
    Ok(points)
}

fn read_columns(columns: &[Column; 3], body: &[u8], count: usize) -> Result<Vec<Point>, String> {
    // Three coordinates of 4 bytes are the least that a point takes.
    if count.checked_mul(12).is_none_or(|least| least > body.len()) {
        return Err(too_few(count, body.len()));
    }
    let mut points = Vec::with_capacity(count);
    column::read(columns, body, count, &mut points).ok_or_else(|| too_few(count, body.len()))?;
    Ok(points)
}

fn too_few(count: usize, bytes: usize) -> String {
    format!("the PCD header declares {count} points, but only {bytes} bytes follow it")
}

/// What follows the header of a compressed file: two lengths, then LZF of `wanted` bytes.
fn decompress(body: &[u8], wanted: Option<usize>) -> Result<Vec<u8>, String> {
    let length = |at: usize| {
        let bytes = body.get(at..)?.first_chunk::<4>()?;
        usize::try_from(u32::from_le_bytes(*bytes)).ok()
    };
    let (Some(compressed), Some(length)) = (length(0), length(4)) else {
        return Err("the PCD file ends before the lengths of its compressed data".into());
    };
    if length > CLOUD_BYTES {
        return Err(format!("{length} bytes of points, decompressed, are over the limit of {CLOUD_BYTES}"));
    }
    if wanted != Some(length) {
        return Err(format!(
            "the compressed data are {length} bytes, which is not what the PCD header declares"
        ));
    }
    let data = body[8..].get(..compressed);
    let data = data.ok_or_else(|| {
        format!("the PCD file promises {compressed} compressed bytes and has {}", body.len() - 8)
    })?;
    lzf::decompress(data, length).map_err(|reason| format!("the PCD file cannot be decompressed: {reason}"))
}

#[cfg(test)]
mod tests;
