//! The cloud of attractors: where the object was touched, as the server's log has it.
//!
//! The table of attempts tells it for every session, also for one that others touch too and after a restart of the bridge;
//! what was retracted is left out.

use serde::Deserialize;

use crate::messages::{Header, PointCloud2, PointField, datatype};

/// A touched point, as the cloud of attractors shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touched {
    /// The touched point in metres, in the session's frame.
    pub point: [f64; 3],
    /// Uncertainty of the contact, in [0, 1].
    pub uncertainty: f32,
    /// Force in N, less that at rest; 0 where it is not known.
    pub force_n: f32,
    /// Number of its event in the session's log.
    pub seq: u32,
}

/// Bytes of one attractor: x, y, z, uncertainty, force_n, seq.
const ATTRACTOR_BYTES: u32 = 24;

/// The cloud of attractors: where the object was touched.
pub fn attractors(touched: &[Touched], header: Header) -> PointCloud2 {
    let names = ["x", "y", "z", "uncertainty", "force_n", "seq"];
    let field = |(at, name): (u32, &str)| PointField {
        name: name.to_owned(),
        offset: 4 * at,
        datatype: if name == "seq" { datatype::UINT32 } else { datatype::FLOAT32 },
        count: 1,
    };
    let bytes = |touched: &Touched| {
        let [x, y, z] = touched.point.map(|part| part as f32);
        let floats = [x, y, z, touched.uncertainty, touched.force_n];
        floats.into_iter().flat_map(f32::to_le_bytes).chain(touched.seq.to_le_bytes())
    };
    let width = u32::try_from(touched.len()).unwrap_or(u32::MAX);
    PointCloud2 {
        header,
        height: 1,
        width,
        fields: (0..).zip(names).map(field).collect(),
        is_bigendian: false,
        point_step: ATTRACTOR_BYTES,
        row_step: width.saturating_mul(ATTRACTOR_BYTES),
        data: touched.iter().flat_map(bytes).collect(),
        is_dense: true,
    }
}

/// A row of the table of attempts, as far as it matters here.
#[derive(Debug, Deserialize)]
struct Attempt {
    seq: u32,
    outcome: String,
    x_m: Option<f64>,
    y_m: Option<f64>,
    z_m: Option<f64>,
    force_n: Option<f32>,
    contact_uncertainty: Option<f32>,
    retracted_by_seq: Option<i64>,
}

/// The touches in a table of attempts, as `ARCHIVE_FORMAT_CSV` is written.
///
/// # Errors
/// The table is not the one that docs/formats.md describes.
pub fn touched(table: &[u8]) -> Result<Vec<Touched>, csv::Error> {
    let mut touched = Vec::new();
    for attempt in csv::Reader::from_reader(table).deserialize() {
        let Attempt { seq, outcome, x_m, y_m, z_m, force_n, contact_uncertainty, retracted_by_seq } =
            attempt?;
        let (Some(x), Some(y), Some(z)) = (x_m, y_m, z_m) else { continue };
        if retracted_by_seq.is_some() || !matches!(outcome.as_str(), "contact" | "early_contact") {
            continue;
        }
        touched.push(Touched {
            point: [x, y, z],
            uncertainty: contact_uncertainty.unwrap_or_default(),
            force_n: force_n.unwrap_or_default(),
            seq,
        });
    }
    Ok(touched)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::cloud::{Points, read};

    #[test]
    fn attractors_are_read_back_as_they_were_written() {
        let touched = [
            Touched { point: [0.1, -0.2, 0.3], uncertainty: 0.05, force_n: 2.0, seq: 3 },
            Touched { point: [1.0, 2.0, 3.0], uncertainty: 0.2, force_n: 0.0, seq: 4 },
        ];
        let cloud = attractors(&touched, Header::default());
        let Points { points, non_finite } = read(&cloud).unwrap();
        assert_eq!((points.len(), non_finite), (2, 0));
        assert!((points[0] - Point3::new(0.1, -0.2, 0.3)).norm() < 1e-7);
        assert_eq!(cloud.data[44..48], 4_u32.to_le_bytes());
        assert_eq!(cloud.row_step as usize, cloud.data.len());
    }

    #[test]
    fn touches_are_taken_from_the_table_and_misses_and_what_was_retracted_are_not() {
        let table = "seq,attempt,outcome,x_m,y_m,z_m,force_n,contact_uncertainty,retracted_by_seq\n\
                     3,1,contact,0.1,0.2,0.3,2.5,0.05,\n\
                     4,2,no_contact,,,,,,\n\
                     5,3,contact,1,1,1,1,0.1,7\n\
                     6,4,early_contact,0.4,0.5,0.6,,0.2,\n";
        let touched = touched(table.as_bytes()).unwrap();
        let seqs: Vec<_> = touched.iter().map(|touched| touched.seq).collect();
        assert_eq!(seqs, [3, 6]);
        assert_eq!(touched[0].point, [0.1, 0.2, 0.3]);
        assert_eq!((touched[0].force_n, touched[1].force_n), (2.5, 0.0));
    }
}
