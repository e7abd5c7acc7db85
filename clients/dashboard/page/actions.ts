// What can be done: with the server, and with one session.
import { api, type Simulations } from "./api";
import { ask, type Field } from "./dialogs";
import { h } from "./dom";
import type { Panel } from "./panel";

const text = (form: FormData, name: string) => String(form.get(name) ?? "").trim();
const number = (form: FormData, name: string) => Number(text(form, name));
const METHODS = ["METHOD_PALPATE", "METHOD_PAPER", "METHOD_GPIS"];
const button = (label: string, click: () => void) => h("button", { type: "button", click }, label);

export function serverActions(simulations: Simulations | null, open: (id: string) => void): HTMLElement[] {
  const create = () =>
    ask("New session", [
      { name: "session_id", label: "Id", hint: "empty: the server makes one" },
      { name: "display_name", label: "Name" },
      { name: "experiment", label: "Experiment" },
      { name: "object", label: "Label object" },
      { name: "method", label: "Method", options: METHODS },
      { name: "subdivisions", label: "Icosphere subdivisions", type: "number", value: "4", hint: "2 (162 vertices) to 5 (10,242)" },
    ], "Create", async (form) => {
      const object = text(form, "object");
      const session = await api.create({
        session_id: text(form, "session_id"),
        display_name: text(form, "display_name"),
        experiment: text(form, "experiment"),
        labels: object ? { object } : {},
        config: { method: text(form, "method"), icosphere_subdivisions: number(form, "subdivisions") },
      });
      open(session.session_id!);
    });
  const simulate = () =>
    ask("Start a simulated robot", [
      { name: "object", label: "Object", options: simulations!.objects },
      { name: "seed", label: "Seed", type: "number", value: "1" },
      { name: "attempts", label: "Touches", type: "number", value: "50" },
      { name: "pause_ms", label: "Pause before each touch, ms", type: "number", value: "500" },
      { name: "experiment", label: "Experiment", value: "simulation" },
    ], "Start", async (form) => {
      const made = await api.simulate({
        object: text(form, "object"),
        seed: number(form, "seed"),
        attempts: number(form, "attempts"),
        pause_ms: number(form, "pause_ms"),
        experiment: text(form, "experiment"),
      });
      open(made.session_id);
    });
  return [button("New session", create), ...(simulations ? [button("Simulated robot", simulate)] : [])];
}

export function sessionActions(panel: Panel, revision: () => number, open: (id: string) => void): HTMLElement {
  const { id } = panel;
  const prior = () =>
    ask("Upload what a camera sees", [
      { name: "file", label: "PLY, PCD, or 16-bit depth PNG", type: "file" },
      { name: "viewpoint", label: "Camera at x,y,z in m", hint: "PLY and PCD; empty where the file says it" },
      { name: "intrinsics", label: "fx,fy,cx,cy in pixels", hint: "depth PNG only" },
      { name: "pose", label: "base_from_camera x,y,z,qx,qy,qz,qw", hint: "depth PNG only" },
      { name: "depth_scale_m", label: "Metres in one unit of depth", hint: "depth PNG only; 0.001 unless said" },
    ], "Upload", async (form) => {
      const file = form.get("file") as File;
      if (!file.size) throw new Error("file: choose a file");
      const kind = file.name.split(".").at(-1)?.toLowerCase();
      const type = kind === "png" ? "image/png" : kind === "pcd" ? "application/pcd" : "application/ply";
      const query = new URLSearchParams();
      const set = (name: string, value: string) => value && query.set(name, value);
      set("viewpoint", text(form, "viewpoint"));
      const intrinsics = text(form, "intrinsics").split(",");
      ["fx", "fy", "cx", "cy"].forEach((name, i) => set(name, (intrinsics[i] ?? "").trim()));
      set("base_from_camera", text(form, "pose"));
      set("depth_scale_m", text(form, "depth_scale_m"));
      await api.addPrior(id, new Blob([file]), type, String(query));
    });
  const finish = () =>
    ask("Finish the session", [{ name: "note", label: "Note" }], "Finish", async (form) => void (await api.finish(id, text(form, "note"))));
  const fork = () =>
    ask(`Fork at revision ${revision()}`, [
      { name: "new_session_id", label: "New id", hint: "empty: the server makes one" },
      { name: "method", label: "Method", options: ["as it is", ...METHODS] },
    ], "Fork", async (form) => {
      const method = text(form, "method");
      const change = method === "as it is" ? {} : { config: { method }, config_mask: "method" };
      const made = await api.fork(id, { new_session_id: text(form, "new_session_id"), revision: revision(), ...change });
      open(made.session_id!);
    });
  const retract = () =>
    ask("Retract an event", [
      { name: "seq", label: "Event", type: "number", value: String(revision()), hint: "its revision" },
      { name: "reason", label: "Reason" },
    ], "Retract", async (form) => void (await api.retract(id, number(form, "seq"), text(form, "reason"))));
  const axes = ["x", "y", "z"] as const;
  const moved = () => {
    const motion = panel.session?.stats.motion?.translation_m;
    ask("The object moved", [
      ...axes.map((axis): Field => ({ name: axis, label: `Moved along ${axis}, mm`, type: "number", value: ((motion?.[axis] ?? 0) * 1e3).toFixed(1) })),
      { name: "std", label: "Known to, mm", type: "number", value: "1" },
    ], "Correct", async (form) => {
      const [x, y, z] = axes.map((axis) => number(form, axis) / 1e3);
      await api.report(id, {
        object_moved: { new_from_old: { position: { x, y, z }, orientation: { w: 1 } }, std_m: number(form, "std") / 1e3 },
      });
    });
  };
  const picture = () => {
    const link = h("a", { href: panel.view.picture(), download: `${id}-r${revision()}.png` });
    link.click();
  };
  const kinds = ["ply", "glb", "stl", "mcap", "csv", "bundle"];
  const download = h("select", { "aria-label": "Download", change: () => {
    h("a", { href: api.download(id, download.value, revision()), download: "" }).click();
    download.value = "";
  } }, h("option", { value: "" }, "Download"), ...kinds.map((kind) => h("option", { value: kind }, kind === "bundle" ? kind : kind.toUpperCase())));
  const look = (label: string, key: string, act: () => void) => h("button", { type: "button", title: `${label} (${key})`, click: act }, label);
  return h("div", { class: "tools", role: "toolbar", "aria-label": "Session" },
    look("Fit", "F", () => panel.view.fit()), look("Top", "1", () => panel.view.from("top")),
    look("Front", "2", () => panel.view.from("front")), look("Side", "3", () => panel.view.from("side")),
    button("Screenshot", picture), h("span", { class: "gap" }),
    button("Upload view", prior), button("Fork", fork), button("Retract", retract), button("Object moved", moved), button("Finish", finish), download);
}
