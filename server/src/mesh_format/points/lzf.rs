//! LZF, the compression of PCD files: literal runs, and copies of what came at most 8 KiB before.
//!
//! The format is that of LibLZF. A decoder is these few lines, so it is no dependency.

/// A byte below this begins a literal run, one longer than it says.
const LITERAL: u8 = 32;
/// The length that another byte adds to.
const LONG: usize = 7;

/// Decompresses to exactly `length` bytes; the caller has bounded it.
///
/// # Errors
/// The bytes give more or fewer, or refer to what was before the first one.
pub(super) fn decompress(mut bytes: &[u8], length: usize) -> Result<Vec<u8>, String> {
    let mut out = Vec::with_capacity(length);
    let early = || "the compressed bytes end too early".to_owned();
    while let Some((&control, rest)) = bytes.split_first() {
        if control < LITERAL {
            let (run, rest) = rest.split_at_checked(usize::from(control) + 1).ok_or_else(early)?;
            out.extend_from_slice(run);
            bytes = rest;
        } else {
            let mut rest = rest.iter();
            let mut next = || rest.next().map(|&byte| usize::from(byte)).ok_or_else(early);
            let short = usize::from(control >> 5);
            let copied = 2 + if short == LONG { LONG + next()? } else { short };
            let back = 1 + (usize::from(control & 0x1f) << 8) + next()?;
            let from = out.len().checked_sub(back).ok_or("a copy from before the first byte")?;
            if out.len() + copied > length {
                return Err(format!("there are more than the declared {length} bytes"));
            }
            // What is copied may overlap what it makes.
            (from..from + copied).for_each(|index| out.push(out[index]));
            bytes = rest.as_slice();
        }
        if out.len() > length {
            return Err(format!("there are more than the declared {length} bytes"));
        }
    }
    if out.len() == length {
        Ok(out)
    } else {
        Err(format!("there are {} of the declared {length} bytes", out.len()))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::{any, proptest};

    use super::*;

    /// A plain compressor: copies where the last three bytes came before, literals elsewhere.
    pub(in super::super) fn compress(bytes: &[u8]) -> Vec<u8> {
        let (mut out, mut literals, mut at) = (Vec::new(), Vec::new(), 0);
        let flush = |literals: &mut Vec<u8>, out: &mut Vec<u8>| {
            for run in literals.chunks(32) {
                out.push(run.len() as u8 - 1);
                out.extend_from_slice(run);
            }
            literals.clear();
        };
        while at < bytes.len() {
            let same = |from: usize| {
                (0..264).take_while(|&i| at + i < bytes.len() && bytes[from + i] == bytes[at + i]).count()
            };
            let best = (at.saturating_sub(64)..at).map(|from| (same(from), from)).max();
            match best.filter(|&(length, _)| length >= 3) {
                Some((length, from)) => {
                    flush(&mut literals, &mut out);
                    let (back, length) = (at - from - 1, length - 2);
                    out.push((length.min(7) as u8) << 5 | (back >> 8) as u8);
                    if length >= 7 {
                        out.push(length as u8 - 7);
                    }
                    out.push(back as u8);
                    at += length + 2;
                }
                None => {
                    literals.push(bytes[at]);
                    at += 1;
                }
            }
        }
        flush(&mut literals, &mut out);
        out
    }

    #[test]
    fn a_known_stream_is_decompressed() {
        // "abc", then 9 bytes from 3 before, which overlap themselves, then "!".
        let stream = [2, b'a', b'b', b'c', 7 << 5, 0, 2, 0, b'!'];
        assert_eq!(decompress(&stream, 13).unwrap(), b"abcabcabcabc!");
        assert!(decompress(&stream, 12).unwrap_err().contains("more than the declared 12"));
        assert!(decompress(&stream, 14).unwrap_err().contains("13 of the declared 14"));
        assert!(decompress(&[1 << 5, 0], 3).unwrap_err().contains("before the first byte"));
        assert!(decompress(&[31, 0], 32).unwrap_err().contains("too early"));
    }

    #[test]
    fn copies_stop_at_the_declared_length() {
        let bomb: Vec<u8> = [[0, b'x'].as_slice(), [[7 << 5, 255, 0]; 1000].as_flattened()].concat();
        assert!(decompress(&bomb, 1000).unwrap_err().contains("more than the declared 1000"));
    }

    proptest! {
        #[test]
        fn what_was_compressed_comes_back(bytes in proptest::collection::vec(0_u8..4, 0..2000)) {
            assert_eq!(decompress(&compress(&bytes), bytes.len()).unwrap(), bytes);
        }

        #[test]
        fn any_bytes_give_an_answer(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = decompress(&bytes, 1000);
        }
    }
}
