"""Leaks of placed scenes against what the placing changes: a panel a scene and workload, a line an intersector and box test."""

from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from matplotlib.transforms import ScaledTranslation

from results import HARD_PREFIX, NoData, ordered
from style import intersector_colour, intersector_legend, legends_right, log_with_zero, panels, plain, short

STEP, MOST_LIFT = 2.2, 14.0  # points
CAPTION = " Lines that lie on each other are drawn a little above each other: the lowest is at its place."
BOX_LINES = {"fast": (0, (2, 1.2)), "ize": "-."}  # others: drawn through


def draw_lines(results, key, value_of, label, why_none):
    """`key`: what of the placing is swept; `value_of(cell)`: where the cell stands on the x axis, or None."""
    points = {}  # (family, workload) -> {(intersector, box, whether embree) -> {x: leaks per million}}
    for cell in results.traces:
        family, placed = without(cell["scene"], key)
        x, leaks = value_of(cell), cell.per_million("cracks")
        if placed and cell["workload"].startswith(HARD_PREFIX) and x is not None and x >= 0 and leaks is not None:
            line = points.setdefault((family, cell["workload"]), {}).setdefault((cell["intersector"], cell["box"], cell["structure"] == "embree"), {})
            line[x] = max(line.get(x, 0.0), leaks)
    points = {panel: lines for panel, lines in points.items() if any(len(line) > 1 for line in lines.values())}
    if not points:
        raise NoData(why_none)
    families = list(dict.fromkeys(family for family, _ in points))
    workloads = ordered({workload for _, workload in points}, "workload")
    figure, axes = panels(len(families), len(workloads), 4.8, 3.4, sharey="row")
    intersectors, embree = set(), False
    for row, family in enumerate(families):
        largest = [leaks for (f, _), lines in points.items() if f == family for line in lines.values() for leaks in line.values()]
        for column, workload in enumerate(workloads):
            axis, lines = axes[row][column], points.get((family, workload), {})
            for ((intersector, box, is_embree), line), lift in zip(sorted(lines.items()), lifts([line for _, line in sorted(lines.items())])):
                intersectors.add(intersector)
                embree = embree or is_embree
                drawn, = axis.plot(*zip(*sorted(line.items())), color=intersector_colour(intersector), linewidth=2.4 if box == "fast" and not is_embree else 1.3,
                          alpha=0.55 if box == "fast" and not is_embree else 1.0, linestyle=BOX_LINES.get(box, "-"),
                          marker="D" if is_embree else "o", markersize=5 if is_embree else 3.5, markerfacecolor="white" if is_embree else None, clip_on=False)
                drawn.set_transform(axis.transData + ScaledTranslation(0, lift / 72, figure.dpi_scale_trans))  # after plot: limits are those of the data
            xs = sorted({x for line in lines.values() for x in line})
            if xs and xs[0] == 0:
                log_with_zero(axis, "x", xs)
            else:
                axis.set_xscale("log")
            axis.xaxis.set_minor_locator(NullLocator())
            if all(abs(round(v, 2) - 1) < 1e-9 or v % 10 == 0 for v in xs):
                axis.xaxis.set_major_locator(FixedLocator(xs))
            axis.xaxis.set_major_formatter(FuncFormatter(lambda v, _: plain(v)))
            log_with_zero(axis, "y", largest)
            axis.set_title(f"{short(family)}, {workload.replace('_', ' ')}")
            axis.set_xlabel(label(family, results))
        axes[row][0].set_ylabel("leaks per million rays")
    boxes = [Line2D([], [], color="#333333", linestyle=BOX_LINES["fast"], linewidth=2.4, alpha=0.55, label="fast"), Line2D([], [], color="#333333", linewidth=1.3, label="padded")]
    who = [Line2D([], [], color="#333333", linestyle="", marker="D", markerfacecolor="white", markersize=5, label="of embree")] if embree else []
    legends_right(figure, [("intersector", intersector_legend(sorted(intersectors))), ("boxes", boxes + who)])
    return figure


def lifts(lines):
    """Points by which each line is drawn above its place, so that all can be seen of those that lie on each other over some stretch: 0 for most."""
    stretches = [set(zip(sorted(line.items()), sorted(line.items())[1:])) for line in lines]
    steps = []
    for i, stretch in enumerate(stretches):
        taken = {steps[k] for k in range(i) if stretch & stretches[k]}
        steps.append(next(step for step in range(len(lines)) if step not in taken))
    return [step * min(STEP, MOST_LIFT / max(1, *steps)) for step in steps]


def without(scene, key):
    """The scene's name without `key=value` of its placing, and whether it had that."""
    parts = scene.split(":")
    kept = [p for p in parts if not p.startswith(f"{key}=")]
    return ":".join(kept), len(kept) < len(parts)
