/** A session's numbers over its attempts, with the revision that is shown. */

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { SeriesRow } from "./api/client";
import { h } from "./dom";

interface Curve {
  title: string;
  unit: string;
  value: (row: SeriesRow) => number | undefined;
  colour: string;
}

const CURVES: Curve[] = [
  { title: "mean uncertainty", unit: "in [0, 1]", value: (row) => row.mean_uncertainty, colour: "#e8590c" },
  { title: "failures", unit: "in all", value: (row) => row.failures, colour: "#e03131" },
  { title: "error", unit: "mm", value: (row) => thousandfold(row.surface_distance_m), colour: "#2f9e44" },
  { title: "stated deviation", unit: "mm, mean", value: (row) => thousandfold(row.mean_std_m), colour: "#7048e8" },
  { title: "force", unit: "N", value: (row) => row.force_n, colour: "#1c7ed6" },
];

const thousandfold = (value: number | undefined) => (value === undefined ? undefined : 1000 * value);
const HEIGHT = 96;
/** Between two marks of the revisions, which are whole numbers. */
const WHOLE = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

/** The colour of what is not in front, as the theme has it now. */
const quiet = () => getComputedStyle(probe).color;
const probe = h("span", { className: "quiet", hidden: true });
document.body.append(probe);

export class Charts {
  readonly element = h("div", { className: "charts" });
  onPick?: (revision: number) => void;
  #plots: { plot: uPlot; curve: Curve; holder: HTMLElement }[] = [];
  #rows: SeriesRow[] = [];
  #revision = 0;
  #observer = new ResizeObserver(() => this.#plots.forEach(({ plot, holder }) => plot.setSize({ width: holder.clientWidth, height: HEIGHT })));

  constructor() {
    const key = crypto.randomUUID();
    this.element.append(h("h2", {}, "By revision"));
    for (const curve of CURVES) {
      const holder = h("figure", { className: "chart" }, h("figcaption", {}, `${curve.title}, ${curve.unit}`));
      const axis = { stroke: quiet, grid: { stroke: "#8883", width: 1 }, ticks: { show: false }, font: "11px system-ui" };
      const plot = new uPlot(
        {
          width: 300,
          height: HEIGHT,
          legend: { show: false },
          cursor: { sync: { key }, y: false },
          scales: { x: { time: false } },
          axes: [{ ...axis, size: 22, incrs: WHOLE }, { ...axis, size: 40 }],
          series: [{}, { stroke: curve.colour, width: 1.5, points: { show: false }, spanGaps: true }],
          hooks: { draw: [(drawn) => this.#markRevision(drawn)] },
        },
        [[], []],
        holder,
      );
      holder.addEventListener("click", () => {
        const revision = plot.cursor.idx == null ? undefined : this.#rows[plot.cursor.idx]?.revision;
        if (revision) this.onPick?.(revision);
      });
      this.#plots.push({ plot, curve, holder });
      this.element.append(holder);
      this.#observer.observe(holder);
    }
  }

  show(rows: SeriesRow[], revision: number): void {
    this.#revision = revision;
    if (rows === this.#rows) return this.#plots.forEach(({ plot }) => plot.redraw(false));
    this.#rows = rows;
    const attempts = rows.map((row) => row.revision);
    for (const { plot, curve, holder } of this.#plots) {
      const values = rows.map((row) => curve.value(row) ?? null);
      holder.hidden = !values.some((value) => value !== null);
      plot.setData([attempts, values]);
    }
  }

  close(): void {
    this.#observer.disconnect();
    this.#plots.forEach(({ plot }) => plot.destroy());
  }

  #markRevision(plot: uPlot): void {
    const x = plot.valToPos(this.#revision, "x", true);
    const { left, top, width, height } = plot.bbox;
    if (x < left || x > left + width) return;
    plot.ctx.fillStyle = "#868e96";
    plot.ctx.fillRect(Math.round(x), top, 2, height);
  }
}

/** A small curve for a row of a list. */
export function sparkline(values: number[]): SVGSVGElement {
  const namespace = "http://www.w3.org/2000/svg";
  const drawing = document.createElementNS(namespace, "svg");
  drawing.setAttribute("viewBox", "0 0 100 24");
  drawing.setAttribute("class", "sparkline");
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label", `mean uncertainty, now ${values.at(-1)?.toFixed(2) ?? "unknown"}`);
  const line = document.createElementNS(namespace, "polyline");
  const step = 100 / Math.max(values.length - 1, 1);
  line.setAttribute("points", values.map((value, index) => `${(index * step).toFixed(1)},${(22 - 20 * value).toFixed(1)}`).join(" "));
  drawing.append(line);
  return drawing;
}
