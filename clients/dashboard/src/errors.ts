/** What went wrong, where people see it: in the server's words, with the field named. */

import { Refused } from "./api/client";
import { clear, h } from "./dom";

export function explained(error: unknown): HTMLElement {
  const box = h("div", { className: "error", role: "alert" });
  clear(box, h("strong", {}, error instanceof Refused && error.status === 404 ? "Not found. " : ""), error instanceof Error ? error.message : String(error));
  if (error instanceof Refused) {
    const fields = error.fields.filter(({ field }) => !error.message.startsWith(field));
    if (fields.length) box.append(h("ul", {}, ...fields.map(({ field, description }) => h("li", {}, h("code", {}, field), `: ${description}`))));
  }
  return box;
}

/** A line at the bottom that goes by itself. */
export function tell(text: string | HTMLElement, isError = false): void {
  const line = h("div", { className: isError ? "toast bad" : "toast", role: isError ? "alert" : "status" }, text);
  document.body.append(line);
  setTimeout(() => line.remove(), isError ? 12_000 : 4_000);
}
