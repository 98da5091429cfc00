"""Points of two costs, lower left better, a panel a scene, workload, instruction set and number of threads: what figures of trade-offs have in common.

Colours are structures, markers builders. Points worth a name have a number, and the names stand below the panel.
"""

from dataclasses import dataclass

from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.transforms import ScaledTranslation

from figures.names import bar_label, label
from results import STRUCTURE_AXES, Estimate, NoData, TooMuch, axis_sort_key, ordered, telling_axes
from style import (MORE_MARKERS, WRONG, builder_marker, colour, is_wrong, legends_right, log_axis, most_wrong, panel_grid, structure_legend, wrong_legend,
                   wrong_marker)

TRACED = (*STRUCTURE_AXES, "workload")
PLACE = ("scene", "workload", "isa", "threads")
NAMED_BY = ("builder", "leaf")
# Inches: of a panel at least; left of its axes; of a line of the names below it, and of a character there; from the axes' left edge to their numbers, markers
# and words.
WIDTH, HEIGHT, LEFT, LINE, CHARACTER = 3.3, 2.6, 0.75, 0.145, 0.062
NUMBER_AT, MARKER_AT, WORDS_AT = -0.47, -0.27, -0.18
FONT = 7.5
MOST_COLUMNS, MOST_NAMES = 4, 10


@dataclass(frozen=True)
class Point:
    cell: object
    x: Estimate
    y: Estimate  # ns a ray

    def scaled(self, factor):
        return Point(self.cell, Estimate(factor * self.x.median, factor * self.x.low, factor * self.x.high, self.x.samples), self.y)


def of_one_number_of_threads(cells):
    """Those cells that have the fewest threads, as the others show the same; and, where there are others, what an axis of time says of it behind the clock."""
    numbers = ordered((c["threads"] for c in cells), "threads")
    if len(numbers) < 2:
        return cells, ""
    return [c for c in cells if c["threads"] == numbers[0]], f", {label('threads', numbers[0])}; not shown: {', '.join(numbers[1:])}"


def fastest_points(cells, metric, x_of, told_apart_by=TRACED):
    """A point for each structure as built, traced in its fastest mode, of those cells of which `x_of` is known, on each scene, workload, instruction set and
    number of threads."""
    best = {}
    for cell in cells:
        rate, x = cell.estimate(metric), x_of(cell)
        if rate is None or rate.low <= 0 or x is None:
            continue
        key, time = tuple(cell[a] for a in told_apart_by), Estimate(1e9 / rate.median, 1e9 / rate.high, 1e9 / rate.low, rate.samples)
        if key not in best or time.median < best[key].y.median:
            best[key] = Point(cell, x, time)
    return list(best.values())


def pareto_front(points):
    """Those (x, y) that none other beats in one and equals in the other, by x."""
    front = []
    for x, y in sorted(points):
        if not front or y < front[-1][1]:
            front.append((x, y))
    return front


def step_front(axis, points):
    front = pareto_front(points)
    axis.step([x for x, _ in front], [y for _, y in front], where="post", color="#777777", linewidth=1, zorder=1)


def of_places(points):
    """{(scene, workload, isa, threads): points} of those places that have at least two; NoData where none has."""
    if not points:
        raise NoData("no traced cell has both figures")
    found = {}
    for point in points:
        found.setdefault(tuple(point.cell[a] for a in PLACE), []).append(point)
    found = {place: here for place, here in found.items() if len(here) > 1}
    if not found:
        raise NoData("nowhere are two structures as built to compare")
    return found


def draw_panels(places, x_label, y_label, named_of):
    """A panel for each of `places`, as of_places() gives them. `x_label(threads)` and `y_label(threads)` name the axes; `named_of(points)` gives (point, text)
    of those that get a number, by x, the text what is said of it."""
    points = [p for here in places.values() for p in here]
    varied = telling_axes([p.cell for p in points], ("scene", "structure", "isa", "threads"), NAMED_BY)
    columns = sorted({place[1:] for place in places}, key=lambda rest: [axis_sort_key(a)(v) for a, v in zip(PLACE[1:], rest)])
    several = len({threads for *_, threads in places}) > 1
    titles = {(workload, isa, threads): ", ".join([workload, isa] + ([label("threads", threads)] if several else [])) for workload, isa, threads in columns}
    named = {place: named_of(here) for place, here in places.items()}
    lines = max(map(len, named.values()))
    beside = min(MOST_COLUMNS, len({rest[1:] for rest in columns}))  # panels of a workload, which stay in a row
    width = max(WIDTH, LEFT + WORDS_AT + CHARACTER * max(len(bar_label(p.cell, varied)) + 2 + len(text) for here in named.values() for p, text in here))
    markers = builder_markers([p.cell["builder"] for p in points])
    figure, axes = panel_grid([(place[0], place[1:]) for place in places], titles, width, HEIGHT + LINE * (lines + 1.5), beside * (MOST_COLUMNS // beside))
    figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)
    drawn = []
    for (scene, rest), axis in axes.items():
        here = places[scene, *rest]
        for point in here:
            mark(axis, point.x.median, point.y.median, point.cell, markers)
        step_front(axis, [(p.x.median, p.y.median) for p in here])
        log_axis(axis, "x", [p.x.median for p in here])
        log_axis(axis, "y", [p.y.median for p in here])
        axis.set_xlabel(x_label(rest[2]))
        axis.set_ylabel(y_label(rest[2]))
        axis.xaxis.label.set_fontsize(9)
        axis.yaxis.label.set_fontsize(9)
        axis.tick_params(labelsize=8.5)
        names_below(axis, named[scene, *rest], varied, markers)
        drawn.append((axis, named[scene, *rest]))
    cells = [p.cell for p in points]
    answers = wrong_legend(cells, wrong_marker(f"edge: some wrong, up to\n{most_wrong(cells)} per million"))
    legends_right(figure, [("structure", structure_legend({c["structure"] for c in cells})), ("builder", builder_legend(markers)), *answers])
    figure.draw_without_rendering()  # numbers have to know where points are
    for axis, here in drawn:
        numbers(axis, here)
    return figure


def builder_markers(builders):
    """{builder: marker}: the same for a builder and its reinserted kin, and for Embree's of our trees and of its own; variants of parameters
    have their own, or, where they are more than there are, that of their builder. TooMuch where builders are."""
    kinds = list(dict.fromkeys(kind(b) for b in ordered(builders, "builder")))
    families = list(dict.fromkeys(map(family, kinds)))
    own = {f: builder_marker(f) for f in families}
    if len(set(own.values())) < len(own):
        raise TooMuch(f"{len(own)} builders are too many to tell apart; choose some with --filter")
    spare = [m for m in MORE_MARKERS if m not in own.values()]
    found = {next(k for k in kinds if family(k) == f): own[f] for f in families}
    variants = [k for k in kinds if k not in found]
    found.update(zip(variants, spare) if len(variants) <= len(spare) else {k: own[family(k)] for k in variants})
    return {b: found[kind(b)] for b in ordered(builders, "builder")}


def family(name):
    return name.partition(":")[0]


def kind(builder):
    """The builder's name without what its marker does not tell."""
    return builder.replace("_reinsertion", "", 1).removeprefix("embree_")


def reinserted(builder):
    return family(builder).endswith("_reinsertion")


def mark(axis, x, y, cell, markers, size=6.0, **more):
    """A point; a white dot in its middle where nodes were reinserted."""
    wrong = is_wrong(cell)
    axis.plot(x, y, linestyle="", marker=markers[cell["builder"]], color=colour(cell["structure"]), markersize=size,
              markeredgecolor=WRONG if wrong else "white", markeredgewidth=0.8 if wrong else 0.5, **more)
    if reinserted(cell["builder"]):
        axis.plot(x, y, "o", color="white", markersize=0.32 * size, markeredgewidth=0, **more)


def builder_legend(markers):
    """Handles, one a marker, named by what shares it: the variants of a builder, a builder and its kin, or the builder where only a reinserted one or Embree's
    of our trees has it; and what the white dot is."""
    names = {}
    for builder, marker in markers.items():
        names.setdefault(marker, {}).setdefault(kind(builder), builder)

    def said(kinds):
        (name, builder), *others = kinds.items()
        return f"{family(name)}: {len(kinds)} variants" if others else name if name in markers else builder

    handles = [Line2D([], [], linestyle="", marker=marker, color="#444444", markeredgewidth=0, markersize=6, label=said(kinds))
               for marker, kinds in names.items()]
    if any(map(reinserted, markers)):
        handles.append(Line2D([], [], linestyle="", marker="o", markersize=4.5, color="white", markeredgecolor="#444444", markeredgewidth=2,
                              label="…_reinsertion: white dot"))
    return handles


def names_below(axis, named, varied, markers):
    """The names of the numbered points below the axis, each with its marker and what is said of it."""
    scale = axis.figure.dpi_scale_trans
    for line, (point, text) in enumerate(named):
        down = -0.56 - LINE * line
        for x, words, weight in ((NUMBER_AT, str(line + 1), "bold"), (WORDS_AT, bar_label(point.cell, varied), "normal")):
            axis.annotate(words, (0, 0), (72 * x, 72 * down), xycoords="axes fraction", textcoords="offset points", va="center", fontsize=FONT,
                          fontweight=weight)
        axis.annotate(text, (1, 0), (0, 72 * down), xycoords="axes fraction", textcoords="offset points", ha="right", va="center", fontsize=FONT)
        mark(axis, 0, 0, point.cell, markers, 5.0, transform=axis.transAxes + ScaledTranslation(MARKER_AT, down, scale), clip_on=False, scalex=False,
             scaley=False)


def numbers(axis, named):
    """The numbers beside their points, each at the first place, from the lower left on, where it is on no other numbered point and no other number."""
    at = [axis.transData.transform((p.x.median, p.y.median)) for p, _ in named]
    dot = axis.figure.dpi / 72
    taken = [(x, y, 3.5 * dot) for x, y in at]
    for i, (x, y) in enumerate(at):
        places = [(dx, dy) for far in (8.5, 14, 20) for dx, dy in ((-0.7 * far, -0.7 * far), (0, -far), (-far, 0), (0.7 * far, -0.7 * far),
                                                                   (-0.7 * far, 0.7 * far), (0, far), (far, 0))]
        free = (p for p in places if x + p[0] * dot > axis.bbox.x0 + 4.5 * dot and y + p[1] * dot > axis.bbox.y0 + 5 * dot
                and all((x + p[0] * dot - a) ** 2 + (y + p[1] * dot - b) ** 2 > (r + 3.6 * dot) ** 2 for a, b, r in taken))
        dx, dy = next(free, places[0])
        taken.append((x + dx * dot, y + dy * dot, 4.0 * dot))
        text = axis.annotate(str(i + 1), (named[i][0].x.median, named[i][0].y.median), (dx, dy), textcoords="offset points", ha="center", va="center",
                             fontsize=8, fontweight="bold", zorder=6, annotation_clip=False)
        text.set_path_effects([withStroke(linewidth=1.8, foreground="white")])
        text.set_in_layout(False)
