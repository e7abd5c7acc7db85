//! The numbers of a depth image, row by row, as they are stored.

use palpate_core::error::FieldError;

use super::png;
use crate::limits::DEPTH_PIXELS;

/// How an image is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Little-endian 16-bit numbers, row by row from the top left.
    U16Le,
    /// A PNG file, 16-bit greyscale.
    Png,
}

/// Depths in stored units; 0 where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Values {
    pub(super) width: usize,
    pub(super) height: usize,
    values: Vec<u16>,
}

impl Values {
    /// The image in `bytes`, of the size that the caller says or that the file says.
    ///
    /// # Errors
    /// Bytes that are none, of another size, or of too many pixels; the error names the field.
    pub(super) fn read(
        encoding: Encoding,
        width: usize,
        height: usize,
        bytes: &[u8],
    ) -> Result<Self, FieldError> {
        match encoding {
            Encoding::U16Le => {
                let pixels = check_size(width, height)?;
                if bytes.len() != 2 * pixels {
                    let reason = format!(
                        "{} bytes are not {width} x {height} pixels of 2 bytes, which are {}",
                        bytes.len(),
                        2 * pixels
                    );
                    return Err(FieldError::invalid("points", reason));
                }
                let (pairs, _) = bytes.as_chunks::<2>();
                let values = pairs.iter().copied().map(u16::from_le_bytes).collect();
                Ok(Self { width, height, values })
            }
            Encoding::Png => {
                let image = png::read(bytes, |found_width, found_height| {
                    agree("depth.width", width, found_width)?;
                    agree("depth.height", height, found_height)?;
                    check_size(found_width, found_height)
                })?;
                Ok(Self { width: image.width, height: image.height, values: image.values })
            }
        }
    }

    /// The stored number of a pixel, which must be within the image.
    pub(super) fn at(&self, column: usize, row: usize) -> u16 {
        self.values[row * self.width + column]
    }
}

/// The number of pixels, if an image of this size is taken.
fn check_size(width: usize, height: usize) -> Result<usize, FieldError> {
    for (field, pixels) in [("depth.width", width), ("depth.height", height)] {
        if pixels == 0 {
            return Err(FieldError::invalid(field, "is missing: say how many pixels the image has"));
        }
    }
    match width.checked_mul(height) {
        Some(pixels) if pixels <= DEPTH_PIXELS => Ok(pixels),
        _ => {
            let reason = format!(
                "{width} x {height} pixels are over the limit of {DEPTH_PIXELS}: send a smaller image, or a part of it \
                 with cx and cy moved by as much"
            );
            Err(FieldError::invalid("depth.width", reason))
        }
    }
}

fn agree(field: &'static str, said: usize, found: usize) -> Result<(), FieldError> {
    if said == 0 || said == found {
        return Ok(());
    }
    let reason =
        format!("{said} is not what the PNG file has, {found}: leave it out, or send the other image");
    Err(FieldError::invalid(field, reason))
}
