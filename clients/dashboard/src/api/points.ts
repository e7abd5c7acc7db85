/** The visual points of a view, as far as its encoding is one of plain numbers. */

import type { Event } from "./client";

export function visualPoints(event: Event): Float32Array {
  const prior = event.visual_prior;
  if (!prior?.points) return new Float32Array();
  if (typeof prior.points !== "string") return Float32Array.from(prior.points.flat());
  const bytes = Uint8Array.from(atob(prior.points), (character) => character.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const packed = prior.packed as Record<string, number | boolean> | undefined;
  if (prior.encoding === "POINT_ENCODING_XYZ_F32_LE") {
    return new Float32Array(bytes.buffer, 0, Math.floor(bytes.length / 12) * 3);
  }
  if (!packed?.point_step) return new Float32Array();
  const step = Number(packed.point_step);
  const isLittle = !packed.is_bigendian;
  const read = (at: number) => (packed.is_double ? view.getFloat64(at, isLittle) : view.getFloat32(at, isLittle));
  const found: number[] = [];
  for (let from = 0; from + step <= bytes.length; from += step) {
    const point = ["x_offset", "y_offset", "z_offset"].map((name) => read(from + Number(packed[name] ?? 0)));
    if (point.every(Number.isFinite)) found.push(...point);
  }
  return Float32Array.from(found);
}
