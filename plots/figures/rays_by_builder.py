"""Throughput by structure and builder: one panel a scene, workload and instruction set, a bar for each structure as built."""

from figures import squares
from figures.bars import LEAST_WIDTH, bar_axes, draw_panel, scene_bars
from figures.modes import Modes
from results import NoData, ordered, undetermined_axes
from style import (PALE, WRONG, edge, interval_legend, is_wrong, legends_right, mode_legend, mode_markers, short_names, wrong_legend, wrong_marker,
                   wrong_text)
from tables import digits

TITLE = "Rays per second by structure and builder"
NEEDS = "rays_per_second of several builders of a structure (`metrics: [trace]`, `builder: [...]`)"
CAPTION = ("A bar reaches the fastest mode of a structure as built, with {interval}; markers "
           "show its other modes. Higher is better. A red marker is a mode with wrong answers; the red number behind a bar's own counts those of the mode "
           "that the bar reaches, per million rays. Those of each cell stand in the table.")
BUILT = ("scene", "workload", "isa", "structure", "builder", "threads")


def draw(results):
    metric, unit = results.throughput()
    cells = [c for c in results.traces if c.estimate(metric)]
    if not cells:
        raise NoData("no cell has a throughput")
    if len({(c["structure"], c["builder"]) for c in cells}) == len({c["structure"] for c in cells}):
        raise NoData("no structure has two builders")
    groups = {}
    for cell in cells:
        groups.setdefault(tuple(cell[a] for a in BUILT), []).append(cell)
    best = [max(group, key=lambda c: c.estimate(metric).median) for group in groups.values()]
    varied = [a for a in undetermined_axes(best, BUILT) if a in ("builder", "threads")]
    modes = Modes([c for c in cells], without=("builder", "leaf"))
    markers = mode_markers(modes.labels) if len(modes.labels) > 1 else {}

    keys = [(s, w, i) for s in ordered((c["scene"] for c in cells), "scene")
            for w in ordered((c["workload"] for c in cells), "workload") for i in ordered((c["isa"] for c in cells), "isa")
            if any((c["scene"], c["workload"], c["isa"]) == (s, w, i) for c in best)]
    shown = {key: scene_bars([c for c in best if (c["scene"], c["workload"], c["isa"]) == key], varied) for key in keys}

    def value(cell):
        rate = cell.estimate(metric)
        return rate.median / 1e6, rate.low / 1e6, rate.high / 1e6

    names = short_names(scene for scene, *_ in keys)
    titles = {key: f"{names[key[0]]}, {key[1]}, {key[2]}" for key in keys}
    if squares.are_due(shown.values(), varied):
        figure, drawn = squares.square_panels([(titles[key], shown[key]) for key in keys], varied, value, digits, unit, higher_is_better=True)
        for axis, places in drawn:
            squares.mark_wrong(axis, places)
        if any(map(is_wrong, best)):
            figure.more_caption += " A square of a mode with wrong answers is framed red."
        legends_right(figure, wrong_legend(best))
        return figure
    figure, axes = bar_axes(shown, LEAST_WIDTH)
    for key, axis in axes.items():
        bars = shown[key]
        draw_panel(axis, bars, value, lambda c: digits(value(c)[0]), varied, alpha=PALE if markers else 1.0)
        for place, bar in enumerate(bars):
            for cell in groups[tuple(bar[a] for a in BUILT)] if markers else ():
                axis.plot(cell.estimate(metric).median / 1e6, place, linestyle="", color=edge(cell), **markers[modes.label(cell)])
            if is_wrong(bar):
                axis.annotate(wrong_text(bar), (value(bar)[2], place), (5 + 6 * len(digits(value(bar)[0])) + 6, 0), textcoords="offset points", va="center",
                              fontsize=8, color=WRONG)
        axis.set_title(titles[key])
        axis.set_xlabel(unit)
    legends = [("mode", mode_legend(markers))] if markers else []
    legends += interval_legend([bar.estimate(metric) for bar in best])
    legends_right(figure, legends + wrong_legend(cells, wrong_marker("some wrong; the number:\nof the bar's, per million")))
    return figure
