// The page: which sessions are shown, at which revision, and everything around them.
import "./style.css";
import { serverActions, sessionActions } from "./actions";
import { api } from "./api";
import { Charts } from "./charts";
import { legend, type Colouring } from "./colouring";
import { explain } from "./dialogs";
import { find, h } from "./dom";
import { List } from "./list";
import { Panel } from "./panel";
import { read, write, type Place } from "./permalink";
import { comparison, experiment, shadows } from "./tables";

const PLAY_MS = 250;
const stage = find("stage");
const colouring: Colouring = { scale: "paper", quantity: "uncertainty", isLocked: true, range: [0, 1], common: null };
let place: Place = read(location.hash);
let panels: Panel[] = [];
let charts: Charts | null = null;
let playing = 0;
let isReached = false;
let requested = 0;
let summary: HTMLElement | null = null;

const scrubber = h("input", { type: "range", min: 1, max: 1, value: 1, "aria-label": "Revision", input: () => seek(Number(scrubber.value)) });
const revisionText = h("output", {});
const play = h("button", { type: "button", "aria-label": "Play", click: () => (playing ? stopPlaying() : startPlaying()) }, "▶");
const live = h("button", { type: "button", class: "live", click: () => seek(newest()) }, "live");
const legendPlace = h("div");
const tables = h("div");

const newest = () => Math.max(1, ...panels.map((panel) => panel.followed.newest));
const revision = () => place.revision ?? newest();

function seek(wanted: number): void {
  // Live is the right end, and nowhere else.
  place.revision = wanted >= newest() ? null : Math.max(1, wanted);
  remember();
  render();
}

function startPlaying(): void {
  if (place.revision === null) place.revision = 1;
  playing = window.setInterval(() => (place.revision === null ? stopPlaying() : seek(place.revision + 1)), PLAY_MS);
  play.textContent = "❚❚";
}

function stopPlaying(): void {
  clearInterval(playing);
  playing = 0;
  play.textContent = "▶";
}

function remember(): void {
  history.replaceState(null, "", write(place));
}

function fail(error: unknown): void {
  const problem = find("problem");
  problem.replaceChildren(explain(error), h("button", { type: "button", "aria-label": "Close", click: () => (problem.hidden = true) }, "×"));
  problem.hidden = false;
}

function open(id: string): void {
  place = { sessions: [id], revision: null, camera: null };
  location.hash = write(place);
  lay();
  void list.refresh();
}

function toggle(id: string, isBeside: boolean): void {
  if (!isBeside) return open(id);
  const others = place.sessions.filter((other) => other !== id);
  const sessions = others.length < place.sessions.length ? others : [...place.sessions, id].slice(-4);
  place = { sessions, revision: place.revision, camera: place.camera };
  location.hash = write(place);
  lay();
}

/** Makes the panels anew where other sessions are to be shown. */
function lay(): void {
  if (panels.length && panels.map(({ id }) => id).join() === place.sessions.join()) return render();
  stopPlaying();
  for (const panel of panels) panel.dispose();
  charts?.dispose();
  summary = null;
  tables.replaceChildren();
  panels = place.sessions.map((id) => new Panel(id, render, fail));
  charts = new Charts(seek);
  for (const panel of panels) {
    if (place.camera) panel.view.lookFrom(place.camera);
    panel.view.controls.addEventListener("start", stopLinking);
    panel.view.onCamera = () => link(panel);
  }
  const first = panels[0];
  if (!first) {
    stage.replaceChildren(h("p", { class: "empty" }, "Choose a session on the left, or start one."), tables);
    return;
  }
  stage.replaceChildren(
    panels.length === 1 ? sessionActions(first, revision, open) : h("div"),
    h("div", { class: `panels n${panels.length}` }, ...panels.map((panel) => panel.element)),
    legendPlace,
    h("div", { class: "time" }, play, scrubber, revisionText, live),
    charts.element,
    tables,
  );
  render();
}

let leading: Panel | null = null;
let remembering = 0;
function stopLinking(): void {
  leading = null;
}

/** All cameras follow the one that was turned. */
function link(panel: Panel): void {
  if (leading && leading !== panel) return;
  leading = panel;
  for (const other of panels) if (other !== panel) other.view.lookFrom(panel.view.place);
  leading = null;
  place.camera = panel.view.place;
  clearTimeout(remembering);
  remembering = window.setTimeout(remember, 300);
}

function render(): void {
  requested ||= requestAnimationFrame(() => {
    requested = 0;
    renderNow();
  });
}

function renderNow(): void {
  showConnection();
  const first = panels[0];
  if (!first) return;
  scrubber.max = String(newest());
  scrubber.value = String(revision());
  revisionText.textContent = `revision ${revision()} of ${newest()}`;
  live.setAttribute("aria-pressed", String(place.revision === null));
  const ranges = panels.map((panel) => panel.ownRange);
  const isShared = !(colouring.isLocked && colouring.quantity === "uncertainty");
  colouring.common = panels.length > 1 && isShared ? [Math.min(...ranges.map(([low]) => low)), Math.max(...ranges.map(([, high]) => high))] : null;
  const before = JSON.stringify(colouring.range);
  void Promise.all(panels.map((panel) => panel.show(place.revision, colouring))).then(() => {
    colouring.range = colouring.common ?? first.ownRange;
    if (JSON.stringify(colouring.range) !== before) showLegend();
  });
  charts?.show(first.followed.rows, revision());
  showTables();
}

function showLegend(): void {
  legendPlace.replaceChildren(legend(colouring, () => (showLegend(), render())));
}

function showTables(): void {
  const parts = [panels.length > 1 ? comparison(panels) : null, shadows(panels[0]?.followed.rows ?? []), summary];
  tables.replaceChildren(...parts.filter((part): part is HTMLElement => part !== null));
  const name = panels[0]?.session?.experiment;
  if (name && !summary) {
    summary = h("button", { type: "button", click: () => experiment(name).then((table) => ((summary = table), showTables()), fail) }, `Summary of the experiment ${name}`);
    tables.append(summary);
  }
}

function showConnection(): void {
  const states = panels.map((panel) => panel.followed.connection);
  const text = !isReached ? "server not reached, reconnecting" : states.includes("reconnecting") ? "reconnecting" : states.includes("connecting") ? "connecting" : "connected";
  const element = find("connection");
  if (element.textContent !== text) element.textContent = text;
  element.className = text === "connected" ? "good" : "bad";
}

const list = new List(find("list"), () => place.sessions, toggle, (sessions) => {
  // On its own the page shows what happened last.
  const id = sessions[0]?.session_id;
  if (!place.sessions.length && id && !location.hash) open(id);
});
list.onReach = (reached) => {
  if (reached && !isReached) {
    api.simulations().then((simulations) => find("actions").replaceChildren(...serverActions(simulations, open)), () => (isReached = false));
  }
  isReached = reached;
  showConnection();
};

addEventListener("hashchange", () => {
  const wanted = read(location.hash);
  if (write(wanted) === write(place)) return;
  place = wanted;
  if (place.camera) for (const panel of panels) panel.view.lookFrom(place.camera);
  lay();
});
addEventListener("keydown", (event) => {
  const target = event.target as HTMLElement;
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName) || document.querySelector("dialog")) return;
  const keys: Record<string, () => void> = {
    f: () => panels.forEach((panel) => panel.view.fit()),
    1: () => panels.forEach((panel) => panel.view.from("top")),
    2: () => panels.forEach((panel) => panel.view.from("front")),
    3: () => panels.forEach((panel) => panel.view.from("side")),
    ArrowLeft: () => seek(revision() - 1),
    ArrowRight: () => seek(revision() + 1),
    " ": () => target.tagName !== "BUTTON" && (playing ? stopPlaying() : startPlaying()),
  };
  const act = keys[event.key.toLowerCase()] ?? keys[event.key];
  if (act) act();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => panels.forEach((panel) => panel.view.theme()));

showLegend();
lay();
