/** Every call that the page makes: HTTP with JSON, and files. All of them go through `ask`. */

import * as access from "../access";
import type { components } from "../../generated/schema";

type Schemas = components["schemas"];
export type Session = Schemas["Session"];
export type SeriesRow = Schemas["SeriesRow"];
export type Candidate = Schemas["Candidate"];
export type ScoreTerm = Schemas["ScoreTerm"];
export type ExplainedVertex = Schemas["ExplainedVertex"];
export type Experiment = Schemas["Experiment"];
export type Summary = Schemas["ExperimentSummary"];
export type Warning = Schemas["Warning"];
export type Vector3 = Schemas["Vector3"];
export type Pose = Schemas["Pose"];

/** An event of a session's log, of whatever kind it is. */
export interface Event {
  seq: number;
  append_time: string;
  actor: string;
  stats_after?: Schemas["SessionStats"];
  retracted_by_seq?: number;
  retraction_reason?: string;
  created?: Schemas["CreateSessionRequest"];
  forked?: Schemas["Forked"];
  visual_prior?: Schemas["VisualPrior"];
  contact_result?: Result;
  lease?: unknown;
  retracted_seq?: number;
  updated?: unknown;
  finished?: string;
}

/** What became of an approach. */
export interface Result {
  candidate_id?: string;
  robot_id?: string;
  contact?: Contact;
  contacts?: { contacts: Contact[] };
  no_contact?: { swept_from?: Vector3; swept_to?: Vector3 };
  rejected?: { reason?: string };
  invalid_contact?: { reason?: string };
  object_moved?: { detail?: string };
}

/** The touches of an event: one for each pad. */
export const contactsOf = ({ contact_result: result }: Event): Contact[] => (result?.contact ? [result.contact] : (result?.contacts?.contacts ?? []));

export interface Contact {
  sensor_pose?: Pose;
  swept_from?: Vector3;
  wrench?: { force?: Vector3 };
}

/** A refusal, in the server's words. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    readonly reason: string,
    detail: string,
    readonly fields: { field: string; description: string }[],
  ) {
    super(detail);
  }
}

/** The server could not be asked at all. */
export class Unreachable extends Error {}

/** The answer; where the server does not know who calls, somebody is asked, and the call goes on. */
async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  const shown = access.headers();
  let response: Response;
  try {
    response = await fetch(path, { ...init, headers: { ...init.headers, ...shown } });
  } catch (error) {
    if (init.signal?.aborted) throw error;
    throw new Unreachable("the server does not answer");
  }
  if (response.ok) return response;
  const problem = await response.json().catch(() => ({}));
  if (response.status === 401) {
    // Another call may have been given a token meanwhile.
    if (shown.Authorization === access.headers().Authorization) await access.askForToken(shown.Authorization ? problem.detail : "");
    return ask(path, init);
  }
  const words = problem.detail ?? `${response.status} ${response.statusText}`;
  throw new Refused(response.status, problem.reason ?? "", words, problem.fields ?? []);
}

const json = async <T>(path: string, init?: RequestInit): Promise<T> => (await ask(path, init)).json();

/** A call that may be repeated: each has a key of its own, so that it is never counted twice. */
function post<T>(path: string, body: unknown, signal?: AbortSignal): Promise<T> {
  const headers = { "Content-Type": "application/json", "Idempotency-Key": crypto.randomUUID() };
  return json(path, { method: "POST", headers, body: JSON.stringify(body), signal });
}

const at = (sessionId: string, rest = "") => `/v1/sessions/${encodeURIComponent(sessionId)}${rest}`;

export async function sessions(signal?: AbortSignal): Promise<Session[]> {
  const found: Session[] = [];
  let token = "";
  do {
    const query = new URLSearchParams({ page_size: "200", page_token: token });
    const page = await json<{ sessions: Session[]; next_page_token: string }>(`/v1/sessions?${query}`, { signal });
    found.push(...page.sessions);
    token = page.next_page_token;
  } while (token && found.length < 2000);
  return found;
}

export const session = (id: string, signal?: AbortSignal) => json<Session>(at(id), { signal });

/** The whole log up to now; clouds only where they are wanted. */
export async function events(id: string, includePoints: boolean, signal?: AbortSignal): Promise<Event[]> {
  const found: Event[] = [];
  let token = "";
  do {
    const query = new URLSearchParams({
      page_size: "500",
      page_token: token,
      include_points: String(includePoints),
    });
    const page = await json<{ events: Event[]; next_page_token: string }>(at(id, `/events?${query}`), { signal });
    found.push(...page.events);
    token = page.next_page_token;
  } while (token);
  return found;
}

/** A file's address as a link opens it, or a stream's: neither can send headers, so it has a ticket for one request. */
export async function opened(address: string): Promise<string> {
  if (!access.isKnown()) return address;
  const { ticket } = await post<{ ticket: string }>("/v1/tickets", {});
  return `${address}${address.includes("?") ? "&" : "?"}ticket=${ticket}`;
}

export const watched = async (id: string, after: number) =>
  new EventSource(await opened(at(id, `/events?after_revision=${after}`)));

/** The surface at a revision as a file of packed numbers, which never changes; nothing before the first view. */
export async function surface(id: string, revision: number, signal?: AbortSignal): Promise<ArrayBuffer | undefined> {
  try {
    return await (await ask(at(id, `/mesh?format=glb&revision=${revision}`), { signal })).arrayBuffer();
  } catch (error) {
    if (error instanceof Refused && error.reason === "NO_VISUAL_PRIOR") return undefined;
    throw error;
  }
}

/** The mesh that the session keeps as the truth. */
export async function reference(id: string, signal?: AbortSignal): Promise<ArrayBuffer | undefined> {
  try {
    return await (await ask(at(id, "/reference"), { signal })).arrayBuffer();
  } catch (error) {
    if (error instanceof Refused && error.status < 500) return undefined;
    throw error;
  }
}

export interface Series {
  rows: SeriesRow[];
  errors_pending: number;
  reference_sha256: string;
}

export const series = (id: string, signal?: AbortSignal) => json<Series>(at(id, "/series"), { signal });

export async function candidates(id: string, count: number, signal?: AbortSignal): Promise<Candidate[]> {
  const reply = await post<{ candidates?: Candidate[] }>(at(id, "/candidates"), { top_k: count }, signal);
  return reply.candidates ?? [];
}

/** What the score of a vertex of the newest surface is made of, and what keeps it from being proposed. */
export const scoreOf = (id: string, vertex: number, signal: AbortSignal) =>
  post<{ revision: number; explained: ExplainedVertex[] }>(at(id, "/candidates"), { top_k: 1, explain_vertices: [vertex] }, signal);

export const experiments = (signal?: AbortSignal) =>
  json<{ experiments: Experiment[] }>("/v1/experiments", { signal }).then((reply) => reply.experiments);

export const summary = (experiment: string, by: string, signal?: AbortSignal) =>
  json<Summary>(`/v1/experiments/${encodeURIComponent(experiment)}/summary?${new URLSearchParams({ by })}`, { signal });

export const create = (request: object) => post<Session>("/v1/sessions", request);

/** Sends a view as the file that it is. */
export function addView(id: string, file: File, query: URLSearchParams): Promise<{ warnings?: string[] }> {
  const kinds: Record<string, string> = { ply: "application/ply", pcd: "application/pcd", png: "image/png" };
  const kind = kinds[file.name.split(".").pop()?.toLowerCase() ?? ""] ?? "application/octet-stream";
  const headers = { "Content-Type": kind, "Idempotency-Key": crypto.randomUUID() };
  return json(at(id, `/priors?${query}`), { method: "POST", headers, body: file });
}

export const finish = (id: string, note: string) => post<Session>(at(id, "/finish"), { note });
export const fork = (id: string, request: object) => post<Session>(at(id, "/fork"), request);
export const retract = (id: string, seq: number, reason: string) =>
  post(at(id, `/events/${seq}/retract`), { reason });
export const report = (id: string, result: object) =>
  post<{ warnings?: string[] }>(at(id, "/contacts"), { result });
export const remove = (id: string) => ask(at(id), { method: "DELETE" });

/** What robots there are to simulate; nothing where the server allows none. */
export interface Simulations {
  objects: string[];
  most_at_once: number;
  running: { session_id: string; object: string; attempts: number; attempts_made: number }[];
}

export async function simulations(signal?: AbortSignal): Promise<Simulations | undefined> {
  try {
    return await json<Simulations>("/v1/simulations", { signal });
  } catch (error) {
    if (error instanceof Refused && error.status === 404) return undefined;
    throw error;
  }
}

export const simulate = (request: object) => post<{ session_id: string }>("/v1/simulations", request);

/** Addresses of files, for links. */
export const files = (id: string, revision: number): [string, string][] => [
  ["PLY", at(id, `/mesh?format=ply&revision=${revision}`)],
  ["GLB", at(id, `/mesh?format=glb&revision=${revision}`)],
  ["STL", at(id, `/mesh?format=stl&revision=${revision}`)],
  ["MCAP recording", at(id, "/export?format=mcap")],
  ["CSV of attempts", at(id, "/export?format=csv")],
  ["Bundle (tar)", at(id, "/export")],
];
