//! A surface as binary glTF, which browsers and most viewers open, with the uncertainty of each vertex.
//!
//! glTF calls its y axis up, and a session's frame rarely does: the one node turns z up into y up, so that viewers show
//! the object as it stands, and the positions below it are in the session's frame as they are everywhere else.

use std::f64::consts::FRAC_1_SQRT_2;

use palpate_core::reconstruction::Surface;
use serde_json::{Value, json};

use super::{Colormap, Remark};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Arrays one after the other, each with its view and its accessor.
#[derive(Default)]
struct Arrays {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

/// Writes a file with one mesh: positions, normals, colours in linear light, and the uncertainty as attributes.
pub(super) fn write(surface: &Surface, remark: &Remark<'_>, colormap: Colormap) -> Vec<u8> {
    let Surface { mesh, uncertainty, std_m } = surface;
    let mut arrays = Arrays::default();
    let positions: Vec<[f32; 3]> =
        mesh.vertices.iter().map(|vertex| [vertex.x, vertex.y, vertex.z].map(|x| x as f32)).collect();
    let position = arrays.floats("VEC3", positions.as_flattened(), positions.len());
    arrays.accessors[position]["min"] = json!(bound(&positions, f32::min));
    arrays.accessors[position]["max"] = json!(bound(&positions, f32::max));
    let normals: Vec<f32> = mesh
        .vertex_normals()
        .iter()
        .flat_map(|normal| [normal.x, normal.y, normal.z])
        .map(|x| x as f32)
        .collect();
    let colours: Vec<f32> = uncertainty.iter().flat_map(|&u| colormap.linear(u)).map(|x| x as f32).collect();
    let mut attributes = json!({
        "POSITION": position,
        "NORMAL": arrays.floats("VEC3", &normals, positions.len()),
        "COLOR_0": arrays.floats("VEC3", &colours, positions.len()),
    });
    let scalars = [("_UNCERTAINTY", Some(uncertainty)), ("_STD_M", std_m.as_ref())];
    for (name, values) in scalars.into_iter().filter_map(|(name, values)| Some((name, values?))) {
        let values: Vec<f32> = values.iter().map(|&value| value as f32).collect();
        attributes[name] = arrays.floats("SCALAR", &values, values.len()).into();
    }
    let indices = arrays.indices(mesh.faces.as_flattened());
    pack(&document(&arrays, &attributes, indices, remark), arrays.bytes)
}

impl Arrays {
    fn floats(&mut self, shape: &str, values: &[f32], count: usize) -> usize {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        self.add(bytes, ARRAY_BUFFER, json!({ "componentType": FLOAT, "type": shape, "count": count }))
    }

    fn indices(&mut self, values: &[u32]) -> usize {
        let accessor = json!({ "componentType": UNSIGNED_INT, "type": "SCALAR", "count": values.len() });
        self.add(values.iter().flat_map(|value| value.to_le_bytes()), ELEMENT_ARRAY_BUFFER, accessor)
    }

    fn add(&mut self, bytes: impl Iterator<Item = u8>, target: u32, mut accessor: Value) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let length = self.bytes.len() - start;
        accessor["bufferView"] = self.views.len().into();
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length, "target": target }));
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

fn bound(positions: &[[f32; 3]], choose: fn(f32, f32) -> f32) -> [f32; 3] {
    let first = positions.first().copied().unwrap_or_default();
    positions.iter().fold(first, |best, place| std::array::from_fn(|axis| choose(best[axis], place[axis])))
}

fn document(arrays: &Arrays, attributes: &Value, indices: usize, remark: &Remark<'_>) -> Value {
    let Remark { session_id, frame_id, revision } = *remark;
    json!({
        "asset": { "version": "2.0", "generator": concat!("Palpate ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{
            "name": format!("{session_id}-r{revision}"),
            "mesh": 0,
            // A quarter turn about x, from z up to y up.
            "rotation": [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2],
            "extras": {
                "session_id": session_id, "revision": revision, "frame_id": frame_id, "unit": "m",
                "axes": "positions are in the session's frame; the node's rotation turns its z axis up",
            },
        }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices, "material": 0 }] }],
        "materials": [{
            "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.9 },
            "doubleSided": true,
        }],
        "accessors": arrays.accessors,
        "bufferViews": arrays.views,
        "buffers": [{ "byteLength": arrays.bytes.len() }],
    })
}

/// A header of three words, and two chunks that are filled up to words.
fn pack(document: &Value, mut binary: Vec<u8>) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut file = Vec::with_capacity(length);
    file.extend(b"glTF");
    file.extend(2_u32.to_le_bytes());
    file.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

#[cfg(test)]
mod tests {
    use gltf::mesh::util::ReadColors;

    use super::*;
    use crate::mesh_format::tests::{HOSTILE, REMARK, tetrahedron};

    fn parse(file: &[u8]) -> (gltf::Document, Vec<u8>) {
        // It validates indices, offsets and what is required.
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(file).unwrap();
        (document, blob.unwrap())
    }

    #[test]
    fn an_independent_reader_finds_vertices_faces_and_colours() {
        let surface = tetrahedron();
        let (document, blob) = parse(&write(&surface, &REMARK, Colormap::Paper));
        let mesh = document.meshes().next().unwrap();
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(&blob));
        let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        let vertices = surface.mesh.vertices.iter().map(|v| [v.x, v.y, v.z].map(|x| x as f32));
        assert_eq!(positions, vertices.collect::<Vec<_>>());
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(indices, surface.mesh.faces.as_flattened());
        assert_eq!(primitive.bounding_box().max, [0.1; 3]);
        let Some(ReadColors::RgbF32(colours)) = reader.read_colors(0) else { panic!("colours") };
        let colours: Vec<[f32; 3]> = colours.collect();
        assert!(colours[0][1] > colours[0][0] && colours[3][0] > colours[3][1], "{colours:?}");
        assert_eq!(reader.read_normals().unwrap().count(), 4);
    }

    #[test]
    fn uncertainties_are_attributes_and_deviations_where_they_are_known() {
        let mut surface = tetrahedron();
        let names = |surface: &Surface| {
            let (document, _) = parse(&write(surface, &REMARK, Colormap::Cividis));
            let json = serde_json::to_value(document.into_json()).unwrap();
            json["meshes"][0]["primitives"][0]["attributes"]
                .as_object()
                .unwrap()
                .keys()
                .cloned()
                .collect::<Vec<_>>()
        };
        assert_eq!(names(&surface), ["COLOR_0", "NORMAL", "POSITION", "_UNCERTAINTY"]);
        surface.std_m = Some(vec![0.001; 4]);
        assert_eq!(names(&surface), ["COLOR_0", "NORMAL", "POSITION", "_STD_M", "_UNCERTAINTY"]);
    }

    #[test]
    fn the_node_turns_z_up_and_says_whose_it_is() {
        let (document, _) = parse(&write(&tetrahedron(), &HOSTILE, Colormap::Paper));
        let node = document.nodes().next().unwrap();
        let turned =
            nalgebra::Matrix4::from(node.transform().matrix()) * nalgebra::Vector4::new(0.0, 0.0, 1.0, 0.0);
        assert!((turned - nalgebra::Vector4::new(0.0, 1.0, 0.0, 0.0)).norm() < 1e-6, "{turned}");
        let extras: Value = serde_json::from_str(node.extras().as_ref().unwrap().get()).unwrap();
        assert_eq!((&extras["session_id"], &extras["unit"]), (&json!("mug"), &json!("m")));
        assert_eq!(extras["frame_id"], HOSTILE.frame_id);
    }
}
