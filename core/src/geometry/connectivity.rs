//! Which vertices and faces of a closed mesh lie next to each other, whatever their positions.

use std::sync::OnceLock;

use super::ring::Rings;

/// The faces of a closed mesh with their adjacency.
#[derive(Debug, Default)]
pub struct Connectivity {
    /// Three vertex indices a face, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Where the rows of each vertex begin in the two lists below, and where the last ones end.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    faces_at: Vec<u32>,
    /// The rings of all vertices, of a connectivity that lasts, once they were asked for.
    rings: OnceLock<Rings>,
    keeps_rings: bool,
}

impl Connectivity {
    /// The adjacency of the faces of a closed mesh with `vertices` vertices.
    pub fn new(faces: Vec<[u32; 3]>, vertices: usize) -> Self {
        // A vertex of a closed mesh has as many edges as faces.
        let mut starts = vec![0; vertices + 1];
        for vertex in faces.iter().flatten() {
            starts[*vertex as usize + 1] += 1;
        }
        for vertex in 0..vertices {
            starts[vertex + 1] += starts[vertex];
        }
        let mut ends = starts.clone();
        let (mut neighbours, mut faces_at) = (vec![0; 3 * faces.len()], vec![0; 3 * faces.len()]);
        for (face, &[a, b, c]) in faces.iter().enumerate() {
            // Each edge is shared by two faces that walk it in opposite directions.
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let end = &mut ends[from as usize];
                neighbours[*end as usize] = to;
                faces_at[*end as usize] = face as u32;
                *end += 1;
            }
        }
        Self { faces, starts, neighbours, faces_at, rings: OnceLock::new(), keeps_rings: false }
    }

    /// The same where the rings of its vertices are kept: it is to last, as an icosphere's does.
    pub(super) fn keeping_rings(self) -> Self {
        Self { keeps_rings: true, ..self }
    }

    /// The rings of all vertices within so many edges, where they are kept: of the number of edges that was asked for
    /// first, and not where they are many.
    pub(super) fn rings(&self, hops: usize) -> Option<&Rings> {
        if !self.keeps_rings || !Rings::are_few(hops, self.vertices()) {
            return None;
        }
        let rings = self.rings.get_or_init(|| Rings::new(self, hops));
        (rings.hops() == hops).then_some(rings)
    }

    /// How many vertices there are.
    pub(super) fn vertices(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The vertices that share an edge with `vertex`.
    pub fn neighbours(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.row(vertex)]
    }

    /// The faces that have `vertex` as a corner.
    pub fn faces_at(&self, vertex: usize) -> &[u32] {
        &self.faces_at[self.row(vertex)]
    }

    fn row(&self, vertex: usize) -> std::ops::Range<usize> {
        self.starts[vertex] as usize..self.starts[vertex + 1] as usize
    }
}
