"""Where the leaves of built structures lie and how many triangles they hold: a row a structure and builder, two histograms a scene."""

import bisect
import math

from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from figures.bars import distinct
from figures.rows import FONT, groups_of, places_of, row_panels
from results import ordered
from style import legends_right

TITLE = "Leaves by depth and by triangles"
NEEDS = "depth_histogram and leaf_histogram (`metrics: [quality]`)"
CAPTION = ("Two histograms of a structure's leaves: how deep they lie (the root's depth is 0) and how many triangles they hold (references: one that lies in "
           "two leaves counts in both; 32 stands for more, too). A square's colour is the share of the leaves. The orange line is the mean, which is written "
           "beside the first; beside the second is the leaf fill, the share of the lanes of leaf blocks that hold a triangle. Structures whose trees are the "
           "same in all rows share them. Structures that cannot be looked into, as embree, have none.")
AXES = ("builder", "leaf", "isa")
BOUNDS = (0, 1, 5, 10, 20, 40)  # %, where a colour begins
SHADES = ("#E4EEF8", "#C6DCF1", "#9CC2E5", "#6299CF", "#2F6BA8", "#123E6B")
MEAN = "#EE7733"
MOST_TRIANGLES = 32  # the last place of a leaf histogram, which has all leaves with more too


def draw(results):
    def shown(cell):
        return histograms(cell) and (histograms(cell), cell.value("leaf_fill"))

    cells, varied = distinct(results, shown, AXES)
    groups = groups_of(cells, varied, shown)
    places = places_of(groups)
    scenes = ordered((c["scene"] for c in cells), "scene")
    most = max(len(histograms(c)[1]) for c in cells)
    figure, axes = row_panels(groups, scenes, [0.95, 0.95], 0.36)
    for scene, (by_depth, by_triangles) in axes.items():
        here = [(place, row.cells[scene]) for place, row in places if scene in row.cells]
        strips(by_depth, [(place, histograms(cell)[0]) for place, cell in here], max(len(histograms(cell)[0]) for _, cell in here))
        strips(by_triangles, [(place, histograms(cell)[1]) for place, cell in here], most)
        by_depth.set_xlabel("depth of the leaf\n(beside it: mean)", fontsize=FONT + 1)
        by_triangles.set_xlabel("triangles in the leaf\n(beside it: leaf fill)", fontsize=FONT + 1)
        means(by_depth, [(place, mean(histograms(cell)[0])) for place, cell in here])
        means(by_triangles, [(place, mean_triangles(cell)) for place, cell in here])
        for place, cell in here:
            beside(by_depth, place, f"{mean(histograms(cell)[0]):.1f}")
            fill = cell.value("leaf_fill")
            beside(by_triangles, place, "" if fill is None else f"{100 * fill:.0f} %")
    names = [f"below {BOUNDS[1]}"] + [f"{a} to {b}" for a, b in zip(BOUNDS[1:], BOUNDS[2:])] + [f"{BOUNDS[-1]} and more"]
    handles = [Patch(facecolor=shade, label=name) for shade, name in zip(SHADES, names)]
    handles.append(Line2D([], [], linestyle="", marker="|", markersize=8, markeredgewidth=1.6, color=MEAN, label="mean"))
    legends_right(figure, [("share of the leaves, %", handles)])
    return figure


def histograms(cell):
    """(leaves at each depth, leaves with so many triangles); None where the cell has not both."""
    found = tuple(tuple(cell.series(name)) for name in ("depth_histogram", "leaf_histogram"))
    return found if all(sum(h) > 0 for h in found) else None


def mean(histogram):
    return sum(i * n for i, n in enumerate(histogram)) / sum(histogram)


def mean_triangles(cell):
    """Of a leaf; None where the histogram's last place hides it and nothing else tells it."""
    references, leaves = cell.value("references"), cell.value("leaves")
    if references is not None and leaves:
        return references / leaves
    histogram = histograms(cell)[1]
    return None if len(histogram) > MOST_TRIANGLES else mean(histogram)


def strips(axis, rows, columns):
    """A strip of squares for each (place, histogram), `columns` of them; white where there is no leaf. A path a colour, which stays sharp at any size."""
    boxes = {}
    for place, histogram in rows:
        for shade, first, end in runs(histogram):
            left, right, top, foot = first - 0.5, end - 0.5, place - 0.42, place + 0.42
            boxes.setdefault(shade, []).extend([(left, top), (right, top), (right, foot), (left, foot), (left, top)])
    for shade, corners in sorted(boxes.items()):
        codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY] * (len(corners) // 5)
        axis.add_patch(PathPatch(Path(corners, codes), facecolor=SHADES[shade], edgecolor=SHADES[shade], linewidth=0.2))
    axis.xaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[1, 2, 4, 5, 8, 10]))
    axis.set_xlim(-0.5, columns - 0.5)
    axis.grid(visible=False)


def runs(histogram):
    """[(shade, first, end)]: the bins from `first` to before `end` have leaves, and shares of one colour."""
    found, total = [], sum(histogram)
    for i, count in enumerate(histogram):
        if count == 0:
            continue
        shade = bisect.bisect_right(BOUNDS, 100.0 * count / total) - 1
        if found and found[-1][0] == shade and found[-1][2] == i:
            found[-1] = (shade, found[-1][1], i + 1)
        else:
            found.append((shade, i, i + 1))
    return found


def means(axis, marks):
    """A line at the foot of the strip at each (place, mean) that lies within it."""
    found = [(place, at) for place, at in marks if at is not None and at <= axis.get_xlim()[1]]
    axis.plot([x for _, at in found for x in (at, at, math.nan)], [y for place, _ in found for y in (place + 0.05, place + 0.42, math.nan)], color=MEAN,
              linewidth=1.3, solid_capstyle="butt")


def beside(axis, place, text):
    axis.annotate(text, (1, place), (3, 0), xycoords=("axes fraction", "data"), textcoords="offset points", va="center", fontsize=FONT - 0.5)
