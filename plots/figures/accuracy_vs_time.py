"""Wrong answers against time: what accuracy costs. One panel a scene and workload, the Pareto front drawn."""

from matplotlib.ticker import LogLocator, NullLocator

from results import NoData, ordered
from style import colour, legends_right, marker_legend, marker_map, panel_grid, structure_legend

TITLE = "Accuracy against time"
CAPTION = ("A point is a cell; every wrong answer counts: missed hits, false hits, wrong surfaces, against exact arithmetic. "
           "The grey steps join the cells that no other beats in both. Zero stands on the lowest line. Lower left is better.")


def draw(results):
    metric, _ = results.throughput()
    points = [(c, 1e9 / c.value(metric), c.per_million("wrong_answers")) for c in results.traces
              if c.value(metric) and c.per_million("wrong_answers") is not None]
    if not points:
        raise NoData("no cell has both a throughput and checked answers")
    scenes = ordered((c["scene"] for c, _, _ in points), "scene")
    workloads = ordered((c["workload"] for c, _, _ in points), "workload")
    structures = ordered((c["structure"] for c, _, _ in points), "structure")
    tests = sorted({test(c) for c, _, _ in points})
    markers = marker_map(tests)
    smallest = min((wrong for _, _, wrong in points if wrong > 0), default=1.0)

    worst = max(wrong for _, _, wrong in points)
    figure, axes = panel_grid(scenes, workloads, 3.9, 3.0, 3)
    for (scene, workload), axis in axes.items():
        here = [p for p in points if p[0]["scene"] == scene and p[0]["workload"] == workload]
        for cell, nanoseconds, wrong in here:
            axis.plot(nanoseconds, wrong, markers[test(cell)], color=colour(cell["structure"]), markersize=6,
                      markeredgecolor="white", markeredgewidth=0.6)
        front = pareto_front([(t, w) for _, t, w in here])
        axis.step([t for t, _ in front], [w for _, w in front], where="post", color="#777777", linewidth=1, zorder=1)
        if worst > 0:
            axis.set_yscale("symlog", linthresh=smallest, linscale=0.5)
            axis.set_ylim(-0.15 * smallest, 2.0 * worst)
        else:
            axis.set_ylim(-0.1, 1.0)
            axis.set_yticks([0, 1])
        times = [t for _, t, _ in here]
        if times and max(times) > 6 * min(times):
            axis.set_xscale("log")
            axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.xaxis.set_major_formatter("{x:g}")
            axis.xaxis.set_minor_locator(NullLocator())
        else:
            axis.set_xlim(0, 1.08 * max(times, default=1.0))
        axis.set_xlabel("time, ns a ray")
        axis.set_ylabel("wrong answers per million")
    legends_right(figure, [("structure", structure_legend(structures)), ("intersector, box", marker_legend(markers))])
    return figure


def test(cell):
    return ", ".join(cell[a] for a in ("intersector", "box") if cell[a])


def pareto_front(points):
    """Those (time, wrong) that none other beats in one and equals in the other, by time."""
    front = []
    for time, wrong in sorted(points):
        if not front or wrong < front[-1][1]:
            front.append((time, wrong))
    return front
