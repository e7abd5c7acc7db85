//! Meshes of objects for the simulator: PLY, STL or OBJ, as the first byte says.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_simulator::mesh_file::{EXTENSIONS, parse};

fuzz_target!(|bytes: &[u8]| {
    let [kind, file @ ..] = bytes else { return };
    let extension = EXTENSIONS[usize::from(*kind) % EXTENSIONS.len()];
    let Ok(body) = parse(extension, file, 1.0) else { return };
    let mesh = body.mesh();
    assert!(mesh.volume() > 0.0);
    assert!(mesh.vertices.iter().all(|vertex| vertex.iter().all(|x| x.is_finite())));
    assert!(mesh.faces.iter().flatten().all(|&vertex| (vertex as usize) < mesh.vertices.len()));
});
