"""Our speed-ups beside published ones: a panel for each comparison of plots/published/<experiment>.json."""

import json
from pathlib import Path

from matplotlib.lines import Line2D

from results import NoData
from style import WRONG, colour, hatch, is_wrong, legends_right, panels, short, structure_legend

TITLE = "Speed-ups beside published ones"
CAPTION = ("Bars: ratios of the medians of this run, with what the 95 % confidence intervals of both leave. Diamonds: the ratio of the published "
           "figures, from another machine and with another share of shading (the source stands below the figure). The line is 1: no gain. A red ratio: some of the answers "
           "of its cells are wrong (the table has how many).")
ONLY_WHEN_NAMED = True
PUBLISHED = Path(__file__).resolve().parent.parent / "published"


def draw(results):
    metric, _ = results.throughput()
    file = PUBLISHED / f"{results.name}.json"
    if not file.is_file():
        raise NoData(f"plots/published has no {file.name}: nothing published to set beside it")
    table = json.loads(file.read_text(encoding="utf-8"))
    shown = [(c, rows) for c in table["comparisons"] if (rows := rows_of(results, c, metric))]
    if not shown:
        raise NoData("no comparison has both of its cells")
    figure, axes = panels(len(shown), 1, 7.6, 2.7)
    for (comparison, rows), axis in zip(shown, axes.flat):
        draw_panel(axis, comparison["structures"], rows)
        axis.set_title(comparison["name"])
        axis.set_ylabel("speed-up")
    structures = [s for s in dict.fromkeys(s for c, _ in shown for s in c["structures"])]
    diamond = Line2D([], [], linestyle="", marker="D", color="#222222", markerfacecolor="white", markersize=6, label="published")
    legends_right(figure, [("measured here", structure_legend(structures)), ("", [diamond])])
    figure.supxlabel("Published: " + wrapped(table["source"]), fontsize=8.5, color="#555555")
    return figure


def wrapped(text, width=105):
    lines = [""]
    for word in text.split():
        lines = lines[:-1] + [f"{lines[-1]} {word}".strip()] if len(lines[-1]) + len(word) < width else [*lines, word]
    return "\n".join(lines)


def rows_of(results, comparison, metric):
    """(place's name, published ratio, {structure: (ratio, low, high, whether answers are wrong)}) for each place where one of ours was measured."""
    rows = []
    for place in comparison["published"]:
        ours = {}
        for structure in comparison["structures"]:
            of, to = (one(results, {**comparison[part], "structure": structure, "scene": place["scene"], "workload": place["workload"]}, metric)
                      for part in ("of", "to"))
            if of and to:
                upper, lower = of.estimate(metric), to.estimate(metric)
                ours[structure] = (upper.median / lower.median, upper.low / lower.high, upper.high / lower.low, is_wrong(of) or is_wrong(to))
        if ours:
            rows.append((f"{short(place['scene'])}\n{place['workload']}", place["of"] / place["to"], ours))
    return rows


def one(results, wanted, metric):
    """The fastest cell of those wanted."""
    found = [c for c in results.traces if all(c[a] == v for a, v in wanted.items()) and c.estimate(metric)]
    return max(found, key=lambda c: c.estimate(metric).median, default=None)


def draw_panel(axis, structures, rows):
    step = 0.8 / len(structures)
    top = max(max(v[2] for v in ours.values()) for _, _, ours in rows)
    top = max(top, max(published for _, published, _ in rows))
    for place, (_, published, ours) in enumerate(rows):
        for slot, structure in enumerate(structures):
            if structure not in ours:
                continue
            x = place + (slot - (len(structures) - 1) / 2) * step
            ratio, low, high, wrong = ours[structure]
            axis.bar(x, ratio, 0.9 * step, color=colour(structure), alpha=0.7, hatch=hatch(structure), edgecolor="white", linewidth=0.5,
                     yerr=[[ratio - low], [high - ratio]], error_kw={"elinewidth": 0.9, "ecolor": "#222222"})
            axis.annotate(f"{ratio:.2f}", (x, 0.04 * top), ha="center", va="bottom", fontsize=8.5, color=WRONG if wrong else "black",
                          bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85})
        axis.plot(place, published, "D", color="#222222", markerfacecolor="white", markersize=6, zorder=4)
        axis.annotate(f"{published:.2f}", (place, published), (8, 0), textcoords="offset points", va="center", fontsize=8.5,
                      bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}, zorder=4)
    axis.axhline(1.0, color="#222222", linewidth=0.8)
    axis.set_xticks(range(len(rows)), [name for name, _, _ in rows])
    axis.set_ylim(0, 1.08 * top)
    axis.grid(axis="x", visible=False)
