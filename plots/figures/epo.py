"""End-point overlap of what was built: one panel a scene."""

from figures import costs
from figures.bars import bar_panels
from tables import digits

TITLE = "End-point overlap (EPO)"
NEEDS = "epo (`metrics: [quality]`)"
CAPTION = ("Surface that lies in boxes of other subtrees, weighed by the cost of visiting them (Aila, Karras, Laine 2013): the work of "
           "rays that end on a surface, which SAH does not see. Beside it, the leaf-count variability (LCV): the standard "
           "deviation of the number of leaves that a random line meets. Lower is better." + costs.CAPTION)


def draw(results):
    def value(cell):
        overlap = cell.value("epo")
        return None if overlap is None else (overlap, overlap, overlap)

    def note(cell):
        spread = cell.value("lcv")
        return digits(value(cell)[0]) + ("" if spread is None else f"  (LCV {digits(spread)})")

    apart, said = costs.built_apart(results, value)
    return bar_panels(apart, value, f"EPO{said}", note, ("builder", "leaf", "isa"))
