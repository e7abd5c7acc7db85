/** Binary glTF as this server writes it: one mesh, its numbers packed. */

/** A surface with what is known of each vertex. */
export interface Surface {
  /** x, y, z of each vertex, in metres. */
  positions: Float32Array;
  faces: Uint32Array;
  /** In [0, 1]. */
  uncertainty: Float32Array;
  /** Along the normal, in metres, where the method states it. */
  std?: Float32Array;
}

interface Gltf {
  meshes: { primitives: { attributes: Record<string, number>; indices: number }[] }[];
  accessors: { bufferView: number; byteOffset?: number; count: number; type: string; componentType: number }[];
  bufferViews: { byteOffset?: number; byteLength: number }[];
}

const NUMBERS: Record<string, number> = { SCALAR: 1, VEC3: 3, VEC4: 4 };
const UNSIGNED_SHORT = 5123;

export function readSurface(file: ArrayBuffer): Surface {
  const header = new DataView(file);
  if (file.byteLength < 20 || header.getUint32(0, true) !== 0x46546c67) throw new Error("this is no binary glTF");
  const jsonBytes = header.getUint32(12, true);
  const gltf: Gltf = JSON.parse(new TextDecoder().decode(new Uint8Array(file, 20, jsonBytes)));
  const start = 20 + jsonBytes + 8;
  const place = (index: number | undefined) => {
    const accessor = index === undefined ? undefined : gltf.accessors[index];
    const view = accessor && gltf.bufferViews[accessor.bufferView];
    if (!accessor || !view) return undefined;
    const from = start + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    return { accessor, from, count: accessor.count * (NUMBERS[accessor.type] ?? 1) };
  };
  const floats = (index: number | undefined) => {
    const found = place(index);
    return found && new Float32Array(file, found.from, found.count);
  };
  const primitive = gltf.meshes[0]?.primitives[0];
  const positions = floats(primitive?.attributes.POSITION);
  const uncertainty = floats(primitive?.attributes._UNCERTAINTY);
  const indices = place(primitive?.indices);
  if (!positions || !uncertainty || !indices) throw new Error("the surface lacks positions, faces or uncertainties");
  const isShort = indices.accessor.componentType === UNSIGNED_SHORT;
  const faces = isShort
    ? Uint32Array.from(new Uint16Array(file, indices.from, indices.count))
    : new Uint32Array(file, indices.from, indices.count);
  return { positions, faces, uncertainty, std: floats(primitive?.attributes._STD_M) };
}
