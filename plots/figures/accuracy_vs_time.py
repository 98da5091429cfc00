"""What accuracy costs in time, the Pareto front drawn. Accuracy is that of hard rays where the run has them: panels of wrong
answers and of the error of t, for each scene and instruction set. Otherwise that of each workload's own rays, a panel a scene, workload and
instruction set. A panel that would show no point is left out."""

from textwrap import fill

from figures.trade_offs import of_one_number_of_threads, step_front
from results import HARD_PREFIX, NoData, ordered
from style import intersector_colour, intersector_legend, legends_right, log_axis, log_with_zero, marker_legend, marker_map, panel_grid

TITLE = "Accuracy against time"
NEEDS = "wrong_answers and rays_per_second (`metrics: [trace, accuracy]`)"
CAPTION = ("A point is a cell; lower left is better. Wrong answers are missed hits, false hits and wrong surfaces against exact arithmetic; the error of t is "
           "that of right answers. Where the run has the workload `hard`, accuracy is that of its rays, which are aimed at what goes wrong, and time that of "
           "ordinary rays of the same cell. Where no cell of ordinary rays has a wrong answer, the figure says so and shows the error of t, which rays of any "
           "hit (shadow rays) have none of: there are no panels of them. The grey steps join the cells that no other beats in both. Zero stands on the lowest "
           "line, where there is one. Cells that differ in builder or way of traversal alone have the same sign; of several numbers of threads the figure "
           "shows the fewest.")

MEASURES = (("wrong_answers", "wrong answers per million"), ("t_error_ulp_p99", "error of t, 99th percentile, ulp"))
PANEL, LEAST_WIDTH = (4.2, 3.1), 2.8  # inches; of a panel where there would be more of them than a figure can hold
BOXES = (("fast", "fast boxes: hollow", "none", "full"), ("padded", "padded boxes: filled", "#333333", "full"), ("ize", "Ize's boxes: half", "#333333", "left"))
COMBINATION = ("scene", "structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "threads")


def draw(results):
    metric, _ = results.throughput()
    traces, threads = of_one_number_of_threads(results.traces)
    timed = f"({results.clock()}{threads})"
    paired = hard_points(traces, metric)
    if paired:
        return draw_hard(paired, timed)
    points = [(c, 1e9 / c.value(metric)) for c in traces if c.value(metric) and c.per_million("wrong_answers") is not None]
    if not points:
        raise NoData("no cell has both a throughput and checked answers")
    return draw_workloads(points, timed)


def hard_points(traces, metric):
    """(ordinary cell, ns a ray of it, the same combination's cell of `hard` rays)."""
    hard = {tuple(c[a] for a in COMBINATION): c for c in traces if c["workload"] == HARD_PREFIX}
    ordinary = [c for c in traces if not c["workload"].startswith(HARD_PREFIX) and c.value(metric)]
    names = ordered({c["workload"] for c in ordinary if tuple(c[a] for a in COMBINATION) in hard}, "workload")
    wanted = "diffuse" if "diffuse" in names else next(iter(names), None)
    found = [(c, 1e9 / c.value(metric), hard.get(tuple(c[a] for a in COMBINATION))) for c in ordinary if c["workload"] == wanted]
    return [p for p in found if p[2] is not None and p[2].per_million("wrong_answers") is not None]


def draw_hard(points, timed):
    isas = ordered((c["isa"] for c, _, _ in points), "isa")
    markers = marker_map(ordered((c["structure"] for c, _, _ in points), "structure"), "structures")
    shown = {}  # (scene, (measure, isa)) -> [(cell, ns a ray, how wrong)]
    for cell, time, hard in points:
        for measure in MEASURES:
            if (value := value_of(hard, measure[0])) is not None:
                shown.setdefault((cell["scene"], (measure, cell["isa"])), []).append((cell, time, value))
    figure, axes = panel_grid(shown, {(measure, isa): isa for measure in MEASURES for isa in isas}, *PANEL, columns_of(isas), LEAST_WIDTH)
    for (scene, ((name, quantity), isa)), axis in axes.items():
        of_scene = [(t, value_of(h, name)) for c, t, h in points if c["scene"] == scene]
        panel(axis, shown[scene, ((name, quantity), isa)], [v for _, v in of_scene], [t for t, _ in of_scene], markers)
        axis.set_xlabel(f"time of {points[0][0]['workload']} rays, ns a ray\n{timed}")
        axis.set_ylabel(quantity + ("\nhard rays" if name == "wrong_answers" else "\nhard rays answered right"))
    add_legends(figure, [c for c, _, _ in points], markers)
    return figure


def columns_of(isas):
    """How many panels stand beside each other: those of all instruction sets, and of so many groups of them that they are four or so."""
    return len(isas) * max(1, 4 // len(isas))


def panel(axis, points, values, times, markers):
    """`points`: (cell, ns a ray, how wrong); `values` and `times`: what the axes must hold."""
    for cell, time, value in sorted(points, key=lambda p: p[0]["box"] == "padded"):  # filled ones above
        own = intersector_colour(cell["intersector"])
        axis.plot(time, value, linestyle="", marker=markers[cell["structure"]], markersize=6.5, color=own, markeredgewidth=1.3,
                  fillstyle="left" if cell["box"] == "ize" else "full", markerfacecoloralt="white",
                  markerfacecolor="white" if cell["box"] == "fast" else own, markeredgecolor=own, clip_on=False)
    step_front(axis, [(t, v) for _, t, v in points])
    log_with_zero(axis, "y", [v for v in values if v is not None])
    log_axis(axis, "x", times)


def add_legends(figure, cells, markers):
    boxes = []
    for box, words, face, fill_style in BOXES:
        if any(c["box"] == box for c in cells):
            boxes += marker_legend({words: "o"})
            boxes[-1].set(markerfacecolor=face, fillstyle=fill_style)
    intersectors = sorted({c["intersector"] for c in cells})
    legends_right(figure, [("intersector", intersector_legend(intersectors)), ("structure", marker_legend(markers)), ("", boxes)])


def value_of(cell, name):
    return cell.per_million(name) if name == "wrong_answers" else cell.value(name)


def draw_workloads(points, timed):
    """`points`: (cell, ns a ray); `timed`: by which clock, with how many threads. What is drawn is the first measure that is not 0 everywhere."""
    isas = ordered((c["isa"] for c, _ in points), "isa")
    places = {(w, i): f"{w}, {i}" for w in ordered((c["workload"] for c, _ in points), "workload") for i in isas}
    markers = marker_map(ordered((c["structure"] for c, _ in points), "structure"), "structures")
    name, quantity, said = measure_of([c for c, _ in points])
    shown = {}  # (scene, place) -> [(cell, ns a ray, how wrong)]
    for cell, time in points:
        if (value := value_of(cell, name)) is not None:
            shown.setdefault((cell["scene"], (cell["workload"], cell["isa"])), []).append((cell, time, value))
    figure, axes = panel_grid(shown, places, *PANEL, columns_of(isas), LEAST_WIDTH)
    values = [v for here in shown.values() for *_, v in here]
    for place, axis in axes.items():
        panel(axis, shown[place], values, [t for _, t, _ in shown[place]], markers)
        axis.set_xlabel(f"time, ns a ray\n{timed}")
        axis.set_ylabel(quantity)
    if said:
        figure.suptitle(fill(said, int(9 * figure.get_size_inches()[0])), fontsize=11)
    add_legends(figure, [c for c, _ in points], markers)
    return figure


def measure_of(cells):
    """(name, label, what must be said) of the first measure that tells the cells apart."""
    (wrong, wrong_label), *others = MEASURES
    if any(value_of(c, wrong) > 0 for c in cells):
        return wrong, wrong_label, ""
    said = f"No wrong answer in {len(cells)} checked cell{'s' if len(cells) > 1 else ''}"
    for name, label in others:
        if any((value_of(c, name) or 0) > 0 for c in cells):
            return name, label, said + "; upwards: the error of t"
    return wrong, wrong_label, said
