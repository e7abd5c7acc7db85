// Every call to the server is made here, so that what each call needs is added in one place.
import type { components } from "./generated/api";

type Schemas = components["schemas"];
export type Session = Schemas["Session"];
export type Stats = Schemas["SessionStats"];
export type Candidate = Schemas["Candidate"];
export type Row = Schemas["SeriesRow"];
export type Vector = Schemas["Vector3"];
export type Contact = Schemas["Contact"];
export type Summary = Schemas["ExperimentSummary"];

/** An event of the log; it has one of the optional fields. */
export interface LoggedEvent {
  seq: number;
  append_time: string;
  stats_after: Stats;
  retracted_by_seq: number;
  visual_prior?: Schemas["VisualPrior"];
  contact_result?: {
    contact?: Contact;
    contacts?: { contacts: Contact[] };
    no_contact?: Schemas["NoContact"];
    object_moved?: Schemas["ObjectMoved"];
  };
}
export interface Step {
  event: LoggedEvent;
  session?: Session;
  candidates: Candidate[];
}
export interface Simulations {
  objects: string[];
  most_at_once: number;
  running: { session_id: string; object: string; attempts: number; attempts_made: number }[];
}

/** What the server refused, with the fields that it named. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    detail: string,
    readonly fields: { field: string; description: string }[],
  ) {
    super(detail);
  }
}

async function call(path: string, init: RequestInit = {}): Promise<Response> {
  const response = await fetch(path, init);
  if (response.ok) return response;
  const problem = await response.json().catch(() => ({}));
  throw new Refused(response.status, problem.detail ?? `the server answered ${response.status}`, problem.fields ?? []);
}

const get = async <T>(path: string, signal?: AbortSignal): Promise<T> => (await call(path, { signal })).json();

/** A change; its key makes a repeated one count once. */
async function send<T>(method: string, path: string, body?: unknown, headers: Record<string, string> = {}): Promise<T> {
  const isJson = !(body instanceof Blob);
  const response = await call(path, {
    method,
    headers: {
      ...(isJson && body !== undefined ? { "content-type": "application/json" } : {}),
      "idempotency-key": `page-${Date.now()}-${Math.random().toString(36).slice(2)}`,
      ...headers,
    },
    body: isJson ? (body === undefined ? undefined : JSON.stringify(body)) : body,
  });
  return response.status === 204 ? (undefined as T) : response.json();
}

const at = (id: string) => `/v1/sessions/${encodeURIComponent(id)}`;

export const api = {
  async sessions(filter: { experiment?: string; labels?: string }, signal?: AbortSignal): Promise<Session[]> {
    const query = new URLSearchParams({ page_size: "100" });
    if (filter.experiment) query.set("experiment", filter.experiment);
    if (filter.labels) query.set("labels", filter.labels);
    return (await get<{ sessions: Session[] }>(`/v1/sessions?${query}`, signal)).sessions;
  },
  session: (id: string) => get<Session>(at(id)),
  create: (body: unknown) => send<Session>("POST", "/v1/sessions", body),
  addPrior: (id: string, file: Blob, type: string, query: string) =>
    send<unknown>("POST", `${at(id)}/priors?${query}`, file, { "content-type": type }),
  candidates: (id: string, top_k: number) =>
    send<{ revision: number; candidates: Candidate[] }>("POST", `${at(id)}/candidates`, { top_k }),
  report: (id: string, result: unknown) => send<unknown>("POST", `${at(id)}/contacts`, { result }),
  finish: (id: string, note: string) => send<Session>("POST", `${at(id)}/finish`, { note }),
  fork: (id: string, body: unknown) => send<Session>("POST", `${at(id)}/fork`, body),
  retract: (id: string, seq: number, reason: string) => send<unknown>("POST", `${at(id)}/events/${seq}/retract`, { reason }),
  series: (id: string, signal?: AbortSignal) =>
    get<{ rows: Row[]; reference_sha256?: string; errors_pending: number }>(`${at(id)}/series`, signal),
  async mesh(id: string, revision: number, signal?: AbortSignal): Promise<ArrayBuffer> {
    return (await call(`${at(id)}/mesh?format=glb&revision=${revision}`, { signal })).arrayBuffer();
  },
  async reference(id: string): Promise<{ text: string } | null> {
    try {
      return { text: await (await call(`${at(id)}/reference`)).text() };
    } catch (error) {
      if (error instanceof Refused) return null;
      throw error;
    }
  },
  async priors(id: string): Promise<LoggedEvent[]> {
    const page = await get<{ events: LoggedEvent[] }>(`${at(id)}/events?include_points=true&page_size=10`);
    return page.events.filter((event) => event.visual_prior);
  },
  experiments: () => get<{ experiments: { experiment: string; sessions: number }[] }>("/v1/experiments"),
  summary: (name: string) =>
    get<Summary>(`/v1/experiments/${encodeURIComponent(name)}/summary?by=labels.strategy,method`),
  async simulations(): Promise<Simulations | null> {
    try {
      return await get<Simulations>("/v1/simulations");
    } catch (error) {
      if (error instanceof Refused && error.status === 404) return null;
      throw error;
    }
  },
  simulate: (body: unknown) => send<{ session_id: string }>("POST", "/v1/simulations", body),
  download: (id: string, kind: string, revision: number) =>
    ["ply", "glb", "stl", "obj"].includes(kind)
      ? `${at(id)}/mesh?format=${kind}&revision=${revision}`
      : `${at(id)}/export${kind === "bundle" ? "" : `?format=${kind}`}`,

  /** Server-sent events after `revision`, until the stream ends; with `fetch`, which can carry headers. */
  async *watch(id: string, revision: number, signal: AbortSignal): AsyncGenerator<Step | "open"> {
    const headers = { accept: "text/event-stream", "last-event-id": String(revision) };
    const response = await call(`${at(id)}/events`, { headers, signal });
    const reader = response.body!.pipeThrough(new TextDecoderStream()).getReader();
    yield "open";
    let text = "";
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      text += value;
      const blocks = text.split("\n\n");
      text = blocks.pop()!;
      for (const block of blocks) {
        const lines = block.split("\n");
        const field = (name: string) =>
          lines.filter((line) => line.startsWith(`${name}:`)).map((line) => line.slice(name.length + 1).trim());
        if (field("event")[0] === "problem") return;
        const data = field("data").join("\n");
        if (data) yield JSON.parse(data) as Step;
      }
    }
  },
};
