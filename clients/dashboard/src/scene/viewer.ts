/** The view of one session: its surface, coloured, and the marks. It is drawn only when something changed. */

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Surface } from "../api/glb";
import { colour, type Palette } from "../colours";
import { dispose, type Mark } from "./marks";

export type Quantity = "uncertainty" | "std";
export type Side = "top" | "front" | "side";

export interface Colouring {
  quantity: Quantity;
  palette: Palette;
  /** The ends of the colours; of the surface itself where it is left out. */
  range?: [number, number];
}

/** What was clicked. */
export type Picked = { vertex: number; at: THREE.Vector3 } | Mark;

const DIRECTIONS: Record<Side, [number, number, number]> = { top: [0, 0, 1], front: [0, -1, 0], side: [1, 0, 0] };
/** Frames that take longer while the view is turned, in milliseconds, are drawn coarser until it rests. */
const SLOW_MS = 34;
const COARSE = 0.5;
/** A click that moves further than this, in pixels, turns the view. */
const CLICK_PX = 4;

export class Viewer {
  readonly element = document.createElement("div");
  onPick?: (picked: Picked | undefined) => void;
  onHover?: (vertex: number | undefined) => void;
  onCamera?: () => void;
  surface?: Surface;
  /** What the colours stand for now. */
  range: [number, number] = [0, 1];

  #renderer: THREE.WebGLRenderer;
  #scene = new THREE.Scene();
  #camera = new THREE.PerspectiveCamera(35, 1, 0.001, 100);
  #controls: OrbitControls;
  #geometry = new THREE.BufferGeometry();
  #mesh: THREE.Mesh;
  #layers = new Map<string, THREE.Object3D>();
  /** Layers that are not shown, whatever is in them. */
  #hidden = new Set<string>();
  #axes = new THREE.Scene();
  #scale = document.createElement("div");
  #colouring: Colouring = { quantity: "uncertainty", palette: "paper" };
  #isQueued = false;
  #hasFit = false;
  #observer: ResizeObserver;
  /** Of the frames while the view is turned: when the last one was drawn, and how long they take on average. */
  #turning?: { last: number; mean: number; isCoarse: boolean };
  #caster = new THREE.Raycaster();

  constructor() {
    this.element.className = "view";
    this.#renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.#renderer.autoClear = false;
    const canvas = this.#renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "The estimated surface in 3D; F fits it, 1 top, 2 front, 3 side, arrow keys move the view");
    this.#scale.className = "scale";
    this.element.append(canvas, this.#scale);
    this.#mesh = new THREE.Mesh(this.#geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
    this.#mesh.visible = false;
    const headlight = new THREE.DirectionalLight(0xffffff, 1.3);
    this.#camera.add(headlight);
    this.#scene.add(this.#mesh, this.#camera, new THREE.HemisphereLight(0xffffff, 0xc8c8c8, 2.1));
    this.#camera.up.set(0, 0, 1);
    this.#camera.position.set(0.35, -0.35, 0.25);
    this.#controls = new OrbitControls(this.#camera, canvas);
    this.#controls.listenToKeyEvents(canvas);
    this.#controls.addEventListener("change", () => {
      this.draw();
      this.onCamera?.();
    });
    this.#controls.addEventListener("start", () => (this.#turning = { last: 0, mean: 0, isCoarse: false }));
    this.#controls.addEventListener("end", () => {
      const wasCoarse = this.#turning?.isCoarse;
      this.#turning = undefined;
      if (wasCoarse) this.#resize();
    });
    this.#makeAxes();
    this.#listen(canvas);
    this.#observer = new ResizeObserver(() => this.#resize());
    this.#observer.observe(this.element);
  }

  close(): void {
    this.#observer.disconnect();
    this.#controls.dispose();
    this.#layers.forEach(dispose);
    dispose(this.#axes);
    dispose(this.#mesh);
    this.#renderer.dispose();
    this.#renderer.forceContextLoss();
    this.element.remove();
  }

  /** Shows a surface, or none. Its buffers are kept while the faces stay the same. */
  show(surface: Surface | undefined): void {
    const before = this.surface;
    this.surface = surface;
    this.#mesh.visible = surface !== undefined && !this.#hidden.has("surface");
    if (surface) {
      const isSame = before?.positions.length === surface.positions.length && sameFaces(before.faces, surface.faces);
      if (isSame) {
        (this.#geometry.getAttribute("position") as THREE.BufferAttribute).copyArray(surface.positions).needsUpdate = true;
      } else {
        this.#geometry.dispose();
        this.#geometry.setIndex(new THREE.BufferAttribute(surface.faces, 1));
        this.#geometry.setAttribute("position", new THREE.BufferAttribute(surface.positions.slice(), 3));
        this.#geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(surface.positions.length), 3));
      }
      this.#geometry.computeVertexNormals();
      // A mesh that began empty would be taken for invisible for ever.
      this.#geometry.computeBoundingSphere();
      this.#geometry.computeBoundingBox();
      this.#colourIn();
      if (!this.#hasFit) this.fit();
    }
    this.draw();
  }

  colourBy(colouring: Colouring): void {
    this.#colouring = colouring;
    this.#colourIn();
    this.draw();
  }

  /** The least and the largest number of the surface, of the quantity that is shown. */
  get extent(): [number, number] | undefined {
    const values = this.#values();
    if (!values?.length) return undefined;
    let [low, high] = [Infinity, -Infinity];
    for (const value of values) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    return [low, high];
  }

  /** Puts marks in the place of those of the same name. */
  put(name: string, layer: THREE.Object3D | undefined): void {
    const before = this.#layers.get(name);
    if (before) {
      this.#scene.remove(before);
      dispose(before);
      this.#layers.delete(name);
    }
    if (layer) {
      layer.visible = !this.#hidden.has(name);
      this.#layers.set(name, layer);
      this.#scene.add(layer);
    }
    this.draw();
  }

  setVisible(name: string, isVisible: boolean): void {
    if (isVisible) this.#hidden.delete(name);
    else this.#hidden.add(name);
    const layer = name === "surface" ? this.#mesh : this.#layers.get(name);
    if (layer) layer.visible = isVisible && (name !== "surface" || this.surface !== undefined);
    this.draw();
  }

  get centre(): THREE.Vector3 {
    return this.#geometry.boundingSphere?.center.clone() ?? new THREE.Vector3();
  }

  get size(): number {
    return 2 * (this.#geometry.boundingSphere?.radius || 0.1);
  }

  /** All of the surface, from where the view is or from a side. */
  fit(side?: Side): void {
    const direction = side
      ? new THREE.Vector3(...DIRECTIONS[side])
      : this.#camera.position.clone().sub(this.#controls.target);
    if (side === "top") direction.add(new THREE.Vector3(0, -1e-4, 0));
    const half = Math.tan((this.#camera.fov * Math.PI) / 360) * Math.min(1, this.#camera.aspect);
    const distance = (0.62 * this.size) / half;
    this.#controls.target.copy(this.centre);
    this.#camera.position.copy(this.centre).addScaledVector(direction.normalize(), distance);
    this.#controls.update();
    this.#hasFit ||= this.surface !== undefined;
    this.draw();
  }

  /** Where the camera stands and what it looks at, in the session's frame. */
  get camera(): number[] {
    const { position } = this.#camera;
    return [...position.toArray(), ...this.#controls.target.toArray()].map((value) => Number(value.toFixed(4)));
  }

  set camera(place: number[]) {
    if (place.length !== 6 || !place.every(Number.isFinite)) return;
    this.#camera.position.fromArray(place);
    this.#controls.target.fromArray(place, 3);
    this.#hasFit = true;
    this.#controls.update();
    this.draw();
  }

  picture(): Promise<Blob | null> {
    this.#render();
    return new Promise((done) => this.#renderer.domElement.toBlob(done, "image/png"));
  }

  draw(): void {
    if (this.#isQueued) return;
    this.#isQueued = true;
    requestAnimationFrame((now) => {
      this.#isQueued = false;
      this.#keepPace(now);
      this.#render();
    });
  }

  /** Draws coarser while the view is turned where frames take too long, as without a graphics card. */
  #keepPace(now: number): void {
    const turning = this.#turning;
    if (!turning || turning.isCoarse) return;
    const took = now - turning.last;
    turning.last = now;
    // A hand that rests between two frames is no slow frame.
    if (took > 250) return;
    turning.mean = turning.mean ? 0.8 * turning.mean + 0.2 * took : took;
    if (turning.mean <= SLOW_MS) return;
    turning.isCoarse = true;
    this.#resize();
  }

  #render(): void {
    const { width, height } = this.#renderer.domElement;
    if (!width || !height) return;
    const ratio = this.#renderer.getPixelRatio();
    const distance = this.#camera.position.distanceTo(this.#controls.target);
    this.#camera.near = distance / 100;
    this.#camera.far = distance * 100;
    this.#camera.updateProjectionMatrix();
    this.#renderer.setViewport(0, 0, width / ratio, height / ratio);
    this.#renderer.clear();
    this.#renderer.render(this.#scene, this.#camera);
    // The axes of the frame, in a corner.
    const corner = new THREE.PerspectiveCamera(35, 1, 0.1, 10);
    corner.up.copy(this.#camera.up);
    corner.position.copy(this.#camera.position).sub(this.#controls.target).setLength(5.2);
    corner.lookAt(0, 0, 0);
    this.#renderer.setViewport(4, 4, 96, 96);
    this.#renderer.clearDepth();
    this.#renderer.render(this.#axes, corner);
    this.#showScale(distance, height / ratio);
  }

  /** A bar of a round length, as long as it is in the plane that the camera turns about. */
  #showScale(distance: number, height: number): void {
    const metresPerPixel = (2 * distance * Math.tan((this.#camera.fov * Math.PI) / 360)) / height;
    const wanted = 90 * metresPerPixel;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((digit) => digit * power).find((one) => one <= wanted) ?? power;
    this.#scale.style.width = `${length / metresPerPixel}px`;
    const millimetres = 1000 * length;
    this.#scale.textContent = millimetres >= 1 ? `${Math.round(millimetres)} mm` : `${millimetres.toPrecision(1)} mm`;
  }

  #values(): Float32Array | undefined {
    return this.#colouring.quantity === "std" ? this.surface?.std : this.surface?.uncertainty;
  }

  #colourIn(): void {
    const values = this.#values() ?? this.surface?.uncertainty;
    const colours = this.#geometry.getAttribute("color") as THREE.BufferAttribute | undefined;
    if (!values || !colours) return;
    this.range = this.#colouring.range ?? (this.#colouring.quantity === "uncertainty" ? [0, 1] : [0, this.extent?.[1] || 1e-3]);
    const [low, high] = this.range;
    const linear = new THREE.Color();
    for (let vertex = 0; vertex < values.length; vertex++) {
      const [r, g, b] = colour(this.#colouring.palette, (values[vertex]! - low) / (high - low || 1));
      linear.setRGB(r, g, b, THREE.SRGBColorSpace);
      colours.setXYZ(vertex, linear.r, linear.g, linear.b);
    }
    colours.needsUpdate = true;
  }

  #makeAxes(): void {
    this.#axes.add(new THREE.AxesHelper(1).setColors("#e03131", "#2f9e44", "#4c6ef5"));
    for (const [name, place, tint] of [["x", [1.25, 0, 0], "#e03131"], ["y", [0, 1.25, 0], "#2f9e44"], ["z", [0, 0, 1.25], "#4c6ef5"]] as const) {
      const canvas = document.createElement("canvas");
      canvas.width = canvas.height = 64;
      const context = canvas.getContext("2d")!;
      context.font = "bold 52px sans-serif";
      context.textAlign = "center";
      context.fillStyle = tint;
      context.fillText(name, 32, 46);
      const texture = new THREE.CanvasTexture(canvas);
      texture.colorSpace = THREE.SRGBColorSpace;
      const label = new THREE.Sprite(new THREE.SpriteMaterial({ map: texture }));
      label.position.fromArray([...place]);
      label.scale.setScalar(0.55);
      this.#axes.add(label);
    }
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * (this.#turning?.isCoarse ? COARSE : 1));
    this.#renderer.setSize(width, height, false);
    this.#camera.aspect = width / height;
    this.#camera.updateProjectionMatrix();
    this.#render();
  }

  #listen(canvas: HTMLCanvasElement): void {
    let down: [number, number] | undefined;
    canvas.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => {
      const moved = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]);
      if (moved !== undefined && moved <= CLICK_PX) this.onPick?.(this.#pick(event));
      down = undefined;
    });
    let hovered = 0;
    canvas.addEventListener("pointermove", (event) => {
      if (down || !this.onHover || event.timeStamp - hovered < 40) return;
      hovered = event.timeStamp;
      const picked = this.#pick(event, false);
      this.onHover(picked && "vertex" in picked ? picked.vertex : undefined);
    });
    canvas.addEventListener("pointerleave", () => this.onHover?.(undefined));
    canvas.addEventListener("keydown", (event) => {
      const sides: Record<string, Side | undefined> = { "1": "top", "2": "front", "3": "side", f: undefined, F: undefined };
      if (event.key in sides && !event.ctrlKey && !event.metaKey) {
        this.fit(sides[event.key]);
        event.preventDefault();
      }
    });
  }

  #pick(event: PointerEvent, withMarks = true): Picked | undefined {
    const box = this.#renderer.domElement.getBoundingClientRect();
    const at = new THREE.Vector2(
      (2 * (event.clientX - box.left)) / box.width - 1,
      1 - (2 * (event.clientY - box.top)) / box.height,
    );
    this.#caster.setFromCamera(at, this.#camera);
    if (withMarks) {
      this.#caster.params.Points.threshold = 0.012 * this.#camera.position.distanceTo(this.#controls.target);
      const marks = [...this.#layers.values()].filter((layer) => layer.visible);
      for (const hit of this.#caster.intersectObjects(marks, true)) {
        const mark: Mark | undefined = hit.object.userData.marks?.[hit.index ?? -1];
        if (mark) return mark;
      }
    }
    if (!this.#mesh.visible) return undefined;
    const hit = this.#caster.intersectObject(this.#mesh)[0];
    if (!hit?.face || !this.surface) return undefined;
    const corners = [hit.face.a, hit.face.b, hit.face.c];
    const place = (vertex: number) => new THREE.Vector3().fromArray(this.surface!.positions, 3 * vertex);
    corners.sort((a, b) => place(a).distanceToSquared(hit.point) - place(b).distanceToSquared(hit.point));
    return { vertex: corners[0]!, at: place(corners[0]!) };
  }
}

function sameFaces(a: Uint32Array, b: Uint32Array): boolean {
  return a.length === b.length && a.every((corner, index) => corner === b[index]);
}
