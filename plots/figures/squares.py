"""Squares, structures down and builders across: what figures of bars become where a scene has more bars than can be read."""

import math

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Rectangle

from results import ordered
from style import WRONG, is_wrong, most_wrong, panels

MOST_BARS = 40
CAPTION = (f" Where a scene has more than {MOST_BARS} bars there is a square for each structure and builder instead: the median alone, the darker the better, "
           "the best of a panel in bold; a white place with a dash was not measured.")
SPAN = 100  # of the colours
NOTHING = 1e-6  # of the largest: written as 0
SHADES = LinearSegmentedColormap.from_list("better", ["#E4EEF8", "#C6DCF1", "#8FBCE6", "#4A8FC9", "#1F5A96"])  # none is white: that is where nothing was measured


def are_due(bars_of_panels, varied):
    """Whether panels of so many bars, told apart by the axes `varied`, are squares instead."""
    return varied == ["builder"] and max(map(len, bars_of_panels)) > MOST_BARS


def square_panels(cells_of, value_of, text_of, quantity, higher_is_better):
    """A panel for each (title, cells) of `cells_of`. `value_of(cell)` gives (median, low, high), `text_of(median)` what stands in a square."""
    builders = ordered((c["builder"] for _, cells in cells_of for c in cells), "builder")
    longest = max(len({c["structure"] for c in cells}) for _, cells in cells_of)
    figure, axes = panels(len(cells_of), 1, 1.9 + 0.5 * len(builders), 1.75 + 0.27 * longest)
    for (title, cells), axis in zip(cells_of, axes.flat):
        used = [b for b in builders if any(c["builder"] == b for c in cells)]
        panel(axis, {(c["structure"], c["builder"]): value_of(c)[0] for c in cells}, used, text_of, higher_is_better)
        axis.set_title(f"{title}: {quantity}", loc="left")
    return figure


def by_place(axis, cells):
    """{(x, y): cell} of a panel's squares, by the labels of its axes."""
    columns, rows = ([t.get_text() for t in labels] for labels in (axis.get_xticklabels(), axis.get_yticklabels()))
    return {(columns.index(c["builder"]), rows.index(c["structure"])): c for c in cells}


def mark_wrong(axis, cells):
    """Frames those squares of `cells`, {(x, y): cell}, that have wrong answers, and says how many these are."""
    wrong = {place: cell for place, cell in cells.items() if is_wrong(cell)}
    for x, y in wrong:
        axis.add_patch(Rectangle((x - 0.44, y - 0.38), 0.88, 0.76, fill=False, edgecolor=WRONG, linewidth=1.2, zorder=3))
    if wrong:
        axis.set_xlabel(f"framed: up to {most_wrong(wrong.values())}\nwrong answers per million", loc="left", color=WRONG, fontsize=9)


def panel(axis, values, builders, text_of, higher_is_better):
    structures = ordered((s for s, _ in values), "structure")
    shade = shades(values.values(), higher_is_better)
    nothing = NOTHING * max(values.values())
    best = (max if higher_is_better else min)(values.values())
    grid = np.array([[shade(values[s, b]) if (s, b) in values else np.nan for b in builders] for s in structures])
    axis.imshow(grid, cmap=SHADES, vmin=0.0, vmax=1.0, aspect="auto")
    for y, structure in enumerate(structures):
        for x, builder in enumerate(builders):
            value = values.get((structure, builder))
            if value is None:
                axis.text(x, y, "–", ha="center", va="center", fontsize=8, color="#BBBBBB")
            else:
                axis.text(x, y, text_of(value) if value > nothing else "0", ha="center", va="center", fontsize=8, color="white" if grid[y, x] > 0.7 else "#222222",
                          fontweight="bold" if value == best else "normal")
    axis.set_yticks(range(len(structures)), structures, fontsize=8.5)
    axis.set_xticks(range(len(builders)), builders, rotation=35, ha="right", rotation_mode="anchor", fontsize=8)
    axis.set_xticks([x - 0.5 for x in range(1, len(builders))], minor=True)
    axis.set_yticks([y - 0.5 for y in range(1, len(structures))], minor=True)
    axis.grid(visible=False)
    axis.grid(which="minor", color="#E8E8E8", linewidth=0.8)
    axis.tick_params(which="both", length=0)
    for spine in axis.spines.values():
        spine.set_visible(False)


def shades(values, higher_is_better):
    """0 for the worst of `values`, 1 for the best, by their logarithms; what is below a hundredth of the largest, 0 too, is as that."""
    largest = max(values)
    least = max(min(values), largest / SPAN)

    def shade(value):
        place = math.log(max(value, least) / least) / math.log(largest / least) if largest > least > 0 else 1.0
        return place if higher_is_better else 1.0 - place

    return shade
