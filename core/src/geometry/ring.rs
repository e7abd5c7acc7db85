//! The vertices around a vertex, ring by ring of edges.

use super::Connectivity;

/// The vertices within a number of edges of another; reusable, so that a search costs its ring.
#[derive(Clone, Debug)]
pub struct Ring {
    seen: Vec<u32>,
    search: u32,
    vertices: Vec<u32>,
    parents: Vec<u32>,
}

impl Ring {
    /// A search over a mesh with `vertices` vertices.
    pub fn new(vertices: usize) -> Self {
        Self { seen: vec![0; vertices], search: 0, vertices: Vec::new(), parents: Vec::new() }
    }

    /// All vertices at most `hops` edges from `centre`, itself first.
    pub fn around(&mut self, connectivity: &Connectivity, centre: u32, hops: usize) -> &[u32] {
        self.search += 1;
        self.seen[centre as usize] = self.search;
        self.vertices.clear();
        self.vertices.push(centre);
        self.parents.clear();
        self.parents.push(0);
        let mut from = 0;
        for _ in 0..hops {
            let to = self.vertices.len();
            for inner in from..to {
                for &outer in connectivity.neighbours(self.vertices[inner] as usize) {
                    if self.seen[outer as usize] != self.search {
                        self.seen[outer as usize] = self.search;
                        self.vertices.push(outer);
                        self.parents.push(inner as u32);
                    }
                }
            }
            from = to;
        }
        &self.vertices
    }

    /// What the last search reached.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// For each vertex of [`Self::vertices`] the index in it of the one it was reached from; the
    /// first is its own.
    pub fn parents(&self) -> &[u32] {
        &self.parents
    }

    /// Whether the last search reached `vertex`.
    pub fn reached(&self, vertex: u32) -> bool {
        self.seen[vertex as usize] == self.search
    }
}
