"""Squares, structures and what else tells cells apart down, builders across: what figures of bars become where a scene has more bars than can be read."""

import math

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Rectangle

from figures.names import label
from results import ordered
from style import WRONG, fits, is_wrong, most_wrong, panels

MOST_BARS = 40
MOST_ROWS_BELOW = 20
WORDS = {"isa": "instruction set", "threads": "number of threads"}  # of axes, where their names are none
SPAN = 100  # of the colours
NOTHING = 1e-6  # of the largest: written as 0
# none is white: that is where nothing was measured
SHADES = LinearSegmentedColormap.from_list("better", ["#E4EEF8", "#C6DCF1", "#8FBCE6", "#4A8FC9", "#1F5A96"])


def are_due(bars_of_panels, varied):
    """Whether panels of so many bars, told apart by the axes `varied`, are squares instead."""
    return bool(varied) and max(map(len, bars_of_panels)) > MOST_BARS


def square_panels(cells_of, varied, value_of, text_of, quantity, higher_is_better):
    """A panel for each (title, cells) of `cells_of`, whose cells structure and the axes `varied` tell apart: builders across (where they are not varied, the
    axis of most keys), the rest down. `value_of(cell)` gives (median, low, high), `text_of(median)` what stands in a square. Gives the figure, which
    has the words for its caption, and [(axis, {(x, y): cell})]."""
    every = [c for _, cells in cells_of for c in cells]
    across = "builder" if "builder" in varied else max(varied, key=lambda a: len({c[a] for c in every}))
    down = ["structure"] + [a for a in varied if a != across]
    rows = rows_of(cells_of, across, down, lambda c: (text_of(value_of(c)[0]), is_wrong(c)))
    row_of = {key: place for place, (_, keys) in enumerate(rows) for key in keys}
    columns = ordered((c[across] for c in every), across)
    tables = []
    for _, cells in cells_of:
        table = {}
        for cell in cells:
            table.setdefault((cell[across], row_of[tuple(cell[a] for a in down)]), cell)
        tables.append(table)
    width = 1.1 + 0.07 * max(len(name) for name, _ in rows) + 0.5 * len(columns)
    most = max(len({row for _, row in table}) for table in tables)
    height = 0.7 + (1 + (most > MOST_ROWS_BELOW)) * (0.15 + 0.036 * max(map(len, columns))) + 0.27 * most
    beside = 1 if fits(2 * len(tables) * height) else 2  # half of what a figure may have
    figure, axes = panels(-(-len(tables) // beside), beside, width, height)
    drawn = []
    for (title, _), table, axis in zip(cells_of, tables, axes.flat):
        used = [[c for c in columns if any(c == column for column, _ in table)], sorted({row for _, row in table})]
        places = {(used[0].index(column), used[1].index(row)): cell for (column, row), cell in table.items()}
        panel(axis, {place: value_of(cell)[0] for place, cell in places.items()}, used[0], [rows[row][0] for row in used[1]], text_of, higher_is_better)
        axis.set_title(f"{title}: {quantity}", loc="left")
        drawn.append((axis, places))
    for axis in axes.flat[len(tables):]:
        axis.set_visible(False)
    figure.more_caption = caption(across, down[1:])
    return figure, drawn


def caption(across, down):
    """What is said of squares that are told apart by the axes `across` and `down`, besides structures."""
    rows = " or ".join(WORDS.get(a, a) for a in down)
    return (f" As there are more than {MOST_BARS} bars, there is a square for each structure and {WORDS.get(across, across)} instead"
            + (f", in a row for each {rows} that makes a difference" if rows else "")
            + ": the median alone, the darker the better, the best of a panel in bold; a white place with a dash was not measured.")


def rows_of(cells_of, across, down, shown):
    """[(name, keys of the axes `down`)], in order. Rows of a structure that show the same in every square are one."""
    written = {}  # keys -> {(panel, column): shown(cell)}
    for panel_of, (_, cells) in enumerate(cells_of):
        for cell in cells:
            written.setdefault(tuple(cell[a] for a in down), {}).setdefault((panel_of, cell[across]), shown(cell))
    places = [{v: i for i, v in enumerate(ordered(keys, a))} for a, keys in zip(down, zip(*written))]
    alike = {}
    for key in sorted(written, key=lambda key: [place[v] for place, v in zip(places, key)]):
        alike.setdefault((key[0], frozenset(written[key].items())), []).append(key)
    return [(row_name(keys, [k for k in written if k[0] == keys[0][0]], down), keys) for keys in alike.values()]


def row_name(keys, of_structure, down):
    """What the row of `keys` is called among all of its structure: an axis of which it has every key goes unsaid."""
    words = [keys[0][0]]
    for place, axis in enumerate(down[1:], 1):
        own = list(dict.fromkeys(key[place] for key in keys))
        if len(own) == 1 or len(own) < len({key[place] for key in of_structure}):
            words.append(", ".join(label(axis, v) for v in own[:2] if v) + (" …" if len(own) > 2 else ""))
    return " ".join(word for word in words if word)


def mark_wrong(axis, cells):
    """Frames those squares of `cells`, {(x, y): cell}, that have wrong answers, and says how many these are."""
    wrong = {place: cell for place, cell in cells.items() if is_wrong(cell)}
    for x, y in wrong:
        axis.add_patch(Rectangle((x - 0.44, y - 0.38), 0.88, 0.76, fill=False, edgecolor=WRONG, linewidth=1.2, zorder=3))
    if wrong:
        axis.set_xlabel(f"framed: up to {most_wrong(wrong.values())}\nwrong answers per million", loc="left", color=WRONG, fontsize=9)


def panel(axis, values, columns, rows, text_of, higher_is_better):
    """`values`: {(x, y): median} of squares in `columns` and `rows`, by their names."""
    shade = shades(values.values(), higher_is_better)
    nothing = NOTHING * max(values.values())
    best = (max if higher_is_better else min)(values.values())
    grid = np.array([[shade(values[x, y]) if (x, y) in values else np.nan for x in range(len(columns))] for y in range(len(rows))])
    axis.imshow(grid, cmap=SHADES, vmin=0.0, vmax=1.0, aspect="auto")
    for y in range(len(rows)):
        for x in range(len(columns)):
            value = values.get((x, y))
            if value is None:
                axis.text(x, y, "–", ha="center", va="center", fontsize=8, color="#BBBBBB")
            else:
                axis.text(x, y, text_of(value) if value > nothing else "0", ha="center", va="center", fontsize=8,
                          color="white" if grid[y, x] > 0.7 else "#222222", fontweight="bold" if value == best else "normal")
    axis.set_yticks(range(len(rows)), rows, fontsize=8.5)
    axis.set_xticks(range(len(columns)), columns, rotation=35, ha="right", rotation_mode="anchor", fontsize=8)
    axis.set_xticks([x - 0.5 for x in range(1, len(columns))], minor=True)
    axis.set_yticks([y - 0.5 for y in range(1, len(rows))], minor=True)
    axis.grid(visible=False)
    axis.grid(which="minor", color="#E8E8E8", linewidth=0.8)
    axis.tick_params(which="both", length=0)
    headings_above(axis, len(rows))
    for spine in axis.spines.values():
        spine.set_visible(False)


def headings_above(axis, rows):
    """The names of the columns above so many rows too, where they are far from those below; whether they are."""
    if above := rows > MOST_ROWS_BELOW:
        axis.tick_params(axis="x", labeltop=True)
        for tick in axis.xaxis.get_major_ticks():
            tick.label2.set_horizontalalignment("left")
    return above


def shades(values, higher_is_better):
    """0 for the worst of `values`, 1 for the best, by their logarithms; what is below a hundredth of the largest, 0 too, is as that."""
    largest = max(values)
    least = max(min(values), largest / SPAN)

    def shade(value):
        place = math.log(max(value, least) / least) / math.log(largest / least) if largest > least > 0 else 1.0
        return place if higher_is_better else 1.0 - place

    return shade
