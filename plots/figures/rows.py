"""Rows of structures as built, a column a scene: what figures have in common that show more of each structure than one number."""

from collections import Counter
from dataclasses import dataclass

from figures import squares
from figures.bars import look, parts_legend
from figures.names import label
from results import axis_sort_key, ordered
from style import legends_right, letters, panels, part_colour, short_names

# Inches: of a row; above and below a panel's rows; of a character of a label; that scenes side by side may take.
ROW, AROUND, CHARACTER, WIDEST = 0.15, 0.75, 0.062, 13.5
ABOVE = 0.2  # of the ticks above a panel
TITLE_LINE = 0.18  # of each line of a title below the first
MOST_STRETCH = 2.2  # of panels, where few scenes leave them room
FONT = 7.5


def rows_are_due(cells):
    """Whether some scene has more of these cells than bars can be read of."""
    return max(Counter(c["scene"] for c in cells).values()) > squares.MOST_BARS


@dataclass(frozen=True)
class Row:
    label: str
    cells: dict  # {scene: cell}


def groups_of(cells, varied, shown_of):
    """[(heading, [Row])]: the rows of a structure, told apart by the axes `varied`. Structures of which `shown_of` is the same in every row are one group:
    layouts of one tree. Where nothing is varied there is a single group without a heading, of a row a structure."""
    rows = {}
    for structure in ordered((c["structure"] for c in cells), "structure"):
        own = [c for c in cells if c["structure"] == structure]
        keys = sorted({tuple(c[a] for a in varied) for c in own}, key=lambda key: [axis_sort_key(a)(v) for a, v in zip(varied, key)])
        rows[structure] = {key: {c["scene"]: c for c in own if tuple(c[a] for a in varied) == key} for key in keys}
    groups = {}
    for structure, own in rows.items():
        same = tuple((key, scene, shown_of(c)) for key, here in own.items() for scene, c in sorted(here.items()))
        groups.setdefault(same, []).append(structure)
    if not varied:
        return [("", [Row(", ".join(names), rows[names[0]][()]) for names in groups.values()])]
    return [(", ".join(names), [Row(" ".join(label(a, v) for a, v in zip(varied, key) if v) or "–", here) for key, here in rows[names[0]].items()])
            for names in groups.values()]


def lines_of(groups):
    """A heading, or a Row, for each place from the top; a group's heading takes the place above its rows."""
    return [line for heading, rows in groups for line in ([heading] if heading else []) + rows]


def places_of(groups):
    """[(place from the top, Row)]."""
    return [(place, line) for place, line in enumerate(lines_of(groups)) if isinstance(line, Row)]


def row_panels(groups, scenes, widths, room=0.0, titles=None, together=1):
    """For each scene as many panels side by side as there are `widths` (inches, at least; `room` besides, of each, for what stands to its right), all with
    the same rows; so many neighbours as are `together` stay in one band of them. Gives the figure and {scene: [axis, ...]}."""
    lines = lines_of(groups)
    labels = 0.3 + CHARACTER * max(len(row.label) for _, rows in groups for row in rows)
    stretch = min(MOST_STRETCH, max(1.0, (WIDEST / len(scenes) - len(widths) * room) / sum(widths)))
    one = stretch * sum(widths) + len(widths) * room
    bands = -(-len(scenes) // max(together, int(WIDEST / one) // together * together))
    beside = -(-len(scenes) // (bands * together)) * together
    columns = beside * len(widths)
    titles = titles or short_names(scenes, max(24, letters(0.8 * one)))
    more = max(titles[scene].count("\n") for scene in scenes)
    height = AROUND + ABOVE * axes_above(lines) + TITLE_LINE * more + ROW * len(lines)
    figure, axes = panels(bands, columns, (labels + one * beside) / columns, height, sharey=True, gridspec_kw={"width_ratios": widths * beside})
    found = {}
    for place in range(bands * beside):
        first = place % beside * len(widths)
        own = list(axes[place // beside][first:first + len(widths)])
        for axis in own:
            if place < len(scenes):
                prepare(axis, lines)
            else:
                axis.set_visible(False)
        if place < len(scenes):
            own[0].set_title(titles[scenes[place]], loc="left")
            found[scenes[place]] = own
    return figure, found


def axes_above(lines):
    """Whether the ticks of so many rows stand above them, too: where those below are far."""
    return len(lines) > squares.MOST_ROWS_BELOW


def prepare(axis, lines):
    """The labels of the rows, and the headings above their groups."""
    axis.set_yticks(range(len(lines)), [line.label if isinstance(line, Row) else line for line in lines], fontsize=FONT)
    for line, tick in zip(lines, axis.get_yticklabels()):
        tick.set_fontweight("normal" if isinstance(line, Row) else "bold")
    axis.set_ylim(len(lines) - 0.4, -0.6)
    above = axes_above(lines)
    axis.tick_params(axis="x", labelsize=FONT, top=above, labeltop=above)
    axis.tick_params(axis="y", length=0)
    axis.grid(axis="y", visible=False)


def bar_rows(groups, scenes, value_of, parts_of, note_of, axis_label, part="part", most=None):
    """Bars as bars.bar_panels has them, of what the legend calls `part`. `most`: where all axes end; else each at its longest bar."""
    places = places_of(groups)
    notes = max(len(note_of(c)) for _, row in places for c in row.cells.values())
    figure, axes = row_panels(groups, scenes, [1.5], 0.2 + 0.055 * notes)
    for scene, (axis,) in axes.items():
        here = [(place, row.cells[scene]) for place, row in places if scene in row.cells]
        ends = [value_of(cell)[0] for _, cell in here]
        for (place, cell), end in zip(here, ends):
            axis.barh(place, end, 0.78, edgecolor="white", linewidth=0, **look(cell, parts_of(cell)))
            axis.annotate(note_of(cell), (end, place), (3, 0), textcoords="offset points", va="center", fontsize=FONT - 0.5)
        for name, bars in by_part(here, parts_of).items():
            axis.barh([place for place, _, _ in bars], [value for _, _, value in bars], 0.78, left=[left for _, left, _ in bars], color=part_colour(name),
                      linewidth=0)
        axis.set_xlim(0, most or max(ends, default=0) or 1.0)
        axis.set_xlabel(axis_label, fontsize=FONT + 1)
    legends_right(figure, parts_legend(part, [(parts_of(c), value_of(c)[0], c) for _, row in places for c in row.cells.values()]))
    return figure


def by_part(here, parts_of):
    """{name: [(place, left, value)]} of (place, cell)s whose parts lie end to end."""
    found = {}
    for place, cell in here:
        left = 0.0
        for name, value in parts_of(cell):
            if value > 0:
                found.setdefault(name, []).append((place, left, value))
            left += value
    return found
