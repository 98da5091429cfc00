"""Where the leaks are: a picture of a closed mesh, its edges and vertices dotted by the rays aimed at them, leaks marked."""

import json

from matplotlib.lines import Line2D

from results import CAMERA_EDGES, NoData, axis_sort_key, ordered
from style import box_colour, boxes_in_order, legends_right, panels, short_names

TITLE = "Where the leaks are"
NEEDS = "leak_points (`metrics: [trace, accuracy]`, `workload: [camera_edges]`)"
CAPTION = ("Rays from the camera at points of edges and at vertices (workload camera_edges): grey where they are aimed, as far as the camera sees it, in "
           "colour where a ray passes through the surface unnoticed. What leaks with padded boxes too, the triangle test loses; what leaks with fast boxes "
           "alone, the boxes lose. The first two scenes are shown. A panel shows at most 4000 leaks a box test; the numbers count all, per million rays.")
LARGEST, SMALLEST = 5.0, 2.2  # points: a leak of the box test that is drawn first, and last, above the others
MOST_SCENES = 2


def draw(results):
    cells = [c for c in results.traces if c["workload"] == CAMERA_EDGES and leak_points(c) is not None]
    scenes = [s for s in ordered((c["scene"] for c in cells), "scene") if seen_points(results.folder, s)][:MOST_SCENES]
    if not scenes:
        raise NoData("no cell of the workload camera_edges tells where its leaks are")
    found = {scene: by_test([c for c in cells if c["scene"] == scene]) for scene in scenes}
    boxes = sizes([c["box"] for c in cells if c["scene"] in scenes])
    columns = min(4, max(len(f) for f in found.values()))
    rows = [(scene, keys[i:i + columns]) for scene, f in found.items() for keys in [list(f)] for i in range(0, len(keys), columns)]
    figure, axes = panels(len(rows), columns, 2.9, 3.05)
    for axis in axes.flat:
        axis.set_axis_off()
    names = short_names(scenes)
    for row, (scene, keys) in zip(axes, rows):
        seen = seen_points(results.folder, scene)
        for axis, key in zip(row, keys):
            panel(axis, seen, names[scene] if len(scenes) > 1 else "", found[scene][key], boxes)
    if len(scenes) == 1:
        figure.suptitle(names[scenes[0]])
    legends_right(figure, [("leaks per million\nrays, with", [Line2D([], [], linestyle="", marker="o", markeredgewidth=0, markersize=size + 1.5,
                                                                     color=box_colour(box), label=f"{box} boxes")
                                           for box, size in boxes.items()])])
    return figure


def sizes(boxes):
    """{box: size of a leak}: smaller for what is drawn later, so that leaks at one place are all seen."""
    names = boxes_in_order(boxes)
    step = (LARGEST - SMALLEST) / max(1, len(names) - 1)
    return {box: LARGEST - step * i for i, box in enumerate(names)}


def by_test(cells):
    """(structure, intersector) -> box -> cell. Of several structures of ours, ISAs or ways of traversal the first stands for all; embree's apart."""
    found = {}
    for cell in sorted(cells, key=lambda c: (c["structure"] == "embree", axis_sort_key("structure")(c["structure"]), axis_sort_key("isa")(c["isa"]))):
        key = ("embree" if cell["structure"] == "embree" else "", cell["intersector"])
        found.setdefault(key, {}).setdefault(cell["box"], cell)
    return dict(sorted(found.items()))


def panel(axis, seen, name, cells, boxes):
    """`name`: of the scene, where there are several; `cells`: {box: cell}; `boxes`: {box: size}, of all panels."""
    points = seen["points"]
    # Dots as pixels: thousands of them would make a drawing of megabytes.
    axis.plot([p[0] for p in points], [p[1] for p in points], ",", color="#AAAAAA", rasterized=True, zorder=1)
    counts = []
    for box, size in boxes.items():
        if box not in cells:
            continue
        leaks = leak_points(cells[box])
        counts.append(f"{box} {cells[box].per_million('cracks') or 0:,.0f}")
        axis.plot([p[0] for p in leaks], [p[1] for p in leaks], "o", color=box_colour(box), markersize=size, markeredgewidth=0, rasterized=True, zorder=2)
    xs, ys = [p[0] for p in points], [p[1] for p in points]
    axis.set_xlim(min(xs) - 6, max(xs) + 6)
    axis.set_ylim(max(ys) + 6, min(ys) - 6)
    axis.set_aspect("equal")
    traced = next(iter(cells.values()))
    axis.set_title("\n".join([*filter(None, [name]), f"{traced['structure']} {traced['intersector']}", ", ".join(counts)]), fontsize=9.5)


def leak_points(cell):
    return next((row["leak_points"] for row in cell.rows if isinstance(row.get("leak_points"), list)), None)


def seen_points(folder, scene):
    try:
        seen = json.loads((folder / f"{CAMERA_EDGES}-{scene}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return seen if isinstance(seen, dict) and seen.get("points") else None
