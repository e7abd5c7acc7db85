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
        match connectivity.rings(hops) {
            Some(rings) => {
                let (vertices, parents) = rings.around(centre);
                self.search += 1;
                vertices.iter().for_each(|vertex| self.seen[*vertex as usize] = self.search);
                self.vertices.clear();
                self.vertices.extend_from_slice(vertices);
                self.parents.clear();
                self.parents.extend_from_slice(parents);
                &self.vertices
            }
            None => self.walk(connectivity, centre, hops),
        }
    }

    fn walk(&mut self, connectivity: &Connectivity, centre: u32, hops: usize) -> &[u32] {
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
    pub(super) fn are_few(hops: usize, vertices: usize) -> bool {
        // Around a vertex of valence six: 1 + 6 (1 + 2 + ... + hops).
        hops.saturating_mul(hops + 1).saturating_mul(3).saturating_add(1).saturating_mul(vertices)
            <= Self::MOST
    }

    pub(super) fn new(connectivity: &Connectivity, hops: usize) -> Self {
        let count = connectivity.vertices();
        let mut ring = Ring::new(count);
        let mut rings = Self { hops, starts: vec![0], vertices: Vec::new(), parents: Vec::new() };
        for vertex in 0..count as u32 {
            ring.walk(connectivity, vertex, hops);
            rings.vertices.extend_from_slice(ring.vertices());
            rings.parents.extend_from_slice(ring.parents());
            rings.starts.push(rings.vertices.len() as u32);
        }
        rings
    }

    pub(super) fn hops(&self) -> usize {
        self.hops
    }

    /// The ring of a vertex, and for each of its vertices the place in it of the one it was reached from.
    fn around(&self, vertex: u32) -> (&[u32], &[u32]) {
        let row = self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize;
        (&self.vertices[row.clone()], &self.parents[row])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Icosphere;

    #[test]
    fn rings_that_are_kept_are_those_that_are_walked() {
        let connectivity = &Icosphere::get(3).connectivity;
        assert!(connectivity.rings(4).is_some() && connectivity.rings(5).is_none());
        let (mut kept, mut walked) = (Ring::new(642), Ring::new(642));
        for centre in [0, 11, 12, 300, 641] {
            for hops in [4, 5] {
                walked.walk(connectivity, centre, hops);
                kept.around(connectivity, centre, hops);
                assert_eq!((kept.vertices(), kept.parents()), (walked.vertices(), walked.parents()));
                assert!((0..642).all(|vertex| kept.reached(vertex) == walked.reached(vertex)));
            }
        }
    }
}
