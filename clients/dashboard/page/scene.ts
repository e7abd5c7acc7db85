// The 3D view of one session, drawn only when something changed.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { PLYLoader } from "three/addons/loaders/PLYLoader.js";
import type { Candidate, Contact, LoggedEvent, Session, Vector } from "./api";
import { colour, type Scale } from "./colour";
import { h } from "./dom";
import type { Surface } from "./mesh";

export type Quantity = "uncertainty" | "deviation";
export interface Colouring {
  scale: Scale;
  quantity: Quantity;
  range: [number, number];
}
export interface Picked {
  vertex?: number;
  point: THREE.Vector3;
  candidate?: Candidate;
}

const point = (v: Vector | undefined) => new THREE.Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);

export class View {
  readonly element = h("div", { class: "view" });
  readonly camera = new THREE.PerspectiveCamera(40, 1, 0.001, 50);
  readonly controls: OrbitControls;
  onPick: (picked: Picked | null, isClick: boolean) => void = () => {};
  onCamera: () => void = () => {};
  private renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  private scene = new THREE.Scene();
  private geometry = new THREE.BufferGeometry();
  private mesh = new THREE.Mesh(
    this.geometry,
    new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.85, side: THREE.DoubleSide }),
  );
  private marks = new THREE.Group();
  private cloud = new THREE.Group();
  private ghost = new THREE.Group();
  private candidates: Candidate[] = [];
  private evidence: THREE.Vector3[] = [];
  private surface: Surface | null = null;
  private requested = 0;
  private isFitted = false;
  private bar = h("div", { class: "scale-bar" });
  private resizing = new ResizeObserver(() => this.resize());

  constructor(label: string) {
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", label);
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.element.append(canvas, this.bar, h("div", { class: "axes" }, "x red · y green · z blue"));
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0.25, -0.25, 0.18);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => {
      this.draw();
      this.onCamera();
    });
    const light = new THREE.DirectionalLight(0xffffff, 1.6);
    light.position.set(1, -2, 3);
    this.camera.add(light);
    this.mesh.visible = false;
    this.scene.add(this.camera, new THREE.HemisphereLight(0xffffff, 0x999999, 1.6), this.mesh, this.marks, this.cloud, this.ghost);
    this.resizing.observe(this.element);
    let hover = 0;
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) return;
      cancelAnimationFrame(hover);
      hover = requestAnimationFrame(() => this.onPick(this.pick(event), false));
    });
    let down = [0, 0];
    canvas.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
    canvas.addEventListener("click", (event) => {
      if (Math.hypot(event.clientX - down[0]!, event.clientY - down[1]!) < 4) this.onPick(this.pick(event), true);
    });
    this.theme();
  }

  theme(): void {
    this.scene.background = new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue("--ground").trim() || "#fff");
    this.draw();
  }

  draw(): void {
    this.requested ||= requestAnimationFrame(() => {
      this.requested = 0;
      this.renderer.render(this.scene, this.camera);
      this.showScale();
    });
  }

  show(surface: Surface | null, colouring: Colouring): void {
    this.mesh.visible = surface !== null;
    if (surface && surface !== this.surface) {
      this.replace("position", surface.positions, 3);
      this.replace("normal", surface.normals, 3);
      const index = this.geometry.index;
      const isSame = index?.count === surface.faces.length && (index.array as Uint32Array).every((v, i) => v === surface.faces[i]);
      if (!isSame) this.geometry.setIndex(new THREE.BufferAttribute(surface.faces, 1));
      // Without it a mesh that began empty stays culled.
      this.geometry.computeBoundingSphere();
    }
    this.surface = surface;
    if (surface) {
      const values = colouring.quantity === "deviation" && surface.deviation_m ? surface.deviation_m : surface.uncertainty;
      const [low, high] = colouring.range;
      const colours = new Float32Array(values.length * 3);
      const shade = new THREE.Color();
      values.forEach((value, i) => {
        shade.setRGB(...colour(colouring.scale, (value - low) / (high - low || 1)), THREE.SRGBColorSpace).toArray(colours, 3 * i);
      });
      this.replace("color", colours, 3);
      if (!this.isFitted) {
        this.isFitted = true;
        this.fit();
      }
    }
    this.draw();
  }

  /** Restores a camera that was kept in a link; the first surface then does not move it. */
  lookFrom(camera: number[]): void {
    this.isFitted = true;
    this.camera.position.fromArray(camera);
    this.controls.target.fromArray(camera, 3);
    this.controls.update();
  }

  get place(): number[] {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray()];
  }

  fit(direction = this.camera.position.clone().sub(this.controls.target)): void {
    const sphere = this.geometry.boundingSphere;
    if (!sphere || sphere.radius <= 0) return;
    const angle = THREE.MathUtils.degToRad(this.camera.fov / 2);
    const narrow = Math.min(1, this.camera.aspect);
    this.controls.target.copy(sphere.center);
    this.camera.position.copy(sphere.center).addScaledVector(direction.normalize(), (1.15 * sphere.radius) / Math.sin(angle) / narrow);
    this.controls.update();
    this.draw();
  }

  from(side: "top" | "front" | "side"): void {
    this.fit(new THREE.Vector3(...({ top: [0, -0.001, 1], front: [0, -1, 0], side: [1, 0, 0] }[side] as [number, number, number])));
  }

  showCloud(points: Float32Array[]): void {
    this.empty(this.cloud);
    for (const positions of points) {
      if (!positions.length) continue;
      const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(positions, 3));
      this.cloud.add(new THREE.Points(geometry, new THREE.PointsMaterial({ color: 0x00b7d4, size: 4, sizeAttenuation: false })));
    }
    this.draw();
  }

  showGhost(file: string | null): void {
    this.empty(this.ghost);
    if (file) {
      const material = new THREE.MeshBasicMaterial({ color: 0x8090a0, transparent: true, opacity: 0.18, depthWrite: false });
      const meshes: THREE.BufferGeometry[] = [];
      if (file.startsWith("ply")) meshes.push(new PLYLoader().parse(file));
      else new OBJLoader().parse(file).traverse((part) => part instanceof THREE.Mesh && meshes.push(part.geometry));
      for (const geometry of meshes) this.ghost.add(new THREE.Mesh(geometry, material));
    }
    this.draw();
  }

  showMarks(events: LoggedEvent[], candidates: Candidate[], session: Session): void {
    this.empty(this.marks);
    this.candidates = candidates;
    this.evidence = [];
    const size = Math.max(0.0012, 0.02 * (this.geometry.boundingSphere?.radius ?? 0.06));
    const doubted = new Set(events.at(-1)?.stats_after.doubted_seqs ?? []);
    const revision = events.at(-1)?.seq ?? 0;
    let early = 0;
    for (const { seq, contact_result: result, stats_after, retracted_by_seq } of events) {
      const isEarly = (stats_after.early_contacts ?? 0) > early;
      early = stats_after.early_contacts ?? 0;
      if (!result || (retracted_by_seq > 0 && retracted_by_seq <= revision)) continue;
      const contacts: Contact[] = result.contacts?.contacts ?? (result.contact ? [result.contact] : []);
      for (const contact of contacts) {
        const place = point(contact.sensor_pose?.position);
        this.evidence.push(place);
        const ball = new THREE.Mesh(
          new THREE.SphereGeometry(size, 12, 8),
          new THREE.MeshBasicMaterial({ color: 0x1f5fd0, wireframe: doubted.has(seq) }),
        );
        ball.position.copy(place);
        this.marks.add(ball);
        if (isEarly) {
          const ring = new THREE.Mesh(new THREE.TorusGeometry(2 * size, 0.3 * size, 6, 20), new THREE.MeshBasicMaterial({ color: 0xe08a00 }));
          ring.position.copy(place);
          this.marks.add(ring);
        }
      }
      if (result.no_contact) {
        const [from, to] = [point(result.no_contact.swept_from), point(result.no_contact.swept_to)];
        const cross = [new THREE.Vector3(1, 1, 1), new THREE.Vector3(1, -1, 1), new THREE.Vector3(-1, 1, 1), new THREE.Vector3(1, 1, -1)];
        const ends = cross.flatMap((d) => [to.clone().addScaledVector(d, 1.5 * size), to.clone().addScaledVector(d, -1.5 * size)]);
        this.line([from, to, ...ends], 0xd02030);
      }
    }
    for (const [rank, candidate] of candidates.entries()) {
      const [start, end, place] = [point(candidate.probe_start), point(candidate.probe_end), point(candidate.point)];
      this.line([start, end], 0x7a3fd0);
      const way = end.clone().sub(start);
      const arrow = new THREE.ArrowHelper(way.normalize(), start.clone().addScaledVector(way, -6 * size), start.distanceTo(place) + 6 * size, rank ? 0xa98ae0 : 0x7a3fd0, 4 * size, 2 * size);
      this.marks.add(arrow);
    }
    if (session.config.support) this.plane(session.config.support, 0x808890);
    for (const keepOut of session.config.keep_out ?? []) {
      if ("half_space" in keepOut && keepOut.half_space) this.plane(keepOut.half_space, 0xd02030);
      if ("ball" in keepOut && keepOut.ball) {
        const material = new THREE.MeshBasicMaterial({ color: 0xd02030, transparent: true, opacity: 0.15, depthWrite: false });
        const ball = new THREE.Mesh(new THREE.SphereGeometry(keepOut.ball.radius_m, 24, 16), material);
        ball.position.copy(point(keepOut.ball.center));
        this.marks.add(ball);
      }
    }
    const axes = new THREE.AxesHelper(25 * size);
    this.marks.add(axes);
    this.draw();
  }

  /** The nearest place that was touched, and how far it is. */
  nearestTouch(place: THREE.Vector3): number | null {
    return this.evidence.length ? Math.min(...this.evidence.map((touch) => touch.distanceTo(place))) : null;
  }

  picture(): string {
    this.renderer.render(this.scene, this.camera);
    return this.renderer.domElement.toDataURL("image/png");
  }

  dispose(): void {
    cancelAnimationFrame(this.requested);
    this.resizing.disconnect();
    for (const group of [this.marks, this.cloud, this.ghost]) this.empty(group);
    this.geometry.dispose();
    this.mesh.material.dispose();
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.element.remove();
  }

  private replace(name: string, values: Float32Array, size: number): void {
    const attribute = this.geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
    if (attribute && attribute.array.length === values.length) {
      attribute.copyArray(values);
      attribute.needsUpdate = true;
    } else {
      this.geometry.setAttribute(name, new THREE.BufferAttribute(values.slice(), size));
    }
  }

  private pick(event: MouseEvent): Picked | null {
    const box = this.renderer.domElement.getBoundingClientRect();
    const place = new THREE.Vector2(((event.clientX - box.x) / box.width) * 2 - 1, 1 - ((event.clientY - box.y) / box.height) * 2);
    for (const candidate of this.candidates) {
      for (const end of [candidate.point, candidate.probe_start]) {
        const seen = point(end).project(this.camera);
        const pixels = Math.hypot(((seen.x - place.x) * box.width) / 2, ((seen.y - place.y) * box.height) / 2);
        if (pixels < 12) return { candidate, vertex: candidate.vertex, point: point(candidate.point) };
      }
    }
    if (!this.surface) return null;
    const ray = new THREE.Raycaster();
    ray.setFromCamera(place, this.camera);
    const hit = ray.intersectObject(this.mesh)[0];
    if (!hit?.face) return null;
    const positions = this.geometry.getAttribute("position");
    const corner = (index: number) => new THREE.Vector3().fromBufferAttribute(positions, index);
    const { a, b, c } = hit.face;
    const vertex = [a, b, c].reduce((best, other) => (corner(other).distanceTo(hit.point) < corner(best).distanceTo(hit.point) ? other : best));
    return { vertex, point: corner(vertex) };
  }

  private line(points: THREE.Vector3[], color: number): void {
    this.marks.add(new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color })));
  }

  private plane({ normal, offset_m = 0 }: { normal: Vector; offset_m?: number }, color: number): void {
    const way = point(normal).normalize();
    const side = 6 * (this.geometry.boundingSphere?.radius ?? 0.05);
    const material = new THREE.MeshBasicMaterial({ color, transparent: true, opacity: 0.18, side: THREE.DoubleSide, depthWrite: false });
    const plane = new THREE.Mesh(new THREE.PlaneGeometry(side, side), material);
    plane.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), way);
    const center = this.geometry.boundingSphere?.center.clone() ?? new THREE.Vector3();
    plane.position.copy(center.addScaledVector(way, offset_m - center.dot(way)));
    this.marks.add(plane);
  }

  private empty(group: THREE.Group): void {
    group.traverse((part) => {
      if (part instanceof THREE.Mesh || part instanceof THREE.LineSegments || part instanceof THREE.Points || part instanceof THREE.Line) {
        part.geometry.dispose();
        for (const material of [part.material].flat()) material.dispose();
      }
    });
    group.clear();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    // At once: a resized canvas is blank, and would be seen so until the next frame.
    this.renderer.render(this.scene, this.camera);
    this.showScale();
  }

  private showScale(): void {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const perPixel = (2 * distance * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2))) / (this.element.clientHeight || 1);
    const wanted = 90 * perPixel;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((part) => part * power).find((part) => part <= wanted) ?? power;
    this.bar.style.width = `${length / perPixel}px`;
    this.bar.textContent = length >= 1 ? `${length} m` : `${Number((1e3 * length).toPrecision(3))} mm`;
  }
}
