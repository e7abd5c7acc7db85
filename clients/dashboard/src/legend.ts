/** What the colours stand for, with numbers, and which ones are used. It remembers the choice. */

import { type Palette, strip } from "./colours";
import { clear, h } from "./dom";
import { COLOURS } from "./scene/marks";
import type { Colouring, Quantity, Viewer } from "./scene/viewer";

const KEY = "palpate-colours";

interface Choice {
  quantity: Quantity;
  palette: Palette;
  isLocked: boolean;
}

function remembered(): Choice {
  try {
    const { quantity, palette } = JSON.parse(localStorage.getItem(KEY) ?? "{}");
    return { quantity: quantity === "std" ? "std" : "uncertainty", palette: palette === "cividis" ? "cividis" : "paper", isLocked: false };
  } catch {
    return { quantity: "uncertainty", palette: "paper", isLocked: false };
  }
}

/** What the marks of the view mean. */
const MARKS: [keyof typeof COLOURS, string, string][] = [
  ["seen", "●", "seen"],
  ["touched", "●", "touched"],
  ["touched", "○", "doubted"],
  ["early", "●", "touched early"],
  ["missed", "✕", "missed"],
  ["next", "➤", "next"],
];

/** The key to the marks; colours are set as properties, which the page's policy allows and attributes it does not. */
export function keyToMarks(): HTMLElement {
  const entries = MARKS.map(([name, sign, meaning]) => {
    const mark = h("span", { "aria-hidden": "true" }, sign);
    mark.style.color = `#${COLOURS[name].toString(16).padStart(6, "0")}`;
    return h("li", {}, mark, meaning);
  });
  return h("ul", { className: "key", "aria-label": "Marks" }, ...entries);
}

export class Legend {
  readonly element = h("div", { className: "legend" });
  onChange?: () => void;
  #choice = remembered();
  #locked?: [number, number];
  #bar = h("div", { className: "bar" });
  #ends = h("div", { className: "ends" });
  #needle = h("div", { className: "needle" });
  #value = h("output");
  #quantity: HTMLSelectElement;
  #palette: HTMLSelectElement;
  #lock: HTMLInputElement;

  /** A legend of one view, or one of several that share their range. */
  constructor(private readonly viewer: Viewer | Viewer[]) {
    this.#quantity = h("select", { "aria-label": "Coloured by", onchange: () => this.#choose() }, h("option", { value: "uncertainty" }, "uncertainty"), h("option", { value: "std" }, "deviation, mm"));
    this.#palette = h("select", { "aria-label": "Colours", onchange: () => this.#choose() }, h("option", { value: "paper" }, "green to red"), h("option", { value: "cividis" }, "cividis"));
    this.#lock = h("input", { type: "checkbox", onchange: () => this.#choose() });
    this.#quantity.value = this.#choice.quantity;
    this.#palette.value = this.#choice.palette;
    this.element.append(h("div", { className: "row" }, this.#quantity, this.#palette, h("label", { title: "Keep this range of colours" }, this.#lock, "lock")), this.#bar, this.#ends, this.#value, keyToMarks());
    this.#apply();
  }

  get #viewers(): Viewer[] {
    return Array.isArray(this.viewer) ? this.viewer : [this.viewer];
  }

  /** The surfaces changed. */
  refresh(): void {
    this.#apply();
  }

  /** What a vertex has. */
  point(vertex: number | undefined): void {
    const [first] = this.#viewers;
    const surface = first?.surface;
    const values = this.#choice.quantity === "std" ? surface?.std : surface?.uncertainty;
    const value = vertex === undefined ? undefined : values?.[vertex];
    this.#needle.hidden = value === undefined;
    this.#value.textContent = value === undefined ? "" : this.#choice.quantity === "std" ? `${(1000 * value).toFixed(2)} mm here` : `${value.toFixed(2)} here`;
    if (value !== undefined && first) this.#needle.style.left = `${100 * Math.min(Math.max((value - first.range[0]) / (first.range[1] - first.range[0] || 1), 0), 1)}%`;
  }

  #choose(): void {
    this.#choice = { quantity: this.#quantity.value as Quantity, palette: this.#palette.value as Palette, isLocked: this.#lock.checked };
    this.#locked = this.#choice.isLocked ? this.#viewers[0]?.range : undefined;
    try {
      localStorage.setItem(KEY, JSON.stringify(this.#choice));
    } catch {
      // Private windows may forbid it.
    }
    this.#apply();
    this.onChange?.();
  }

  #apply(): void {
    const { quantity, palette } = this.#choice;
    let range = this.#locked;
    const viewers = this.#viewers;
    if (!range && viewers.length > 1 && quantity === "std") {
      viewers.forEach((viewer) => viewer.colourBy({ quantity, palette }));
      range = [0, Math.max(...viewers.map((viewer) => viewer.extent?.[1] ?? 0)) || 1e-3];
    }
    const colouring: Colouring = { quantity, palette, range };
    viewers.forEach((viewer) => viewer.colourBy(colouring));
    const [low, high] = viewers[0]?.range ?? [0, 1];
    const text = (value: number) => (quantity === "std" ? `${(1000 * value).toFixed(2)} mm` : value.toFixed(2));
    clear(this.#bar, strip(palette), this.#needle);
    this.#needle.hidden = true;
    const hasNone = quantity === "std" && viewers.some((viewer) => viewer.surface && !viewer.surface.std);
    clear(this.#ends, h("span", {}, text(low)), h("span", {}, hasNone ? "not stated by this method" : quantity === "std" ? "standard deviation" : "0 certain, 1 a guess"), h("span", {}, text(high)));
  }
}
