// Elements in one expression.

type Child = Node | string | null | undefined | false;
type Options = Record<string, string | number | boolean | ((event: Event) => void) | undefined>;

export function h<K extends keyof HTMLElementTagNameMap>(tag: K, options: Options = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(options)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined) element.setAttribute(name, String(value));
  }
  element.append(...children.filter((child): child is Node | string => Boolean(child)));
  return element;
}

export const find = (id: string): HTMLElement => document.getElementById(id)!;
export const mm = (metres: number | undefined, digits = 1) => (metres === undefined ? "–" : `${(1e3 * metres).toFixed(digits)} mm`);
export const unit = (value: number | undefined) => (value === undefined ? "–" : value.toFixed(3));
/** `STATE_OF_X_GOOD` as "good", without what all values of its kind begin with. */
export const word = (value: string | undefined, prefix: string) =>
  (value ?? "").replace(prefix, "").toLowerCase().replaceAll("_", " ");
