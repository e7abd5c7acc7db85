/** One session: its surface now or then, the numbers on the way, and what can be done. */

import * as api from "../api/client";
import { readSurface, type Surface } from "../api/glb";
import { Charts } from "../charts";
import * as dialogs from "../dialogs";
import { clear, dropDown, h, millimetres, plain, share } from "../dom";
import { explained, tell } from "../errors";
import { describe } from "../events";
import { LiveSession } from "../live";
import * as parts from "../picked";
import { readPlace, linkTo, note } from "../place";
import * as marks from "../scene/marks";
import { type Picked, Viewer } from "../scene/viewer";
import { Legend } from "../legend";
import { shadowTable } from "../shadow";
import { warningsOf } from "../warnings";
import type { Page } from "./page";

const CANDIDATES = 3;
/** Between two revisions while playing, in milliseconds. */
const STEP_MS = 250;
/** Surfaces that are kept: scrubbing back is immediate. */
const KEPT = 80;
const SERIES_PAUSE_MS = 400;

export class SessionPage implements Page {
  readonly element = h("main", { className: "session" });
  readonly title: string;
  #live: LiveSession;
  #viewer = new Viewer();
  #legend: Legend;
  #charts = new Charts();
  #surfaces = new Map<number, Surface | undefined>();
  #candidates: { revision: number; list: api.Candidate[] } = { revision: 0, list: [] };
  #rows: api.SeriesRow[] = [];
  /** The revision that is looked at; none follows the newest. */
  #at?: number;
  /** The surface that is on its way. */
  #loading?: { stop: AbortController; isLive: boolean };
  #drawn = "";
  #abort = new AbortController();
  /** Of the question for the score of a picked vertex. */
  #asked?: AbortController;
  #timers = new Set<number>();
  #player?: number;
  #isClosed = false;
  #seriesDue?: number;
  #notePlaceDue?: number;
  #hasReference = false;

  #head = h("header", { className: "session-head" });
  #actions = h("div");
  #facts = h("section", { className: "facts", "aria-label": "The session in numbers" });
  #next = h("section", { className: "row", hidden: true });
  #picked = h("section", { className: "picked", "aria-live": "polite" });
  #warnings = h("section");
  #shadow = h("section");
  #problem = h("div");
  #empty = h("div", { className: "empty" });
  #scrubber = h("input", { type: "range", min: "1", max: "1", value: "1", "aria-label": "Revision" });
  #where = h("output", { className: "where" });
  #playButton = h("button", { type: "button", title: "Play from here, or from the start" }, "▶ Play");
  #liveButton = h("button", { type: "button", title: "Follow the newest revision" }, "Live");

  constructor(id: string) {
    this.title = id;
    this.#legend = new Legend(this.#viewer);
    const place = readPlace();
    this.#at = place.revision;
    this.#build(id);
    if (place.camera) this.#viewer.camera = place.camera;
    this.#live = new LiveSession(id, () => this.#changed());
  }

  close(): void {
    this.#isClosed = true;
    this.#live.close();
    this.#abort.abort();
    this.#asked?.abort();
    this.#timers.forEach((timer) => clearTimeout(timer));
    clearTimeout(this.#notePlaceDue);
    clearInterval(this.#player);
    this.#charts.close();
    this.#viewer.close();
  }

  #build(id: string): void {
    const button = (label: string, title: string, act: () => void) => h("button", { type: "button", title, onclick: act }, label);
    const views = h(
      "div",
      { className: "view-tools", role: "toolbar", "aria-label": "View" },
      button("Fit", "All of the surface (F)", () => this.#viewer.fit()),
      button("Top", "From above (1)", () => this.#viewer.fit("top")),
      button("Front", "From the front (2)", () => this.#viewer.fit("front")),
      button("Side", "From the side (3)", () => this.#viewer.fit("side")),
      button("Picture", "Save what is shown as a PNG file", () => void this.#savePicture()),
      this.#layerSwitch(),
    );
    this.#actions = h(
      "div",
      { className: "actions", role: "toolbar", "aria-label": "Session" },
      button("Add view…", "Send what the camera sees", () => dialogs.addView(id)),
      button("Object moved…", "Report that the object was moved", () => dialogs.objectMoved(id)),
      button("Fork here…", "A session of the touches up to this revision", () => dialogs.fork(id, this.#shown, (fork) => (location.hash = linkTo({ page: "session", ids: [fork] })))),
      button("Finish…", "Close the session", () => dialogs.finish(id)),
      this.#downloads(id),
      button("Delete…", "Remove the session with its log", () => dialogs.remove(id, () => (location.hash = "#/sessions"))),
    );
    const stage = h("div", { className: "stage" }, this.#viewer.element, this.#legend.element, views, this.#empty);
    const time = h("div", { className: "time" }, this.#playButton, this.#scrubber, this.#where, this.#liveButton);
    const side = h("aside", {}, this.#facts, this.#next, this.#picked, this.#warnings, this.#charts.element, this.#shadow);
    this.element.append(this.#head, this.#problem, stage, time, side);

    this.#scrubber.addEventListener("input", () => this.#go(Number(this.#scrubber.value)));
    this.#liveButton.addEventListener("click", () => this.#go(undefined));
    this.#playButton.addEventListener("click", () => this.#togglePlay());
    this.#charts.onPick = (revision) => this.#go(revision);
    this.#viewer.onPick = (picked) => this.#tellPicked(picked);
    this.#viewer.onHover = (vertex) => this.#legend.point(vertex);
    this.#viewer.onCamera = () => {
      // The address follows when the camera rests: browsers limit how often it may change.
      clearTimeout(this.#notePlaceDue);
      this.#notePlaceDue = window.setTimeout(() => this.#noteplace(), 300);
    };
  }

  get #shown(): number {
    return Math.min(this.#at ?? this.#live.revision, this.#live.revision);
  }

  #layerSwitch(): HTMLElement {
    const names: [string, string][] = [["surface", "surface"], ["history", "seen and touched"], ["next", "next touches"], ["limits", "table, keep-out"], ["reference", "reference"]];
    const boxes = names.map(([name, label]) => {
      const box = h("input", { type: "checkbox", checked: true, onchange: () => this.#viewer.setVisible(name, box.checked) });
      return h("label", {}, box, label);
    });
    return dropDown("Layers", h("div", { className: "menu" }, ...boxes));
  }

  #downloads(id: string): HTMLElement {
    const menu = h("div", { className: "menu" });
    const details = dropDown("Download", menu);
    details.addEventListener("toggle", () => {
      clear(menu, ...api.files(id, this.#shown).map(([name, address]) => h("a", { href: address, download: "" }, name)));
    });
    return details;
  }

  /** The log went on, or the connection changed. */
  #changed(): void {
    if (this.#isClosed) return;
    const { connection, session, revision } = this.#live;
    this.#showHead(session, connection);
    if (connection === "gone") {
      clear(this.#problem, h("div", { className: "error", role: "alert" }, `There is no session ${this.title}. `, h("a", { href: "#/sessions" }, "All sessions")));
      return;
    }
    if (!this.#live.events.length) return;
    clear(this.#problem);
    this.#scrubber.max = String(Math.max(revision, 1));
    void this.#update();
    this.#loadSeries();
  }

  #showHead(session: api.Session | undefined, connection: string): void {
    const words: Record<string, string> = { live: "live", connecting: "connecting…", reconnecting: "the server does not answer; trying again", gone: "gone" };
    clear(
      this.#head,
      h("h1", {}, session?.display_name || this.title),
      h("span", { className: "quiet" }, [session?.experiment, ...Object.entries(session?.labels ?? {}).map(([name, value]) => `${name}: ${value}`)].filter(Boolean).join(" · ")),
      h("span", { className: `badge ${connection}`, role: "status" }, words[connection]),
      h("span", { className: "grow" }),
      this.#actions,
    );
  }

  #go(revision: number | undefined): void {
    const newest = this.#live.revision;
    this.#at = revision === undefined || revision >= newest ? undefined : Math.max(1, revision);
    this.#noteplace();
    void this.#update();
  }

  #togglePlay(): void {
    if (this.#player) {
      clearInterval(this.#player);
      this.#player = undefined;
    } else {
      if (this.#at === undefined) this.#go(1);
      this.#player = window.setInterval(() => {
        if (this.#at === undefined) return this.#togglePlay();
        // The next one waits for this one to be seen.
        if (this.#surfaces.has(this.#at)) this.#go(this.#at + 1);
      }, STEP_MS);
    }
    this.#playButton.textContent = this.#player ? "❚❚ Pause" : "▶ Play";
  }

  /** Shows the wanted revision; the surface before stays until the new one is there. */
  async #update(): Promise<void> {
    const revision = this.#shown;
    this.#scrubber.value = String(revision);
    this.#where.textContent = `revision ${revision} of ${this.#live.revision}`;
    this.#liveButton.classList.toggle("on", this.#at === undefined);
    this.#liveButton.setAttribute("aria-pressed", String(this.#at === undefined));
    this.#showFacts(revision);
    this.#charts.show(this.#rows, revision);
    if (!revision) return;
    const isLive = this.#at === undefined;
    // What follows a robot is drawn before the next one is asked for: one that is faster than the network would else
    // never be seen. Who scrubs wants the last one alone.
    if (isLive && this.#loading?.isLive) return;
    this.#loading?.stop.abort();
    const loading = { stop: new AbortController(), isLive };
    this.#loading = loading;
    try {
      const surface = await this.#surface(revision, AbortSignal.any([this.#abort.signal, loading.stop.signal]));
      if (this.#isClosed || this.#loading !== loading) return;
      clear(this.#problem);
      this.#draw(revision, surface);
      if (!isLive) void this.#surface(Math.min(revision + 1, this.#live.revision), this.#abort.signal).catch(() => undefined);
      else if (revision === this.#live.revision) await this.#loadCandidates(revision);
    } catch (error) {
      if (this.#isClosed || this.#loading !== loading || (error as Error).name === "AbortError") return;
      if (!(error instanceof api.Unreachable)) clear(this.#problem, explained(error));
      this.#later(1000, () => void this.#update());
    } finally {
      if (this.#loading === loading) {
        this.#loading = undefined;
        if (isLive && this.#at === undefined && revision !== this.#live.revision && !this.#isClosed) void this.#update();
      }
    }
  }

  async #surface(revision: number, signal: AbortSignal): Promise<Surface | undefined> {
    if (this.#surfaces.has(revision)) return this.#surfaces.get(revision);
    const file = await api.surface(this.title, revision, signal);
    const surface = file && readSurface(file);
    this.#surfaces.set(revision, surface);
    if (this.#surfaces.size > KEPT) this.#surfaces.delete(this.#surfaces.keys().next().value!);
    return surface;
  }

  #draw(revision: number, surface: Surface | undefined): void {
    this.element.dataset.revision = String(revision);
    this.#viewer.show(surface);
    this.#legend.refresh();
    this.#empty.hidden = surface !== undefined;
    this.#empty.textContent = "Nothing was seen yet: send what the camera sees with Add view.";
    const { session, events } = this.#live;
    const key = `${revision} ${events.length}`;
    if (key !== this.#drawn) {
      this.#drawn = key;
      this.#viewer.put("history", marks.history(events, revision));
      if (session && surface) this.#viewer.put("limits", marks.limits(session, this.#viewer.centre, this.#viewer.size));
    }
    const isNewest = this.#candidates.revision === revision && this.#at === undefined;
    this.#showNext(isNewest ? this.#candidates.list : []);
  }

  async #loadCandidates(revision: number): Promise<void> {
    const { session } = this.#live;
    if (this.#candidates.revision === revision || session?.state !== "SESSION_STATE_ACTIVE") return;
    const list = await api.candidates(this.title, CANDIDATES, this.#abort.signal).catch((error) => {
      if (error instanceof api.Refused && error.status < 500) return [];
      throw error;
    });
    if (this.#isClosed || this.#shown !== revision) return;
    this.#candidates = { revision, list };
    this.#showNext(list);
  }

  /** The next touches, in the view and as buttons for those who do not click into it. */
  #showNext(list: api.Candidate[]): void {
    this.#viewer.put("next", list.length ? marks.next(list) : undefined);
    this.#next.hidden = !list.length;
    const button = (candidate: api.Candidate, rank: number) =>
      h("button", { type: "button", "aria-label": `Next touch ${rank + 1}, at vertex ${candidate.vertex}`, title: candidate.why, onclick: () => this.#tellPicked({ candidate }) }, rank + 1);
    clear(this.#next, h("h2", {}, "Next touches"), ...list.map(button));
  }

  /** The series follows the log, some time behind it. */
  #loadSeries(): void {
    if (this.#seriesDue) return;
    this.#seriesDue = this.#later(this.#rows.length ? SERIES_PAUSE_MS : 0, async () => {
      this.#seriesDue = undefined;
      try {
        const series = await api.series(this.title, this.#abort.signal);
        if (this.#isClosed) return;
        this.#rows = series.rows;
        this.#charts.show(this.#rows, this.#shown);
        if (series.reference_sha256 && !this.#hasReference) this.#loadReference();
        clear(this.#shadow, shadowTable(this.#rows));
        if (series.errors_pending) this.#later(1000, () => this.#loadSeries());
      } catch {
        // The next event, or the stream, asks again.
      }
    });
  }

  #loadReference(): void {
    this.#hasReference = true;
    void import("../scene/reference").then(async ({ loadReference }) => {
      const ghost = await loadReference(this.title, this.#abort.signal).catch(() => undefined);
      if (ghost && !this.#isClosed) this.#viewer.put("reference", ghost);
    });
  }

  #showFacts(revision: number): void {
    const { session, events } = this.#live;
    const event = events[revision - 1];
    const stats = event?.stats_after;
    const stop = session?.config?.stop?.max_attempts;
    const facts: [string, string][] = [
      ["state", plain(session?.state, "SESSION_STATE_")],
      ["attempts", `${stats?.attempts ?? 0}${stop ? ` of ${stop}` : ""}`],
      ["failures", `${stats?.failures ?? 0} (${stats?.no_contacts ?? 0} missed, ${stats?.early_contacts ?? 0} early, ${stats?.invalid_contacts ?? 0} invalid)`],
      ["mean uncertainty", share(stats?.mean_uncertainty)],
      ["stated deviation", stats?.mean_std_m ? `${millimetres(stats.mean_std_m)} mean, ${millimetres(stats.max_std_m)} at most` : "–"],
      ["template", stats?.template || "–"],
      ["method", `${plain(session?.config?.method, "METHOD_")}, ${plain(session?.config?.strategy, "STRATEGY_")}`],
      ["frame", session?.frame_id ?? "–"],
      ["event", event ? `${describe(event)}, ${new Date(event.append_time).toLocaleTimeString()}` : "–"],
    ];
    if (this.#at === undefined && session?.should_stop && !session.should_stop.endsWith("UNSPECIFIED")) facts.splice(1, 0, ["advice", `stop: ${plain(session.should_stop, "STOP_REASON_")}`]);
    clear(this.#facts, h("dl", {}, ...facts.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)])));
    const warnings = session ? warningsOf(session, events, revision) : [];
    clear(
      this.#warnings,
      ...warnings.map(({ text, act, verb }) => h("p", { className: "warning" }, text, " ", act && h("button", { type: "button", onclick: () => act(this.title) }, verb ?? ""))),
    );
  }

  #tellPicked(picked: Picked | undefined): void {
    this.#asked?.abort();
    if (!picked) return clear(this.#picked);
    if ("vertex" in picked) return this.#tellVertex(picked.vertex, picked.at.toArray());
    if (picked.candidate) return clear(this.#picked, ...parts.candidateParts(picked.candidate));
    const event = this.#live.events.find(({ seq }) => seq === picked.seq);
    if (!event) return clear(this.#picked);
    clear(
      this.#picked,
      ...parts.eventParts(event, [
        h("button", { type: "button", onclick: () => this.#go(event.seq) }, "Go there"),
        h("button", { type: "button", onclick: () => dialogs.retract(this.title, event.seq) }, "Take back…"),
      ]),
    );
  }

  /** What the surface says of a vertex at once, and then what its score is, which the server tells. */
  #tellVertex(vertex: number, at: number[]): void {
    const revision = this.#shown;
    const score = h("div", {}, "Score: asking…");
    clear(this.#picked, ...parts.vertexParts(vertex, at, this.#viewer.surface!, this.#live.events, revision), score);
    if (this.#at !== undefined) return clear(score, h("p", { className: "quiet" }, "Scores are told at the newest revision only: press Live."));
    if (this.#live.session?.state !== "SESSION_STATE_ACTIVE") return clear(score, h("p", { className: "quiet" }, "The session takes nothing more, so there is no score."));
    this.#asked = new AbortController();
    api.scoreOf(this.title, vertex, this.#asked.signal).then(
      (reply) => {
        const isOfThis = Number(reply.revision) === revision && reply.explained[0];
        clear(score, ...(isOfThis ? parts.scoreParts(isOfThis) : [h("p", { className: "quiet" }, "The surface has changed meanwhile: click again.")]));
      },
      (error: Error) => error.name !== "AbortError" && clear(score, explained(error)),
    );
  }

  async #savePicture(): Promise<void> {
    const blob = await this.#viewer.picture();
    if (!blob) return tell("The picture could not be made.", true);
    const address = URL.createObjectURL(blob);
    h("a", { href: address, download: `${this.title}-r${String(this.#shown).padStart(4, "0")}.png` }).click();
    URL.revokeObjectURL(address);
  }

  #noteplace(): void {
    if (!this.#isClosed) note({ page: "session", ids: [this.title], revision: this.#at, camera: this.#viewer.camera });
  }

  #later(pause: number, act: () => void): number {
    const timer = window.setTimeout(() => {
      this.#timers.delete(timer);
      if (!this.#isClosed) act();
    }, pause);
    this.#timers.add(timer);
    return timer;
  }
}
