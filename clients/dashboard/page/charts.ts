// The course of a session; the cursor of every chart is the revision that is shown.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { Row } from "./api";
import { h } from "./dom";

interface Chart {
  title: string;
  value: (row: Row) => number | null;
}

const CHARTS: Chart[] = [
  { title: "Mean uncertainty", value: (row) => row.mean_uncertainty },
  { title: "Failures", value: (row) => row.failures },
  { title: "Error to reference, mm", value: (row) => (row.surface_distance_m === undefined ? null : 1e3 * row.surface_distance_m) },
  { title: "Force, N", value: (row) => row.force_n ?? null },
];

export class Charts {
  readonly element = h("div", { class: "charts" });
  private plots: { chart: Chart; plot: uPlot; figure: HTMLElement }[] = [];
  private resizing = new ResizeObserver(() => this.resize());
  private shown = 0;
  private rows: Row[] = [];

  constructor(seek: (revision: number) => void) {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--quiet").trim();
    const line = style.getPropertyValue("--line").trim();
    for (const chart of CHARTS) {
      const figure = h("figure", {}, h("figcaption", {}, chart.title));
      this.element.append(figure);
      const axis = { stroke: ink, font: "11px system-ui", grid: { stroke: line, width: 1 }, ticks: { show: false } };
      const mark = (plot: uPlot) => {
        const x = Math.round(plot.valToPos(this.shown, "x", true));
        plot.ctx.fillStyle = style.getPropertyValue("--accent").trim();
        plot.ctx.fillRect(x, plot.bbox.top, 1.5 * devicePixelRatio, plot.bbox.height);
      };
      const plot = new uPlot(
        {
          width: 240,
          height: 110,
          legend: { show: false },
          scales: { x: { time: false } },
          axes: [{ ...axis, size: 22 }, { ...axis, size: 40 }],
          series: [{}, { stroke: style.getPropertyValue("--accent").trim(), width: 1.5, points: { show: false }, spanGaps: true }],
          cursor: { sync: { key: "revisions" }, drag: { x: false, y: false } },
          hooks: { draw: [mark] },
        },
        [[], []],
        figure,
      );
      plot.over.addEventListener("click", () => {
        const row = this.rows[plot.cursor.idx ?? -1];
        if (row) seek(row.revision);
      });
      this.plots.push({ chart, plot, figure });
    }
    this.resizing.observe(this.element);
  }

  show(rows: Row[], revision: number): void {
    this.shown = revision;
    const isNew = rows !== this.rows;
    this.rows = rows;
    for (const { chart, plot, figure } of this.plots) {
      const values = rows.map(chart.value);
      figure.hidden = values.every((value) => value === null);
      if (isNew) plot.setData([rows.map((row) => row.revision), values]);
      else plot.redraw(false);
    }
  }

  dispose(): void {
    this.resizing.disconnect();
    for (const { plot } of this.plots) plot.destroy();
  }

  private resize(): void {
    for (const { plot, figure } of this.plots) {
      const width = figure.clientWidth;
      if (width > 0 && width !== plot.width) plot.setSize({ width, height: 110 });
    }
  }
}
