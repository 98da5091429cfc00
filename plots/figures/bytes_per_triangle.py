"""Memory of what was built, by part: one panel a scene."""

from figures.bars import bar_panels, distinct
from figures.rows import bar_rows, groups_of, rows_are_due
from results import ordered
from tables import digits

TITLE = "Bytes per triangle"
NEEDS = "bytes_per_triangle (`metrics: [build]` or `[trace]`)"
CAPTION = ("What tracing needs besides the mesh, a triangle of the mesh: nodes, leaves (references that are shared count as often as "
           "they are stored), and what is neither. Structures that cannot be looked into, as embree, have one part. Beside it, the "
           "most memory held while building, as a multiple of the result. Lower is better.")
AXES = ("builder", "leaf", "isa", "threads")
PARTS = (("nodes", "node_bytes"), ("leaves", "leaf_bytes"), ("other", "other_bytes"))


def draw(results):
    def value(cell):
        found = cell.value("bytes_per_triangle")
        return None if found is None else (found, found, found)

    def note(cell, word="peak "):
        peak, size = cell.value("peak_build_bytes"), cell.value("bytes")
        return digits(value(cell)[0]) + (f"  ({word}{peak / size:.2f} ×)" if peak and size else "")

    def parts(cell):
        triangles = cell.value("triangles")
        if not triangles or cell.value("node_bytes") is None:
            return []
        return [(name, (cell.value(key) or 0.0) / triangles) for name, key in PARTS]

    def shown(cell):
        return value(cell) and (value(cell), tuple(parts(cell)), note(cell))

    cells, varied = distinct(results, shown, AXES)
    if not rows_are_due(cells):
        return bar_panels(results, value, "bytes a triangle", note, AXES, parts)
    groups = groups_of(cells, varied, shown)
    return bar_rows(groups, ordered((c["scene"] for c in cells), "scene"), value, parts, lambda c: note(c, ""),
                    "bytes a triangle\n(in brackets: peak ÷ result)")
