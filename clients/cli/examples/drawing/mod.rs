//! What the pictures of the examples have in common: an eye, and shaded triangles as SVG.

use std::collections::BTreeMap;
use std::fmt::Write;

use palpate_core::geometry::{Point, TriangleMesh, Vector};

/// Faces are drawn from far to near in groups of this many, and by colour within a group.
const GROUP: usize = 400;
/// What has no uncertainty: the true object.
const GREY: [f64; 3] = [200.0, 200.0, 204.0];

/// The eye of whoever looks at the picture.
pub(crate) struct Eye {
    right: Vector,
    up: Vector,
    /// From the object to the eye; of length one.
    pub(crate) towards: Vector,
    units_a_metre: f64,
}

impl Eye {
    /// In this direction from the object, and so near that a metre has this many drawing units.
    pub(crate) fn new(azimuth_deg: f64, elevation_deg: f64, units_a_metre: f64) -> Self {
        let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
        let right = Vector::new(-azimuth.sin(), azimuth.cos(), 0.0);
        let towards =
            Vector::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
        Self { right, up: towards.cross(&right), towards, units_a_metre }
    }

    /// To the right and down from where the session's origin is drawn, in drawing units.
    pub(crate) fn place(&self, point: &Point) -> (f64, f64) {
        let (right, up) = (point.coords.dot(&self.right), point.coords.dot(&self.up));
        (self.units_a_metre * right, -self.units_a_metre * up)
    }
}

/// Colours for uncertainties from 0 to 1, evenly spaced: red, green and blue, each from 0 to 255.
#[derive(Clone, Copy)]
pub(crate) struct Ramp(pub(crate) &'static [[f64; 3]]);

impl Ramp {
    /// The ramp at `uncertainty`, darker where the face turns away; in few steps, so that faces share colours.
    pub(crate) fn colour(self, uncertainty: Option<f64>, facing: f64) -> String {
        let Self(colours) = self;
        let light = 0.55 + 0.45 * (5.0 * facing).round() / 5.0;
        let base = uncertainty.map_or(GREY, |u| {
            let along = (12.0 * u.clamp(0.0, 1.0)).round() / 12.0 * (colours.len() - 1) as f64;
            let below = (along as usize).min(colours.len() - 2);
            let share = along - below as f64;
            std::array::from_fn(|part| {
                (1.0 - share) * colours[below][part] + share * colours[below + 1][part]
            })
        });
        // Three digits: sixteen steps a channel.
        let [red, green, blue] = base.map(|part| (light * part / 17.0).round() as u8);
        format!("#{red:x}{green:x}{blue:x}")
    }
}

/// A surface as it is drawn.
pub(crate) struct Solid<'a> {
    /// The surface, in metres.
    pub(crate) mesh: &'a TriangleMesh,
    /// Uncertainty of each vertex, in [0, 1]; none for the true object.
    pub(crate) uncertainty: Option<&'a [f64]>,
    /// What the uncertainty is drawn in.
    pub(crate) ramp: Ramp,
}

impl Solid<'_> {
    /// Draws the faces that look at the eye, the farthest first, with the session's origin at `origin`
    /// in drawing units.
    pub(crate) fn draw(&self, svg: &mut String, eye: &Eye, origin: (i32, i32)) -> std::fmt::Result {
        let Self { mesh, uncertainty, ramp } = self;
        let place = |vertex: u32| {
            let (x, y) = eye.place(&mesh.vertices[vertex as usize]);
            (origin.0 + x.round() as i32, origin.1 + y.round() as i32)
        };
        let facing = |face: usize| mesh.face_normal(face).dot(&eye.towards);
        let depth = |face: usize| mesh.corners(face).iter().map(|p| p.coords.dot(&eye.towards)).sum::<f64>();
        let mut faces: Vec<usize> = (0..mesh.faces.len()).filter(|&face| facing(face) > 0.0).collect();
        faces.sort_by(|&a, &b| depth(a).total_cmp(&depth(b)));
        for group in faces.chunks(GROUP) {
            let mut by_colour: BTreeMap<String, String> = BTreeMap::new();
            for &face in group {
                let corners = mesh.faces[face];
                let [a, b, c] = corners.map(place);
                let uncertainty = uncertainty.map(|u| mean(corners.map(|vertex| u[vertex as usize])));
                let outline = by_colour.entry(ramp.colour(uncertainty, facing(face))).or_default();
                write!(outline, "M{} {}l{} {} {} {}z", a.0, a.1, b.0 - a.0, b.1 - a.1, c.0 - b.0, c.1 - b.1)?;
            }
            for (colour, outline) in by_colour {
                writeln!(svg, "<path fill=\"{colour}\" stroke=\"{colour}\" d=\"{outline}\"/>")?;
            }
        }
        Ok(())
    }
}

fn mean(values: [f64; 3]) -> f64 {
    values.iter().sum::<f64>() / 3.0
}
