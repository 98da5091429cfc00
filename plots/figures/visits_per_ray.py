"""What a ray meets on its way: nodes, leaves, boxes and triangles, a row a structure, builder and way of traversal, a column a scene and workload."""

from matplotlib.lines import Line2D

from figures.names import label
from figures.rows import FONT, groups_of, places_of, row_panels, rows_are_due
from results import Cell, NoData, ordered, telling_axes
from style import legends_right, letters, log_axis, panel_title, short_names

TITLE = "Visits and tests of a ray"
NEEDS = "nodes_per_ray, leaves_per_ray, boxes_per_ray and triangles_per_ray (`metrics: [trace]`)"
CAPTION = ("Nodes and leaves that a ray visits, and tests of a ray against child boxes and triangles, counted in a pass of its own, untimed; the numbers "
           "beside the points are the same, in the legend's order. Fewer are better, but not each costs the same: a node's boxes, or a block's triangles, are "
           "tested together, and a visit by rays together (packets, streams) is one of each of them. A grid's nodes are the cells that the ray crosses. Of "
           "several workloads the figure shows one of coherent rays and one of incoherent ones (the latter alone where there are many rows), of several "
           "instruction sets the widest. Rows that differ in leaf, tests or threads alone and show the same numbers are one. Structures that cannot be looked "
           "into, as embree, have none.")
TESTS = ("leaf", "intersector", "box", "threads")
AXES = ("builder", "traversal", *TESTS)
COUNTS = (("nodes_per_ray", "nodes visited", "o", "#332288"), ("leaves_per_ray", "leaves visited", "D", "#117733"),
          ("boxes_per_ray", "boxes tested", "|", "#332288"), ("triangles_per_ray", "triangles tested", "x", "#CC3311"))
COHERENT, INCOHERENT = ("primary", "shadow"), ("diffuse", "ambient_occlusion", "reflection")
WIDTH, COLUMN = 1.3, 0.3  # inches: of a panel, at least; of the numbers of one count beside it


def draw(results):
    cells = [c for c in results.traces if counts(c)]
    if not cells:
        raise NoData("no cell has counted its visits")
    isa = ordered((c["isa"] for c in cells), "isa")[-1]
    workloads = chosen(ordered((c["workload"] for c in cells), "workload"))
    cells = [c for c in cells if c["isa"] == isa and c["workload"] in workloads]
    room = WIDTH + COLUMN * len(COUNTS)
    names = short_names(ordered((c["scene"] for c in cells), "scene"), max(24, letters(room) - 4))
    titles = {panel_of(s, w): panel_title(name, w, room) for s, name in names.items() for w in workloads}
    cells = without_doubles([Cell({**c.axes, "scene": panel_of(c["scene"], c["workload"])}, c.rows) for c in cells])
    if rows_are_due(cells):
        cells = without_doubles([c for c in cells if c["workload"] == workloads[-1]])
    varied = telling_axes(cells, ("scene", "structure"), AXES)
    groups = groups_of(cells, varied, shown)
    places = places_of(groups)
    used = {c["scene"] for c in cells}
    figure, axes = row_panels(groups, [p for p in titles if p in used], [WIDTH], COLUMN * len(COUNTS) + 0.1, titles, len({c["workload"] for c in cells}))
    for panel, (axis,) in axes.items():
        strip(axis, [(place, counts(row.cells[panel])) for place, row in places if panel in row.cells])
    handles = [Line2D([], [], linestyle="", marker=marker, color=shade, markersize=5, label=label) for _, label, marker, shade in COUNTS]
    legends_right(figure, [(f"a ray, {isa}", handles)])
    return figure


def panel_of(scene, workload):
    return f"{scene}, {workload}"


def counts(cell):
    """The cell's COUNTS; None where it has not all."""
    found = tuple(cell.value(name) for name, *_ in COUNTS)
    return None if None in found else found


def chosen(workloads):
    """At most one of coherent rays and one of incoherent ones, whatever their variant; where there is neither, the first."""
    found = [next((w for base in kind for w in workloads if w.partition(":")[0] == base), None) for kind in (COHERENT, INCOHERENT)]
    return [w for w in found if w] or workloads[:1]


def without_doubles(cells):
    """Cells that differ in leaf, tests or threads alone and show the same numbers in every panel are one, which is called by
    what they differ in only where others differ in it, too."""
    variants = {}
    for cell in cells:
        same = tuple(cell[a] for a in ("structure", "builder", "traversal"))
        variants.setdefault(same, {}).setdefault(tuple(cell[a] for a in TESTS), []).append(cell)
    found = []
    for own in variants.values():
        alike = {}
        for tests, here in own.items():
            alike.setdefault(frozenset((c["scene"], shown(c)) for c in here), []).append(tests)
        for these in alike.values():
            blank = {a: several({tests[i] for tests in these}, {tests[i] for tests in own}, a) for i, a in enumerate(TESTS)
                     if len({tests[i] for tests in these}) > 1}
            found += [Cell({**c.axes, **blank}, c.rows) for c in own[these[0]]]
    return found


def several(keys, of, axis):
    """What a row of several keys is called by them: nothing where there are no others."""
    first = ordered(keys, axis)
    return "" if len(keys) == len(of) else ", ".join(label(axis, key) for key in first[:2]) + (" …" if len(first) > 2 else "")


def shown(cell):
    return tuple(map(short_number, counts(cell)))


def strip(axis, rows):
    for i, (_, _, marker, shade) in enumerate(COUNTS):
        found = [(place, values[i]) for place, values in rows if values[i] > 0]
        if not found:
            continue  # an empty line that is not clipped would be given room at the figure's corner
        axis.plot([v for _, v in found], [place for place, _ in found], marker, color=shade, markersize=3.6, markeredgewidth=0.9 if marker in "|x" else 0,
                  linestyle="", clip_on=False)
    log_axis(axis, "x", [v for _, values in rows for v in values if v > 0])
    axis.set_xlabel("visits and tests a ray", fontsize=FONT + 1)
    for place, values in rows:
        for i, (value, (*_, shade)) in enumerate(zip(values, COUNTS)):
            axis.annotate(short_number(value), (1, place), (72 * COLUMN * (i + 1), 0), xycoords=("axes fraction", "data"), textcoords="offset points",
                          ha="right", va="center", fontsize=FONT - 1, color=shade)


def short_number(value):
    return ("0" if value == 0 else f"{value:.2f}" if value < 1 else f"{value:.1f}" if value < 100 else f"{value:.0f}" if value < 9999.5
            else f"{value / 1e3:.0f}k")
