// What a user of the generated types writes: it must compile under `--strict`.
import createClient from "openapi-fetch";
import type { components, paths } from "./palpate";

const client = createClient<paths>({ baseUrl: "http://127.0.0.1:7257" });
type Result = components["schemas"]["ContactResult"];
const point = { x: 0.1, y: 0, z: 0.2 };
const missed: Result = { candidate_id: "c", no_contact: { swept_from: point, swept_to: point } };
// @ts-expect-error an outcome is missing
const none: Result = { candidate_id: "c" };

export async function loop(): Promise<number> {
  const params = { path: { session_id: "ball" } };
  const proposed = await client.POST("/v1/sessions/{session_id}/candidates", { params, body: { top_k: 1 } });
  if (!proposed.data) throw new Error(proposed.error.detail);
  const first: components["schemas"]["Candidate"] | undefined = proposed.data.candidates[0];
  const body = { result: missed, propose: 1 };
  const reported = await client.POST("/v1/sessions/{session_id}/contacts", { params, body });
  if (!reported.data) throw new Error(reported.error.detail);
  return reported.data.session.revision + reported.data.candidates.length + (first?.point.x ?? 0);
}
void none;
