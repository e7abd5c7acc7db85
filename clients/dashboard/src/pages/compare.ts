/** Two to four sessions side by side: one camera, one range of colours, one table. */

import * as api from "../api/client";
import { readSurface } from "../api/glb";
import { clear, h, millimetres, plain, share } from "../dom";
import { Legend } from "../legend";
import { LiveSession } from "../live";
import { linkTo, note, readPlace } from "../place";
import * as marks from "../scene/marks";
import { Viewer } from "../scene/viewer";
import type { Page } from "./page";
import { MOST_COMPARED } from "./sessions";

interface Side {
  live: LiveSession;
  viewer: Viewer;
  caption: HTMLElement;
  shown: number;
  isLoading: boolean;
  /** Mean distance to the reference, in metres. */
  error?: number;
}

export class ComparePage implements Page {
  readonly title = "Compare";
  readonly element = h("main", { className: "compare" });
  #sides: Side[];
  #legend: Legend;
  #table = h("table");
  #abort = new AbortController();
  #isLinking = false;
  #noteDue?: number;
  /** Whether the address says where the camera is. */
  #hasCamera: boolean;

  constructor(private readonly ids: string[]) {
    const camera = readPlace().camera;
    this.#hasCamera = camera !== undefined;
    this.#sides = ids.slice(0, MOST_COMPARED).map((id) => {
      const viewer = new Viewer();
      const caption = h("figcaption", {}, id);
      const side: Side = { viewer, caption, shown: 0, isLoading: false, live: new LiveSession(id, () => void this.#changed(side)) };
      if (camera) viewer.camera = camera;
      viewer.onCamera = () => this.#link(side);
      return side;
    });
    this.#legend = new Legend(this.#sides.map(({ viewer }) => viewer));
    const grid = h("div", { className: `grid of-${this.#sides.length}` }, ...this.#sides.map(({ viewer, caption }) => h("figure", {}, caption, viewer.element)));
    this.element.append(h("header", { className: "row" }, h("h1", {}, "Compare"), h("span", { className: "grow" }), h("button", { type: "button", title: "All of the largest surface", onclick: () => this.#fit() }, "Fit")), grid, this.#legend.element, h("div", { className: "scroll" }, this.#table));
    this.#showTable();
  }

  close(): void {
    this.#abort.abort();
    clearTimeout(this.#noteDue);
    for (const { live, viewer } of this.#sides) {
      live.close();
      viewer.close();
    }
  }

  /** All of the largest surface, so that none is cut off; the others follow. */
  #fit(): void {
    const viewers = this.#sides.map(({ viewer }) => viewer).filter(({ surface }) => surface);
    viewers.sort((a, b) => b.size - a.size)[0]?.fit();
  }

  /** The others look as this one does. */
  #link(from: Side): void {
    if (this.#isLinking) return;
    this.#isLinking = true;
    for (const { viewer } of this.#sides) if (viewer !== from.viewer) viewer.camera = from.viewer.camera;
    this.#isLinking = false;
    clearTimeout(this.#noteDue);
    this.#noteDue = window.setTimeout(() => note({ page: "compare", ids: this.ids, camera: from.viewer.camera }), 300);
  }

  async #changed(side: Side): Promise<void> {
    this.#showTable();
    const { live, viewer } = side;
    if (side.isLoading || side.shown === live.revision) return;
    side.isLoading = true;
    const revision = live.revision;
    try {
      const file = await api.surface(live.id, revision, this.#abort.signal);
      const isFirst = !viewer.surface;
      viewer.show(file && readSurface(file));
      if (isFirst && !this.#hasCamera) this.#fit();
      viewer.put("history", marks.history(live.events, revision));
      side.shown = revision;
      void this.#loadError(side);
      viewer.element.dataset.revision = String(revision);
      this.#legend.refresh();
    } catch {
      // The stream says whether the server is there.
    }
    side.isLoading = false;
    if (!this.#abort.signal.aborted && side.shown === revision && revision !== live.revision) void this.#changed(side);
  }

  /** How far off the surface is, where the session has a reference. */
  async #loadError(side: Side): Promise<void> {
    const series = await api.series(side.live.id, this.#abort.signal).catch(() => undefined);
    const known = series?.rows.filter((row) => row.surface_distance_m !== undefined).at(-1);
    if (this.#abort.signal.aborted || !known) return;
    side.error = known.surface_distance_m;
    this.#showTable();
  }

  #showTable(): void {
    const stats = ({ live }: Side) => live.session?.stats;
    const rows: [string, (side: Side) => string | number][] = [
      ["state", ({ live }) => (live.connection === "live" ? plain(live.session?.state, "SESSION_STATE_") : live.connection === "gone" ? "there is no such session" : live.connection)],
      ["method", ({ live }) => `${plain(live.session?.config?.method, "METHOD_")}, ${plain(live.session?.config?.strategy, "STRATEGY_")}`],
      ["attempts", (side) => stats(side)?.attempts ?? 0],
      ["failures", (side) => stats(side)?.failures ?? 0],
      ["missed", (side) => stats(side)?.no_contacts ?? 0],
      ["early", (side) => stats(side)?.early_contacts ?? 0],
      ["mean uncertainty", (side) => share(stats(side)?.mean_uncertainty)],
      ["mean deviation", (side) => millimetres(stats(side)?.mean_std_m, 2)],
      ["error", ({ error }) => millimetres(error, 2)],
      ["template", (side) => stats(side)?.template || "–"],
    ];
    for (const { caption, live } of this.#sides) clear(caption, h("a", { href: linkTo({ page: "session", ids: [live.id] }) }, live.session?.display_name || live.id));
    clear(
      this.#table,
      h("thead", {}, h("tr", {}, h("td"), ...this.#sides.map(({ live }) => h("th", { scope: "col" }, live.session?.display_name || live.id)))),
      h("tbody", {}, ...rows.map(([name, value]) => h("tr", {}, h("th", { scope: "row" }, name), ...this.#sides.map((side) => h("td", {}, value(side)))))),
    );
  }
}
