"""Throughput by structure and instruction set: one panel a scene and workload."""

from figures.modes import Modes
from results import NoData, ordered
from style import MARKERS, colour, hatch, legends_right, marker_legend, marker_map, panel_grid, structure_legend

TITLE = "Rays per second"
CAPTION = ("Bars reach the fastest mode of a structure; markers show every mode with its 95 % confidence interval of the "
           "median. Higher is better. The wrong answers of each cell stand in the table.")


def draw(results):
    metric, unit = results.throughput()
    cells = [c for c in results.traces if c.estimate(metric)]
    if not cells:
        raise NoData("no cell has a throughput")
    scenes, workloads = ordered((c["scene"] for c in cells), "scene"), ordered((c["workload"] for c in cells), "workload")
    isas, structures = ordered((c["isa"] for c in cells), "isa"), ordered((c["structure"] for c in cells), "structure")
    modes = Modes(cells)
    markers = marker_map(modes.labels) if len(modes.labels) <= len(MARKERS) else {}

    width = min(7.0, max(3.2, 0.2 * len(isas) * (len(structures) + 1) + 0.8))
    figure, axes = panel_grid(scenes, workloads, width, 2.9, 3 if width < 4.2 else 2)
    for (scene, workload), axis in axes.items():
        here = [c for c in cells if c["scene"] == scene and c["workload"] == workload]
        panel(axis, here, metric, isas, structures, modes, markers)
        axis.set_ylabel(unit)
    legends = [("structure", structure_legend(structures))]
    legends_right(figure, legends + ([("mode", marker_legend(markers))] if len(markers) > 1 else []))
    return figure


def panel(axis, cells, metric, isas, structures, modes, markers):
    step = 1.0 / (len(structures) + 1)
    bar = 0.86 * step
    for group, isa in enumerate(isas):
        for slot, structure in enumerate(structures):
            here = [(c, c.estimate(metric)) for c in cells if c["isa"] == isa and c["structure"] == structure]
            if not here:
                continue
            x = group + (slot - (len(structures) - 1) / 2) * step
            best = max(e.median for _, e in here) / 1e6
            axis.bar(x, best, bar, color=colour(structure), alpha=0.55, hatch=hatch(structure), edgecolor="white",
                     linewidth=0.5)
            if not markers:  # too many modes to tell apart: where they lie is still seen
                axis.plot([x] * len(here), [e.median / 1e6 for _, e in here], ".", color="#222222", markersize=2.5)
                continue
            for cell, value in here:
                label = modes.label(cell)
                at = x
                if len(markers) > 1:
                    at += (modes.labels.index(label) / (len(markers) - 1) - 0.5) * 0.55 * bar
                axis.errorbar(at, value.median / 1e6,
                              [[(value.median - value.low) / 1e6], [(value.high - value.median) / 1e6]],
                              fmt=markers[label], color="#222222", markersize=4, markerfacecolor="white",
                              markeredgewidth=0.9, elinewidth=0.9)
    axis.set_xticks(range(len(isas)), isas)
    axis.set_xlim(-0.55, len(isas) - 0.45)
    axis.set_ylim(bottom=0)
    axis.grid(axis="x", visible=False)
    if not cells:
        axis.text(0.5, 0.5, "no cells", transform=axis.transAxes, ha="center", color="#777777")
