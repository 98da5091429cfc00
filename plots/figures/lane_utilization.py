"""Lane utilisation by depth: how full the lanes are that nodes are tested with, from the root down."""

from textwrap import fill

from matplotlib.lines import Line2D

from figures.modes import Modes
from results import NoData, TooMuch, ordered
from style import MARKERS, colour, legends_right, marker_legend, marker_map, panel_grid, structure_legend

TITLE = "Lane utilisation by depth"
NEEDS = "lane_utilization_by_depth (`metrics: [trace]`)"
CAPTION = ("Of the SIMD lanes of ray/box tests at nodes of a depth, those that hold a ray and a box: a packet has a child's rays in lanes, a ray that goes "
           "alone a node's children; registers without a ray are passed over and not counted. Depths of less than one visit in a thousand rays are left "
           "out. Counted in a pass of its own, untimed. "
           "Of several builders, leaves, tests or numbers of threads a line is of those that the configuration has first; the legend says which, "
           "and what is not shown.")
FEWEST_VISITS = 1e-3
ONLY_WHEN_NAMED = True
HIDDEN = ("builder", "leaf", "intersector", "box", "threads")  # axes of which a line is of one key


def draw(results):
    cells = [c for c in results.traces if c.series("lane_utilization_by_depth")]
    if not cells:
        raise NoData("no cell counted lanes by depth")
    modes = Modes(cells, without=HIDDEN)
    isas = ordered((c["isa"] for c in cells), "isa")
    cells, told = of_the_first(cells, lambda c: (c["structure"], label(modes, c, isas)))
    drawn = {(c["isa"], modes.label(c)): label(modes, c, isas) for c in cells}
    labels = [drawn[key] for m in modes.labels for i in isas if (key := (i, m)) in drawn]
    if len(labels) > len(MARKERS):
        raise TooMuch(f"{len(labels)} modes are too many to tell apart; choose some with --filter")
    markers = marker_map(labels, "modes")
    workloads = ordered((c["workload"] for c in cells), "workload")
    figure, axes = panel_grid([(c["scene"], c["workload"]) for c in cells], {w: w for w in workloads}, 4.6, 2.9, 2)
    for (scene, workload), axis in axes.items():
        for cell in (c for c in cells if c["scene"] == scene and c["workload"] == workload):
            points = [(d, 100 * lanes) for d, (lanes, visits) in enumerate(zip(cell.series("lane_utilization_by_depth"), cell.series("visits_by_depth")))
                      if lanes is not None and visits >= FEWEST_VISITS]
            axis.plot(*zip(*points), color=colour(cell["structure"]), linewidth=1.1, marker=markers[label(modes, cell, isas)], markersize=4,
                      markerfacecolor="white")
        axis.set_ylim(0, 103)
        axis.set_xlabel("depth of the node (the root's is 0)")
        axis.set_ylabel("lanes in use, %")
        axis.xaxis.get_major_locator().set_params(integer=True)
    legends_right(figure, [("structure", structure_legend({c["structure"] for c in cells})), ("mode", marker_legend(markers)),
                           *([("of several", [Line2D([], [], linestyle="", label=fill(line, 48)) for line in told])] if told else [])])
    return figure


def of_the_first(cells, line_of):
    """Those cells that have the keys of HIDDEN which the first cell of their line has, and, in a line for each of HIDDEN, what of
    several is shown and what is not."""
    first = {}
    for cell in cells:
        first.setdefault(line_of(cell), tuple(cell[a] for a in HIDDEN))
    kept = [c for c in cells if tuple(c[a] for a in HIDDEN) == first[line_of(c)]]
    told = []
    for place, axis in enumerate(HIDDEN):
        shown, others = {}, {}
        for cell in cells:
            key = first[line_of(cell)][place]
            shown.setdefault(cell["structure"], set()).add(key)
            if cell[axis] != key:
                others.setdefault(cell["structure"], set()).add(cell[axis])
        alike = {}
        for structure, hidden in others.items():
            alike.setdefault((tuple(ordered(shown[structure], axis)), tuple(ordered(hidden - shown[structure], axis))), []).append(structure)
        told += [f"{', '.join(structures)}: {axis} {', '.join(here)}" +
                 (f"; not shown: {', '.join(hidden)}" if hidden else "") for (here, hidden), structures in alike.items()]
    return kept, told


def label(modes, cell, isas):
    words = [modes.label(cell)] if len(modes.labels) > 1 or len(isas) < 2 else []
    return ", ".join(words + ([cell["isa"]] if len(isas) > 1 else []))
