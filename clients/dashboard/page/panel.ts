// One session on the stage: its 3D view, what is picked in it, and a caption.
import { api, type Candidate, type Session } from "./api";
import type { Colouring } from "./colouring";
import { h, mm, unit, word } from "./dom";
import { Followed } from "./follow";
import { readPoints } from "./mesh";
import { View, type Picked } from "./scene";

export class Panel {
  readonly element = h("article", { class: "panel" });
  readonly view: View;
  readonly followed: Followed;
  private caption = h("div", { class: "caption" });
  private note = h("div", { class: "picked", "aria-live": "polite" });
  private empty = h("p", { class: "empty" }, "Waiting for the session.");
  private shownRevision = 0;
  private marksOf = "";
  private cloudOf = -1;
  private ghostShown = false;
  private fetching = new AbortController();
  private ahead: { revision: number; candidates: Candidate[] } = { revision: 0, candidates: [] };
  private pinned: Picked | null = null;
  private range: [number, number] = [0, 1];

  constructor(
    readonly id: string,
    private readonly changed: () => void,
    private readonly failed: (error: unknown) => void,
  ) {
    this.view = new View(`3D view of session ${id}`);
    this.element.append(this.caption, this.view.element, this.empty, this.note);
    this.followed = new Followed(id, changed, failed);
    this.view.onPick = (picked, isClick) => {
      if (isClick) this.pinned = picked;
      this.describe(isClick ? picked : (this.pinned ?? picked));
      if (isClick && picked && !picked.candidate) void this.askTerms(picked);
    };
  }

  get session(): Session | null {
    return this.followed.session;
  }

  /** Shows the session as it was at `revision`, or as it is. */
  async show(revision: number | null, colouring: Colouring): Promise<void> {
    const { session } = this.followed;
    if (!session) return;
    const wanted = Math.min(revision ?? this.followed.newest, this.followed.newest);
    const step = this.followed.steps.get(wanted);
    const stats = step?.event.stats_after ?? session.stats;
    this.caption.replaceChildren(
      h("strong", {}, session.display_name || this.id),
      h("span", {}, `revision ${wanted} · ${stats.attempts ?? 0} attempts · ${stats.failures ?? 0} failures · uncertainty ${unit(stats.mean_uncertainty)}${stats.mean_std_m === undefined ? "" : ` · mean deviation ± ${mm(stats.mean_std_m)}`}`),
    );
    const hasSurface = (stats.visual_points ?? 0) > 0;
    this.empty.hidden = hasSurface;
    if (!hasSurface) {
      this.empty.textContent = "No view yet: upload a prior, or let a robot send one.";
      return;
    }
    this.fetching.abort();
    this.fetching = new AbortController();
    const { signal } = this.fetching;
    try {
      const surface = await this.followed.surface(wanted);
      if (signal.aborted) return;
      const values = colouring.quantity === "deviation" && surface.deviation_m ? surface.deviation_m : surface.uncertainty;
      this.range = colouring.isLocked && colouring.quantity === "uncertainty" ? [0, 1] : extent(values);
      this.view.show(surface, { ...colouring, range: colouring.common ?? this.range });
      this.element.dataset.revision = String(wanted);
      this.shownRevision = wanted;
      if (wanted > 2 && revision !== null) void this.followed.surface(wanted - 1).catch(() => undefined);
      const isNewest = wanted === this.followed.newest;
      if (isNewest && session.state === "SESSION_STATE_ACTIVE" && this.ahead.revision !== wanted) {
        this.ahead = { revision: wanted, candidates: step?.candidates ?? [] };
        api.candidates(this.id, 3).then((reply) => {
          this.ahead = { revision: wanted, candidates: reply.candidates };
          this.changed();
        }, () => undefined);
      }
      const candidates = isNewest ? this.ahead.candidates : (step?.candidates ?? []);
      const marks = `${wanted}/${this.followed.steps.size}/${candidates.length}/${session.retracted_seqs?.length ?? 0}`;
      if (marks !== this.marksOf) {
        this.marksOf = marks;
        this.view.showMarks(this.followed.events(wanted), candidates, session);
      }
      await this.showExtras(stats.visual_points ?? 0);
    } catch (error) {
      if (!signal.aborted && error instanceof Error && "status" in error) this.failed(error);
    }
  }

  get ownRange(): [number, number] {
    return this.range;
  }

  dispose(): void {
    this.fetching.abort();
    this.followed.stop();
    this.view.dispose();
    this.element.remove();
  }

  private async showExtras(points: number): Promise<void> {
    if (points !== this.cloudOf) {
      this.cloudOf = points;
      const priors = await api.priors(this.id);
      this.view.showCloud(priors.map(({ visual_prior: view }) => readPoints(view?.encoding, view?.points)));
    }
    if (this.followed.hasReference && !this.ghostShown) {
      this.ghostShown = true;
      this.view.showGhost((await api.reference(this.id))?.text ?? null);
    }
  }

  private describe(picked: Picked | null, candidate: Candidate | undefined = picked?.candidate): void {
    if (!picked) return this.note.replaceChildren();
    const lines: string[] = [];
    void this.followed.surface(this.shownRevision).then((surface) => {
      if (picked.vertex !== undefined) {
        lines.push(`Vertex ${picked.vertex}: uncertainty ${unit(surface.uncertainty[picked.vertex])}, deviation ± ${mm(surface.deviation_m?.[picked.vertex], 2)}`);
      }
      const nearest = this.view.nearestTouch(picked.point);
      lines.push(nearest === null ? "Not touched yet" : `Nearest touch ${mm(nearest)} away`);
      if (candidate) {
        lines.push(`Candidate: ${candidate.why}`, `Risk of failure ${unit(candidate.failure_risk)}, score ${unit(candidate.score)}`);
        for (const { term, weight, value } of candidate.terms) lines.push(`${term}: ${weight} × ${unit(value)}`);
      }
      this.note.replaceChildren(...lines.map((line) => h("div", {}, line)));
    }, () => undefined);
  }

  /** The terms of a picked vertex, where it is among the places that the server would have touched. */
  private async askTerms(picked: Picked): Promise<void> {
    if (this.session?.state !== "SESSION_STATE_ACTIVE" || this.shownRevision !== this.followed.newest) return;
    const reply = await api.candidates(this.id, 50).catch(() => null);
    const found = reply?.candidates.find((candidate) => candidate.vertex === picked.vertex);
    if (found && this.pinned === picked) this.describe(picked, found);
  }
}

function extent(values: Float32Array): [number, number] {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return [low, high];
}

export const stateOf = (session: Session) => word(session.state, "SESSION_STATE_");
