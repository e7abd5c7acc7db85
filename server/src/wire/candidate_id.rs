//! Candidate ids that carry what they stand for, so that the server need not remember what it proposed.
//!
//! `revision-vertex-payload.session`, the payload being point and normal as little-endian `f64` in URL-safe
//! base64, and `session` a tag of the session that proposed it. A candidate thus survives a restart, and aims
//! where it aimed when it was proposed. Ids of earlier versions have no tag.

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use palpate_core::evidence::Target;
use palpate_core::geometry::{Point, Vector};

/// What a candidate id stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CandidateId {
    /// The revision of the estimate that it was proposed from.
    pub(crate) revision: i64,
    /// The vertex of that revision's mesh.
    pub(crate) vertex: u32,
    /// Where it aims.
    pub(crate) target: Target,
    /// The tag of the session that proposed it; nothing in ids of earlier versions.
    pub(crate) session: Option<u32>,
}

/// Writes a candidate id.
pub(crate) fn encode(id: &CandidateId) -> String {
    let CandidateId { revision, vertex, target, session } = id;
    let tag = session.map_or_else(String::new, |session| format!(".{session:08x}"));
    let numbers = target.point().iter().chain(target.normal().iter());
    let bytes: Vec<u8> = numbers.flat_map(|number| number.to_le_bytes()).collect();
    format!("{revision}-{vertex}-{}{tag}", URL_SAFE_NO_PAD.encode(bytes))
}

/// Reads a candidate id; `None` for anything that [`encode`] does not write.
pub(crate) fn decode(text: &str) -> Option<CandidateId> {
    let (text, session) = match text.split_once('.') {
        Some((text, tag)) if tag.len() == 8 => (text, Some(u32::from_str_radix(tag, 16).ok()?)),
        Some(_) => return None,
        None => (text, None),
    };
    let mut parts = text.splitn(3, '-');
    let revision = parts.next()?.parse().ok()?;
    let vertex = parts.next()?.parse().ok()?;
    let bytes = URL_SAFE_NO_PAD.decode(parts.next()?).ok()?;
    let (chunks, rest) = bytes.as_chunks::<8>();
    let numbers: [f64; 6] =
        chunks.iter().map(|&chunk| f64::from_le_bytes(chunk)).collect::<Vec<_>>().try_into().ok()?;
    let [x, y, z, nx, ny, nz] = numbers;
    let normal = Vector::new(nx, ny, nz);
    if !rest.is_empty() || (normal.norm() - 1.0).abs() > 1e-9 {
        return None;
    }
    let target = Target::new(Point::new(x, y, z), normal).ok()?;
    let id = CandidateId { revision, vertex, target, session };
    (id.revision >= 1).then_some(id)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id() -> CandidateId {
        let normal = Vector::new(0.6, -0.8, 0.0);
        let target = Target::new(Point::new(0.123_456_789, -1e-9, 4.0 / 3.0), normal).unwrap();
        CandidateId { revision: 12, vertex: 417, target, session: Some(0x1f) }
    }

    #[test]
    fn what_is_written_is_read_back_to_the_last_bit() {
        let text = encode(&id());
        assert!(text.starts_with("12-417-"));
        let read = decode(&text).unwrap();
        assert_eq!((read.revision, read.vertex, read.session), (12, 417, Some(0x1f)));
        let earlier = decode(text.split_once('.').unwrap().0).unwrap();
        assert_eq!((earlier.revision, earlier.session), (12, None));
        assert_eq!(read.target.point(), id().target.point());
        assert!((read.target.normal().into_inner() - id().target.normal().into_inner()).norm() < 1e-15);
    }

    #[test]
    fn anything_else_is_refused() {
        let text = encode(&id());
        for bad in [
            "",
            "12",
            "12-417",
            "12-417-",
            "12-417-AAAA",
            &text.replacen("12", "0", 1),
            &text.replacen("417", "-1", 1),
            &format!("{text}AAAA"),
            &text.replace('.', ""),
            &text[..text.len() - 1],
            &text.replace('-', "+"),
        ] {
            assert_eq!(decode(bad), None, "{bad}");
        }
        let zeros = format!("1-1-{}", URL_SAFE_NO_PAD.encode([0; 48]));
        assert_eq!(decode(&zeros), None, "a normal has length one");
    }
}
