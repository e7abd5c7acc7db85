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
  const dialog = h("dialog", { "aria-label": "Who are you?" }, form);
  // There is nothing to see without a token, and calls wait for one: closed with Escape, it is there again. A browser
  // lets only the first Escape be prevented.
  const again = () => {
    dialog.showModal();
    input.focus();
  };
  dialog.addEventListener("close", again);
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
    dialog.removeEventListener("close", again);
    dialog.close();
    dialog.remove();
    for (const listener of listeners) listener();
    done();
  });
  document.body.append(dialog);
  say(refused);
  again();
}

/** Why the server does not take this token; nothing where it does. */
async function refusal(given: string): Promise<string> {
  // What else it may have, no header can carry.
  if (!/^[\x21-\x7e]+$/.test(given)) return "this is no token: it is one word of plain letters, as it was printed";
  try {
    const response = await fetch("/version", { headers: { Authorization: `Bearer ${given}` } });
    // Whoever may not see the version is known all the same.
    if (response.ok || response.status === 403) return "";
    const problem = await response.json().catch(() => ({}));
    return problem.detail ?? `${response.status} ${response.statusText}`;
  } catch {
    return "the server does not answer";
  }
}
