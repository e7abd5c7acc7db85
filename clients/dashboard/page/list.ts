// The sessions of the server, newest first, with how far each is.
import { api, type Row, type Session } from "./api";
import { h, unit } from "./dom";
import { stateOf } from "./panel";

const REFRESH_MS = 2000;

export class List {
  onReach: (isReached: boolean) => void = () => {};
  private items = h("ul", { class: "sessions" });
  private experiment = h("input", { type: "search", placeholder: "Experiment", "aria-label": "Filter by experiment" });
  private labels = h("input", { type: "search", placeholder: "Label, such as object:mug", "aria-label": "Filter by label" });
  private message = h("p", { class: "empty", role: "status" });
  private sparklines = new Map<string, { revision: number; rows: Row[] }>();
  private reading = new AbortController();
  private known = "";

  constructor(
    root: HTMLElement,
    private readonly shown: () => string[],
    private readonly toggle: (id: string, beside: boolean) => void,
    private readonly first: (sessions: Session[]) => void,
  ) {
    const refresh = () => void this.refresh();
    this.experiment.addEventListener("input", refresh);
    this.labels.addEventListener("input", refresh);
    root.append(h("div", { class: "filters" }, this.experiment, this.labels), this.message, this.items);
    void this.refresh();
    setInterval(() => document.hidden || void this.refresh(), REFRESH_MS);
  }

  get filteredExperiment(): string {
    return this.experiment.value.trim();
  }

  async refresh(): Promise<void> {
    this.reading.abort();
    this.reading = new AbortController();
    const { signal } = this.reading;
    try {
      const filter = { experiment: this.filteredExperiment, labels: this.labels.value.trim() };
      const sessions = await api.sessions(filter, signal);
      this.onReach(true);
      this.message.hidden = sessions.length > 0;
      this.message.textContent = sessions.length ? "" : "No sessions here yet. Create one, or start a robot.";
      await Promise.all(sessions.slice(0, 12).map((session) => this.readSparkline(session)));
      if (signal.aborted) return;
      this.draw(sessions);
      this.first(sessions);
    } catch (error) {
      if (signal.aborted) return;
      const isRefused = error instanceof Error && "status" in error;
      this.onReach(isRefused);
      this.message.hidden = false;
      this.message.textContent = isRefused ? (error as Error).message : "The server does not answer. Trying again.";
    }
  }

  draw(sessions: Session[]): void {
    const shown = this.shown();
    const state = JSON.stringify([sessions.map(({ session_id, revision, state, display_name }) => [session_id, revision, state, display_name]), shown]);
    if (state === this.known) return;
    this.known = state;
    const focused = document.activeElement instanceof HTMLElement ? document.activeElement.dataset.key : undefined;
    this.items.replaceChildren(...sessions.map((session) => this.item(session, shown.includes(session.session_id!))));
    if (focused) this.items.querySelector<HTMLElement>(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  }

  private item(session: Session, isShown: boolean): HTMLElement {
    const id = session.session_id!;
    const { stats } = session;
    const most = session.config.stop?.max_attempts;
    const beside = h("input", { type: "checkbox", checked: isShown, "aria-label": `Compare ${session.display_name || id}`, "data-key": `c-${id}`, change: () => this.toggle(id, true) });
    const open = h("button", { type: "button", "data-key": id, "aria-current": isShown && "true", click: () => this.toggle(id, false) },
      h("strong", {}, session.display_name || id),
      h("span", {}, `${stateOf(session)} · ${stats.attempts ?? 0}${most ? `/${most}` : ""} touches · ${stats.failures ?? 0} failures`),
      h("span", {}, `${session.experiment || "no experiment"} · ${unit(stats.mean_uncertainty)} · ${new Date(session.update_time).toLocaleTimeString()}`));
    return h("li", { class: isShown ? "shown" : "" }, beside, open, this.sparkline(id));
  }

  private async readSparkline(session: Session): Promise<void> {
    const id = session.session_id!;
    if (this.sparklines.get(id)?.revision === session.revision) return;
    const { rows } = await api.series(id, this.reading.signal);
    this.sparklines.set(id, { revision: session.revision ?? 0, rows });
  }

  private sparkline(id: string): HTMLCanvasElement {
    const canvas = h("canvas", { width: 96, height: 40, "aria-hidden": "true" });
    const context = canvas.getContext("2d");
    const rows = this.sparklines.get(id)?.rows ?? [];
    if (!context || rows.length < 2) return canvas;
    context.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue("--accent");
    context.lineWidth = 2;
    rows.forEach((row, i) => context.lineTo((i / (rows.length - 1)) * 92 + 2, 38 - 36 * row.mean_uncertainty));
    context.stroke();
    return canvas;
  }
}
