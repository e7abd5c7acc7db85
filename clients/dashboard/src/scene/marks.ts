/** What is drawn beside the surface: what was seen, touched and missed, where to touch next, what is forbidden. */

import * as THREE from "three";
import { contactsOf, type Candidate, type Event, type Session, type Vector3 } from "../api/client";
import { visualPoints } from "../api/points";

export const COLOURS = { seen: 0x22b8cf, touched: 0x1c7ed6, early: 0xf08c00, missed: 0xe03131, next: 0x7048e8, plane: 0x868e96 };

/** What a click on a mark says. */
export interface Mark {
  seq?: number;
  candidate?: Candidate;
}

const vector = (v: Vector3 | undefined) => new THREE.Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);

/** A picture of a mark, some pixels wide. */
function picture(shape: "disc" | "ring" | "cross"): THREE.Texture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 32;
  const context = canvas.getContext("2d")!;
  context.fillStyle = context.strokeStyle = "white";
  context.lineWidth = 6;
  context.beginPath();
  if (shape === "cross") {
    context.moveTo(5, 5);
    context.lineTo(27, 27);
    context.moveTo(27, 5);
    context.lineTo(5, 27);
    context.stroke();
  } else {
    context.arc(16, 16, shape === "ring" ? 11 : 14, 0, 2 * Math.PI);
    if (shape === "ring") context.stroke();
    else context.fill();
  }
  return new THREE.CanvasTexture(canvas);
}

let pictures: Record<"disc" | "ring" | "cross", THREE.Texture> | undefined;

function points(shape: "disc" | "ring" | "cross", colour: number, size: number, places: number[] | Float32Array, marks: Mark[] = []) {
  pictures ??= { disc: picture("disc"), ring: picture("ring"), cross: picture("cross") };
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
  const material = new THREE.PointsMaterial({
    color: colour,
    size,
    sizeAttenuation: false,
    map: pictures[shape],
    alphaTest: 0.5,
    depthTest: size > 4 ? false : true,
    transparent: size > 4,
  });
  const drawn = new THREE.Points(geometry, material);
  drawn.renderOrder = size > 4 ? 2 : 0;
  drawn.userData.marks = marks;
  return drawn;
}

/** Lines; those that are `seenThrough` are drawn faintly where the surface hides them. */
function lines(colour: number, places: THREE.Vector3[], seenThrough = false): THREE.LineSegments {
  const geometry = new THREE.BufferGeometry().setFromPoints(places);
  const faint = seenThrough ? { depthTest: false, transparent: true, opacity: 0.55 } : {};
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour, ...faint }));
}

/** The visual points and the attempts of a log up to a revision. */
export function history(events: Event[], revision: number): THREE.Group {
  const group = new THREE.Group();
  const doubted = new Set((events.find((event) => event.seq === revision)?.stats_after?.doubted_seqs ?? []).map(Number));
  const touched: { [kind in "believed" | "doubted" | "early"]: { places: number[]; marks: Mark[] } } = {
    believed: { places: [], marks: [] },
    doubted: { places: [], marks: [] },
    early: { places: [], marks: [] },
  };
  const missed: number[] = [];
  const missMarks: Mark[] = [];
  const sweeps: THREE.Vector3[] = [];
  let before = 0;
  for (const event of events) {
    if (event.seq > revision) break;
    if (event.retracted_by_seq && event.retracted_by_seq <= revision) continue;
    if (event.visual_prior) {
      const seen = visualPoints(event);
      if (seen.length) group.add(points("disc", COLOURS.seen, 3, seen));
    }
    const result = event.contact_result;
    const early = event.stats_after?.early_contacts ?? 0;
    for (const contact of contactsOf(event)) {
      const place = vector(contact.sensor_pose?.position);
      const kind = doubted.has(event.seq) ? "doubted" : early > before ? "early" : "believed";
      touched[kind].places.push(...place.toArray());
      touched[kind].marks.push({ seq: event.seq });
    }
    before = Math.max(before, early);
    if (result?.no_contact) {
      const [from, to] = [vector(result.no_contact.swept_from), vector(result.no_contact.swept_to)];
      missed.push(...from.clone().lerp(to, 0.5).toArray());
      missMarks.push({ seq: event.seq });
      sweeps.push(from, to);
    }
  }
  const { believed, doubted: hollow, early } = touched;
  if (believed.places.length) group.add(points("disc", COLOURS.touched, 8, believed.places, believed.marks));
  if (hollow.places.length) group.add(points("ring", COLOURS.touched, 10, hollow.places, hollow.marks));
  if (early.places.length) group.add(points("disc", COLOURS.early, 8, early.places, early.marks));
  if (missed.length) group.add(points("cross", COLOURS.missed, 11, missed, missMarks), lines(COLOURS.missed, sweeps));
  return group;
}

/** The next places to touch: the way of the probe, and an arrow along it. */
export function next(candidates: Candidate[]): THREE.Group {
  const group = new THREE.Group();
  const heads: number[] = [];
  candidates.forEach((candidate, rank) => {
    const [start, end] = [vector(candidate.probe_start), vector(candidate.probe_end)];
    const way = end.clone().sub(start);
    const length = way.length();
    group.add(lines(COLOURS.next, [start, end], true));
    const arrow = new THREE.ArrowHelper(way.normalize(), start, 0.5 * length, COLOURS.next, 0.25 * length, rank ? 0.08 * length : 0.16 * length);
    group.add(arrow);
    heads.push(...start.toArray());
  });
  if (heads.length) group.add(points("disc", COLOURS.next, 9, heads, candidates.map((candidate) => ({ candidate }))));
  return group;
}

/** The table and where no approach may go, as far as it is near an object of some size. */
export function limits(session: Session, centre: THREE.Vector3, size: number): THREE.Group {
  const group = new THREE.Group();
  const plane = (normal: Vector3 | undefined, offset: number, opacity: number) => {
    const up = vector(normal).normalize();
    const side = 2.4 * size;
    const material = new THREE.MeshBasicMaterial({ color: COLOURS.plane, transparent: true, opacity, side: THREE.DoubleSide, depthWrite: false });
    const drawn = new THREE.Mesh(new THREE.PlaneGeometry(side, side), material);
    drawn.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
    drawn.position.copy(centre.clone().addScaledVector(up, offset - centre.dot(up)));
    group.add(drawn);
  };
  const config = session.config;
  if (config?.support) plane(config.support.normal, config.support.offset_m ?? 0, 0.25);
  for (const region of config?.keep_out ?? []) {
    if ("half_space" in region) plane(region.half_space.normal, region.half_space.offset_m ?? 0, 0.12);
    if ("ball" in region) {
      const sphere = new THREE.SphereGeometry(region.ball.radius_m ?? 0, 24, 16);
      const material = new THREE.MeshBasicMaterial({ color: COLOURS.plane, wireframe: true, transparent: true, opacity: 0.3 });
      const ball = new THREE.Mesh(sphere, material);
      ball.position.copy(vector(region.ball.center));
      group.add(ball);
    }
  }
  return group;
}

/** Gives back what the graphics card holds for a group. */
export function dispose(group: THREE.Object3D): void {
  group.traverse((part) => {
    const { geometry, material } = part as THREE.Mesh;
    geometry?.dispose();
    for (const one of Array.isArray(material) ? material : [material]) one?.dispose();
  });
}
