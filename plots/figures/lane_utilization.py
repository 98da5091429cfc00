"""Lane utilisation by depth: how full the lanes are that nodes are tested with, from the root down."""

from figures.modes import Modes
from results import NoData, TooMuch, ordered
from style import MARKERS, colour, legends_right, marker_legend, marker_map, panel_grid, structure_legend

TITLE = "Lane utilisation by depth"
CAPTION = ("Of the SIMD lanes of ray/box tests at nodes of a depth, those that hold a ray and a box: a packet has a child's rays in lanes, a ray that goes "
           "alone a node's children; registers without a ray are passed over and not counted. Depths of less than one visit in a thousand rays are left out. "
           "Counted in a pass of its own, untimed.")
FEWEST_VISITS = 1e-3
ONLY_WHEN_NAMED = True


def draw(results):
    cells = [c for c in results.traces if c.series("lane_utilization_by_depth")]
    if not cells:
        raise NoData("no cell counted lanes by depth")
    modes = Modes(cells, without=("builder", "leaf", "intersector", "box", "threads"))
    isas = ordered((c["isa"] for c in cells), "isa")
    labels = sorted({label(modes, c, isas) for c in cells})
    if len(labels) > len(MARKERS):
        raise TooMuch(f"{len(labels)} modes are too many to tell apart; choose some with --filter")
    markers = marker_map(labels, "modes")
    workloads = ordered((c["workload"] for c in cells), "workload")
    figure, axes = panel_grid([(c["scene"], c["workload"]) for c in cells], {w: w for w in workloads}, 4.6, 2.9, 2)
    for (scene, workload), axis in axes.items():
        drawn = set()
        for cell in (c for c in cells if c["scene"] == scene and c["workload"] == workload):
            key = (cell["structure"], label(modes, cell, isas))
            if key in drawn:
                continue
            drawn.add(key)
            points = [(d, 100 * lanes) for d, (lanes, visits) in enumerate(zip(cell.series("lane_utilization_by_depth"), cell.series("visits_by_depth")))
                      if lanes is not None and visits >= FEWEST_VISITS]
            axis.plot(*zip(*points), color=colour(cell["structure"]), linewidth=1.1, marker=markers[key[1]], markersize=4, markerfacecolor="white")
        axis.set_ylim(0, 103)
        axis.set_xlabel("depth of the node (the root's is 0)")
        axis.set_ylabel("lanes in use, %")
        axis.xaxis.get_major_locator().set_params(integer=True)
    legends_right(figure, [("structure", structure_legend({c["structure"] for c in cells})), ("mode", marker_legend(markers))])
    return figure


def label(modes, cell, isas):
    return modes.label(cell) + (f", {cell['isa']}" if len(isas) > 1 else "")
