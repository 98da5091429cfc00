"""Throughput by structure and instruction set: one panel a scene and workload."""

from matplotlib.lines import Line2D

from figures import trade_offs
from figures.modes import Modes
from results import NoData, ordered
from style import (PALE, WRONG, colour, edge, hatch, interval_legend, is_wrong, legends_right, mode_legend, mode_markers, panel_grid, round_ticks,
                   structure_legend, wrong_legend, wrong_marker, wrong_text)

TITLE = "Rays per second"
NEEDS = "rays_per_second (`metrics: [trace]`)"
CAPTION = ("Bars reach the fastest mode of a structure; markers show every mode with {interval}; "
           "where there are more than 20 modes, their medians alone, told apart by the way of traversal. Higher is better. A red marker is a mode with wrong "
           "answers; the red number above a bar counts those of the mode that the bar reaches, per million rays. "
           "Those of each cell stand in the table. Of several numbers of threads the figure shows the fewest.")
DIGIT = 0.032  # of a panel's height, that a character of a number above a bar takes

LARGEST, LEAST, LINE = 7.5, 4.5, 1.2  # points of these numbers; how much wider than its size a line of them is
AROUND = 1.0  # inches of a panel beside its axes
BAR, MARKER = 0.2, 0.045  # inches that a bar takes at least, and each of the markers beside each other on it
DOT = {"marker": ".", "markersize": 2.5}


def draw(results):
    metric, unit = results.throughput()
    cells, threads = trade_offs.of_one_number_of_threads([c for c in results.traces if c.estimate(metric)])
    if threads:
        unit = f"Mray/s\n({results.clock()}{threads})".replace("; ", ";\n")
    if not cells:
        raise NoData("no cell has a throughput")
    workloads = ordered((c["workload"] for c in cells), "workload")
    isas, structures = ordered((c["isa"] for c in cells), "isa"), ordered((c["structure"] for c in cells), "structure")
    modes = Modes(cells)
    markers, each = mode_markers(modes.labels), len(modes.labels)
    if not markers and len({c["traversal"] for c in cells}) > 1:
        modes = Modes(cells, without=("builder", "leaf", "intersector", "box", "threads"))
        markers = mode_markers(modes.labels)
    intervals = each == len(modes.labels) and bool(markers)

    at_bars = {}
    for cell in cells:
        at_bars.setdefault(tuple(cell[a] for a in ("scene", "workload", "isa", "structure")), set()).add(modes.label(cell))
    bar = max(BAR, MARKER * max(map(len, at_bars.values())) if markers else 0)
    of_isa = {isa: ordered((c["structure"] for c in cells if c["isa"] == isa), "structure") for isa in isas}
    most = max(map(len, of_isa.values()))
    width = min(7.0, max(3.2, bar * len(isas) * (most + 1) + 0.8))
    figure, axes = panel_grid([(c["scene"], c["workload"]) for c in cells], {w: w for w in workloads}, width, 2.9, 3 if width < 4.2 else 2)
    for (scene, workload), axis in axes.items():
        here = [c for c in cells if c["scene"] == scene and c["workload"] == workload]
        slot = 72 * (width - AROUND) / len(isas) / (most + 1)  # points that a bar has
        panel(axis, here, metric, of_isa, most, modes, markers, intervals, min(LARGEST, max(LEAST, slot / LINE)))
        axis.set_ylabel(unit, **({"fontsize": 8.5} if threads else {}))
    legends = [("structure", structure_legend(structures))]
    dot = Line2D([], [], linestyle="", color="#222222", label=f"each of {each}", **DOT)
    legends += [("mode" if intervals or not markers else f"traversal, of {each} modes", mode_legend(markers) or [dot])] if each > 1 else []
    legends += interval_legend([c.estimate(metric) for c in cells]) if intervals else []
    legends_right(figure, legends + wrong_legend(cells, wrong_marker("some wrong; the number:\nof the bar's, per million")))
    return figure


def panel(axis, cells, metric, of_isa, most, modes, markers, intervals, number_size):
    """`of_isa`: {instruction set: structures that have bars there, in any panel}, `most` of them at most."""
    step, isas = 1.0 / (most + 1), list(of_isa)
    bar = 0.86 * step
    for group, (isa, structures) in enumerate(of_isa.items()):
        for slot, structure in enumerate(structures):
            here = [(c, c.estimate(metric)) for c in cells if c["isa"] == isa and c["structure"] == structure]
            if not here:
                continue
            x = group + (slot - (len(structures) - 1) / 2) * step
            fastest, best = max(here, key=lambda pair: pair[1].median)
            axis.bar(x, best.median / 1e6, bar, color=colour(structure), alpha=PALE, hatch=hatch(structure), edgecolor="white",
                     linewidth=0.5)
            if is_wrong(fastest):
                top = max(e.high if intervals else e.median for _, e in here) / 1e6
                axis.annotate(wrong_text(fastest), (x, top), (0, 5), textcoords="offset points", rotation=90, ha="center", va="bottom",
                              fontsize=number_size, color=WRONG)
            own = {modes.label(c) for c, _ in here}
            places = [label for label in modes.labels if label in own] if markers else [""]
            for cell, value in here:
                label = modes.label(cell) if markers else ""
                at = x + ((places.index(label) + 0.5) / len(places) - 0.5) * 0.9 * bar
                ends = [[(value.median - value.low) / 1e6], [(value.high - value.median) / 1e6]] if intervals else None
                axis.errorbar(at, value.median / 1e6, ends, linestyle="", color=edge(cell), elinewidth=0.9, **markers.get(label, DOT))
    axis.set_xticks(range(len(isas)), isas)
    axis.set_xlim(-0.55, len(isas) - 0.45)
    longest = max((len(wrong_text(c)) for c in cells if is_wrong(c)), default=0)
    axis.set_ylim(0, axis.get_ylim()[1] / (1 - DIGIT * longest))
    axis.yaxis.set_major_locator(round_ticks(9))
    axis.grid(axis="x", visible=False)
