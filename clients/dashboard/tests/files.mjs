// Files as cameras write them, of a ball of 40 mm at (0.5, 0, 0.1) m, seen from 0.5 m above its centre.

import { crc32, deflateSync } from "node:zlib";

const CENTRE = [0.5, 0, 0.1];
const RADIUS = 0.04;

/** Where the camera is, x y z in metres, and its pose: it looks down. */
export const VIEWPOINT = "0.5 0 0.6";
export const CAMERA_POSE = "0.5 0 0.6 1 0 0 0";
/** fx fy cx cy in pixels, of images of WIDTH by HEIGHT. */
export const INTRINSICS = "300 300 60 45";
const [WIDTH, HEIGHT, FOCAL] = [120, 90, 300];

/** The cap that the camera sees. */
export function cap() {
  const points = [];
  for (let ring = 1; ring <= 8; ring++) {
    for (let step = 0; step < 24; step++) {
      const [polar, turn] = [(0.9 * ring) / 8, (2 * Math.PI * step) / 24];
      const normal = [Math.sin(polar) * Math.cos(turn), Math.sin(polar) * Math.sin(turn), Math.cos(polar)];
      points.push(normal.map((part, axis) => CENTRE[axis] + RADIUS * part));
    }
  }
  return points;
}

export function ply(points) {
  const header = `ply\nformat ascii 1.0\nelement vertex ${points.length}\nproperty float x\nproperty float y\nproperty float z\nend_header\n`;
  return header + points.map((point) => point.map((x) => x.toFixed(6)).join(" ")).join("\n") + "\n";
}

/** A binary PCD file, as PCL writes it. */
export function pcd(points) {
  const header = `# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH ${points.length}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS ${points.length}\nDATA binary\n`;
  return Buffer.concat([Buffer.from(header), Buffer.from(new Float32Array(points.flat()).buffer)]);
}

/** A depth image in millimetres, 16 bits a pixel; 0 where nothing is. */
export function depthPng() {
  const rows = [];
  for (let y = 0; y < HEIGHT; y++) {
    const row = Buffer.alloc(1 + 2 * WIDTH);
    for (let x = 0; x < WIDTH; x++) {
      // The ray (a, b, 1) meets the ball whose centre is 0.5 m before the camera.
      const [a, b] = [(x - 60) / FOCAL, (y - 45) / FOCAL];
      const square = a * a + b * b + 1;
      const root = 0.25 - square * (0.25 - RADIUS * RADIUS);
      const depth = root < 0 ? 0 : (0.5 - Math.sqrt(root)) / square;
      row.writeUInt16BE(Math.round(1000 * depth), 1 + 2 * x);
    }
    rows.push(row);
  }
  const size = Buffer.alloc(13);
  size.writeUInt32BE(WIDTH, 0);
  size.writeUInt32BE(HEIGHT, 4);
  size.set([16, 0, 0, 0, 0], 8); // 16 bits, grey
  const signature = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  return Buffer.concat([signature, chunk("IHDR", size), chunk("IDAT", deflateSync(Buffer.concat(rows))), chunk("IEND", Buffer.alloc(0))]);
}

function chunk(kind, data) {
  const body = Buffer.concat([Buffer.from(kind), data]);
  const [length, check] = [Buffer.alloc(4), Buffer.alloc(4)];
  length.writeUInt32BE(data.length);
  check.writeUInt32BE(crc32(body));
  return Buffer.concat([length, body, check]);
}
