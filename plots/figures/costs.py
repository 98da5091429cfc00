"""What a step at a node and a test of a leaf block cost in SAH costs and end-point overlaps: structures as built with other costs are not compared."""

import re
from dataclasses import replace

from results import Cell

NAMES = ("traversal_cost", "intersection_cost")
ONE = (1.0, 1.0)
CAPTION = (" Costs are those of the structure's own `traversal_cost` (a step at a node) and `intersection_cost` (a leaf block's test), 1 unless "
           "something else is said: numbers of other costs are in other units, and are not to be compared.")


def costs_of(cell, results):
    """(of a step, of a block's test) of a structure as built: as its builder's name has them, which it does where several are measured,
    else the configuration's."""
    named = dict(part.split("=", 1) for part in cell["builder"].split(":")[1:] if "=" in part)
    return tuple(number(named.get(name) or alone(results.effective_yaml, name)) for name in NAMES)


def alone(yaml, name):
    """The only value of a parameter in an effective configuration; None where there are several, or none."""
    found = re.search(rf"^\s+{name}:\s*\[?([^\[\],\n]+)\]?\s*$", yaml, re.MULTILINE)
    return found and found[1]


def number(text):
    try:
        return float(text)
    except (TypeError, ValueError):
        return 1.0


def words(costs):
    return f"(step {costs[0]:g}, block {costs[1]:g})"


def split(cells, results):
    """[(cell, the one to draw)]: where there are several costs, scenes are apart by them, and called by them in a second line;
    and what has to be said of them at an axis."""
    every = {costs_of(c, results) for c in cells}
    if len(every) < 2:
        return [(c, c) for c in cells], "".join(" " + words(costs) for costs in every if costs != ONE)
    scenes = list(dict.fromkeys(c["scene"] for c in cells))
    order = sorted(cells, key=lambda c: (scenes.index(c["scene"]), costs_of(c, results)))
    return [(c, Cell({**c.axes, "scene": f"{c['scene']}\n{words(costs_of(c, results))}", "builder": without(c["builder"])}, c.rows)) for c in order], ""


def without(builder):
    """The builder's name without its costs."""
    return ":".join(part for part in builder.split(":") if part.partition("=")[0] not in NAMES)


def built_apart(results, has):
    """The results with those structures as built that `has` holds of, split() by their costs, and what has to be said at an axis."""
    cells, said = split([c for c in results.structures if has(c)], results)
    return replace(results, structures=[apart for _, apart in cells], _structure_index={}), said
