/** What a session found out about its evidence, with what can be done about it. */

import type { Event, Session } from "./api/client";
import * as dialogs from "./dialogs";
import { millimetres } from "./dom";

export interface Advice {
  text: string;
  verb?: string;
  act?: (sessionId: string) => void;
}

/** A view that is off by more is worth calibrating, in metres. */
const OFFSET_M = 0.004;

export function warningsOf(session: Session, events: Event[], revision: number): Advice[] {
  const found: Advice[] = [];
  const stats = events[revision - 1]?.stats_after;
  if (session.state === "SESSION_STATE_QUARANTINED") found.push({ text: `The log is damaged: ${session.quarantine ?? ""} It is shown up to its last sound revision.` });
  for (const seq of stats?.doubted_seqs ?? []) {
    found.push({ text: `The touch of event ${seq} contradicts the others.`, verb: "Take back…", act: (id) => dialogs.retract(id, Number(seq)) });
  }
  for (const offset of stats?.camera_offsets ?? []) {
    const { x = 0, y = 0, z = 0 } = offset.translation_m ?? {};
    const distance = Math.hypot(x, y, z);
    if (distance > OFFSET_M && distance > 2 * (offset.std_m ?? 0)) found.push({ text: `The view of event ${offset.seq} seems to be off by ${millimetres(distance)}: calibrate the camera against the robot.` });
  }
  if (stats?.motion) {
    const { x = 0, y = 0, z = 0 } = stats.motion.translation_m ?? {};
    const what = `The object seems to have moved by ${millimetres(Math.hypot(x, y, z))} before event ${stats.motion.since_seq}`;
    found.push({ text: `${what}; ${stats.motion.followed ? "earlier evidence was taken along." : "it is not followed."}`, verb: "Correct it…", act: dialogs.objectMoved });
  }
  return found;
}
