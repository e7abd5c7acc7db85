/** Who looks: a token, in the memory of this page alone, asked for where the server asks who calls. */

import { clear, h } from "./dom";

let token = "";
let asking: Promise<void> | undefined;
const listeners: (() => void)[] = [];

/** What says who calls; nothing where nobody asked. */
export const headers = (): Record<string, string> => (token ? { Authorization: `Bearer ${token}` } : {});

/** Whether a token was given. */
export const isKnown = (): boolean => token !== "";

/** Tells when a token was given. */
export const onKnown = (listener: () => void): void => void listeners.push(listener);

/** Asks for a token, once for all calls that wait for it; `refused` is what the server said of the one before. */
export function askForToken(refused: string): Promise<void> {
  asking ??= new Promise<void>((done) => open(refused, done)).finally(() => (asking = undefined));
  return asking;
}

function open(refused: string, done: () => void): void {
  const input = h("input", { id: "field-token", type: "password", required: true, autocomplete: "off", spellcheck: false });
  const problem = h("div");
  const say = (text: string) => clear(problem, text ? h("p", { className: "error", role: "alert" }, text) : undefined);
  const submit = h("button", { type: "submit", className: "primary" }, "Continue");
  const form = h(
    "form",
    { method: "dialog" },
    h("h2", {}, "Who are you?"),
    h("p", {}, "This server asks who calls. Give it a token: whoever runs it makes one with ", h("code", {}, "palpate token create"), "."),
    h("div", { className: "field" }, h("label", { htmlFor: "field-token" }, "Token"), input, h("small", {}, "It is kept in this page alone, and forgotten when the page is loaded again.")),
    problem,
    h("div", { className: "row end" }, submit),
  );
  // There is nothing to see without one, so that it cannot be waved away.
  const dialog = h("dialog", { "aria-label": "Who are you?", oncancel: (event: Event) => event.preventDefault() }, form);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    submit.disabled = true;
    say("");
    const given = input.value.trim();
    const words = await refusal(given);
    submit.disabled = false;
    if (words) {
      say(words);
      input.select();
      return;
    }
    token = given;
    dialog.close();
    dialog.remove();
    for (const listener of listeners) listener();
    done();
  });
  document.body.append(dialog);
  say(refused);
  dialog.showModal();
  input.focus();
}

/** Why the server does not take this token; nothing where it does. */
async function refusal(given: string): Promise<string> {
  try {
    const response = await fetch("/version", { headers: { Authorization: `Bearer ${given}` } });
    if (response.status !== 401) return "";
    const problem = await response.json().catch(() => ({}));
    return problem.detail ?? "the server does not know this token";
  } catch {
    return "the server does not answer";
  }
}
