"""How a cell is traced, in a few words: those axes of builder to threads that tell cells of these results apart."""

from figures.names import label
from results import axis_sort_key, swept_axes


class Modes:
    """`label(cell)` is short and the same for cells that are traced alike; `labels` has all of them, in order."""

    def __init__(self, cells, without=()):
        """`without`: axes that the figure shows otherwise."""
        swept = swept_axes(cells)
        varied = [a for a in ("intersector", "box", "traversal", "threads") if len({c[a] for c in cells}) > 1]
        self.axes = [a for a in [a for a in ("builder", "leaf") if a in swept] + varied if a not in without]
        found = {}
        for cell in cells:
            found.setdefault(self.label(cell), [axis_sort_key(a)(cell[a]) for a in self.axes])
        self.labels = sorted(found, key=found.get)

    def label(self, cell):
        parts = [label(a, cell[a]) for a in self.axes if cell[a]]
        return ", ".join(parts) or "one mode"
