//! Which vertices and faces of a closed mesh lie next to each other, whatever their positions.

use std::sync::OnceLock;

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
        (rings.hops == hops).then_some(rings)
    }

    /// How many vertices there are.
    fn vertices(&self) -> usize {
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

    /// All vertices at most `hops` edges from `centre`, itself first, and for each of them the place in that list of the
    /// one it was reached from; `is_new` says of each vertex once that it is new.
    pub(super) fn walk(
        &self,
        centre: u32,
        hops: usize,
        mut is_new: impl FnMut(u32) -> bool,
        vertices: &mut Vec<u32>,
        parents: &mut Vec<u32>,
    ) {
        is_new(centre);
        vertices.clear();
        vertices.push(centre);
        parents.clear();
        parents.push(0);
        let mut from = 0;
        for _ in 0..hops {
            let to = vertices.len();
            for inner in from..to {
                for &outer in self.neighbours(vertices[inner] as usize) {
                    if is_new(outer) {
                        vertices.push(outer);
                        parents.push(inner as u32);
                    }
                }
            }
            from = to;
        }
    }

    fn row(&self, vertex: usize) -> std::ops::Range<usize> {
        self.starts[vertex] as usize..self.starts[vertex + 1] as usize
    }
}

/// The rings of all vertices of a connectivity, walked once.
#[derive(Debug)]
pub(super) struct Rings {
    hops: usize,
    /// Where each vertex's ring begins in the two lists below, and where the last one ends.
    starts: Vec<u32>,
    vertices: Vec<u32>,
    parents: Vec<u32>,
}

impl Rings {
    /// No more members of rings are kept: those of 2562 vertices within six edges, in 2.6 MB.
    const MOST: usize = 1 << 19;

    /// Whether so many vertices have few enough members of rings within so many edges.
    fn are_few(hops: usize, vertices: usize) -> bool {
        // Around a vertex of valence six: 1 + 6 (1 + 2 + ... + hops).
        hops.saturating_mul(hops + 1).saturating_mul(3).saturating_add(1).saturating_mul(vertices)
            <= Self::MOST
    }

    fn new(connectivity: &Connectivity, hops: usize) -> Self {
        let count = connectivity.vertices();
        let mut seen_from = vec![u32::MAX; count];
        let (mut vertices, mut parents) = (Vec::new(), Vec::new());
        let mut rings = Self { hops, starts: vec![0], vertices: Vec::new(), parents: Vec::new() };
        for centre in 0..count as u32 {
            let is_new = |vertex: u32| std::mem::replace(&mut seen_from[vertex as usize], centre) != centre;
            connectivity.walk(centre, hops, is_new, &mut vertices, &mut parents);
            rings.vertices.append(&mut vertices);
            rings.parents.append(&mut parents);
            rings.starts.push(rings.vertices.len() as u32);
        }
        rings
    }

    /// The ring of a vertex, and for each of its vertices the place in it of the one it was reached
    /// from.
    pub(super) fn around(&self, vertex: u32) -> (&[u32], &[u32]) {
        let row = self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize;
        (&self.vertices[row.clone()], &self.parents[row])
    }
}
