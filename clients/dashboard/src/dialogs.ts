/** What can be done to sessions, each in a dialog that stays until it was done or is closed. */

import * as api from "./api/client";
import { clear, h } from "./dom";
import { explained, tell } from "./errors";

interface Field {
  name: string;
  label: string;
  hint?: string;
  type?: "text" | "number" | "file" | "select" | "checkbox";
  value?: string;
  options?: [string, string][];
  required?: boolean;
  accept?: string;
}

type Values = Map<string, string>;

/** Asks for some values and does something with them; what is refused stays to be put right. */
function ask(title: string, explanation: string, fields: Field[], verb: string, act: (values: Values, file?: File) => Promise<void>): void {
  const inputs = fields.map((field) => {
    const id = `field-${field.name}`;
    const common = { id, name: field.name, required: field.required ?? false };
    const input =
      field.type === "select"
        ? h("select", common, ...(field.options ?? []).map(([value, label]) => h("option", { value, selected: value === field.value }, label)))
        : h("input", {
            ...common,
            type: field.type ?? "text",
            step: field.type === "number" ? "any" : undefined,
            accept: field.accept,
            ...(field.type === "file" ? {} : { value: field.value ?? "" }),
          });
    return { field, input, row: h("div", { className: "field" }, h("label", { htmlFor: id }, field.label), input, field.hint ? h("small", {}, field.hint) : undefined) };
  });
  const problem = h("div");
  const submit = h("button", { type: "submit", className: "primary" }, verb);
  const form = h(
    "form",
    { method: "dialog" },
    h("h2", {}, title),
    h("p", {}, explanation),
    ...inputs.map(({ row }) => row),
    problem,
    h("div", { className: "row end" }, h("button", { type: "button", onclick: () => dialog.close() }, "Cancel"), submit),
  );
  const dialog = h("dialog", { "aria-label": title, onclose: () => dialog.remove() }, form);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    submit.disabled = true;
    clear(problem);
    for (const { input } of inputs) input.removeAttribute("aria-invalid");
    const values: Values = new Map(inputs.map(({ field, input }) => [field.name, input.value.trim()]));
    const file = inputs.map(({ input }) => (input as HTMLInputElement).files?.[0]).find(Boolean);
    try {
      await act(values, file);
      dialog.close();
    } catch (error) {
      clear(problem, explained(error));
      if (error instanceof api.Refused) {
        for (const { field, input } of inputs) {
          if (error.fields.some((wrong) => wrong.field.split(".").at(-1) === field.name)) input.setAttribute("aria-invalid", "true");
        }
      }
    } finally {
      submit.disabled = false;
    }
  });
  document.body.append(dialog);
  dialog.showModal();
}

const METHODS: [string, string][] = [
  ["METHOD_PALPATE", "Palpate"],
  ["METHOD_PAPER", "the paper's"],
  ["METHOD_GPIS", "Gaussian process implicit surface"],
];
const STRATEGIES: [string, string][] = [
  ["STRATEGY_PROACTIVE", "proactive"],
  ["STRATEGY_EXPECTED_GAIN", "expected gain"],
  ["STRATEGY_MIN_UNCERTAINTY", "least uncertainty"],
  ["STRATEGY_UNIFORM", "uniform"],
  ["STRATEGY_RANDOM", "random"],
];

/** A number, or nothing where the field is empty. */
const number = (values: Values, name: string) => (values.get(name) ? Number(values.get(name)) : undefined);
const numbers = (text: string | undefined) => (text ?? "").split(/[\s,;]+/).filter(Boolean).map(Number);

export function createSession(done: (id: string) => void): void {
  const fields: Field[] = [
    { name: "session_id", label: "Id", hint: "letters, digits, dots, dashes; the server makes one where it is empty" },
    { name: "frame_id", label: "Frame", value: "base", required: true, hint: "the frame of every pose and point" },
    { name: "experiment", label: "Experiment", hint: "sessions of one experiment are summed up together" },
    { name: "method", label: "Method", type: "select", options: METHODS },
    { name: "strategy", label: "Strategy", type: "select", options: STRATEGIES },
    { name: "max_attempts", label: "Attempts", type: "number", value: "50" },
    { name: "offset_m", label: "Height of the table, in m", type: "number", hint: "what the object stands on; empty where there is none" },
  ];
  ask("New session", "One session is one object.", fields, "Create", async (values) => {
    const table = number(values, "offset_m");
    const session = await api.create({
      session_id: values.get("session_id"),
      frame_id: values.get("frame_id"),
      experiment: values.get("experiment"),
      config: {
        method: values.get("method"),
        strategy: values.get("strategy"),
        stop: { max_attempts: number(values, "max_attempts") ?? 50, mean_uncertainty_below: 0.25 },
        ...(table === undefined ? {} : { support: { normal: { z: 1 }, offset_m: table } }),
      },
    });
    done(session.session_id!);
  });
}

export function simulate(objects: string[], done: (id: string) => void): void {
  const fields: Field[] = [
    { name: "object", label: "Object", type: "select", options: objects.map((name) => [name, name]), value: "bottle" },
    { name: "seed", label: "Seed", type: "number", value: "1", required: true },
    { name: "attempts", label: "Attempts", type: "number", value: "50", required: true },
    { name: "pause_ms", label: "Pause, in ms", type: "number", value: "500", required: true, hint: "before each touch" },
    { name: "experiment", label: "Experiment", value: "simulation" },
  ];
  ask("Simulated robot", "It sees the object from one side and touches where the server proposes, in a session of its own.", fields, "Start", async (values) => {
    const { session_id: id } = await api.simulate({
      object: values.get("object"),
      seed: number(values, "seed"),
      attempts: number(values, "attempts"),
      pause_ms: number(values, "pause_ms"),
      experiment: values.get("experiment"),
    });
    done(id);
  });
}

export function addView(id: string): void {
  const fields: Field[] = [
    { name: "file", label: "File", type: "file", required: true, accept: ".ply,.pcd,.png,.bin", hint: "PLY or PCD in metres, or a depth image as 16-bit PNG" },
    { name: "viewpoint", label: "Camera's place, x y z in m", hint: "where the camera was; for a depth image it follows from its pose" },
    { name: "intrinsics", label: "fx fy cx cy", hint: "depth images only, in pixels" },
    { name: "base_from_camera", label: "Camera's pose", hint: "depth images only: x y z qx qy qz qw of the optical frame" },
    { name: "max_depth_m", label: "Farthest depth, in m", type: "number", hint: "depth images only" },
  ];
  ask("What the camera sees", "The part of the cloud that shows the object, in the session's frame.", fields, "Send", async (values, file) => {
    const query = new URLSearchParams();
    const put = (name: string, value: string) => value && query.set(name, value);
    put("viewpoint", numbers(values.get("viewpoint")).join(","));
    const isDepth = file!.name.toLowerCase().endsWith(".png");
    if (isDepth) {
      const intrinsics = numbers(values.get("intrinsics"));
      ["fx", "fy", "cx", "cy"].forEach((name, index) => put(name, String(intrinsics[index] ?? "")));
      put("base_from_camera", numbers(values.get("base_from_camera")).join(","));
      put("max_depth_m", values.get("max_depth_m") ?? "");
    }
    const reply = await api.addView(id, file!, query);
    tell(reply.warnings?.length ? reply.warnings.join("; ") : "The view was taken in.");
  });
}

export function finish(id: string): void {
  ask("Finish the session", "It stays readable, takes nothing more, and can be forked.", [{ name: "note", label: "Note" }], "Finish", async (values) => {
    await api.finish(id, values.get("note") ?? "");
  });
}

export function fork(id: string, revision: number, done: (id: string) => void): void {
  const fields: Field[] = [
    { name: "new_session_id", label: "Id of the fork", hint: "the server makes one where it is empty" },
    { name: "method", label: "Method", type: "select", options: [["", "as it is"], ...METHODS] },
    { name: "strategy", label: "Strategy", type: "select", options: [["", "as it is"], ...STRATEGIES] },
  ];
  ask(`Fork at revision ${revision}`, "A session of the same touches up to here, computed anew.", fields, "Fork", async (values) => {
    const changed = ["method", "strategy"].filter((name) => values.get(name));
    const session = await api.fork(id, {
      revision,
      new_session_id: values.get("new_session_id"),
      config: Object.fromEntries(changed.map((name) => [name, values.get(name)])),
      config_mask: changed.join(","),
    });
    done(session.session_id!);
  });
}

export function retract(id: string, seq: number): void {
  const reason: Field = { name: "reason", label: "Reason", required: true, hint: "it stays in the log, beside the event" };
  ask(`Take back event ${seq}`, "The estimate becomes that of the log without it.", [reason], "Take back", async (values) => {
    await api.retract(id, seq, values.get("reason") ?? "");
    tell(`Event ${seq} was taken back.`);
  });
}

export function objectMoved(id: string): void {
  const fields: Field[] = [
    { name: "position", label: "Moved by, x y z in m", value: "0 0 0", required: true },
    { name: "turn", label: "Turned about z by, in degrees", type: "number", value: "0" },
    { name: "std_m", label: "Known to, in m", type: "number", value: "0.002", required: true },
    { name: "detail", label: "What happened" },
  ];
  ask("The object was moved", "What was seen and touched before moves with it.", fields, "Report", async (values) => {
    const [x, y, z] = numbers(values.get("position"));
    const half = ((number(values, "turn") ?? 0) * Math.PI) / 360;
    const orientation = { x: 0, y: 0, z: Math.sin(half), w: Math.cos(half) };
    const moved = { new_from_old: { position: { x, y, z }, orientation }, std_m: number(values, "std_m"), detail: values.get("detail") };
    const reply = await api.report(id, { object_moved: moved });
    tell(reply.warnings?.length ? reply.warnings.join("; ") : "The motion was taken in.");
  });
}

export function remove(id: string, done: () => void): void {
  ask(`Delete ${id}`, "The session goes with its whole log. Take a bundle first if it may be needed.", [], "Delete", async () => {
    await api.remove(id);
    done();
  });
}
