"""Horizontal bars, one a built structure, one panel a scene: what sah_cost and build_time have in common."""

from figures import squares
from figures.names import bar_label
from results import Cell, NoData, axis_sort_key, ordered, telling_axes
from style import (REST_COLOUR, colour, hatch, interval_legend, legends_right, letters, panels, part_colour, part_legend, round_ticks, short_names,
                   structure_legend)
from tables import digits


# Inches: of a panel at least; of its bars; of a character beside them; of a bar's thickness; above and below the bars.
LEAST_WIDTH, BAR_WIDTH, CHARACTER, BAR, AROUND = 5.6, 2.6, 0.068, 0.26, 0.9
LEAST_REST = 0.005  # of a bar's length, that is seen


def bar_panels(results, value_of, axis_label, note_of, label_axes, parts_of=None, estimate_of=None):
    """`value_of(cell)` gives (median, low, high) or None; `note_of(cell)` the text at a bar's end; `parts_of(cell)`, where
    given, (name, value) of what the bar consists of: it is then stacked, and what the parts leave is drawn as the rest; `estimate_of(cell)`, where
    given, the estimate that `value_of` is of, which has an interval. Lower is better.

    `label_axes` are the axes that may tell bars of a scene apart; those that the ones before settle are not written.
    """
    cells, varied = distinct(results, lambda c: value_of(c) and (value_of(c), note_of(c)), label_axes)
    scenes = ordered((c["scene"] for c in cells), "scene")
    names = short_names(scenes)
    bars = {scene: scene_bars([c for c in cells if c["scene"] == scene], varied) for scene in scenes}
    if squares.are_due(bars.values(), varied):
        every = [c for c in results.structures if value_of(c)]
        varied = telling_axes(every, ("scene", "structure"), label_axes)
        return squares.square_panels([(names[scene], [c for c in every if c["scene"] == scene]) for scene in scenes], varied, value_of, digits, axis_label,
                                     higher_is_better=False)[0]

    texts = max(len(bar_label(c, varied)) + len(note_of(c)) for c in cells)
    width = max(LEAST_WIDTH, BAR_WIDTH + CHARACTER * texts)
    names = short_names(scenes, letters(0.6 * width))
    figure, axes = bar_axes(bars, width)
    for scene, axis in axes.items():
        draw_panel(axis, bars[scene], value_of, note_of, varied, parts_of)
        axis.set_title(names[scene])
        axis.set_xlabel(axis_label)
    legends = parts_legend("part", [(parts_of(cell), value_of(cell)[0], cell) for cell in cells]) if parts_of else []
    legends_right(figure, legends + (interval_legend(map(estimate_of, cells)) if estimate_of else []))
    return figure


def bar_axes(bars, width):
    """The figure and {place: axis}, two beside each other, for the bars of each of `bars`, {place: cells}: a row as tall as the most bars in it, and
    a bar as thick in each panel."""
    places, columns = list(bars), min(2, len(bars))
    most = [max(len(bars[place]) for place in places[i:i + columns]) for i in range(0, len(places), columns)]
    figure, axes = panels(len(most), columns, width, AROUND + BAR * sum(most) / len(most), gridspec_kw={"height_ratios": [n + 0.2 for n in most]})
    figure.get_layout_engine().set(w_pad=0.15)
    for index, axis in enumerate(axes.flat):
        axis.set_visible(index < len(places))
        axis.set_ylim(most[index // columns] - 0.4, -0.6)
    return figure, dict(zip(places, axes.flat))


def parts_legend(title, bars):
    """Legends of bars, (parts, length, cell): of the parts, and of the structures whose bars have none."""
    names = in_order([name for name, value in parts if value > 0] for parts, *_ in bars)
    rest = any(parts and sum(value for _, value in parts) < (1 - LEAST_REST) * length for parts, length, _ in bars)
    whole = {cell["structure"] for parts, _, cell in bars if not parts}
    return ([(title, part_legend(names, rest))] + ([(f"no {title}s", structure_legend(whole))] if whole else [])) if names else []


def distinct(results, shown_of, label_axes):
    """The built structures of which there is something to show, those that show the same as one, and those of `label_axes` that tell them apart."""
    cells = without_doubles([c for c in results.structures if shown_of(c)], shown_of)
    if not cells:
        raise NoData("no structure has that")
    return cells, telling_axes(cells, ("scene", "structure"), label_axes)


def without_doubles(cells, shown_of):
    """A SAH cost that is the same for several ISAs, thread counts and leaf layouts is one bar, called by all of them: "all ISAs" where none of them differs.
    Threads go unsaid where several have the same."""
    seen, kin = {}, {}
    for cell in cells:
        built = tuple(cell[a] for a in ("scene", "structure", "builder"))
        seen.setdefault((built, shown_of(cell)), []).append(cell)
        kin.setdefault(built, []).append(cell)
    return [shared(alike, kin[built]) for (built, _), alike in seen.items()]


ALL = {"isa": "all ISAs", "leaf": "all leaves"}


def shared(alike, kin):
    """The cell that stands for those `alike`, among all of its structure and builder."""
    axes = {}
    for axis, every in ALL.items():
        own = ordered((c[axis] for c in alike), axis)
        if len(own) > 1:
            axes[axis] = every if len(own) == len({c[axis] for c in kin}) else ", ".join(own[:2]) + (" …" if len(own) > 2 else "")
    if len({c["threads"] for c in alike}) > 1:
        axes["threads"] = ""
    return Cell({**alike[0].axes, **axes}, alike[0].rows) if axes else alike[0]


def in_order(sequences):
    """Every name of `sequences` once, each before those that follow it in the sequence that first has it."""
    found = []
    for names in sequences:
        place = len(found)
        for name in reversed(list(names)):
            if name in found:
                place = found.index(name)
            else:
                found.insert(place, name)
    return found


def scene_bars(cells, varied):
    order = {s: i for i, s in enumerate(ordered((c["structure"] for c in cells), "structure"))}
    return sorted(cells, key=lambda c: (order[c["structure"]], [axis_sort_key(a)(c[a]) for a in varied]))


def draw_panel(axis, cells, value_of, note_of, varied, parts_of=None, alpha=1.0):
    """`alpha`: of the bars, paler where markers are to be seen on them."""
    for place, cell in enumerate(cells):
        median, low, high = value_of(cell)
        parts = parts_of(cell) if parts_of else []
        axis.barh(place, median, 0.74, **look(cell, parts), alpha=alpha, edgecolor="white", linewidth=0.5,
                  xerr=None if low == high else [[median - low], [high - median]],
                  error_kw={"elinewidth": 0.9, "ecolor": "#222222", "zorder": 3})
        left = 0.0
        for name, value in parts:
            axis.barh(place, value, 0.74, left=left, color=part_colour(name), edgecolor="white", linewidth=0.5)
            left += value
        axis.annotate(note_of(cell), (high, place), (5, 0), textcoords="offset points", va="center", fontsize=8.5)
    axis.set_yticks(range(len(cells)), [bar_label(c, varied) for c in cells])
    axis.xaxis.set_major_locator(round_ticks(6))
    axis.set_xlim(0, 1.02 * max(value_of(c)[2] for c in cells) or 1.0)
    axis.grid(axis="y", visible=False)


def look(cell, parts):
    """Colour and hatch of a bar: its structure's, or, beneath its parts, the grey of what none of them covers."""
    return {"color": REST_COLOUR} if parts else {"color": colour(cell["structure"]), "hatch": hatch(cell["structure"])}
