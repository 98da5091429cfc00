"""SAH cost of what was built: one panel a scene."""

from figures.bars import bar_panels
from tables import SAH_STEP

TITLE = "SAH cost"
CAPTION = ("Expected cost of a ray through the root's box, in units of a leaf block test. Lower is better. Structures that "
           "cannot be looked into, as embree, have none. " + SAH_STEP + " With a step for each child box instead, the cost stands in the "
           "report's table of structures.")


def draw(results):
    def value(cell):
        cost = cell.value("sah_cost")
        return None if cost is None else (cost, cost, cost)

    return bar_panels(results, value, "SAH cost", lambda c: f"{value(c)[0]:.1f}", ("builder", "leaf", "isa"))
