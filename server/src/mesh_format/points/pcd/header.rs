//! The header of a PCD file: what every point has, how many there are, and where they were seen from.

use palpate_core::geometry::{Point, Vector};

use crate::limits::{CLOUD_BYTES, FILE_PROPERTIES};
use crate::mesh_format::points::column::Column;
use crate::mesh_format::points::text::HeaderLines;

/// A part of every point.
#[derive(Clone, Debug, Default)]
pub(super) struct Field {
    pub(super) name: String,
    /// Bytes of one number.
    pub(super) size: usize,
    /// `I`, `U` or `F`.
    pub(super) kind: String,
    /// How many numbers.
    pub(super) count: usize,
}

/// What comes before the points; `WIDTH`, `HEIGHT` and `POINTS` are as the file has them.
#[derive(Clone, Debug, Default)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    width: Option<usize>,
    height: Option<usize>,
    points: Option<usize>,
    pub(super) viewpoint: Option<Point>,
}

/// How the points follow the header.
#[derive(Clone, Copy, Debug)]
pub(super) enum Data {
    Ascii,
    Binary,
    Compressed,
}

/// Reads up to the line that says how the points follow.
///
/// # Errors
/// A line that PCD does not have, or that says something impossible.
pub(super) fn read(lines: &mut HeaderLines) -> Result<(Header, Data), String> {
    let mut header = Header::default();
    loop {
        let line = lines.next()?.ok_or("no PCD header: it ends before a line 'DATA'")?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let read = match *words.as_slice() {
            [] => Ok(()),
            [comment, ..] if comment.starts_with('#') => Ok(()),
            ["VERSION", ..] => Ok(()),
            ["FIELDS" | "COLUMNS", ref names @ ..] => header.set_fields(names),
            ["SIZE", ref sizes @ ..] => header.set_each(sizes, |field, word| {
                field.size = word.parse().ok().filter(|size| [1, 2, 4, 8].contains(size))?;
                Some(())
            }),
            ["TYPE", ref kinds @ ..] => header.set_each(kinds, |field, word| {
                field.kind = word.to_owned();
                ["I", "U", "F"].contains(&word).then_some(())
            }),
            ["COUNT", ref counts @ ..] => header.set_each(counts, |field, word| {
                field.count = word.parse().ok().filter(|count| *count <= CLOUD_BYTES)?;
                Some(())
            }),
            ["WIDTH", width] => set(&mut header.width, width),
            ["HEIGHT", height] => set(&mut header.height, height),
            ["POINTS", points] => set(&mut header.points, points),
            ["VIEWPOINT", ref numbers @ ..] => viewpoint(numbers).map(|point| header.viewpoint = point),
            ["DATA", "ascii"] => return Ok((header, Data::Ascii)),
            ["DATA", "binary"] => return Ok((header, Data::Binary)),
            ["DATA", "binary_compressed"] => return Ok((header, Data::Compressed)),
            _ => Err("is none that PCD has".into()),
        };
        read.map_err(|reason: String| {
            let quoted: String = line.chars().take(60).collect();
            format!("no PCD header: line {} {quoted:?}: {reason}", lines.line())
        })?;
    }
}

fn set(number: &mut Option<usize>, word: &str) -> Result<(), String> {
    *number = Some(word.parse().map_err(|_| "is not a number of points")?);
    Ok(())
}

/// `x y z qw qx qy qz` of the sensor; what was not set is the identity, and says nothing.
fn viewpoint(words: &[&str]) -> Result<Option<Point>, String> {
    let numbers: Vec<f64> = words.iter().filter_map(|word| word.parse().ok()).collect();
    match *numbers.as_slice() {
        [x, y, z, qw, qx, qy, qz] if words.len() == 7 => {
            let is_identity = [x, y, z, qx, qy, qz] == [0.0; 6] && qw == 1.0;
            // A sensor whose place is unknown is written as NaN.
            let is_known = !is_identity && [x, y, z].iter().all(|x| x.is_finite());
            Ok(is_known.then(|| Point::from(Vector::new(x, y, z))))
        }
        _ => Err("is not a place and a quaternion, 7 numbers".into()),
    }
}

impl Header {
    fn set_fields(&mut self, names: &[&str]) -> Result<(), String> {
        if names.len() > FILE_PROPERTIES {
            return Err(format!("there are more than {FILE_PROPERTIES} fields, the limit"));
        }
        let field = |name: &&str| Field { name: (*name).to_owned(), count: 1, ..Field::default() };
        self.fields = names.iter().map(field).collect();
        Ok(())
    }

    /// Takes one word for each field.
    fn set_each(
        &mut self,
        words: &[&str],
        set: impl Fn(&mut Field, &str) -> Option<()>,
    ) -> Result<(), String> {
        let count = self.fields.len();
        if words.len() != count {
            return Err(format!("there are {count} FIELDS, each has one"));
        }
        self.fields
            .iter_mut()
            .zip(words)
            .try_for_each(|(field, word)| set(field, word))
            .ok_or_else(|| "is none that PCD has".into())
    }

    /// How many points there are.
    pub(super) fn count(&self) -> Result<usize, String> {
        let area = match (self.width, self.height) {
            (Some(width), height) => width.checked_mul(height.unwrap_or(1)),
            (None, _) => None,
        };
        match (self.points, area) {
            (Some(points), Some(area)) if points != area => {
                Err(format!("the PCD header declares {points} POINTS, but WIDTH * HEIGHT is {area}"))
            }
            (Some(count), _) | (None, Some(count)) => Ok(count),
            (None, None) => Err("the PCD header does not say how many POINTS there are".into()),
        }
    }

    /// Which fields are x, y and z.
    pub(super) fn axes(&self) -> Result<[usize; 3], String> {
        let axis = |name: &str| {
            let index = self.fields.iter().position(|field| field.name == name);
            let found = index.map(|index| (index, &self.fields[index]));
            match found {
                Some((index, field)) if field.kind == "F" && field.size >= 4 && field.count == 1 => Ok(index),
                _ => Err(format!("the PCD file needs a field '{name}' of TYPE F and SIZE 4 or 8")),
            }
        };
        let axes = [axis("x")?, axis("y")?, axis("z")?];
        match self.fields.iter().find(|field| field.size == 0) {
            Some(field) => Err(format!("the PCD header has no SIZE of field {:?}", field.name)),
            None => Ok(axes),
        }
    }

    /// Bytes of one point.
    pub(super) fn point_bytes(&self) -> usize {
        self.fields.iter().map(|field| field.size * field.count).sum()
    }

    /// Where the coordinates are: in each point, or with `apart` points, each field by itself.
    pub(super) fn columns(&self, axes: [usize; 3], apart: Option<usize>) -> [Column; 3] {
        axes.map(|axis| {
            let before: usize = self.fields[..axis].iter().map(|field| field.size * field.count).sum();
            let size = self.fields[axis].size;
            let (offset, step) = match apart {
                None => (before, self.point_bytes()),
                Some(count) => (before * count, size),
            };
            Column { offset, step, is_double: size == 8, is_bigendian: false }
        })
    }
}
