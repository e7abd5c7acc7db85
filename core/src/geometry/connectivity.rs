//! Which vertices and faces of a closed mesh lie next to each other, whatever their positions.

/// The faces of a closed mesh with their adjacency.
#[derive(Debug, Default)]
pub struct Connectivity {
    /// Three vertex indices a face, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    neighbours: Vec<Vec<u32>>,
    faces_at: Vec<Vec<u32>>,
}

impl Connectivity {
    /// The adjacency of the faces of a closed mesh with `vertices` vertices.
    pub fn new(faces: Vec<[u32; 3]>, vertices: usize) -> Self {
        let mut neighbours = vec![Vec::new(); vertices];
        let mut faces_at = vec![Vec::new(); vertices];
        for (face, &[a, b, c]) in faces.iter().enumerate() {
            // Each edge is shared by two faces that walk it in opposite directions.
            for (from, to) in [(a, b), (b, c), (c, a)] {
                neighbours[from as usize].push(to);
                faces_at[from as usize].push(face as u32);
            }
        }
        Self { faces, neighbours, faces_at }
    }

    /// The vertices that share an edge with `vertex`.
    pub fn neighbours(&self, vertex: usize) -> &[u32] {
        &self.neighbours[vertex]
    }

    /// The faces that have `vertex` as a corner.
    pub fn faces_at(&self, vertex: usize) -> &[u32] {
        &self.faces_at[vertex]
    }
}
