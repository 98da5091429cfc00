"""Every way of traversal against the best of Embree's, or against single rays: a panel an instruction set, a square for each scene and workload."""

import math

import numpy as np
from matplotlib.colors import LinearSegmentedColormap

from figures.modes import Modes
from figures.squares import headings_above, mark_wrong
from results import NoData, ordered
from style import panels, short

TITLE = "Ways of traversal"
CAPTION = ("Rays a second as a multiple of the fastest way of Embree on the same scene, workload and instruction set (where the sweep has no Embree: of the structure's "
           "own single rays). Medians; blue is faster, orange slower. The last column of a workload is the geometric mean of its scenes. "
           "Framed red: ways with wrong answers. Where an instruction set would have more than 60 rows, a row is a structure and way of traversal, on each scene by its fastest builder, leaf and tests.")
MOST_ROWS = 60
# Blue to orange by way of white: readers with any colour vision can tell the ends apart.
COLOURS = LinearSegmentedColormap.from_list("ratio", ["#B35806", "#F1A340", "#FEE9CF", "#FFFFFF", "#D3E4F3", "#5C9BCF", "#1F5A96"])
MEAN = "mean"
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
    longest = max(map(len, rows.values()))
    figure, axes = panels(len(tables), 1, max(5.0, 1.9 + 0.52 * len(columns)), 1.6 + 0.26 * longest)
    for (isa, table), axis in zip(tables.items(), axes.flat):
        panel(axis, table, rows[isa], columns)
        fastest = fastest_cells([c for c in cells if c["isa"] == isa], modes, metric)
        mark_wrong(axis, {(x, y): fastest[row][place] for y, row in enumerate(rows[isa]) for x, place in enumerate(columns) if place in fastest[row]})
        axis.set_title(isa + (": fastest builder, leaf and tests of each" if fastest_alone else ""), loc="left", pad=30)
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


def ratios(cells, modes, metric):
    """{(structure, mode): {(workload, scene): ratio}} of one instruction set."""
    base = {}
    for cell in cells:
        rate = cell.estimate(metric).median
        place = (cell["workload"], cell["scene"])
        for owner, wanted in (("embree", cell["structure"] == "embree"), (cell["structure"], cell["traversal"] == "single")):
            if wanted:
                base[owner, place] = max(base.get((owner, place), 0.0), rate)
    table = {}
    for (structure, mode), row in fastest_cells(cells, modes, metric).items():
        compared = {p: c.estimate(metric).median / b for p, c in row.items() if (b := base.get(("embree", p)) or base.get((structure, p)))}
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


def row_names(table, modes):
    structures = ordered((s for s, _ in table), "structure")
    return [(s, m) for s in structures for m in modes.labels if (s, m) in table]


def value_at(row, workload, scene):
    if scene != MEAN:
        return row.get((workload, scene))
    found = [v for (w, _), v in row.items() if w == workload]
    return math.exp(sum(map(math.log, found)) / len(found)) if found else None


def panel(axis, table, rows, columns):
    values = np.array([[value_at(table[r], *c) or np.nan for c in columns] for r in rows])
    axis.imshow(np.log2(values), cmap=COLOURS, vmin=-1.0, vmax=1.0, aspect="auto")
    for y, line in enumerate(values):
        for x, v in enumerate(line):
            if not np.isnan(v):
                dark = abs(math.log2(v)) > 0.75
                axis.text(x, y, f"{v:.2f}", ha="center", va="center", fontsize=8, color="white" if dark else "#222222",
                          fontweight="bold" if columns[x][1] == MEAN else "normal")
    axis.set_yticks(range(len(rows)), [f"{s}  {m}" for s, m in rows], fontsize=8.5)
    axis.set_xticks(range(len(columns)), [short(s, 16) for _, s in columns], rotation=30, ha="right", rotation_mode="anchor", fontsize=8)
    axis.tick_params(length=0)
    headed = headings_above(axis, len(rows))
    axis.grid(visible=False)
    for spine in axis.spines.values():
        spine.set_visible(False)
    starts = [k for k in range(len(columns)) if k == 0 or columns[k][0] != columns[k - 1][0]]
    for first, after in zip(starts, [*starts[1:], len(columns)]):
        alone = after - first == 1
        axis.annotate(columns[first][0].replace("_", "\n" if alone else " "), ((first + after - 1) / 2, -0.5), (0, 50 if headed else 4), textcoords="offset points", ha="center",
                      va="bottom", fontsize=7.5 if alone else 9.5)
        if first:
            axis.axvline(first - 0.5, color="white", linewidth=4)
    for y in range(1, len(rows)):
        if rows[y][0] != rows[y - 1][0]:
            axis.axhline(y - 0.5, color="white", linewidth=4)
