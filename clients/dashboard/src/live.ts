/** A session as it is followed: its log, kept up with over broken connections. */

import * as api from "./api/client";

export type Connection = "connecting" | "live" | "reconnecting" | "gone";

const KINDS = ["created", "forked", "visual_prior", "contact_result", "lease", "retracted", "updated", "finished"];
/** The server is asked again after this long, in milliseconds. */
const PAUSES = [250, 500, 1000, 2000, 4000];

export class LiveSession {
  session?: api.Session;
  events: api.Event[] = [];
  connection: Connection = "connecting";
  #source?: EventSource;
  #timer?: number;
  #tries = 0;
  #isClosed = false;

  constructor(
    readonly id: string,
    private readonly onChange: (live: LiveSession) => void,
  ) {
    void this.#begin();
  }

  /** The newest revision that is known. */
  get revision(): number {
    return this.events.at(-1)?.seq ?? 0;
  }

  close(): void {
    this.#isClosed = true;
    this.#source?.close();
    clearTimeout(this.#timer);
  }

  async #begin(): Promise<void> {
    try {
      const [session, events] = await Promise.all([api.session(this.id), api.events(this.id, true)]);
      if (this.#isClosed) return;
      this.session = session;
      this.events = events;
      await this.#listen();
      this.onChange(this);
    } catch (error) {
      this.#failed(error);
    }
  }

  async #listen(): Promise<void> {
    const source = await api.watched(this.id, this.revision);
    if (this.#isClosed) return source.close();
    this.#source = source;
    source.onopen = () => {
      this.#tries = 0;
      this.#tell("live");
    };
    source.onerror = () => {
      source.close();
      this.#failed();
    };
    for (const kind of KINDS) {
      source.addEventListener(kind, (message) => {
        const { event, session } = JSON.parse(message.data);
        if (event.seq <= this.revision) return;
        this.events.push(event);
        this.session = session ?? this.session;
        // Its points are not in the stream.
        if (kind === "visual_prior" || kind === "retracted") void this.#reread();
        this.onChange(this);
      });
    }
    source.addEventListener("problem", () => {
      source.close();
      this.#failed();
    });
  }

  async #reread(): Promise<void> {
    try {
      const events = await api.events(this.id, true);
      if (this.#isClosed || events.length < this.events.length) return;
      this.events = events;
      this.onChange(this);
    } catch {
      // The stream says so if the server is gone.
    }
  }

  #failed(error?: unknown): void {
    if (this.#isClosed) return;
    const isGone = error instanceof api.Refused && error.status === 404;
    this.#tell(isGone ? "gone" : this.events.length ? "reconnecting" : "connecting");
    // One that is not there may be created yet.
    const pause = PAUSES[Math.min(this.#tries++, PAUSES.length - 1)]!;
    this.#timer = window.setTimeout(() => void this.#resume(), pause * (0.75 + 0.5 * Math.random()));
  }

  /** Asks first: a stream that cannot be opened does not say why. */
  async #resume(): Promise<void> {
    if (!this.events.length) return this.#begin();
    try {
      this.session = await api.session(this.id);
      if (!this.#isClosed) await this.#listen();
    } catch (error) {
      this.#failed(error);
    }
  }

  #tell(connection: Connection): void {
    if (this.connection === connection) return;
    this.connection = connection;
    this.onChange(this);
  }
}
