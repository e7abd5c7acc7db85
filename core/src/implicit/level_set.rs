//! The zero level of a field as a mesh: surface nets on a grid, each vertex then moved onto the level.

use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};

use super::process::Process;
use crate::geometry::{Connectivity, Icosphere, Point, TriangleMesh, Vector};

/// Steps of Newton's method that move a vertex onto the level.
const STEPS: usize = 4;
/// Where the grid finds no level, this share of the radius stands for it.
const FALLBACK: f64 = 0.3;

/// The part of the zero level with the most vertices, in the sphere of `radius_m` about `centre`; closed, and
/// wound outwards.
pub(super) fn mesh(field: &Process, centre: Point, radius_m: f64, cells: usize) -> TriangleMesh {
    // With an even number of cells a node lies in the middle, which is known to be inside.
    on_grid(field, centre, radius_m, cells).unwrap_or_else(|| {
        Icosphere::get(3).mesh_of(|direction| centre + direction.into_inner() * (FALLBACK * radius_m))
    })
}

/// Nothing where the level lies between the nodes of the grid.
fn on_grid(field: &Process, centre: Point, radius_m: f64, cells: usize) -> Option<TriangleMesh> {
    let cell_m = 2.0 * radius_m / cells as f64;
    let nodes = cells as u32 + 1;
    let shape = RuntimeShape::<u32, 3>::new([nodes; 3]);
    let corner = centre - Vector::repeat(radius_m);
    let place = |node: [f64; 3]| corner + Vector::from(node) * cell_m;
    // Beyond the sphere of outside points nothing holds the field, and nothing of the object is there.
    let value = |point: Point| {
        if (point - centre).norm() < radius_m { field.value(&point) as f32 } else { 1.0 }
    };
    let values: Vec<f32> =
        (0..shape.size()).map(|index| value(place(shape.delinearize(index).map(f64::from)))).collect();
    let mut net = SurfaceNetsBuffer::default();
    surface_nets(&values, &shape, [0; 3], [nodes - 1; 3], &mut net);
    let vertices =
        net.positions.iter().map(|node| on_level(field, place(node.map(f64::from)), cell_m)).collect();
    let faces: Vec<[u32; 3]> = net.indices.chunks_exact(3).map(|face| [face[0], face[1], face[2]]).collect();
    let mut mesh = largest_part(TriangleMesh { vertices, faces })?;
    if mesh.volume() < 0.0 {
        mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
    }
    Some(mesh)
}

/// Moves a point along the gradient until the field is zero, by no more than a cell.
fn on_level(field: &Process, start: Point, cell_m: f64) -> Point {
    let mut point = start;
    for _ in 0..STEPS {
        let (value, gradient) = field.at(&point);
        let step = gradient * (value / gradient.norm_squared().max(f64::MIN_POSITIVE));
        let moved = point - step;
        if (moved - start).norm() > cell_m {
            break;
        }
        point = moved;
    }
    point
}

/// The connected part with the most vertices, the first of equals; nothing of a mesh without faces.
fn largest_part(mesh: TriangleMesh) -> Option<TriangleMesh> {
    let connectivity = Connectivity::new(mesh.faces, mesh.vertices.len());
    let mut part_of = vec![usize::MAX; mesh.vertices.len()];
    let mut sizes = Vec::new();
    for start in 0..mesh.vertices.len() {
        if part_of[start] != usize::MAX {
            continue;
        }
        let part = sizes.len();
        let (mut open, mut size) = (vec![start], 0);
        part_of[start] = part;
        while let Some(vertex) = open.pop() {
            size += 1;
            for &next in connectivity.neighbours(vertex) {
                if part_of[next as usize] == usize::MAX {
                    part_of[next as usize] = part;
                    open.push(next as usize);
                }
            }
        }
        sizes.push(size);
    }
    let most = *sizes.iter().max()?;
    let largest = sizes.iter().position(|size| *size == most)?;
    let mut number = vec![0; mesh.vertices.len()];
    let mut vertices = Vec::with_capacity(most);
    for (vertex, point) in mesh.vertices.iter().enumerate().filter(|(vertex, _)| part_of[*vertex] == largest)
    {
        number[vertex] = vertices.len() as u32;
        vertices.push(*point);
    }
    let kept = connectivity.faces.iter().filter(|face| part_of[face[0] as usize] == largest);
    let faces = kept.map(|face| face.map(|vertex| number[vertex as usize])).collect();
    Some(TriangleMesh { vertices, faces })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_separate_parts_the_larger_one_is_kept() {
        let sphere = |subdivisions: usize, x: f64| {
            Icosphere::get(subdivisions).mesh_of(|d| Point::new(x, 0.0, 0.0) + 0.01 * d.into_inner())
        };
        let (small, large) = (sphere(0, 0.0), sphere(1, 1.0));
        let shifted = large.faces.iter().map(|face| face.map(|vertex| vertex + 12));
        let both = TriangleMesh {
            vertices: [small.vertices, large.vertices.clone()].concat(),
            faces: small.faces.into_iter().chain(shifted).collect(),
        };
        assert_eq!(largest_part(both).unwrap(), large);
        assert_eq!(largest_part(TriangleMesh::default()), None);
    }
}
