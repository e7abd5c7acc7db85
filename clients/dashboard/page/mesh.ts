// Surfaces as packed floats: the arrays of a binary glTF file are used as they are.

export interface Surface {
  positions: Float32Array;
  normals: Float32Array;
  uncertainty: Float32Array;
  deviation_m: Float32Array | null;
  faces: Uint32Array;
}

export function readGlb(file: ArrayBuffer): Surface {
  const words = new DataView(file);
  const length = words.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(file, 20, length)));
  const start = 28 + length;
  const primitive = json.meshes[0].primitives[0];
  const place = (accessor: number): [number, number] => {
    const view = json.bufferViews[json.accessors[accessor].bufferView];
    return [start + view.byteOffset, view.byteLength / 4];
  };
  const floats = (name: string) => new Float32Array(file, ...place(primitive.attributes[name]));
  return {
    positions: floats("POSITION"),
    normals: floats("NORMAL"),
    uncertainty: floats("_UNCERTAINTY"),
    deviation_m: "_STD_M" in primitive.attributes ? floats("_STD_M") : null,
    faces: new Uint32Array(file, ...place(primitive.indices)),
  };
}

/** Packed points of a view, where the log has them as floats. */
export function readPoints(encoding: string | undefined, base64: unknown): Float32Array {
  if (encoding !== "POINT_ENCODING_XYZ_F32_LE" || typeof base64 !== "string") return new Float32Array();
  const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  return new Float32Array(bytes.buffer, 0, Math.floor(bytes.length / 12) * 3);
}
