"""How well the SAH cost foretells the measured time: a panel a scene, workload and instruction set, where there are three structures as built or more; scenes
share panels where there would be many of them and costs are near each other."""

import numpy as np

from figures import costs, trade_offs
from results import NoData, estimate, is_aimed, ordered
from style import (WRONG, colour, is_wrong, legends_right, marker_legend, marker_map, most_wrong, panel_grid, panels, structure_legend,
                   wrong_legend, wrong_marker)
from tables import SAH_STEP

TITLE = "SAH cost against measured time"
NEEDS = "sah_cost and rays_per_second (`metrics: [trace, quality]`)"
CAPTION = ("A point is a structure as built, by one builder, on a scene, with its fastest leaf traced in its fastest mode; of "
           "several numbers of threads the figure shows the fewest. A line is the least-squares fit through the points of one scene in a panel, R² its share "
           "of the variance explained (where scenes share a panel, in the legend's order; of more than three the least and the most); with EPO: that of the "
           "plane through SAH cost and end-point overlap, which never explains less, so small differences say nothing. There is no fit where "
           "fewer than four costs are more than 2 % apart. brute_force, which has no tree and whose cost and time are many times those of all others, is "
           "left out: it alone would decide the fit. "
           "So are rays that are aimed at edges and vertices (hard ones, camera_edges). A red edge: the mode has wrong answers. "
           + costs.CAPTION[1:] + " " + SAH_STEP + " So a low R² across structures is a finding, not a fault.")

MOST_PANELS = 24  # of scenes apart
FAR_APART = 4.0  # scenes whose costs differ by more never share panels
NO_TREE = "brute_force"
FEWEST_POINTS = 3  # of a panel
FEWEST_COSTS = 4  # of a fit: through three a line goes as it may
SAME = 0.02  # costs that differ by no larger share are one: measured times then tell the rest
BUILT = ("scene", "structure", "builder", "isa", "workload")


def draw(results):
    points, threads = fastest_points(results)
    if not points:
        raise NoData("no traced cell has a SAH cost")
    numbers = {id(cell): rest for cell, *rest in points}
    cells, said = costs.split([cell for cell, *_ in points])
    points = compared([(apart_by_costs, *numbers[id(cell)]) for cell, apart_by_costs in cells])
    if not points:
        raise NoData("nowhere are three structures as built, brute_force apart, of different SAH costs to set against time")
    y_label = f"time, ns a ray\n({results.clock()}{threads})".replace("; ", ";\n")
    workloads = ordered((c["workload"] for c, *_ in points), "workload")
    isas = ordered((c["isa"] for c, *_ in points), "isa")
    scenes = ordered((c["scene"] for c, *_ in points), "scene")
    structures = ordered((c["structure"] for c, *_ in points), "structure")

    if len({place_of(c) for c, *_ in points}) <= MOST_PANELS or far_apart(points):
        markers = {}
        figure = panels_by_scene(points, {(w, i): f"{w}, {i}" for w in workloads for i in isas}, y_label, said)
    else:
        markers = marker_map(scenes, "scenes")
        figure = panels_of_all(points, workloads, isas, markers, y_label, said)
    answers = wrong_legend([c for c, *_ in points], wrong_marker(f"edge: some wrong, up to\n{most_wrong([c for c, *_ in points])} per million"))
    legends_right(figure, [("structure", structure_legend(structures)), *([("scene", marker_legend(markers))] if markers else []), *answers])
    return figure


def place_of(cell):
    return tuple(cell[a] for a in ("scene", "workload", "isa"))


def fastest_points(results):
    """[(cell, SAH cost, ns a ray, EPO or None)] of the fastest leaf and mode of each structure, builder, scene, workload and ISA, with one number of threads;
    and what is said of that number."""
    metric, _ = results.throughput()

    def cost(cell):
        found = results.structure_value(cell, "sah_cost")
        return None if found is None else estimate([found])

    cells, threads = trade_offs.of_one_number_of_threads([c for c in results.traces if c["structure"] != NO_TREE and not is_aimed(c["workload"]) and cost(c)])
    return [(p.cell, p.x.median, p.y.median, results.structure_value(p.cell, "epo")) for p in trade_offs.fastest_points(cells, metric, cost, BUILT)], threads


def compared(points):
    """Those on whose scene, workload and instruction set there are enough that differ to be set against each other."""
    places = {}
    for point in points:
        places.setdefault(place_of(point[0]), []).append(point)
    return [p for p in points if len(here := places[place_of(p[0])]) >= FEWEST_POINTS and len({cost for _, cost, *_ in here}) > 1]


def far_apart(points):
    """Whether the largest SAH cost of one scene is a multiple of another's."""
    largest = {}
    for cell, cost, *_ in points:
        largest[cell["scene"]] = max(cost, largest.get(cell["scene"], 0.0))
    return max(largest.values()) > FAR_APART * min(largest.values())


def panels_by_scene(points, kinds, y_label, said):
    shown = {}  # (scene, (workload, isa)) -> points
    for point in points:
        shown.setdefault((point[0]["scene"], (point[0]["workload"], point[0]["isa"])), []).append(point)
    figure, axes = panel_grid(shown, kinds, 3.3, 3.05, 4)
    for place, axis in axes.items():
        panel(axis, shown[place], {place[0]: "o"}, axis.get_title())
        axis.set_xlim(0, 1.08 * max(p[1] for p in shown[place]))
        axis.set_ylim(0, 1.08 * max(p[2] for p in shown[place]))
        axis.set_xlabel(f"SAH cost{said}")
        axis.set_ylabel(y_label)
    return figure


def panels_of_all(points, workloads, isas, markers, y_label, said):
    figure, axes = panels(len(workloads), len(isas), 3.3, 3.05, sharex=True, sharey="row")
    for row, workload in enumerate(workloads):
        for column, isa in enumerate(isas):
            here = [p for p in points if p[0]["workload"] == workload and p[0]["isa"] == isa]
            panel(axes[row][column], here, markers, f"{workload}, {isa}")
        axes[row][0].set_ylabel(y_label)
        axes[row][0].set_ylim(0, 1.08 * max(p[2] for p in points if p[0]["workload"] == workload))
    axes[0][0].set_xlim(0, 1.08 * max(p[1] for p in points))
    for axis in axes[-1]:
        axis.set_xlabel(f"SAH cost{said}")
    return figure


def panel(axis, points, markers, title):
    """`markers`: of the scenes that share the panel."""
    for cell, cost, nanoseconds, _ in points:
        axis.plot(cost, nanoseconds, linestyle="", marker=markers[cell["scene"]], color=colour(cell["structure"]), markersize=7,
                  markeredgecolor=WRONG if is_wrong(cell) else "white", markeredgewidth=1.2 if is_wrong(cell) else 0.7)
    explained_by = []  # (R², R² with EPO) of each scene, None where there is none
    for scene in markers:
        here = [p for p in points if p[0]["scene"] == scene]
        x, y = [p[1] for p in here], [p[2] for p in here]
        if fit := linear_fit(x, y):
            slope, offset, _ = fit
            ends = np.array([min(x), max(x)])
            axis.plot(ends, slope * ends + offset, "-", color="#777777", linewidth=1, zorder=1)
        explained_by.append((fit and fit[2], fit and plane_fit(x, [p[3] for p in here], y)))
    if points:
        fits = fits_text(explained_by) if any(alone is not None for alone, _ in explained_by) else f"no fit, fewer than {FEWEST_COSTS} costs"
        title += f"\n{fits} (n = {len(points)})"
    else:
        axis.text(0.5, 0.5, "no cells", transform=axis.transAxes, ha="center", color="#777777")
    axis.set_title(title)


def fits_text(explained_by):
    """(R², R² with EPO) of each scene in words, None where there is none; of more than three scenes from the least to the most."""
    def said(values):
        if len(values) <= 3:
            return ", ".join("–" if value is None else f"{value:.2f}" for value in values)
        known = [value for value in values if value is not None]
        return "–" if not known else f"{min(known):.2f} to {max(known):.2f}"

    alone, both = zip(*explained_by)
    return f"R² = {said(alone)}" + (f"{', ' if len(both) == 1 else chr(10)}with EPO {said(both)}" if any(value is not None for value in both) else "")


def linear_fit(x, y):
    """(slope, offset, R²) by least squares; None where fewer than FEWEST_COSTS of `x` are apart or `y` does not vary."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if apart(x) < FEWEST_COSTS or np.ptp(y) == 0:
        return None
    slope, offset = np.polyfit(x, y, 1)
    return slope, offset, explained(y, slope * x + offset)


def apart(costs):
    """How many of `costs` there are of which each is more than SAME above the one before."""
    kept = []
    for cost in sorted(costs):
        if not kept or cost > (1 + SAME) * kept[-1]:
            kept.append(cost)
    return len(kept)


def explained(y, fit):
    """R²: the share of the variance of `y` that `fit` explains."""
    return 1.0 - float(((y - fit) ** 2).sum()) / float(((y - y.mean()) ** 2).sum())


def plane_fit(x1, x2, y):
    """R² of the least-squares plane through two predictors; None below five points, where one is missing or does not vary apart from the other."""
    if len(y) < 5 or None in x2:
        return None
    columns, y = np.column_stack([x1, x2, np.ones(len(y))]).astype(float), np.asarray(y, dtype=float)
    columns /= np.abs(columns).max(axis=0).clip(1e-300)
    weights, _, rank, _ = np.linalg.lstsq(columns, y, rcond=None)
    if rank < 3 or np.ptp(y) == 0:
        return None
    return explained(y, columns @ weights)
