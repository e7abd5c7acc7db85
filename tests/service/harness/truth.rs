//! The ball of the samples as files: a true surface to compare with.

use palpate_proto::v1;

use super::ball::{CENTRE, RADIUS_M, distance_m};

/// Corners and triangles of a mesh, outward wound.
type Solid = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// A sphere of `radius_m` about the ball's centre, by rings from pole to pole, in units of `metres_per_unit`.
fn sphere(radius_m: f64, metres_per_unit: f64) -> Solid {
    let (rings, around) = (40_u32, 80_u32);
    let place = |polar: f64, turn: f64| {
        let direction = [polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos()];
        [0, 1, 2].map(|k| (CENTRE[k] + radius_m * direction[k]) / metres_per_unit)
    };
    let step = std::f64::consts::PI / f64::from(rings);
    let mut corners = vec![place(0.0, 0.0)];
    for ring in 1..rings {
        corners.extend((0..around).map(|at| {
            let turn = std::f64::consts::TAU * f64::from(at) / f64::from(around);
            place(step * f64::from(ring), turn)
        }));
    }
    corners.push(place(std::f64::consts::PI, 0.0));
    let at = |ring: u32, along: u32| 1 + (ring - 1) * around + along % around;
    let last = corners.len() as u32 - 1;
    let mut faces = Vec::new();
    for along in 0..around {
        faces.push([0, at(1, along), at(1, along + 1)]);
        faces.push([last, at(rings - 1, along + 1), at(rings - 1, along)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, along), at(ring, along + 1)];
            let [c, d] = [at(ring + 1, along), at(ring + 1, along + 1)];
            faces.extend([[a, c, b], [b, c, d]]);
        }
    }
    (corners, faces)
}

/// The sphere as an OBJ file.
pub(crate) fn obj(radius_m: f64, metres_per_unit: f64) -> Vec<u8> {
    let (corners, faces) = sphere(radius_m, metres_per_unit);
    let corners = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let faces = faces.iter().map(|face| {
        let [a, b, c] = face.map(|corner| corner + 1);
        format!("f {a} {b} {c}\n")
    });
    corners.chain(faces).collect::<String>().into()
}

/// The sphere as a binary PLY file, in doubles.
pub(crate) fn ply(radius_m: f64, metres_per_unit: f64) -> Vec<u8> {
    let (corners, faces) = sphere(radius_m, metres_per_unit);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        corners.len(),
        faces.len()
    )
    .into_bytes();
    corners.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
    for face in faces {
        bytes.push(3);
        face.iter().for_each(|corner| bytes.extend(corner.to_le_bytes()));
    }
    bytes
}

/// The sphere as a binary STL file.
pub(crate) fn stl(radius_m: f64, metres_per_unit: f64) -> Vec<u8> {
    let (corners, faces) = sphere(radius_m, metres_per_unit);
    let mut bytes = vec![b' '; 80];
    bytes.extend((faces.len() as u32).to_le_bytes());
    for face in faces {
        bytes.extend([0; 12]);
        let of_face = face.iter().flat_map(|&corner| corners[corner as usize]);
        of_face.for_each(|x| bytes.extend((x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A wish to keep the true ball.
pub(crate) fn keep_ball(session_id: &str) -> v1::SetReferenceRequest {
    v1::SetReferenceRequest {
        session_id: session_id.into(),
        mesh: ply(RADIUS_M, 1.0).into(),
        ..Default::default()
    }
}

/// Mean distance of points from the true ball's surface, in metres.
pub(crate) fn mean_off_m(points: &[[f64; 3]]) -> f64 {
    let off = points.iter().map(|&point| (distance_m(point, CENTRE) - RADIUS_M).abs());
    off.sum::<f64>() / points.len() as f64
}
