/** What a click on the view tells: of a vertex, of a next touch, of an event. */

import * as api from "./api/client";
import { visualPoints } from "./api/points";
import { h, millimetres, share } from "./dom";
import { describe } from "./events";

/** Why a vertex is no candidate, in words that go on after "It is no candidate:". */
const EXCLUSIONS: { [exclusion: string]: string } = {
  EXCLUSION_ALREADY_CERTAIN: "it is less uncertain than a candidate has to be (candidate_min)",
  EXCLUSION_NO_CONFIDENT_NEIGHBOUR: "no vertex beside it is confident yet",
  EXCLUSION_KEEP_OUT: "its approach would enter the table or another keep-out region",
  EXCLUSION_LEASED: "it is promised to another robot",
  EXCLUSION_RECENTLY_FAILED: "a touch near it failed lately",
  EXCLUSION_UNREACHABLE: "a robot could not approach a place near it",
  EXCLUSION_NOT_COMPARED: "the strategy compares an even selection of vertices, and it is not among them",
};

const heading = (text: string) => h("h2", {}, text);
const line = (text: string) => h("p", {}, text);

/** What a score is made of, term by term. */
function scoreTable(terms: api.ScoreTerm[], score: number): HTMLElement {
  const columns = ["term", "weight", "value", "score"].map((name) => h("th", { scope: "col" }, name));
  const rows = terms.map(({ term, weight, value }) => h("tr", {}, h("th", { scope: "row" }, term), ...[weight, value, weight * value].map((number) => h("td", {}, number.toFixed(2)))));
  const sum = h("tr", { className: "sum" }, h("th", { scope: "row" }, "score"), h("td"), h("td"), h("td", {}, score.toFixed(2)));
  return h("table", { className: "terms" }, h("thead", {}, h("tr", {}, ...columns)), h("tbody", {}, ...rows, sum));
}

export function candidateParts(candidate: api.Candidate): HTMLElement[] {
  const risk = `risk of failure ${share(candidate.failure_risk)}, uncertainty ${share(candidate.uncertainty)}, stated deviation ${millimetres(candidate.std_m, 2)}`;
  return [
    heading(`Next touch, at vertex ${candidate.vertex}`),
    line(`Why: ${candidate.why}.`),
    line(`${risk}${candidate.sensor_id ? `, with the pad “${candidate.sensor_id}”` : ""}`),
    ...(candidate.terms.length ? [scoreTable(candidate.terms, candidate.score)] : []),
  ];
}

/** A vertex as the surface has it; its score is asked of the server, where there is one. */
export function vertexParts(vertex: number, at: number[], surface: { uncertainty: Float32Array; std?: Float32Array }, events: api.Event[], revision: number): HTMLElement[] {
  const { uncertainty, std } = surface;
  const near = nearestEvidence(events, revision, at);
  return [
    heading(`Vertex ${vertex} at revision ${revision}`),
    line(`at ${at.map((value) => (1000 * value).toFixed(1)).join(", ")} mm`),
    line(`uncertainty ${share(uncertainty[vertex])}${std ? `, stated deviation ${millimetres(std[vertex], 2)}` : ""}`),
    ...(near ? [line(`nearest attractor: ${near.what}, ${millimetres(near.distance)} away`)] : []),
  ];
}

/** The score of a vertex, whether it can be proposed or not. */
export function scoreParts({ terms, score, failure_risk, excluded }: api.ExplainedVertex): HTMLElement[] {
  const reason = EXCLUSIONS[excluded];
  return [
    line(reason ? `It is no candidate: ${reason}.` : "It can be proposed."),
    ...(failure_risk ? [line(`risk of failure ${share(failure_risk)}`)] : []),
    scoreTable(terms, score),
  ];
}

export function eventParts(event: api.Event, buttons: HTMLElement[]): HTMLElement[] {
  const force = api.contactsOf(event)[0]?.wrench?.force;
  return [
    heading(`Event ${event.seq}`),
    line(`${describe(event)} by ${event.contact_result?.robot_id || event.actor}, ${new Date(event.append_time).toLocaleString()}`),
    ...(force ? [line(`force ${Math.hypot(force.x ?? 0, force.y ?? 0, force.z ?? 0).toFixed(2)} N`)] : []),
    h("div", { className: "row" }, ...buttons),
  ];
}

/** The touch or visual point nearest to a place. */
function nearestEvidence(events: api.Event[], revision: number, place: number[]): { what: string; distance: number } | undefined {
  let best: { what: string; distance: number } | undefined;
  const offer = (what: string, at: ArrayLike<number>, from = 0) => {
    const distance = Math.hypot(at[from]! - place[0]!, at[from + 1]! - place[1]!, at[from + 2]! - place[2]!);
    if (!best || distance < best.distance) best = { what, distance };
  };
  for (const event of events) {
    if (event.seq > revision) break;
    if (event.retracted_by_seq && event.retracted_by_seq <= revision) continue;
    for (const { sensor_pose } of api.contactsOf(event)) {
      const position = sensor_pose?.position;
      if (position) offer(`the touch of event ${event.seq}`, [position.x ?? 0, position.y ?? 0, position.z ?? 0]);
    }
    if (event.visual_prior) {
      const points = visualPoints(event);
      for (let from = 0; from < points.length; from += 3) offer("a visual point", points, from);
    }
  }
  return best;
}
