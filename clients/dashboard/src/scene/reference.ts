/** The mesh that a session keeps as the truth, as a ghost. */

import * as THREE from "three";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { PLYLoader } from "three/addons/loaders/PLYLoader.js";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import * as api from "../api/client";

export async function loadReference(id: string, signal: AbortSignal): Promise<THREE.Object3D | undefined> {
  const file = await api.reference(id, signal);
  if (!file) return undefined;
  const start = new TextDecoder("latin1").decode(file.slice(0, 512));
  const material = new THREE.MeshLambertMaterial({ color: 0x4dabf7, transparent: true, opacity: 0.22, depthWrite: false, side: THREE.DoubleSide });
  if (start.startsWith("ply")) return ghost(new PLYLoader().parse(file), material);
  if (/^(#|v |vn |o |g |mtllib)/m.test(start) && !start.startsWith("solid")) {
    const object = new OBJLoader().parse(new TextDecoder().decode(file));
    object.traverse((part) => {
      if (part instanceof THREE.Mesh) part.material = material;
    });
    return object;
  }
  return ghost(new STLLoader().parse(file), material);
}

function ghost(geometry: THREE.BufferGeometry, material: THREE.Material): THREE.Mesh {
  geometry.computeVertexNormals();
  geometry.computeBoundingSphere();
  return new THREE.Mesh(geometry, material);
}
