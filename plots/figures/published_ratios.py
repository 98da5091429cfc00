"""Ours beside published figures: a panel for each comparison of plots/published/<experiment>.json (docs/reproductions.md tells what such a file holds)."""

import json
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from textwrap import fill

from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from results import AXES, STRUCTURE_AXES, NoData, ordered
from style import WRONG, colour, hatch, is_wrong, legends_right, log_axis, panels, short_names
from tables import STRUCTURE_COLUMNS

TITLE = "Beside published figures"
NEEDS = "cells that plots/published has numbers for, of the configurations in configs/papers"
CAPTION = ("Bars: ratios of the medians of this run, or the median itself where a panel sets no two things side by side, with what their intervals leave, each "
           "{interval}. Diamonds, of a span one at each end, of several bars with dashes across them: the published figures, from other machines and mostly "
           "other scenes (the sources stand below the figure); a panel without them shows a claim that was published in words. The line is 1: no difference. A "
           "red number: some of the answers of its cells are wrong (the table has how many).")
ONLY_WHEN_NAMED = True
PUBLISHED = Path(__file__).resolve().parent.parent / "published"
TIME = "time"  # the inverse of the throughput
BUILT = tuple(name for name, _, _ in STRUCTURE_COLUMNS)  # quantities of what was built, whatever rays went through it
FAR_APART = 12.0  # bars whose heights differ by more stand on a scale of logarithms
WIDEST = 16.0  # inches of a panel whose places are named upright
MOST_IN_A_COLUMN = 5  # panels
FASTER = ("rays_per_second", "rays_per_cpu_second", "triangles_per_second")  # quantities whose ratio is a speed-up


@dataclass(frozen=True)
class Row:
    """A place of a panel: what is published for it, (low, high) or None, and of each series (value, low, high, whether answers are wrong)."""

    name: str
    published: tuple | None
    ours: dict


def draw(results):
    file = PUBLISHED / f"{results.name}.json"
    if not file.is_file():
        raise NoData(f"plots/published has no {file.name}: nothing published to set beside it")
    table = json.loads(file.read_text(encoding="utf-8"))
    shown = [(c, rows) for c in table["comparisons"] if (rows := rows_of(results, c))]
    if not shown:
        raise NoData("no comparison has both of its cells")
    most = max(len(rows) for _, rows in shown)
    widest = max(len(line) for _, rows in shown for row in rows for line in row.name.split("\n"))
    width = max(7.6, most * (0.25 + 0.075 * widest))
    slanted = width > WIDEST
    panel_width = max(7.6, 0.8 * most) if slanted else width
    columns = 2 if len(shown) > MOST_IN_A_COLUMN and 2 * panel_width < 1.2 * WIDEST else 1
    figure, axes = panels(-(-len(shown) // columns), columns, panel_width, 3.6 if slanted else 2.9)
    across = int(13 * panel_width)
    for axis in axes.flat[len(shown):]:
        axis.set_visible(False)
    for (comparison, rows), axis in zip(shown, axes.flat):
        draw_panel(axis, [s for s in series_of(comparison) if any(s["name"] in row.ours for row in rows)], rows, most)
        name_places(axis, rows, slanted)
        axis.set_title(fill(comparison["name"] + (f" ({comparison['claim']})" if "claim" in comparison else ""), across), fontsize=9.5)
        axis.set_ylabel(label_of(results, comparison))
    legends_right(figure, [("measured here", series_legend(shown)), *published_legend(shown)])
    figure.supxlabel("Published: " + fill(table["source"], columns * across), fontsize=8.5, color="#555555")
    return figure


def series_of(comparison):
    """Each of the comparison's series as {name, structure, of, to}: a structure's key alone stands for that structure."""
    found = []
    for series in comparison["series"]:
        series = {"structure": series} if isinstance(series, str) else series
        shared = {axis: series[axis] for axis in AXES if axis in series}
        sides = {side: {**shared, **comparison[side], **series.get(side, {})} for side in ("of", "to") if side in comparison}
        structure = sides["of"]["structure"]
        found.append({"name": series.get("name", structure), "structure": structure, **sides})
    return found


def quantity_of(results, entry):
    """The quantity of a comparison or of one of its places, and whether it is inverted."""
    quantity = entry.get("quantity", results.throughput()[0])
    return (results.throughput()[0], True) if quantity == TIME else (quantity, False)


def label_of(results, comparison):
    quantity, inverted = quantity_of(results, comparison)
    if "to" not in comparison:
        return comparison.get("unit", quantity)
    if any("quantity" in place for place in comparison["published"]):
        return "ratio"
    return "speed-up" if quantity in FASTER and not inverted else f"ratio of {'time' if inverted else quantity}"


def rows_of(results, comparison):
    """The rows of a comparison: of each published place those scenes and workloads of which a series was measured; a place that names none stands for all."""
    rows, series = [], series_of(comparison)
    names = short_names([c["scene"] for c in results.structures + results.traces], 17)
    for place in comparison["published"]:
        quantity, inverted = quantity_of(results, {**comparison, **place})
        cells = [c for c in (results.structures if quantity in BUILT else results.traces) if value_of(c, quantity, place)]
        scenes = [place["scene"]] if "scene" in place else ordered((c["scene"] for c in cells), "scene")
        workloads = [place["workload"]] if "workload" in place else ordered((c["workload"] for c in cells), "workload")  # of what was built: none
        for scene in scenes:
            for workload in workloads:
                here = [c for c in cells if c["scene"] == scene and c["workload"] == workload]
                ours = {s["name"]: found for s in series if (found := ours_of(here, s, quantity, inverted, place))}
                if ours:
                    name = "\n".join(n for n in (place.get("label", ""), names.get(scene), workload) if n)
                    rows.append(Row(name, published_of(place), ours))
    return rows


def published_of(place):
    """What is published for a place, as (low, high): `of` over `to`, a `value`, or a span of two values; None where it gives no number."""
    if "to" in place:
        return (place["of"] / place["to"],) * 2
    value = place.get("value")
    return value if value is None else tuple(value) if isinstance(value, list) else (value, value)


def ours_of(cells, series, quantity, inverted, place):
    sides = [one(cells, series[side], quantity, place) for side in ("of", "to") if side in series]
    if not all(sides):
        return None
    wrong = any(map(is_wrong, sides))
    of, *to = [value_of(c, quantity, place) for c in sides]
    if not to:
        return (*of, wrong)
    (median, low, high), (base, base_low, base_high) = (to[0], of) if inverted else (of, to[0])
    return median / base, low / base_high, high / base_low, wrong


def value_of(cell, quantity, place):
    """(median, low, high) of a positive quantity of a cell, or the place's element of one that is a list; None where it has none."""
    if "element" in place:
        series = cell.series(quantity)
        return (series[place["element"]],) * 3 if place["element"] < len(series) else None
    estimate = cell.estimate(quantity)
    return (estimate.median, estimate.low, estimate.high) if estimate and estimate.low > 0 else None


def one(cells, wanted, quantity, place):
    """The cell of those wanted that has most of the quantity: the fastest, where it is a speed. What was built is not asked for axes of rays."""
    axes = STRUCTURE_AXES if quantity in BUILT else AXES
    found = [c for c in cells if all(c[a] == v for a, v in wanted.items() if a in axes)]
    return max(found, key=lambda c: value_of(c, quantity, place)[0], default=None)


def series_legend(shown):
    """A handle for each series that is drawn."""
    drawn = {s["name"]: s["structure"] for c, rows in shown for s in series_of(c) if any(s["name"] in row.ours for row in rows)}
    return [Patch(facecolor=colour(structure), edgecolor="white", hatch=hatch(structure), label=name) for name, structure in drawn.items()]


def published_legend(shown):
    if not any(row.published for _, rows in shown for row in rows):
        return []
    return [("", [Line2D([], [], linestyle="", marker="D", color="#222222", markerfacecolor="white", markersize=6, label="published")])]


def draw_panel(axis, series, rows, most):
    step = 0.8 / len(series)
    values = [v for row in rows for v in row.ours.values()]
    published = [row.published for row in rows if row.published]
    low, top = min(v[0] for v in [*values, *published]), max([v[2] for v in values] + [p[1] for p in published])
    far = top > FAR_APART * low
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    for place, row in enumerate(rows):
        for slot, each in enumerate(series):
            if each["name"] not in row.ours:
                continue
            x = place + (slot - (len(series) - 1) / 2) * step
            ratio, least, most_of_it, wrong = row.ours[each["name"]]
            axis.bar(x, ratio, 0.9 * step, color=colour(each["structure"]), alpha=0.7, hatch=hatch(each["structure"]), edgecolor="white", linewidth=0.5,
                     yerr=[[ratio - least], [most_of_it - ratio]], error_kw={"elinewidth": 0.9, "ecolor": "#222222"})
            axis.annotate(f"{ratio:.2f}", (x, 0.04), xycoords=axis.get_xaxis_transform(), ha="center", va="bottom", fontsize=8.5,
                          color=WRONG if wrong else "black", bbox=box)
    first = 0
    for span, alike in groupby(row.published for row in rows):
        last = first + len(list(alike)) - 1
        if span:
            draw_published(axis, first, last, span, box)
        first = last + 1
    if "to" in series[0]:
        axis.axhline(1.0, color="#222222", linewidth=0.8)
    axis.set_xlim(-0.6, max(len(rows), 0.6 * most) - 0.4)
    if far:
        log_axis(axis, "y", [0.5 * low, 1.08 * top])
    else:
        axis.set_ylim(0, 1.08 * top)
    axis.grid(axis="x", visible=False)


def name_places(axis, rows, slanted):
    if slanted:
        axis.set_xticks(range(len(rows)), [row.name.replace("\n", ", ") for row in rows], rotation=25, ha="right", rotation_mode="anchor")
    else:
        axis.set_xticks(range(len(rows)), [row.name for row in rows])


def draw_published(axis, first, last, span, box):
    """What is published for the places from `first` to `last`, once."""
    low, high = span
    where = (first + last) / 2 if first == last else last + 0.45
    for value in {low, high} if last > first else ():
        axis.plot([first - 0.45, last + 0.45], [value, value], "--", color="#222222", linewidth=0.9, zorder=4)
    axis.plot([where, where], span, "D-", color="#222222", markerfacecolor="white", markersize=6, zorder=5)
    axis.annotate(f"{high:.2f}" if low == high else f"{low:.2f} – {high:.2f}", (where, high), (8, 0) if first == last else (-8, 9), textcoords="offset points",
                  va="center", ha="left" if first == last else "right", fontsize=8.5, bbox=box, zorder=6)
