//! Depth images as PNG files: 16-bit greyscale, decoded within bounds.

use std::io::Cursor;

use palpate_core::error::FieldError;
use png::{BitDepth, ColorType, Decoder, Limits};

use crate::limits::PNG_DECODER_BYTES;

/// A decoded file, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Image {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<u16>,
}

/// Decodes a file; `check` is asked about its width and height before anything is allocated for them.
///
/// # Errors
/// Bytes that are no such file (the error names the field `points`), or what `check` refuses.
pub(super) fn read(
    bytes: &[u8],
    check: impl FnOnce(usize, usize) -> Result<usize, FieldError>,
) -> Result<Image, FieldError> {
    let broken = |error: png::DecodingError| {
        FieldError::invalid("points", format!("the PNG file cannot be read: {error}"))
    };
    let limits = Limits { bytes: PNG_DECODER_BYTES };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let mut reader = decoder.read_info().map_err(broken)?;
    let info = reader.info();
    let (width, height) = (info.width as usize, info.height as usize);
    if (info.color_type, info.bit_depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
        let reason = format!(
            "the PNG file is {:?} of {} bits: a depth image is greyscale of 16 bits, its values depths and no colours",
            info.color_type, info.bit_depth as u8
        );
        return Err(FieldError::invalid("points", reason));
    }
    let pixels = check(width, height)?;
    let mut buffer = vec![0; 2 * pixels];
    reader.next_frame(&mut buffer).map_err(broken)?;
    let (pairs, _) = buffer.as_chunks::<2>();
    let values = pairs.iter().copied().map(u16::from_be_bytes).collect();
    Ok(Image { width, height, values })
}
