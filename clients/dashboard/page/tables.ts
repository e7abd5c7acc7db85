// Sessions in numbers: side by side, as the paper's table, and what other strategies would have done.
import { api, type Row } from "./api";
import { h, mm, unit, word } from "./dom";
import { stateOf, type Panel } from "./panel";

function table(caption: string, head: string[], rows: string[][]): HTMLElement {
  const cells = (tag: "th" | "td", values: string[]) => h("tr", {}, ...values.map((value) => h(tag, tag === "th" ? { scope: "col" } : {}, value)));
  return h("div", { class: "table" }, h("table", {}, h("caption", {}, caption), h("thead", {}, cells("th", head)), h("tbody", {}, ...rows.map((row) => cells("td", row)))));
}

export function comparison(panels: Panel[]): HTMLElement {
  const rows = panels.flatMap(({ id, session, followed }) => {
    if (!session) return [];
    const { stats } = session;
    const error = followed.rows.findLast((row) => row.surface_distance_m !== undefined)?.surface_distance_m;
    return [[session.display_name || id, stateOf(session), word(session.config.method, "METHOD_"), word(session.config.strategy, "STRATEGY_"),
      String(stats.attempts ?? 0), String(stats.failures ?? 0), unit(stats.mean_uncertainty), mm(stats.mean_std_m, 2), mm(error, 2)]];
  });
  return table("Side by side", ["Session", "State", "Method", "Strategy", "Attempts", "Failures", "Uncertainty", "Deviation", "Error"], rows);
}

export function shadows(rows: Row[]): HTMLElement | null {
  const counts = new Map<string, Map<string, number>>();
  for (const { strategy, hindsight } of rows.flatMap((row) => row.shadow_choices)) {
    const of = counts.get(word(strategy, "STRATEGY_")) ?? new Map<string, number>();
    const outcome = word(hindsight, "HINDSIGHT_");
    counts.set(word(strategy, "STRATEGY_"), of.set(outcome, (of.get(outcome) ?? 0) + 1));
  }
  if (!counts.size) return null;
  const lines = [...counts].map(([strategy, of]) => [strategy, ...["hit", "early", "miss"].map((outcome) => String(of.get(outcome) ?? 0))]);
  return table("What the shadow strategies would have done", ["Strategy", "Hit", "Early", "Miss"], lines);
}

export async function experiment(name: string): Promise<HTMLElement> {
  const { groups } = await api.summary(name);
  const spread = (value: { n: number; mean: number; sd: number } | undefined, scale: number, digits: number) =>
    value && value.n > 0 ? `${(scale * value.mean).toFixed(digits)} ± ${(scale * value.sd).toFixed(digits)}` : "–";
  const rows = groups.map((group) => [
    group.key.map((part) => word(part, "METHOD_") || "–").join(" · "), String(group.n), spread(group.attempts, 1, 1), spread(group.failures, 1, 1),
    spread(group.mean_uncertainty, 1, 3), spread(group.surface_distance_m, 1e3, 2)]);
  return table(`Experiment ${name}: mean ± sample deviation`, ["Strategy · method", "n", "Attempts", "Failures", "Uncertainty", "Error, mm"], rows);
}
