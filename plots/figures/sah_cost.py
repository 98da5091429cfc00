"""SAH cost of what was built: one panel a scene."""

from figures import costs
from figures.bars import bar_panels
from figures.sah_vs_time import NO_TREE
from tables import SAH_STEP

TITLE = "SAH cost"
NEEDS = "sah_cost (`metrics: [quality]`)"
CAPTION = ("Expected cost of a ray through the root's box. Lower is better. Structures that "
           "cannot be looked into, as embree, have none; brute_force, which has no tree and whose cost is many times that of all others, is left out where "
           "there are others." + costs.CAPTION + " " + SAH_STEP +
           " With a step for each child box instead, the cost stands in the report's table of structures.")


def draw(results):
    def value(cell):
        cost = cell.value("sah_cost")
        return None if cost is None else (cost, cost, cost)

    def shown(cell):
        return bool(value(cell)) and (cell["structure"] != NO_TREE or not trees)

    trees = {c["structure"] for c in results.structures if value(c)} - {NO_TREE}
    apart, said = costs.built_apart(results, shown)
    return bar_panels(apart, value, f"SAH cost{said}", lambda c: f"{value(c)[0]:.1f}", ("builder", "leaf", "isa"))
