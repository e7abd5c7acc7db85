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
        match connectivity.rings(hops) {
            Some(rings) => {
                let (vertices, parents) = rings.around(centre);
                vertices.iter().for_each(|vertex| self.seen[*vertex as usize] = self.search);
                self.vertices.clear();
                self.vertices.extend_from_slice(vertices);
                self.parents.clear();
                self.parents.extend_from_slice(parents);
            }
            None => self.walk(connectivity, centre, hops),
        }
        &self.vertices
    }

    fn walk(&mut self, connectivity: &Connectivity, centre: u32, hops: usize) {
        let Self { seen, search, vertices, parents } = self;
        let is_new = |vertex: u32| std::mem::replace(&mut seen[vertex as usize], *search) != *search;
        connectivity.walk(centre, hops, is_new, vertices, parents);
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
                walked.search += 1;
                walked.walk(connectivity, centre, hops);
                kept.around(connectivity, centre, hops);
                assert_eq!((kept.vertices(), kept.parents()), (walked.vertices(), walked.parents()));
                assert!((0..642).all(|vertex| kept.reached(vertex) == walked.reached(vertex)));
            }
        }
    }
}
