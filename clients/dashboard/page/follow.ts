// One session as it grows: every step so far, and the stream that brings the next, reconnected when it breaks.
import { api, type LoggedEvent, type Row, type Session, type Step } from "./api";
import { readGlb, type Surface } from "./mesh";

const KEPT_SURFACES = 32;
const WAIT_MS = [300, 600, 1000, 2000];

export type Connection = "connecting" | "live" | "reconnecting";

export class Followed {
  session: Session | null = null;
  steps = new Map<number, Step>();
  rows: Row[] = [];
  hasReference = false;
  connection: Connection = "connecting";
  private stopped = new AbortController();
  private surfaces = new Map<number, Promise<Surface>>();
  private seriesTimer = 0;

  constructor(
    readonly id: string,
    private readonly changed: () => void,
    private readonly failed: (error: unknown) => void,
  ) {
    void this.run();
  }

  get newest(): number {
    return this.session?.revision ?? 0;
  }

  events(revision: number): LoggedEvent[] {
    return [...this.steps.values()].map((step) => step.event).filter((event) => event.seq <= revision);
  }

  surface(revision: number, signal?: AbortSignal): Promise<Surface> {
    const known = this.surfaces.get(revision);
    if (known) return known;
    const surface = api.mesh(this.id, revision, signal).then(readGlb);
    this.surfaces.set(revision, surface);
    surface.catch(() => this.surfaces.delete(revision));
    const oldest = this.surfaces.keys().next().value;
    if (this.surfaces.size > KEPT_SURFACES && oldest !== undefined) this.surfaces.delete(oldest);
    return surface;
  }

  stop(): void {
    this.stopped.abort();
    clearTimeout(this.seriesTimer);
    this.surfaces.clear();
  }

  private async run(): Promise<void> {
    const { signal } = this.stopped;
    let last = 0;
    for (let failures = 0; !signal.aborted; failures += 1) {
      try {
        this.session ??= await api.session(this.id);
        for await (const step of api.watch(this.id, last, signal)) {
          if (step === "open") {
            this.connection = "live";
            failures = 0;
          } else {
            last = step.event.seq;
            this.steps.set(last, step);
            if (step.session && last >= this.newest) this.session = step.session;
            this.readSeriesSoon();
          }
          this.changed();
        }
      } catch (error) {
        if (signal.aborted) return;
        if (error instanceof Error && "status" in error && error.status === 404) return this.failed(error);
      }
      if (signal.aborted) return;
      this.connection = "reconnecting";
      this.changed();
      await new Promise((resolve) => setTimeout(resolve, WAIT_MS[Math.min(failures, WAIT_MS.length - 1)]));
    }
  }

  /** The series has what events lack, such as the true error; it is read at most twice a second. */
  private readSeriesSoon(): void {
    if (this.seriesTimer) return;
    this.seriesTimer = window.setTimeout(async () => {
      this.seriesTimer = 0;
      try {
        const series = await api.series(this.id, this.stopped.signal);
        this.rows = series.rows;
        this.hasReference = Boolean(series.reference_sha256);
        this.changed();
        if (series.errors_pending > 0) this.readSeriesSoon();
      } catch {
        if (!this.stopped.signal.aborted) this.readSeriesSoon();
      }
    }, 500);
  }
}
