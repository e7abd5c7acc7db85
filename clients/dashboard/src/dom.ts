/** Elements, made without any text being read as markup. */

type Child = Node | string | number | undefined | false;
type Properties = { [name: string]: unknown };

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Properties = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value as EventListener);
    else if (name in element && !["list", "form", "role"].includes(name)) Reflect.set(element, name, value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children.filter((child) => child !== undefined && child !== false).map((child) => child instanceof Node ? child : String(child)));
  return element;
}

export const clear = (element: Element, ...children: Child[]) => {
  element.replaceChildren(...children.filter((child) => child !== undefined && child !== false).map((child) => child instanceof Node ? child : String(child)));
};

/** A button that opens a menu, which closes with Escape or when one goes elsewhere. */
export function dropDown(label: string, menu: HTMLElement): HTMLDetailsElement {
  const summary = h("summary", {}, label);
  const details = h("details", {}, summary, menu);
  details.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !details.open) return;
    details.open = false;
    summary.focus();
  });
  details.addEventListener("focusout", ({ relatedTarget }) => {
    if (relatedTarget instanceof Node && !details.contains(relatedTarget)) details.open = false;
  });
  return details;
}

/** A length in the unit that people read. */
export const millimetres = (metres: number | undefined, digits = 1) =>
  metres === undefined ? "–" : `${(1000 * metres).toFixed(digits)} mm`;

export const share = (value: number | undefined) => (value === undefined ? "–" : value.toFixed(2));

/** How long ago a moment was. */
export function ago(time: string): string {
  const seconds = Math.max(0, (Date.now() - Date.parse(time)) / 1000);
  if (seconds < 60) return `${Math.floor(seconds)} s ago`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ago`;
  if (seconds < 86400) return `${Math.floor(seconds / 3600)} h ago`;
  return new Date(time).toLocaleDateString();
}

/** The names of the contract, in words. */
export const plain = (name: string | undefined, prefix: string) =>
  (name ?? "").replace(prefix, "").toLowerCase().replaceAll("_", " ");
