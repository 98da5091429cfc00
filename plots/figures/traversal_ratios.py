"""Every way of traversal against the best of Embree's, or against single rays: a panel an instruction set, a square for each scene and workload."""

import math
from textwrap import wrap

import numpy as np
from matplotlib.colors import LinearSegmentedColormap

from figures.modes import Modes
from figures.squares import MOST_ROWS_BELOW, headings_above, mark_wrong
from results import NoData, ordered
from style import closed, is_wrong, opened, panels, short_names

TITLE = "Ways of traversal"
NEEDS = "rays_per_second of several ways of traversal, `single` or Embree's among them (`metrics: [trace]`, `traversal: [...]`)"
CAPTION = ("Rays a second as a multiple of the fastest way of Embree on the same scene, workload and instruction set with as many threads (where the sweep has "
           "no Embree: of the structure's own single rays: below a workload's name stands which). Medians; blue is faster, orange slower. The last column of a "
           "workload is the geometric mean of its scenes. Framed red: ways with wrong answers. Where an instruction set would have more than 60 rows, a row is "
           "a structure and way of traversal, on each scene by its fastest builder, leaf and tests.")
MOST_ROWS = 60
# Blue to orange by way of white: readers with any colour vision can tell the ends apart.
COLOURS = LinearSegmentedColormap.from_list("ratio", ["#B35806", "#F1A340", "#FEE9CF", "#FFFFFF", "#D3E4F3", "#5C9BCF", "#1F5A96"])
MEAN = "mean"
TO = "… Embree's fastest, or own single rays"  # the longest of what stands below a workload's name
LONGEST_SCENE = 30  # characters of a name below or above its column
# inches: of a column at least, of a row; of a character of a workload's name above its columns, of a row's name beside it, of a slanted name of a scene
COLUMN, ROW, CHARACTER, ROW_CHARACTER, SLANTED = 0.52, 0.26, 0.078, 0.062, 0.034
AROUND, LINE, FRAMED = 0.75, 0.17, 0.45  # inches above and below a panel: at least, of a line above its columns, of what is said of frames
SMALL = 0.8  # of that size: above a single column
KEY = ((0.5, "half or less"), (0.7, "0.7"), (1.0, "1"), (1.4, "1.4"), (2.0, "twice or more"))
ONLY_WHEN_NAMED = True


def draw(results):
    metric, _ = results.throughput()
    cells = [c for c in results.traces if c.estimate(metric)]
    if len({c["traversal"] for c in cells}) < 2:
        raise NoData("all cells have one way of traversal")
    modes = Modes(cells)
    tables = tables_of(cells, modes, metric)
    if not tables:
        raise NoData("nothing to compare with: neither embree nor single rays on the same scene and workload")
    if fastest_alone := max(map(len, tables.values())) > MOST_ROWS:
        modes = Modes(cells, without=("builder", "leaf", "intersector", "box"))
        tables = tables_of(cells, modes, metric)
    columns = columns_of(cells)
    rows = {isa: row_names(table, modes) for isa, table in tables.items()}
    wide = max([COLUMN] + [(SMALL if count == 1 else 1.0) * CHARACTER * (len(word) + 1) / count
                           for workload, count in spans_of(columns) for word in [*words_of(workload), TO.partition(" fastest")[0]]])
    beside = 1.9 + ROW_CHARACTER * max(len(row_label(row)) for of_isa in rows.values() for row in of_isa)  # names of rows, and the key
    headings = {isa: headings_of(columns, [c for c in cells if c["isa"] == isa], wide) for isa in tables}
    around = {isa: around_panel(columns, headings[isa], len(rows[isa]), any(is_wrong(c) for c in cells if c["isa"] == isa)) for isa in tables}
    height = sum(around[isa] + ROW * len(rows[isa]) for isa in tables) / len(tables)
    figure, axes = panels(len(tables), 1, max(5.0, beside + wide * len(columns)), height, gridspec_kw={"height_ratios": [len(rows[isa]) for isa in tables]})
    for (isa, table), axis in zip(tables.items(), axes.flat):
        image = panel(axis, table, rows[isa], columns, headings[isa], isa + (": fastest builder, leaf and tests of each" if fastest_alone else ""))
        fastest = fastest_cells([c for c in cells if c["isa"] == isa], modes, metric)
        mark_wrong(axis, {(x, y): fastest[row][place] for y, row in enumerate(rows[isa]) for x, place in enumerate(columns) if place in fastest[row]})
    key = figure.colorbar(image, ax=list(axes.flat), location="right", anchor=(0.0, 1.0), shrink=min(1.0, 2.4 / figure.get_size_inches()[1]), aspect=14,
                          pad=0.01)
    key.set_ticks([math.log2(value) for value, _ in KEY], labels=[text for _, text in KEY])
    key.ax.set_title("rays a second,\na multiple of …", fontsize=9, loc="left", pad=10)
    key.outline.set_visible(False)
    return figure


def tables_of(cells, modes, metric):
    """{isa: what ratios() gives} of those instruction sets of which there is something to compare with."""
    return {isa: table for isa in ordered((c["isa"] for c in cells), "isa") if (table := ratios([c for c in cells if c["isa"] == isa], modes, metric))}


def fastest_cells(cells, modes, metric):
    """{(structure, mode): {(workload, scene): cell}}: the fastest cell stands for those of a kind."""
    fastest = {}
    for cell in cells:
        row, place = fastest.setdefault((cell["structure"], modes.label(cell)), {}), (cell["workload"], cell["scene"])
        row[place] = max(row.get(place, cell), cell, key=lambda c: c.estimate(metric).median)
    return fastest


def compared_at(cell):
    """Where cells of one instruction set have to be alike to be compared."""
    return tuple(cell[a] for a in ("workload", "scene", "threads"))


def ratios(cells, modes, metric):
    """{(structure, mode): {(workload, scene): ratio}} of one instruction set."""
    base = {}
    for cell in cells:
        rate, place = cell.estimate(metric).median, compared_at(cell)
        for owner, wanted in (("embree", cell["structure"] == "embree"), (cell["structure"], cell["traversal"] == "single")):
            if wanted:
                base[owner, place] = max(base.get((owner, place), 0.0), rate)
    table = {}
    for (structure, mode), row in fastest_cells(cells, modes, metric).items():
        compared = {p: c.estimate(metric).median / b for p, c in row.items()
                    if (b := base.get(("embree", compared_at(c))) or base.get((structure, compared_at(c))))}
        if compared:
            table[structure, mode] = compared
    return table


def columns_of(cells):
    """(workload, scene) in order; behind a workload's scenes, where there are several, their mean."""
    columns = []
    for workload in ordered((c["workload"] for c in cells), "workload"):
        scenes = ordered((c["scene"] for c in cells if c["workload"] == workload), "scene")
        columns += [(workload, s) for s in scenes] + ([(workload, MEAN)] if len(scenes) > 1 else [])
    return columns


def spans_of(columns):
    """[(workload, number of its columns)]."""
    return [(workload, sum(w == workload for w, _ in columns)) for workload in dict.fromkeys(w for w, _ in columns)]


def words_of(workload):
    return opened(workload.replace(":", ": ")).split()


def headings_of(columns, cells, wide):
    """What stands above a workload's columns, each `wide` inches: its name, and what its ratios are to, broken into lines that stay above them."""
    found = []
    for workload, count in spans_of(columns):
        places = {compared_at(c) for c in cells if c["workload"] == workload}
        with_embree = {compared_at(c) for c in cells if c["workload"] == workload and c["structure"] == "embree"}
        to = "" if not places else "… Embree's fastest" if with_embree == places else TO if with_embree else "… own single rays"
        most = max(4, int(count * wide / (CHARACTER * (SMALL if count == 1 else 1.0))))
        lines = [line for text in (" ".join(words_of(workload)), to) for line in wrap(text, most, break_long_words=False)]
        found.append(closed("\n".join(lines)))
    return found


def around_panel(columns, headings, rows, framed):
    """Inches above and below a panel of so many rows: headings, the scenes' names, and what is said of squares that are `framed`."""
    names = scene_names(columns)
    return (AROUND + LINE * max(heading.count("\n") + 1 for heading in headings) + SLANTED * max(map(len, names)) * (2 if rows > MOST_ROWS_BELOW else 1)
            + (FRAMED if framed else 0.0))


def scene_names(columns):
    short_of = short_names([s for _, s in columns], LONGEST_SCENE)
    return [short_of[s] for _, s in columns]


def row_names(table, modes):
    structures = ordered((s for s, _ in table), "structure")
    return [(s, m) for s in structures for m in modes.labels if (s, m) in table]


def row_label(row):
    return "  ".join(row)


def value_at(row, workload, scene):
    if scene != MEAN:
        return row.get((workload, scene))
    found = [v for (w, _), v in row.items() if w == workload]
    return math.exp(sum(map(math.log, found)) / len(found)) if found else None


def panel(axis, table, rows, columns, headings, title):
    values = np.array([[value_at(table[r], *c) or np.nan for c in columns] for r in rows])
    image = axis.imshow(np.log2(values), cmap=COLOURS, vmin=-1.0, vmax=1.0, aspect="auto")
    for y, line in enumerate(values):
        for x, v in enumerate(line):
            if not np.isnan(v):
                dark = abs(math.log2(v)) > 0.75
                axis.text(x, y, f"{v:.2f}", ha="center", va="center", fontsize=8, color="white" if dark else "#222222",
                          fontweight="bold" if columns[x][1] == MEAN else "normal")
    axis.set_yticks(range(len(rows)), map(row_label, rows), fontsize=8.5)
    names = scene_names(columns)
    axis.set_xticks(range(len(columns)), names, rotation=30, ha="right", rotation_mode="anchor", fontsize=8)
    axis.set_xticks([x - 0.5 for x in range(len(columns) + 1)], minor=True)
    axis.set_yticks([y - 0.5 for y in range(len(rows) + 1)], minor=True)
    axis.tick_params(which="both", length=0)
    above = 8 + 2.4 * max(map(len, names)) if headings_above(axis, len(rows)) else 4  # points that the names take
    axis.grid(visible=False)
    axis.grid(which="minor", color="#E8E8E8", linewidth=0.8)
    for spine in axis.spines.values():
        spine.set_visible(False)
    first, tallest = 0, 0.0
    for (workload, count), heading in zip(spans_of(columns), headings):
        axis.annotate(heading, (first + (count - 1) / 2, -0.5), (0, above), textcoords="offset points", ha="center", va="bottom",
                      fontsize=7.5 if count == 1 else 9.5)
        tallest = max(tallest, (10.0 if count == 1 else 12.5) * (heading.count("\n") + 1))
        if first:
            axis.axvline(first - 0.5, color="white", linewidth=4)
        first += count
    axis.set_title(title, loc="left", pad=above + tallest + 6)
    for y in range(1, len(rows)):
        if rows[y][0] != rows[y - 1][0]:
            axis.axhline(y - 0.5, color="white", linewidth=4)
    return image
