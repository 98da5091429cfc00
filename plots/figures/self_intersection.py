"""How secondary rays leave their surface: what each way loses, and what it costs. A row a scene; a column a fault, the last one time."""

from textwrap import fill

from matplotlib.lines import Line2D

from results import NoData, ordered
from style import intersector_colour, intersector_legend, legends_right, log_axis, log_with_zero, marker_map, panels, short_names

TITLE = "Leaving a surface"
NEEDS = "self_hits_per_million (`metrics: [trace]`, `workload: [diffuse]` or other secondary rays, `rays: {self_intersection: [...]}`)"
CAPTION = ("Secondary rays that meet the primitive that they start on again (any hit: anything, where nothing is), that meet another too early, and that pass "
           "through what they should meet, against the exact answer of the ray that starts at the hit point itself, its own primitive left out. A ray that "
           "meets its own surface ends there, and is quick. Zero stands on the left line; what no cell has is named in the legend instead.")
SIZE = 4.0  # points that a marker takes, its edge too
LEAST, BETWEEN = 0.3, 0.2  # inches: of a way at least; between the markers of one way and the next
WAYS = ("none", "epsilon", "integer_offset", "error_bound", "exclusion")
FAULTS = (("self_hits_per_million", "own surface met,\nper million"), ("near_hits_per_million", "neighbour met too early,\nper million"),
          ("leaks_per_million", "passed through,\nper million"))


def draw(results):
    metric, _ = results.throughput()
    cells = [c for c in results.traces if way_of(c) and c.value("self_hits_per_million") is not None and c.value(metric)]
    if len({way_of(c) for c in cells}) < 2:
        raise NoData("no workload is measured with several ways of leaving a surface")
    scenes, ways = ordered((c["scene"] for c in cells), "scene"), [w for w in WAYS if any(way_of(c) == w for c in cells)]
    workloads = ordered({base(c) for c in cells}, "workload")
    intersectors = sorted({c["intersector"] for c in cells})
    markers = marker_map(workloads, "workloads")
    counted = [f for f in FAULTS if any(c.value(f[0]) is not None for c in cells)]
    faults = [f for f in counted if any(c.value(f[0]) for c in cells)] or counted[:1]
    columns = faults + [(None, f"time, ns a ray\n({results.clock()})")]
    traced = {(c["intersector"], base(c)) for c in cells}
    slots = [slot for i in intersectors for w in workloads if (slot := (i, w)) in traced]
    way = max(LEAST, BETWEEN + SIZE / 72 * len(slots))  # inches, in which no marker lies on another
    figure, axes = panels(len(scenes), len(columns), 2.7, 0.5 + 0.5 / len(scenes) + way * len(ways), sharey=True, sharex="col")
    names = short_names(scenes, 60)
    for row, scene in enumerate(scenes):
        for column, (name, label) in enumerate(columns):
            axis = axes[row][column]
            for cell in (c for c in cells if c["scene"] == scene):
                value = cell.value(name) if name else 1e9 / cell.value(metric)
                if value is None:
                    continue
                own = intersector_colour(cell["intersector"])
                slot = slots.index((cell["intersector"], base(cell))) - (len(slots) - 1) / 2
                axis.plot(value, ways.index(way_of(cell)) + slot * SIZE / 72 / way, linestyle="", marker=markers[base(cell)], color=own,
                          markersize=SIZE - 1, markerfacecolor="white", markeredgewidth=0.9, clip_on=False)
            if row == len(scenes) - 1:
                axis.set_xlabel(label)
            if column == 0:
                axis.set_title(names[scene], loc="left")
            axis.set_yticks(range(len(ways)), ways)
            axis.set_ylim(len(ways) - 0.5, -0.5)
            axis.grid(axis="y", visible=False)
            for between in range(len(ways) - 1):
                axis.axhline(between + 0.5, color="#DDDDDD", linewidth=0.7, zorder=0)
    for column, (name, _) in enumerate(columns):
        if name:
            log_with_zero(axes[0][column], "x", [v for c in cells for v in [c.value(name)] if v is not None])
        else:
            log_axis(axes[0][column], "x", [1e9 / c.value(metric) for c in cells])
    if others := [s for s in ordered((c["scene"] for c in results.traces), "scene") if s not in scenes]:
        figure.supxlabel("not shown, as no secondary rays were measured: " + fill(", ".join(others), 90), fontsize=8.5, color="#555555")
    handles = [Line2D([], [], linestyle="", marker=m, color="#333333", markerfacecolor="white", markersize=5, label=w)
               for w, m in markers.items()]
    zeros = [Line2D([], [], linestyle="", label=label.partition(",")[0]) for f in counted if f not in faults for _, label in [f]]
    legends_right(figure, [("intersector", intersector_legend(intersectors)), ("workload", handles)] + ([("nowhere", zeros)] if zeros else []))
    return figure


def way_of(cell):
    return next((row["self_intersection"] for row in cell.rows if isinstance(row.get("self_intersection"), str)), None)


def base(cell):
    """The workload without the way."""
    return cell["workload"].split(":")[0]
