"""What accuracy costs in time, the Pareto front drawn. Accuracy is that of hard rays where the run has them: a row of panels for wrong
answers, one for the error of t, a column an instruction set. Otherwise that of each workload's own rays, a panel a scene and workload."""

from matplotlib.ticker import FixedLocator, NullLocator

from results import HARD_PREFIX, NoData, ordered
from style import (colour, intersector_colour, intersector_legend, legends_right, log_with_zero, marker_legend, marker_map, panel_grid, panels,
                   short, structure_legend)

TITLE = "Accuracy against time"
CAPTION = ("A point is a cell; lower left is better. Wrong answers are missed hits, false hits and wrong surfaces against exact "
           "arithmetic; the error of t is that of right answers. Where the run has the workload `hard`, accuracy is that of its rays, which are aimed at "
           "what goes wrong, and time that of ordinary rays of the same cell. The grey steps join the cells that no other beats in both. "
           "Zero stands on the lowest line.")

MEASURES = (("wrong_answers", "wrong answers per million"), ("t_error_ulp_p99", "error of t, 99th percentile, ulp"))
COMBINATION = ("scene", "structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "threads")


def draw(results):
    metric, _ = results.throughput()
    paired = hard_points(results, metric)
    if paired:
        return draw_hard(paired)
    points = [(c, 1e9 / c.value(metric), c.per_million("wrong_answers")) for c in results.traces
              if c.value(metric) and c.per_million("wrong_answers") is not None]
    if not points:
        raise NoData("no cell has both a throughput and checked answers")
    return draw_workloads(points)


def hard_points(results, metric):
    """(ordinary cell, ns a ray of it, the same combination's cell of `hard` rays)."""
    hard = {tuple(c[a] for a in COMBINATION): c for c in results.traces if c["workload"] == HARD_PREFIX}
    ordinary = [c for c in results.traces if not c["workload"].startswith(HARD_PREFIX) and c.value(metric)]
    names = ordered({c["workload"] for c in ordinary if tuple(c[a] for a in COMBINATION) in hard}, "workload")
    wanted = "diffuse" if "diffuse" in names else next(iter(names), None)
    found = [(c, 1e9 / c.value(metric), hard.get(tuple(c[a] for a in COMBINATION))) for c in ordinary if c["workload"] == wanted]
    return [p for p in found if p[2] is not None and p[2].per_million("wrong_answers") is not None]


def draw_hard(points):
    scenes, isas = ordered((c["scene"] for c, _, _ in points), "scene"), ordered((c["isa"] for c, _, _ in points), "isa")
    structures = ordered((c["structure"] for c, _, _ in points), "structure")
    intersectors = sorted({c["intersector"] for c, _, _ in points})
    markers = marker_map(structures)
    measures = [(name, label) for name, label in MEASURES if any(value_of(hard, name) is not None for _, _, hard in points)]
    figure, axes = panels(len(scenes) * len(measures), len(isas), 4.2, 3.1)
    rows = [(scene, *measure) for scene in scenes for measure in measures]
    for row, (scene, name, label) in enumerate(rows):
        everywhere = [value_of(h, name) for c, _, h in points if c["scene"] == scene]
        for column, isa in enumerate(isas):
            axis = axes[row][column]
            here = [(c, t, value_of(h, name)) for c, t, h in points if c["scene"] == scene and c["isa"] == isa and value_of(h, name) is not None]
            for cell, time, value in sorted(here, key=lambda p: p[0]["box"] == "padded"):  # filled ones above
                own = intersector_colour(cell["intersector"])
                axis.plot(time, value, markers[cell["structure"]], markersize=6.5, color=own, markeredgewidth=1.3,
                          fillstyle="left" if cell["box"] == "ize" else "full", markerfacecoloralt="white",
                          markerfacecolor="white" if cell["box"] == "fast" else own, markeredgecolor=own, clip_on=False)
            step_front(axis, [(t, v) for _, t, v in here])
            log_with_zero(axis, "y", [v for v in everywhere if v is not None])
            log_time(axis, [t for c, t, _ in points if c["scene"] == scene])
            axis.set_title(f"{short(scene)}, {isa}")
            axis.set_xlabel(f"time of {points[0][0]['workload'].replace('_', ' ')} rays, ns a ray")
            axis.set_ylabel(label + ("\nhard rays" if name == "wrong_answers" else "\nhard rays answered right"))
    boxes = marker_legend({"fast boxes: hollow": "o", "padded boxes: filled": "o"})
    boxes[1].set_markerfacecolor("#333333")
    if any(c["box"] == "ize" for c, _, _ in points):
        boxes += marker_legend({"Ize's boxes: half": "o"})
        boxes[2].set_fillstyle("left")
        boxes[2].set_markerfacecolor("#333333")
    legends_right(figure, [("intersector", intersector_legend(intersectors)), ("structure", marker_legend(markers)), ("", boxes)])
    return figure


def value_of(cell, name):
    return cell.per_million(name) if name == "wrong_answers" else cell.value(name)


def draw_workloads(points):
    scenes = ordered((c["scene"] for c, _, _ in points), "scene")
    workloads = ordered((c["workload"] for c, _, _ in points), "workload")
    structures = ordered((c["structure"] for c, _, _ in points), "structure")
    markers = marker_map(sorted({test(c) for c, _, _ in points}))

    figure, axes = panel_grid(scenes, workloads, 3.9, 3.0, 3)
    for (scene, workload), axis in axes.items():
        here = [p for p in points if p[0]["scene"] == scene and p[0]["workload"] == workload]
        for cell, nanoseconds, wrong in here:
            axis.plot(nanoseconds, wrong, markers[test(cell)], color=colour(cell["structure"]), markersize=6,
                      markeredgecolor="white", markeredgewidth=0.6, clip_on=False)
        step_front(axis, [(t, w) for _, t, w in here])
        log_with_zero(axis, "y", [wrong for _, _, wrong in points])
        log_time(axis, [t for _, t, _ in here])
        axis.set_xlabel("time, ns a ray")
        axis.set_ylabel("wrong answers per million")
    legends_right(figure, [("structure", structure_legend(structures)), ("intersector, box", marker_legend(markers))])
    return figure


def log_time(axis, times):
    low, high = min(times, default=1.0), max(times, default=1.0)
    axis.set_xscale("log")
    axis.set_xlim(0.85 * low, 1.18 * high)
    dense = high / low < 30
    digits = (1, 1.5, 2, 3, 4, 5, 7) if high / low < 5 else (1, 2, 5) if dense else (1,)
    axis.xaxis.set_major_locator(FixedLocator([d * 10.0**k for k in range(-1, 8) for d in digits]))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_locator(NullLocator())


def step_front(axis, points):
    front = pareto_front(points)
    axis.step([t for t, _ in front], [w for _, w in front], where="post", color="#777777", linewidth=1, zorder=1)


def test(cell):
    return ", ".join(cell[a] for a in ("intersector", "box") if cell[a])


def pareto_front(points):
    """Those (time, wrong) that none other beats in one and equals in the other, by time."""
    front = []
    for time, wrong in sorted(points):
        if not front or wrong < front[-1][1]:
            front.append((time, wrong))
    return front
