// What the colours mean, chosen for all views together, and the legend that says it.
import { gradient, type Scale } from "./colour";
import { h } from "./dom";
import type { Quantity } from "./scene";

export interface Colouring {
  scale: Scale;
  quantity: Quantity;
  isLocked: boolean;
  range: [number, number];
  /** One range for all that are side by side. */
  common: [number, number] | null;
}

export function legend(colouring: Colouring, changed: () => void): HTMLElement {
  const inMm = colouring.quantity === "deviation";
  const text = (value: number) => (inMm ? `${(1e3 * value).toFixed(2)} mm` : value.toFixed(2));
  const [low, high] = colouring.range;
  const strip = h("div", { class: "strip" });
  strip.style.background = gradient(colouring.scale);
  const choice = (label: string, value: string, values: [string, string][], set: (value: string) => void) => {
    const select = h("select", { "aria-label": label, change: () => (set(select.value), changed()) });
    for (const [key, name] of values) select.append(h("option", { value: key, selected: key === value }, name));
    return select;
  };
  return h("div", { class: "legend" },
    choice("Quantity", colouring.quantity, [["uncertainty", "Uncertainty [0, 1]"], ["deviation", "Deviation, mm"]], (value) => (colouring.quantity = value as Quantity)),
    h("span", {}, text(low)), strip, h("span", {}, text(high)),
    choice("Colours", colouring.scale, [["paper", "red–green"], ["cividis", "cividis"]], (value) => (colouring.scale = value as Scale)),
    choice("Colour range", colouring.isLocked ? "locked" : "auto", [["locked", "range locked"], ["auto", "range automatic"]], (value) => (colouring.isLocked = value === "locked")));
}
