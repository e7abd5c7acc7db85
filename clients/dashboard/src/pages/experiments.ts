/** Experiments, and one of them as a table of means and spreads, a row for each group. */

import * as api from "../api/client";
import { ago, clear, h, plain } from "../dom";
import { explained } from "../errors";
import { linkTo } from "../place";
import type { Page } from "./page";

export class ExperimentsPage implements Page {
  readonly title = "Experiments";
  readonly element = h("main", {}, h("h1", {}, "Experiments"), h("p", { className: "placeholder" }, "Loading…"));
  #abort = new AbortController();

  constructor() {
    void api.experiments(this.#abort.signal).then(
      (found) => {
        const rows = found.map((one) => h("tr", {}, h("td", {}, h("a", { href: linkTo({ page: "experiment", ids: [one.experiment] }) }, one.experiment)), h("td", {}, one.sessions), h("td", {}, one.active), h("td", {}, one.finished), h("td", {}, ago(one.last_create_time))));
        const head = ["Experiment", "Sessions", "Active", "Finished", "Last session"].map((name) => h("th", { scope: "col" }, name));
        const table = h("table", {}, h("thead", {}, h("tr", {}, ...head)), h("tbody", {}, ...rows));
        clear(this.element, h("h1", {}, "Experiments"), found.length ? table : h("p", {}, "No session names an experiment yet: it is a field of a new session."));
      },
      (error) => this.#abort.signal.aborted || clear(this.element, h("h1", {}, "Experiments"), explained(error)),
    );
  }

  close(): void {
    this.#abort.abort();
  }
}

/** What groups are made by. */
const GROUPINGS = ["labels.strategy,method", "labels.object", "method", "strategy", "template", "state"];
const inWords = (by: string) => by.split(",").map((one) => (one.startsWith("labels.") ? `label ${one.slice(7)}` : one)).join(" and ");
/** The contract's names in words. */
const keyInWords = (key: string) => ["METHOD_", "STRATEGY_", "SESSION_STATE_"].reduce((text, prefix) => (text.startsWith(prefix) ? plain(text, prefix) : text), key);
/** Lengths are metres on the wire, and millimetres in the table. */
const COLUMNS: ["attempts" | "failures" | "mean_uncertainty" | "mean_std_m" | "surface_distance_m", string, number][] = [
  ["attempts", "attempts", 1],
  ["failures", "failures", 1],
  ["mean_uncertainty", "mean uncertainty", 1],
  ["mean_std_m", "deviation, mm", 1000],
  ["surface_distance_m", "error, mm", 1000],
];

export class ExperimentPage implements Page {
  readonly title: string;
  readonly element = h("main");
  #abort = new AbortController();
  #by = h("select", { "aria-label": "Group by", onchange: () => void this.#load() }, ...GROUPINGS.map((name) => h("option", { value: name }, `by ${inWords(name)}`)));
  #content = h("div", { className: "scroll" }, h("p", { className: "placeholder" }, "Loading…"));

  constructor(experiment: string) {
    this.title = experiment;
    const csv = h("a", { href: `/v1/experiments/${encodeURIComponent(experiment)}/summary?format=csv`, download: "" }, "CSV");
    this.element.append(h("header", { className: "row" }, h("h1", {}, experiment), this.#by, csv, h("a", { href: `#/sessions/${encodeURIComponent(experiment)}` }, "its sessions")), this.#content);
    void this.#load();
  }

  close(): void {
    this.#abort.abort();
  }

  async #load(): Promise<void> {
    try {
      const summary = await api.summary(this.title, this.#by.value, this.#abort.signal);
      const head = [...summary.by.map(inWords), "sessions", ...COLUMNS.map(([, name]) => name)].map((name) => h("th", { scope: "col" }, name));
      const rows = summary.groups.map((group) => {
        const cells = COLUMNS.map(([name, , factor]) => spread(group[name], factor));
        return h("tr", {}, ...group.key.map((key) => h("td", {}, keyInWords(key))), h("td", {}, group.n), ...cells.map((cell) => h("td", {}, cell)));
      });
      clear(this.#content, h("table", {}, h("thead", {}, h("tr", {}, ...head)), h("tbody", {}, ...rows)), h("p", { className: "quiet" }, "Mean and sample deviation over the sessions of a group."));
    } catch (error) {
      if (!this.#abort.signal.aborted) clear(this.#content, explained(error));
    }
  }
}

function spread(value: { mean: number; sd: number; n: number } | undefined, factor: number): string {
  if (!value?.n) return "–";
  const deviation = value.n > 1 ? ` ± ${(factor * value.sd).toFixed(2)}` : "";
  return `${(factor * value.mean).toFixed(2)}${deviation}`;
}
