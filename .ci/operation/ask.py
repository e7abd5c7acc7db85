"""Asks a Prometheus each query of the dashboard and of the alerts, and draws the dashboard's panels if wanted."""

import argparse
import json
import re
import time
import urllib.parse
import urllib.request
from pathlib import Path

arguments = argparse.ArgumentParser()
arguments.add_argument("prometheus")
arguments.add_argument("dashboard", type=Path)
arguments.add_argument("alerts", type=Path)
arguments.add_argument("--picture", type=Path, help="where the panels are drawn; needs matplotlib")
given = arguments.parse_args()

STEP_S = 1
# What Grafana puts in the place of $__rate_interval: four times the time between two scrapes, at least.
RATE_INTERVAL = "5s"
# Nothing was refused and nothing is broken, so these have nothing to show.
MAY_BE_EMPTY = {"Refusals", "Warnings"}


def ask(path: str, **query: object) -> list:
    """The result of a query."""
    with urllib.request.urlopen(f"{given.prometheus}{path}?{urllib.parse.urlencode(query)}") as answer:
        reply = json.load(answer)
    assert reply["status"] == "success", reply
    return reply["data"]["result"]


def series(expression: str) -> list:
    """What the panel shows: each line with its labels, times and values."""
    now = time.time()
    query = expression.replace("$__rate_interval", RATE_INTERVAL)
    lines = ask("/api/v1/query_range", query=query, start=now - 60, end=now, step=STEP_S)
    finite = [(line["metric"], [(t, float(v)) for t, v in line["values"] if v != "NaN"]) for line in lines]
    return [(labels, values) for labels, values in finite if values]


panels = json.loads(given.dashboard.read_text())["panels"]
shown = []
for panel in panels:
    lines = []
    for target in panel["targets"]:
        for labels, values in series(target["expr"]):
            name = re.sub(r"{{(\w+)}}", lambda found: labels.get(found[1], ""), target["legendFormat"])
            lines.append((name, values))
    assert lines or panel["title"] in MAY_BE_EMPTY, f"{panel['title']}: nothing to show"
    shown.append((panel, lines))

for expression in re.findall(r"^ +expr: (.+)$", given.alerts.read_text(), re.MULTILINE):
    ask("/api/v1/query", query=expression)
firing = ask("/api/v1/query", query="ALERTS{alertstate='firing'}")
assert not firing or given.picture, f"a server that is well raises alerts: {firing}"
print(f"{len(shown)} panels and all alerts were answered")

if given.picture:
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    height = max(panel["gridPos"]["y"] + panel["gridPos"]["h"] for panel, _ in shown)
    figure = plt.figure(figsize=(14, height * 0.42), facecolor="#f4f5f5")
    plt.rcParams.update({"font.size": 8, "svg.fonttype": "none"})
    start = min(values[0][0] for _, lines in shown for _, values in lines)

    def in_words(value: float, unit: str) -> str:
        """A value with the unit of its panel."""
        if unit == "bytes":
            return f"{value / 2**30:.1f} GiB" if value >= 2**30 else f"{value / 2**20:.1f} MiB"
        return f"{value:.3g}"

    for panel, lines in shown:
        grid, unit = panel["gridPos"], panel["fieldConfig"]["defaults"]["unit"]
        place = [(grid["x"] + 1.1) / 25, 1 - (grid["y"] + grid["h"] - 1.4) / height]
        axes = figure.add_axes([*place, (grid["w"] - 1.6) / 25, (grid["h"] - 2.4) / height])
        axes.set_title(panel["title"], loc="left", fontsize=9, fontweight="bold")
        if panel["type"] == "stat":
            axes.axis("off")
            value = lines[0][1][-1][1] if lines else 0.0
            axes.text(0.0, 0.4, in_words(value, unit), fontsize=20, color="#1f6f8b", va="center")
            continue
        for name, values in lines:
            axes.plot([t - start for t, _ in values], [v for _, v in values], label=name, linewidth=1.2)
        axes.set_ylim(bottom=0)
        axes.yaxis.set_major_formatter(lambda value, _, unit=unit: in_words(value, unit))
        axes.set_ylabel({"s": "s", "ops": "a second"}.get(unit, ""))
        axes.set_xlabel("s")
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
        if lines:
            axes.legend(loc="lower right", bbox_to_anchor=(1.02, 0.98), frameon=False, ncols=5, fontsize=7)
        else:
            axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", color="#888888")
    figure.savefig(given.picture)
