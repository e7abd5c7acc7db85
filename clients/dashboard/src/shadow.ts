/** What the strategies that were asked beside the session's own would have touched, in hindsight. */

import type { SeriesRow } from "./api/client";
import { h, plain } from "./dom";

export function shadowTable(rows: SeriesRow[]): HTMLElement | undefined {
  const counts = new Map<string, { hit: number; miss: number; early: number; unknown: number }>();
  for (const row of rows) {
    for (const choice of row.shadow_choices ?? []) {
      const name = plain(choice.strategy, "STRATEGY_");
      const count = counts.get(name) ?? { hit: 0, miss: 0, early: 0, unknown: 0 };
      const outcome = plain(choice.hindsight as string | undefined, "HINDSIGHT_");
      count[outcome === "hit" || outcome === "miss" || outcome === "early" ? outcome : "unknown"] += 1;
      counts.set(name, count);
    }
  }
  if (!counts.size) return undefined;
  const head = ["strategy", "hit", "missed", "early", "not known"].map((name) => h("th", { scope: "col" }, name));
  const body = [...counts].map(([name, { hit, miss, early, unknown }]) => h("tr", {}, ...[name, hit, miss, early, unknown].map((cell) => h("td", {}, cell))));
  return h("div", {}, h("h2", {}, "What other strategies would have touched"), h("table", {}, h("thead", {}, h("tr", {}, ...head)), h("tbody", {}, ...body)));
}
