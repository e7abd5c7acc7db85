/** All sessions: which are alive, how far they are, how well they go. */

import * as api from "../api/client";
import { sparkline } from "../charts";
import * as dialogs from "../dialogs";
import { ago, clear, h, millimetres, plain, share } from "../dom";
import { explained } from "../errors";
import { linkTo } from "../place";
import type { Page } from "./page";

const REFRESH_MS = 2000;
/** Rows that are shown at once. */
const MOST = 200;
export const MOST_COMPARED = 4;

export class SessionsPage implements Page {
  readonly title = "Sessions";
  readonly element = h("main", { className: "sessions" });
  #abort = new AbortController();
  #timer?: number;
  #sessions: api.Session[] = [];
  #curves = new Map<string, { revision: number; values: number[] }>();
  #chosen = new Set<string>();
  #problem = h("div");
  #body = h("tbody");
  #count = h("span", { className: "quiet", role: "status" }, "Loading…");
  #filter = h("input", { type: "search", placeholder: "Filter by id, name, state, experiment:NAME or LABEL:VALUE", "aria-label": "Filter", list: "filters", oninput: () => this.#show() });
  #filters = h("datalist", { id: "filters" });
  #compare = h("button", { type: "button", disabled: true, onclick: () => (location.hash = linkTo({ page: "compare", ids: [...this.#chosen] })) }, "Compare");

  #objects: string[] = [];
  #offered = "";
  #robot = h("button", { type: "button", hidden: true, onclick: () => dialogs.simulate(this.#objects, (id) => (location.hash = linkTo({ page: "session", ids: [id] }))) }, "Simulated robot…");

  constructor(experiment?: string) {
    if (experiment) this.#filter.value = experiment;
    const columns = ["Compare", "Session", "Experiment and labels", "State", "Attempts", "Failures", "Uncertainty", "Deviation", "Last event"];
    this.element.append(
      h("header", { className: "row" }, h("h1", {}, "Sessions"), this.#count, h("span", { className: "grow" }), this.#compare, this.#robot, h("button", { type: "button", className: "primary", onclick: () => dialogs.createSession((id) => (location.hash = linkTo({ page: "session", ids: [id] }))) }, "New session…")),
      this.#filter,
      this.#filters,
      this.#problem,
      h("div", { className: "scroll" }, h("table", {}, h("thead", {}, h("tr", {}, ...columns.map((name) => h("th", { scope: "col" }, name)))), this.#body)),
    );
    void this.#refresh();
    void api.simulations(this.#abort.signal).then((found) => {
      this.#objects = found?.objects ?? [];
      this.#robot.hidden = !found;
    }, () => undefined);
  }

  close(): void {
    this.#abort.abort();
    clearTimeout(this.#timer);
  }

  async #refresh(): Promise<void> {
    try {
      this.#sessions = await api.sessions(this.#abort.signal);
      clear(this.#problem);
      this.#show();
      await this.#loadCurves();
    } catch (error) {
      if (this.#abort.signal.aborted) return;
      clear(this.#problem, error instanceof api.Unreachable ? h("div", { className: "error", role: "alert" }, "The server does not answer; trying again. What is below was true before.") : explained(error));
    }
    if (!this.#abort.signal.aborted) this.#timer = window.setTimeout(() => void this.#refresh(), REFRESH_MS);
  }

  get #filtered(): api.Session[] {
    const words = this.#filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    return this.#sessions.filter((session) => {
      const text = [session.session_id, session.display_name, plain(session.state, "SESSION_STATE_"), ...namesOf(session)].join(" ").toLowerCase();
      return words.every((word) => text.includes(word));
    });
  }

  async #loadCurves(): Promise<void> {
    const due = this.#filtered.slice(0, 30).filter((session) => this.#curves.get(session.session_id!)?.revision !== session.revision);
    for (const session of due) {
      const series = await api.series(session.session_id!, this.#abort.signal).catch(() => undefined);
      if (!series) continue;
      this.#curves.set(session.session_id!, { revision: session.revision!, values: series.rows.map((row) => row.mean_uncertainty) });
    }
    if (due.length) this.#show();
  }

  #show(): void {
    const found = this.#filtered;
    const active = this.#sessions.filter(({ state }) => state === "SESSION_STATE_ACTIVE").length;
    this.#count.textContent = `${found.length} of ${this.#sessions.length}, ${active} active`;
    if (!this.#sessions.length) {
      clear(this.#body, h("tr", {}, h("td", { colSpan: 9, className: "empty-row" }, "There are no sessions yet. ", h("code", {}, "palpate demo --keep"), " fills one, and New session makes one.")));
      return;
    }
    const names = [...new Set(this.#sessions.flatMap(namesOf))].sort();
    if (names.join() !== this.#offered) {
      this.#offered = names.join();
      clear(this.#filters, ...names.map((value) => h("option", { value })));
    }
    if (!found.length) {
      clear(this.#body, h("tr", {}, h("td", { colSpan: 9, className: "empty-row" }, "No session matches the filter.")));
      return;
    }
    const focused = document.activeElement?.id;
    clear(this.#body, ...found.slice(0, MOST).map((session) => this.#row(session)));
    if (focused?.match(/^(choose|label)-/)) document.getElementById(focused)?.focus();
    this.#compare.disabled = this.#chosen.size < 2;
    this.#compare.textContent = this.#chosen.size ? `Compare ${this.#chosen.size}` : "Compare";
  }

  #filterBy(word: string): void {
    const words = this.#filter.value.split(/\s+/).filter(Boolean);
    if (!words.includes(word)) this.#filter.value = [...words, word].join(" ");
    this.#show();
  }

  #row(session: api.Session): HTMLElement {
    const id = session.session_id!;
    const stats = session.stats;
    const most = session.config?.stop?.max_attempts;
    const box = h("input", {
      type: "checkbox",
      id: `choose-${id}`,
      checked: this.#chosen.has(id),
      disabled: !this.#chosen.has(id) && this.#chosen.size >= MOST_COMPARED,
      "aria-label": `Compare ${id}`,
      onchange: () => {
        if (box.checked) this.#chosen.add(id);
        else this.#chosen.delete(id);
        this.#show();
      },
    });
    const curve = this.#curves.get(id)?.values;
    return h(
      "tr",
      {},
      h("td", {}, box),
      h("td", {}, h("a", { href: linkTo({ page: "session", ids: [id] }) }, session.display_name || id), session.display_name ? h("small", { className: "quiet" }, id) : undefined),
      h("td", {}, session.experiment ? h("a", { href: linkTo({ page: "experiment", ids: [session.experiment] }) }, session.experiment) : "", h("div", { className: "labels" }, ...Object.entries(session.labels ?? {}).map(([name, value]) => h("button", { type: "button", id: `label-${id}-${name}`, title: "Only sessions with this label", onclick: () => this.#filterBy(`${name}:${value}`) }, `${name}: ${value}`)))),
      h("td", {}, h("span", { className: `state ${plain(session.state, "SESSION_STATE_").replaceAll(" ", "-")}` }, plain(session.state, "SESSION_STATE_"))),
      h("td", {}, most ? h("progress", { max: most, value: Math.min(stats?.attempts ?? 0, most), "aria-label": "attempts" }) : undefined, ` ${stats?.attempts ?? 0}${most ? ` of ${most}` : ""}`),
      h("td", { "data-name": "failures" }, stats?.failures ?? 0),
      h("td", { "data-name": "uncertainty" }, curve && curve.length > 1 ? sparkline(curve) : undefined, ` ${share(stats?.mean_uncertainty)}`),
      h("td", { "data-name": "deviation" }, millimetres(stats?.mean_std_m, 2)),
      h("td", {}, session.update_time ? ago(session.update_time) : ""),
    );
  }
}

/** What a session can be filtered by: its experiment and its labels, each as one word. */
function namesOf({ experiment, labels }: api.Session): string[] {
  return [...(experiment ? [`experiment:${experiment}`] : []), ...Object.entries(labels ?? {}).map(([name, value]) => `${name}:${value}`)];
}
