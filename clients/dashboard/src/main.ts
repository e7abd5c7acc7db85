/** The frame around the pages: which one is shown follows from the address. */

import "./style.css";
import { isKnown, onKnown } from "./access";
import { opened } from "./api/client";
import { clear, h } from "./dom";
import { explained, tell } from "./errors";
import { ComparePage } from "./pages/compare";
import { ExperimentPage, ExperimentsPage } from "./pages/experiments";
import type { Page } from "./pages/page";
import { SessionPage } from "./pages/session";
import { SessionsPage } from "./pages/sessions";
import { readPlace } from "./place";

const app = document.getElementById("app")!;
const content = h("div", { id: "content" });
let page: Page | undefined;
let where = "";

/** Under which link of the navigation a page is. */
const SECTIONS: { [page: string]: string | undefined } = { session: "sessions", compare: "sessions", experiment: "experiments" };

function made(): Page {
  const { page: name, ids } = readPlace();
  const [first] = ids;
  if (name === "session" && first) return new SessionPage(first);
  if (name === "compare" && ids.length) return new ComparePage(ids);
  if (name === "experiments") return new ExperimentsPage();
  if (name === "experiment" && first) return new ExperimentPage(first);
  return new SessionsPage(first);
}

function open(): void {
  const { page: name, ids } = readPlace();
  // A permalink that is only noted changes nothing.
  const next = `${name}/${ids.join(",")}`;
  if (page && next === where) return;
  where = next;
  page?.close();
  try {
    page = made();
    clear(content, page.element);
    document.title = `${page.title} – Palpate`;
  } catch (error) {
    page = undefined;
    clear(content, explained(error));
  }
  for (const link of document.querySelectorAll("nav a")) {
    const isHere = link.getAttribute("href") === `#/${SECTIONS[name] ?? name}` && !link.classList.contains("brand");
    if (isHere) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

const themes = ["auto", "light", "dark"];
const themeButton = h("button", { type: "button", title: "Light, dark, or as the system has it" });
function rememberedTheme(): string {
  try {
    return localStorage.getItem("palpate-theme") ?? "auto";
  } catch {
    return "auto";
  }
}

function setTheme(theme: string): void {
  document.documentElement.dataset.theme = theme;
  themeButton.textContent = `◐ ${theme}`;
  themeButton.setAttribute("aria-label", `Theme: ${theme}`);
  try {
    localStorage.setItem("palpate-theme", theme);
  } catch {
    // Private windows may forbid it; the theme then lasts as long as the page.
  }
}
themeButton.addEventListener("click", () => setTheme(themes[(themes.indexOf(document.documentElement.dataset.theme ?? "auto") + 1) % themes.length]!));
setTheme(rememberedTheme());

const logOut = h("button", { type: "button", hidden: true, title: "Forget the token", onclick: () => location.reload() }, "Log out");
onKnown(() => (logOut.hidden = false));

/** What is downloaded cannot send headers. */
document.addEventListener("click", async (event) => {
  const link = event.target instanceof Element ? event.target.closest("a[download]") : null;
  const address = link?.getAttribute("href");
  if (!isKnown() || !address?.startsWith("/v1/")) return;
  event.preventDefault();
  try {
    h("a", { href: await opened(address), download: "" }).click();
  } catch (error) {
    tell(explained(error), true);
  }
});

clear(
  app,
  h("nav", { "aria-label": "Palpate" }, h("a", { href: "#/sessions", className: "brand" }, "Palpate"), h("a", { href: "#/sessions" }, "Sessions"), h("a", { href: "#/experiments" }, "Experiments"), h("a", { href: "/docs/" }, "API"), h("span", { className: "grow" }), logOut, themeButton),
  content,
);
window.addEventListener("hashchange", open);
window.addEventListener("unhandledrejection", (event) => console.error(event.reason));
open();
