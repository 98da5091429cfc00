"""Leaks of placed scenes against what the placing changes: a panel a scene and workload, a line an intersector and box test."""

import math

from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from results import HARD_PREFIX, NoData, ordered
from style import Palette, boxes_in_order, intersector_colour, intersector_legend, legends_right, log_axis, log_with_zero, panels, plain, short_names

CAPTION = (" Lines in the shaded band are at zero, side by side so that all can be seen; above it the scale is logarithmic. Where lines lie on each "
           "other, those beneath are wider.")
box_line = Palette({"fast": (0, (2, 1.2)), "ize": "-.", "padded": "-"}, (":",))


def draw_lines(results, key, value_of, label, why_none):
    """`key`: what of the placing is swept; `value_of(cell)`: where the cell stands on the x axis, or None."""
    points = {}  # (family, workload) -> {(intersector, box, whether embree) -> {x: leaks per million}}
    for cell in results.traces:
        family, placed = without(cell["scene"], key)
        x, leaks = value_of(cell), cell.per_million("cracks")
        if placed and cell["workload"].startswith(HARD_PREFIX) and x is not None and x >= 0 and leaks is not None:
            line = points.setdefault((family, cell["workload"]), {}).setdefault((cell["intersector"], cell["box"], cell["structure"] == "embree"), {})
            line[x] = max(line.get(x, 0.0), leaks)
    points = {panel: lines for panel, lines in points.items() if any(len(line) > 1 for line in lines.values())}
    if not points:
        raise NoData(why_none)
    families = list(dict.fromkeys(family for family, _ in points))
    workloads = ordered({workload for _, workload in points}, "workload")
    figure, axes = panels(len(families), len(workloads), 4.8, 3.4, sharey="row")
    names = short_names(families, 34)
    intersectors, own_boxes, embree = set(), set(), False
    for row, family in enumerate(families):
        scale = LeakScale([leaks for (f, _), lines in points.items() if f == family for line in lines.values() for leaks in line.values()])
        for column, workload in enumerate(workloads):
            axis, lines = axes[row][column], points.get((family, workload), {})
            drawn = sorted(lines.items())
            zeros = slots([line for _, line in drawn])
            for ((intersector, box, is_embree), line), zero, beneath in zip(drawn, zeros, wider([line for _, line in drawn])):
                intersectors.add(intersector)
                embree = embree or is_embree
                if not is_embree:
                    own_boxes.add(box)
                fast = box == "fast" and not is_embree
                axis.plot(list(sorted(line)), [scale(line[x], zero) for x in sorted(line)], color=intersector_colour(intersector),
                          linewidth=(2.4 if fast else 1.3) + min(1.1 * beneath, 3.3), alpha=0.55 if fast else 1.0, linestyle=box_line(box),
                          marker="D" if is_embree else "o", markersize=5 if is_embree else 3.5, markerfacecolor="white" if is_embree else None, clip_on=False)
            xs = sorted({x for line in lines.values() for x in line})
            (log_with_zero if xs and xs[0] == 0 else log_axis)(axis, "x", xs)
            axis.xaxis.set_minor_locator(NullLocator())
            if all(abs(round(v, 2) - 1) < 1e-9 or v % 10 == 0 for v in xs):
                axis.xaxis.set_major_locator(FixedLocator(xs))
            axis.xaxis.set_major_formatter(FuncFormatter(lambda v, _: plain(v)))
            scale.apply(axis)
            axis.set_title(f"{names[family]}, {workload}")
            axis.set_xlabel(label(family, results))
        axes[row][0].set_ylabel("leaks per million rays")
    boxes = [Line2D([], [], color="#333333", linestyle=box_line(box), linewidth=2.4 if box == "fast" else 1.3, alpha=0.55 if box == "fast" else 1.0, label=box)
             for box in boxes_in_order(own_boxes)]
    who = [Line2D([], [], color="#333333", linestyle="", marker="D", markerfacecolor="white", markersize=5, label="of embree")] if embree else []
    legends_right(figure, [("intersector", intersector_legend(sorted(intersectors))), ("boxes", boxes + who)])
    return figure


class LeakScale:
    """A logarithmic y axis with a band for zero beneath it, apart from it by a break: places are log10 of what they stand for."""

    BAND, GAP = 0.32, 0.1  # heights, in those of the logarithmic part

    def __init__(self, values):
        positive = [v for v in values if v > 0]
        self.first = math.floor(math.log10(min(positive))) if positive else 0
        self.last = math.log10(2.5 * max(positive)) if positive else self.first
        height = max(1.0, self.last - self.first)
        self.has_zero = len(positive) < len(values) or not positive
        self.band = (self.first - (self.BAND + self.GAP) * height, self.first - self.GAP * height) if positive else (0.0, 1.0)

    def __call__(self, value, slot):
        """Of `value`; zero in its `slot`, 0 to 1 from the band's lower edge to its upper."""
        low, high = self.band
        return math.log10(value) if value > 0 else low + slot * (high - low)

    def apply(self, axis):
        low, high = self.band
        decades = range(self.first, math.floor(self.last) + 1)
        step = max(1, -(-len(decades) // 6))
        digits = (1, 2, 5) if len(decades) < 3 else (1,)  # two labels at least
        ticks = [tick for k in decades[::step] for d in digits if (tick := k + math.log10(d)) <= self.last] if self.last > self.first else []
        axis.yaxis.grid(False)
        for tick in ticks:
            axis.axhline(tick, color="#DDDDDD", linewidth=0.7, zorder=0)
        if self.has_zero:
            axis.axhspan(low, high, color="#EFEFE6", linewidth=0, zorder=0)
            if ticks:  # the break: the axis' line left out between band and logarithm
                lower, upper = (high + k * (self.first - high) for k in (0.3, 0.7))
                axis.plot([0, 0], [lower, upper], color="white", linewidth=3, clip_on=False, transform=axis.get_yaxis_transform(), zorder=5)
                for y in (lower, upper):
                    axis.plot([0], [y], marker=[(-1, -0.6), (1, 0.6)], markersize=9, color="black", linestyle="", clip_on=False,
                              transform=axis.get_yaxis_transform(), zorder=6)
        axis.set_ylim(low if self.has_zero else self.first, max(high, self.last))
        axis.yaxis.set_major_locator(FixedLocator(([(low + high) / 2] if self.has_zero else []) + ticks))
        axis.yaxis.set_minor_locator(NullLocator())
        axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: "0" if y <= high and self.has_zero else plain(float(f"{10.0 ** y:.0e}"))))


def slots(lines):
    """Where each line is drawn in the band of zero: apart from all others that are zero somewhere."""
    zero = [i for i, line in enumerate(lines) if 0 in line.values()]
    return [(zero.index(i) + 0.5) / len(zero) if i in zero else 0.5 for i in range(len(lines))]


def wider(lines):
    """How many of the lines drawn after each lie on it over some stretch above zero."""
    stretches = [{s for s in zip(sorted(line.items()), sorted(line.items())[1:]) if s[0][1] > 0 and s[1][1] > 0} for line in lines]
    return [sum(bool(stretch & after) for after in stretches[i + 1:]) for i, stretch in enumerate(stretches)]


def without(scene, key):
    """The scene's name without `key=value` of its placing, and whether it had that."""
    parts = scene.split(":")
    kept = [p for p in parts if not p.startswith(f"{key}=")]
    return ":".join(kept), len(kept) < len(parts)
