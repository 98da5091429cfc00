"""What a step at a node and a test of a leaf block cost in SAH costs and end-point overlaps: structures as built with other costs are not compared."""

from dataclasses import replace

from results import Cell

NAMES = ("traversal_cost", "intersection_cost")
ONE = (1.0, 1.0)
CAPTION = (" Costs are those of the structure's own `traversal_cost` (a step at a node) and `intersection_cost` (a leaf block's test), 1 unless "
           "something else is said: numbers of other costs are in other units, and are not to be compared.")


def costs_of(cell):
    """(of a step, of a block's test) that a structure was built with; of one whose rows do not say it, 1 each."""
    told = next((row["parameters"] for row in cell.rows if isinstance(row.get("parameters"), dict)), {})
    return tuple(float(told.get(name, one)) for name, one in zip(NAMES, ONE))


def words(costs):
    return f"(step {costs[0]:g}, block {costs[1]:g})"


def split(cells):
    """[(cell, the one to draw)]: where there are several costs, scenes are apart by them, and called by them in a second line;
    and what has to be said of them at an axis."""
    every = {costs_of(c) for c in cells}
    if len(every) < 2:
        return [(c, c) for c in cells], "".join(" " + words(costs) for costs in every if costs != ONE)
    scenes = list(dict.fromkeys(c["scene"] for c in cells))
    order = sorted(cells, key=lambda c: (scenes.index(c["scene"]), costs_of(c)))
    return [(c, Cell({**c.axes, "scene": f"{c['scene']}\n{words(costs_of(c))}", "builder": without(c["builder"])}, c.rows)) for c in order], ""


def without(builder):
    """The builder's name without its costs."""
    return ":".join(part for part in builder.split(":") if part.partition("=")[0] not in NAMES)


def built_apart(results, has):
    """The results with those structures as built that `has` holds of, split() by their costs, and what has to be said at an axis."""
    cells, said = split([c for c in results.structures if has(c)])
    return replace(results, structures=[apart for _, apart in cells], _structure_index={}), said
