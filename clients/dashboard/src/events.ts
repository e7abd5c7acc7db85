/** The log, in words. */

import type * as api from "./api/client";
import { plain } from "./dom";

/** An event in words. */
export function describe(event: api.Event): string {
  const result = event.contact_result;
  const taken = event.retracted_by_seq ? " (taken back)" : "";
  if (event.created) return "created";
  if (event.forked) return "forked";
  if (event.visual_prior) return `a view${taken}`;
  if (result?.contact || result?.contacts) return `touch${taken}`;
  if (result?.no_contact) return `nothing touched${taken}`;
  if (result?.rejected) return `not approached: ${plain(result.rejected.reason, "REJECT_REASON_")}${taken}`;
  if (result?.invalid_contact) return `invalid contact: ${plain(result.invalid_contact.reason, "INVALID_REASON_")}${taken}`;
  if (result?.object_moved) return `object moved${taken}`;
  if (event.retracted_seq) return `event ${event.retracted_seq} taken back`;
  if (event.finished !== undefined) return "finished";
  return event.lease ? "a place was promised" : "renamed or labelled";
}
