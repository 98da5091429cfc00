"""One look for all figures: a colour a structure (the same in every figure), a marker a mode, units, saving.

Colours are Paul Tol's `muted` scheme, which readers with any colour vision can tell apart; embree is dark grey and
hatched, so that it stays apart in print too.
"""

import math
import re
from collections import Counter
from textwrap import fill

import matplotlib
from matplotlib import font_manager

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.patches import Patch  # noqa: E402
from matplotlib.ticker import FixedLocator, FuncFormatter, Locator, MaxNLocator, NullFormatter, NullLocator  # noqa: E402

from results import TooMuch, TooTall, interval_name, ordered  # noqa: E402
from tables import per_million_text  # noqa: E402

COLOURS = {  # structures
    "kdtree": "#CC6677", "bvh2": "#88CCEE", "bvh4": "#44AA99", "bvh8": "#332288", "bvh16": "#882255",
    "bvh4_aos": "#AA4499", "grid": "#999933", "octree": "#117733", "brute_force": "#DDCC77", "embree": "#555555",
    "bvh4_quantised": "#EE8866", "bvh8_quantised": "#6699CC", "bih": "#997700", "two_level": "#004488", "bvh4_motion": "#994455",
}
SPARE_COLOURS = ("#FFAABB", "#BBCC33", "#DD00AA", "#8855DD", "#442200", "#66DD88")  # far from those of every structure and intersector
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
MODE_FACES = ("#FFFFFF", "#4477AA", "#CCBB44", "#228833", "#66CCEE", "#AA3377", "#222222")  # their number and that of MARKERS have no common divisor
MOST_MODES = 20  # whose markers can be told apart
MORE_MARKERS = (*MARKERS, "p", "d", "h", (4, 1, 0), (6, 1, 0))  # of larger signs: as many as structures; the last two cannot be half filled
DPI = 160
TALLEST = 8000  # pixels of a figure
PALE = 0.55  # alpha of a bar that markers stand on
WIDEST = 17.0  # inches of scenes beside each other
BETWEEN_TITLES = 0.25  # inches from the title of a panel to that of the next
MOST_TICKS = 6  # of a logarithmic axis

# Of fonts that have what DejaVu Sans lacks (Chinese, Japanese, Korean; then the rest of Unicode), those that are installed are asked for such characters.
FALLBACK_FONTS = ("Noto Sans CJK JP", "Noto Sans CJK SC", "Noto Sans JP", "Noto Sans SC", "Source Han Sans", "IPAexGothic", "IPAGothic", "TakaoGothic",
                  "VL Gothic", "WenQuanYi Zen Hei", "WenQuanYi Micro Hei", "Droid Sans Fallback", "Baekmuk Gulim", "NanumGothic", "Hiragino Sans", "Yu Gothic",
                  "Noto Sans", "FreeSans", "Symbola", "Unifont")


def font_families(installed):
    """DejaVu Sans, then those of FALLBACK_FONTS that are among the names `installed`."""
    return ["DejaVu Sans", *(name for name in FALLBACK_FONTS if name in installed)]


plt.rcParams.update({
    "font.family": font_families({font.name for font in font_manager.fontManager.ttflist}),
    "figure.facecolor": "white", "savefig.facecolor": "white", "axes.facecolor": "white",
    "font.size": 10, "axes.titlesize": 10.5, "axes.labelsize": 10, "xtick.labelsize": 9.5, "ytick.labelsize": 9.5,
    "legend.fontsize": 9, "legend.frameon": False, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": "#DDDDDD", "grid.linewidth": 0.7, "axes.axisbelow": True,
    "svg.hashsalt": "arboretum", "hatch.linewidth": 0.6, "errorbar.capsize": 2.0,
})
if "text.parse_math" in plt.rcParams:  # from matplotlib 3.6 on: names of scenes and files are text, a pair of $ in them too
    plt.rcParams["text.parse_math"] = False


class Palette:
    """Names that have a colour of their own, and spare colours for those that are new: by the name, or the next one free: the same in
    every figure of a report unless two new names fall on one colour, then by the order in which they are drawn. Two names get the same only where there are
    more of them than spare colours."""

    def __init__(self, own, spare):
        self.own, self.spare, self.given = own, spare, {}

    def __call__(self, name):
        if name in self.own:
            return self.own[name]
        if name not in self.given:
            first = sum(map(ord, name)) % len(self.spare)
            turns = [self.spare[(first + k) % len(self.spare)] for k in range(len(self.spare))]
            self.given[name] = next((c for c in turns if c not in self.given.values()), turns[0])
        return self.given[name]


colour = Palette(COLOURS, SPARE_COLOURS)


INTERSECTOR_COLOURS = {  # families near each other: crack-free ones green and black, precomputed ones yellow and brown
    "watertight": "#117733", "watertight_refined": "#44AA99", "exact": "#000000", "moller_trumbore": "#CC3355",
    "moller_trumbore_double": "#AA4499", "pluecker": "#332288", "pluecker_double": "#6699DD", "baldwin_weber": "#DDAA33",
    "havel_herout": "#EE7733", "wald_projection": "#885522",
}


intersector_colour = Palette(INTERSECTOR_COLOURS, SPARE_COLOURS)


BOX_COLOURS = {"fast": "#3377CC", "ize": "#E69F00", "padded": "#CC2222"}  # box tests, in the order in which they are drawn: each on those before
box_colour = Palette(BOX_COLOURS, SPARE_COLOURS)


def boxes_in_order(boxes):
    """Distinct box tests in the order of BOX_COLOURS, new ones last."""
    return [b for b in BOX_COLOURS if b in set(boxes)] + sorted(set(boxes) - set(BOX_COLOURS))


def intersector_legend(intersectors):
    return [Patch(facecolor=intersector_colour(i), edgecolor="white", label=i) for i in intersectors]


def log_with_zero(axis, which, values):
    """A log scale for `values` with a place for zero, which is labelled; linear where all are zero; without that place where none is."""
    if min(values, default=0) > 0:
        return log_axis(axis, which, values, 10.0)
    smallest, largest = min((v for v in values if v > 0), default=0), max(values, default=0)
    set_limits = axis.set_ylim if which == "y" else axis.set_xlim
    ticks = axis.yaxis if which == "y" else axis.xaxis
    if largest <= 0:
        set_limits(-0.1, 1.0)
        ticks.set_major_locator(FixedLocator([0, 1]))
        return
    low = 10.0 ** math.floor(math.log10(smallest))
    (axis.set_yscale if which == "y" else axis.set_xscale)("symlog", linthresh=low, linscale=0.6)
    set_limits(-0.25 * low, 2.5 * largest)
    first, last = round(math.log10(low)), math.floor(math.log10(2.5 * largest))
    step = max(1, -(-(last - first + 1) // 6))
    # Powers of ten alone would leave few values a tick near them; beside each other labels take more room than one above the other.
    digits = (1, 2, 5) if last - first < (2 if which == "y" else 1) else (1,)
    ticks.set_major_locator(FixedLocator([0] + [d * 10.0**k for k in range(first, last + 1, step) for d in digits if d * 10.0**k <= 2.5 * largest]))
    ticks.set_minor_locator(NullLocator())
    ticks.set_major_formatter(FuncFormatter(lambda v, _: plain(v)))


def log_axis(axis, which, values, least=1.0):
    """A log scale just wide enough for `values`, and for a factor of `least`, with labelled ticks however little they differ."""
    low, high = min(values, default=1.0), max(values, default=1.0)
    more = max(1.0, math.sqrt(least * low / high))
    (axis.set_xscale if which == "x" else axis.set_yscale)("log")
    (axis.set_xlim if which == "x" else axis.set_ylim)(0.8 * low / more, 1.2 * high * more)
    ticks = axis.xaxis if which == "x" else axis.yaxis
    ticks.set_major_locator(LogTicks(which))
    ticks.set_major_formatter(FuncFormatter(lambda v, _: plain(v)))
    ticks.set_minor_locator(BetweenPowers())
    ticks.set_minor_formatter(NullFormatter())


def round_ticks(most):
    """Ticks of a linear axis with few digits, 5 and 10, not 2.5 and 7.5; `most` steps of them."""
    return MaxNLocator(most, steps=[1, 2, 5, 10])


class LogTicks(Locator):
    """Ticks of a logarithmic axis, as many as their labels leave room for between them at the size that the axis has when it is drawn."""

    DIGITS = ((1, 2, 5), (1, 3), (1, 1.5, 2, 3, 5, 7), (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8))  # between powers of ten, about as far apart
    DIGIT, APART, LINE = 0.64, 1.0, 1.8  # of a font's size: a digit's width; between labels; from a line to the next

    def __init__(self, which):
        self.which = which

    def __call__(self):
        return self.tick_values(*sorted(self.axis.get_view_interval()))

    def tick_values(self, first, last):
        powers = range(math.floor(math.log10(first)), math.ceil(math.log10(last)) + 1)
        within = lambda ticks: [t for t in ticks if first <= t <= last]
        choices = [within(10.0**k for k in powers if k % step == 0) for step in range(1, 1 + max(1, len(powers) // 2))]
        choices += [within(float(f"{d}e{k}") for k in powers for d in digits) for digits in self.DIGITS]
        choices.append(within(MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(first, last)))  # where values hardly differ
        choices += [[ticks[0], ticks[-1]] for ticks in choices[-2:] if len(ticks) > 1]  # where labels are long
        fitting = [ticks for ticks in choices if len(ticks) <= MOST_TICKS and self.fit(ticks, first, last)]
        far = lambda ticks: math.log(ticks[-1] / ticks[0]) > 0.5 * math.log(last / first) if ticks else False
        return max(fitting, key=lambda ticks: (min(3, len(ticks)), far(ticks)), default=choices[0][:1])  # the first of three or more; else the most

    def fit(self, ticks, first, last):
        """Whether their labels are apart."""
        axes, size = self.axis.axes, self.axis.get_major_ticks(1)[0].label1.get_size()
        length = (axes.bbox.width if self.which == "x" else axes.bbox.height) * 72 / axes.figure.dpi / size  # in sizes of the font
        at = [length * math.log(tick / first) / math.log(last / first) for tick in ticks]
        widths = [self.DIGIT * len(plain(tick)) for tick in ticks]
        return all(b - a >= (self.LINE if self.which == "y" else (v + w) / 2 + self.APART)
                   for a, b, v, w in zip(at, at[1:], widths, widths[1:]))


class BetweenPowers(Locator):
    """Ticks without labels at the multiples of powers of ten, where LogTicks has labelled nothing but those."""

    def __call__(self):
        first, last = sorted(self.axis.get_view_interval())
        powers = [round(math.log10(tick)) for tick in self.axis.get_majorticklocs()]
        if [10.0**k for k in powers] != list(self.axis.get_majorticklocs()) or any(b - a > 1 for a, b in zip(powers, powers[1:])):
            return []
        every = range(math.floor(math.log10(first)), math.ceil(math.log10(last)) + 1)
        return [t for k in every for d in range(2, 10) if first <= (t := d * 10.0**k) <= last]


SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain(value):
    """0, 0.01, 1, 1000, 10⁵, 1.5·10⁵: as a person writes a power of ten or a multiple of one."""
    if value == 0 or 1e-3 < value < 1e4:
        return f"{value:g}"
    digits, power = f"{value:e}".split("e")
    return ("" if float(digits) == 1 else f"{float(digits):g}·") + "10" + str(int(power)).translate(SUPERSCRIPTS)


def hatch(structure):
    return "///" if structure == "embree" else None


PART_COLOURS = {
    "nodes": "#332288", "leaves": "#DDCC77", "other": "#AAAAAA",  # the memory's parts; leaves are a phase, too
    "references": "#009988", "sort": "#88CCEE", "splits": "#EE8866", "order": "#997700", "tree": "#BBCC33", "clusters": "#FFAABB", "embree": "#555555",
    "layout": "#6699CC", "reinsertion": "#AA4499", "collapse": "#CC6677", "planes": "#004488", "outer_grid": "#663333", "inner_grids": "#EE3377",
}
SPARE_PART_COLOURS = ("#4477AA", "#44AA99", "#117733", "#994455", "#999933", "#882255")
part_colour = Palette(PART_COLOURS, SPARE_PART_COLOURS)  # of a phase of a build, a part of the memory


REST_COLOUR = "#CCCCCC"  # of what none of a bar's parts covers


def part_legend(names, rest):
    """A handle for each part, and for what none of them covers where there is a `rest`."""
    handles = [Patch(facecolor=part_colour(n), edgecolor="white", label=n) for n in names]
    return handles + ([Patch(facecolor=REST_COLOUR, edgecolor="white", label="none of these")] if rest else [])


def structure_legend(structures):
    """Legend handles, one a structure."""
    return [Patch(facecolor=colour(s), edgecolor="white", hatch=hatch(s), label=s)
            for s in ordered(structures, "structure")]


BUILDER_MARKERS = {"binned_sah": "o", "sweep_sah": "s", "spatial_sah": "D", "morton": "^", "ploc": "v", "low": "<", "medium": ">", "high": "P", "octants": "h",
                   "uniform": "X",
                   "two_level": "p"}
builder_marker = Palette(BUILDER_MARKERS, ("*", "d", "H"))


WRONG = "#CC1111"  # edges and numbers where answers are wrong


def is_wrong(cell):
    """Whether some of the cell's answers were found wrong."""
    return bool(cell.per_million("wrong_answers"))


def edge(cell):
    """The edge of a cell's marker."""
    return WRONG if is_wrong(cell) else "#222222"


def wrong_text(cell):
    """The cell's wrong answers per million, to three digits."""
    return per_million_text(cell.per_million("wrong_answers") or 0.0)


def most_wrong(cells):
    """The text of the cell that has the most wrong answers for its rays."""
    return wrong_text(max(cells, key=lambda cell: cell.per_million("wrong_answers") or 0.0))


def wrong_legend(cells, handle=None):
    """[(title, handles)]: `handle`, which says what red is, where some of `cells` have wrong answers, and how many were not checked; empty where neither is."""
    handles = [handle] if handle and any(map(is_wrong, cells)) else []
    unchecked = sum(cell.per_million("wrong_answers") is None for cell in cells)
    if unchecked:
        handles.append(Line2D([], [], linestyle="", label="not checked" if unchecked == len(cells) else f"{unchecked} of {len(cells)} cells not checked"))
    return [("answers", handles)] if handles else []


def wrong_marker(label):
    return Line2D([], [], linestyle="", marker="o", color=WRONG, markerfacecolor="white", markersize=5, label=label)


def interval_legend(estimates):
    """[(title, handles)]: what the lines at the medians are; empty where none has any."""
    counts = [e.samples for e in estimates]
    return [("", [Line2D([], [], color="#222222", linewidth=0.9, label=interval_name(counts))])] if max(counts, default=1) > 1 else []


def marker_map(keys, what):
    """A marker of its own for each key, in the order given; TooMuch, of `what`, where there are none left."""
    if len(keys) > len(MORE_MARKERS):
        raise TooMuch(f"{len(keys)} {what} are too many to tell apart; choose some with --filter")
    return dict(zip(keys, MORE_MARKERS))


def mode_markers(modes):
    """{mode: look of its marker}, of which no two are the same; empty where modes are too many to tell apart."""
    if len(modes) > MOST_MODES:
        return {}
    return {mode: {"marker": MARKERS[k % len(MARKERS)], "markerfacecolor": MODE_FACES[k % len(MODE_FACES)], "markeredgewidth": 0.9, "markersize": 4.5}
            for k, mode in enumerate(modes)}


def mode_legend(markers):
    return [Line2D([], [], linestyle="", color="#222222", label=mode, **{**look, "markersize": 6}) for mode, look in markers.items()]


def marker_legend(markers):
    return [Line2D([], [], linestyle="", marker=m, color="#333333", markerfacecolor="none", markersize=6, label=str(k))
            for k, m in markers.items()]


def short(scene, most=24):
    """At most so many characters of a scene's name. What it is placed by stays whole while four of its own name do: that tells places apart."""
    name, colon, place = scene.partition(":")
    if colon and len(scene) > most >= len(place) + 6:
        return name[: most - len(place) - 2] + "…:" + place
    return scene if len(scene) <= most else scene[: most // 2 - 1] + "…" + scene[-most // 2 :]


def short_names(scenes, most=24):
    """{scene: its name as short() has it}: of names that would be the same as another's, or be cut within a number,
    so many characters more as they need not to be. What stands on lines of their own below a name stays."""
    lengths = dict.fromkeys(scenes, most)
    while True:
        found = {scene: "\n".join([short(name, length), *more]) for scene, length in lengths.items() for name, *more in [scene.split("\n")]}
        times = Counter(found.values())
        unclear = [scene for scene, name in found.items() if name != scene and (times[name] > 1 or cuts_a_number(scene, name))]
        if not unclear:
            return found
        for scene in unclear:
            lengths[scene] += 1


def cuts_a_number(scene, name):
    """Whether `name`, a short one of `scene`, ends or begins again within a number of it."""
    before, _, after = name.partition("…")
    return any(scene[place - 1 : place + 1].isdigit() and scene[place - 1 : place + 1][1:] for place in (len(before), len(scene) - len(after)))


def letters(width):
    """How many a title above a panel `width` inches wide may have in a line."""
    return int(11.5 * width)


def panel_title(scene, workload, width):
    """Scene, shortened already, and workload on as many lines as a panel `width` inches wide needs: broken between the two, then within a
    name before a variant."""
    most = letters(width)
    if max(map(len, f"{scene}, {workload}".split("\n"))) <= most:
        return f"{scene}, {workload}"
    lines = f"{scene},\n{workload}".split("\n")
    broken = "\n".join(line if len(line) <= most + 1 else line.replace(":", ":\n", 1) for line in lines)
    return "\n".join(broken_keys(line, most + 1) for line in broken.split("\n"))


def broken_keys(text, most):
    """`text` on lines of so many letters, where it must be broken within its keys, too: behind an underscore or an equals sign."""
    return text if len(text) <= most else closed(fill(opened(text), most))


def opened(text):
    """`text` with a blank wherever a key may be broken: behind an underscore or an equals sign; closed() takes them out again."""
    return text.replace("_", "_ ").replace("=", "= ")


def closed(text):
    return text.replace("_ ", "_").replace("= ", "=")


def panel_grid(shown, places, width, height, most_columns, least_width=None):
    """A panel for each (scene, place) of `shown`, titled; `places`, {place: words of the title}, gives their order. A scene begins a row, or stands beside the
    one before where all panels of both fit; where lines of `most_columns` would end in a gap, it is one line if that is no wider than WIDEST.
    A figure that would be too tall has more columns than `most_columns`, up to WIDEST, of panels that are as narrow as
    `least_width` where that is given. Gives the figure and {(scene, place): axis}."""
    shown = dict.fromkeys(shown)  # in order, each once
    own = {scene: [place for place in places if (scene, place) in shown] for scene in dict.fromkeys(scene for scene, _ in shown)}
    lines, columns, beside = lines_of(own, width, most_columns)
    most = max(map(len, own.values()))
    if most % columns and most * width <= WIDEST:  # one line of them without a gap, not several with one
        most_columns = most
        lines, columns, beside = lines_of(own, width, most_columns)
    while not fits(height * -(-len(lines) // beside)) and (most_columns + 1) * (least_width or width) <= WIDEST:
        most_columns += 1
        width = min(width, WIDEST / most_columns)
        lines, columns, beside = lines_of(own, width, most_columns)
    figure, axes = panels(-(-len(lines) // beside), beside * columns, width, height)
    found, room = {}, width - BETWEEN_TITLES
    names = short_names(own, max(24, letters(room) - 4))
    for i, (scene, line) in enumerate(lines):
        for k, place in enumerate(line):
            axis = found[scene, place] = axes[i // beside][i % beside * columns + k]
            axis.set_title(panel_title(names[scene], places[place], room))
    for axis in set(axes.flat) - set(found.values()):
        axis.set_visible(False)
    return figure, found


def lines_of(own, width, most_columns):
    """[(scene, places of a line)] of `own`, {scene: places}, of how many columns a line is, and how many lines stand beside each other."""
    most = max(map(len, own.values()))
    columns = -(-most // -(-most // most_columns))  # as few lines as there can be, the last as full as the others
    lines = [(scene, line[i:i + columns]) for scene, line in own.items() for i in range(0, len(line), columns)]
    return lines, columns, max(1, min(most_columns // columns, int(WIDEST / (columns * width)), len(lines))) if most == columns else 1


def legends_right(figure, legends):
    """(title, handles) one below the other at the figure's right edge, outside all data; save() keeps them whole."""
    height, top = figure.get_size_inches()[1], 0.98
    for title, handles in legends:
        figure.legend(handles=handles, title=title, loc="upper left", bbox_to_anchor=(1.0, top), alignment="left")
        top -= (0.20 * sum(handle.get_label().count("\n") + 1 for handle in handles) + 0.45) / height


def panels(rows, columns, width, height, **options):
    """A grid of axes, always two-dimensional. Sizes in inches, one panel's each. TooTall where that is taller than can be read."""
    if not fits(height * rows):
        raise TooTall(f"it would be {DPI * height * rows:.0f} pixels tall ({TALLEST} at most); "
                      f"choose fewer scenes, workloads or builders, in the configuration or with --filter",
                      math.ceil(DPI * height * rows / TALLEST))
    figure, axes = plt.subplots(rows, columns, figsize=(width * columns, height * rows), squeeze=False,
                                layout="constrained", **options)
    return figure, axes


def fits(height):
    """Whether a figure of so many inches is not taller than can be read."""
    return DPI * height <= TALLEST


def save(figure, folder, name):
    """Writes name.png and name.svg; the same data gives the same bytes."""
    figure.set_dpi(DPI)
    figure.draw_without_rendering()  # the layout and what is around it once for both files: they take longer than the drawing
    figure.set_layout_engine(None)
    around = figure.get_tightbbox().padded(plt.rcParams["savefig.pad_inches"])
    figure.savefig(folder / f"{name}.png", dpi=DPI, bbox_inches=around, metadata={"Software": None})
    figure.savefig(folder / f"{name}.svg", bbox_inches=around, metadata={"Date": None, "Creator": None})
    plt.close(figure)


def discard(folder, name):
    """Closes what is open and removes name.png and name.svg, name-1.png and so on: what is left of a figure that could not be drawn, or of one drawn before."""
    plt.close("all")
    discard_files(folder, name)


def discard_files(folder, name):
    for path in list(folder.iterdir()):
        if re.fullmatch(rf"{re.escape(name)}(-\d+)?\.(png|svg)", path.name):
            path.unlink()
