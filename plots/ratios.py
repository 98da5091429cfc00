#!/usr/bin/env python3
"""The figure of a comparison: ratios.py COMPARISON.json OUT.png|OUT.svg. Each cell's B/A with its interval, above them the geometric means.

Reads what `compare --json` writes. Exit status: 0 done, 2 a file cannot be read or written.
"""

import json
import math
import sys
from pathlib import Path
from textwrap import fill, wrap

sys.path.insert(0, str(Path(__file__).resolve().parent))

from plot import fail, need_matplotlib  # noqa: E402

METRICS = (("trace", "rays a second"), ("build", "build speed"))
TOTALS = {"trace": "rays", "build": "builds"}  # what means and controls of a metric are called
COLOURS = {"faster": "#117733", "slower": "#CC3355", "indistinguishable": "#777777", "undecided": "#BBBBBB", "mean": "#332288"}
MOST_CELLS = 80
SAME = 1e-6  # of the logarithm of a ratio: no difference
LETTER = 0.075  # inches that a letter of a label takes
WIDTH, TITLE_LETTER = 6.5, 0.09  # inches: of what is beside the labels; that a letter of a title takes


def labels(cells):
    """What tells the cells apart, and the rest once for all."""
    from figures.names import label
    from results import AXES

    varying = [axis for axis in AXES if len({cell[axis] for cell in cells}) > 1]
    constant = [label(axis, str(cells[0][axis])) for axis in AXES if axis not in varying and cells[0][axis] not in ("-", 1)]
    return ["  ".join(label(axis, str(cell[axis])) for axis in varying if cell[axis] != "-") or cell["structure"] for cell in cells], ", ".join(constant)


def rows_of(comparison, metric):
    """(label, ratio, low, high, kind) of one metric from the top down, and what all of its cells share."""
    cells = [cell for cell in comparison["cells"] if cell["metric"] == metric]
    if not cells:
        return [], ""
    rows = []
    for mean in comparison["geometric_means"]:
        if mean["axis"] == "all" and mean["value"] == TOTALS[metric]:
            ratio = mean["ratio"]
            rows.append((f"geometric mean of {mean['cells']}", ratio["median"], ratio["low"], ratio["high"], "mean"))
    names, shared = labels(cells)
    shown = list(zip(names, cells))
    differing = sorted((pair for pair in shown if abs(math.log(pair[1]["ratio"])) > SAME), key=lambda pair: -abs(math.log(pair[1]["ratio"])))
    if not differing:
        what = f"none of {len(cells)} cells differs" if len(cells) > 1 else "its cell does not differ"
        shown, shared = [], what + (f"; {shared}" if shared else "")
    elif len(cells) > MOST_CELLS:
        shown = differing[:MOST_CELLS]
        shared = f"{len(shown)} of {len(cells)} cells, those that differ most, called so or not" + (f"; {shared}" if shared else "")
    for name, cell in shown:
        ratio = cell["ratio"]  # of one repetition, which has no interval
        rows.append((name, ratio, ratio if cell["ratio_low"] is None else cell["ratio_low"], ratio if cell["ratio_high"] is None else cell["ratio_high"],
                     cell["verdict"]))
    return rows, shared


def heads(comparison):
    """What A and B are, and what ratios are relative to, in lines."""
    lines = []
    for side in ("a", "b"):
        told = comparison[side]
        revision = str(told["context"].get("git_revision") or "unknown").split(" | ")  # several of merged parts
        changed = " with changes" if "true" in str(told["context"].get("git_dirty")).lower() else ""
        lines.append(f"{side.upper()}: {told['folder']}, revision {', '.join(r[:12] for r in revision)}{changed}")
    for metric, control in (comparison.get("control") or {}).items():
        lines.append(f"Ratios of {metric} are relative to {control['cells']} cells of --control '{comparison['options']['control']}', "
                     f"whose own B over A is {control['ratio']['median']:.3f}")
    return lines


def draw(comparison):
    import style
    from matplotlib.lines import Line2D
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

    controls = comparison.get("control") or {}
    parts = [(title, *rows_of(comparison, metric), "B over A" + (", relative to the control" if TOTALS[metric] in controls else ""))
             for metric, title in METRICS]
    parts = [(fill(title + (f": {shared}" if shared else ""), int(WIDTH / TITLE_LETTER)), rows, ratio) for title, rows, shared, ratio in parts if rows]
    heights = [len(rows) + 2.5 + title.count("\n") for title, rows, _ in parts]
    width = WIDTH + LETTER * max(len(row[0]) for _, rows, _ in parts for row in rows)
    said = [part for line in heads(comparison) for part in wrap(line, int(width / LETTER))]
    figure, axes = style.plt.subplots(len(parts), 1, figsize=(width, 0.19 * (sum(heights) + len(said)) + 0.8), squeeze=False, layout="constrained",
                                      gridspec_kw={"height_ratios": heights})
    figure.suptitle("\n".join(said), x=0.01, ha="left", fontsize=9.5)
    limit = 1 + comparison["options"]["min_difference_percent"] / 100
    drawn = [row for _, rows, _ in parts for row in rows]  # one scale for all panels
    low, high = min(1 / limit, *(row[2] for row in drawn)) / 1.02, max(limit, *(row[3] for row in drawn)) * 1.02
    for axis, (title, rows, ratio_label) in zip(axes[:, 0], parts):
        axis.axvspan(1 / limit, limit, color="#EEEEEE", zorder=0)
        axis.axvline(1, color="#333333", linewidth=0.8, zorder=1)
        for place, (_, ratio, least, most, kind) in enumerate(rows):
            axis.errorbar(ratio, place, xerr=[[max(ratio - least, 0)], [max(most - ratio, 0)]], fmt="D" if kind == "mean" else "o", color=COLOURS[kind],
                          markersize=6 if kind == "mean" else 4.5, linewidth=1.3, zorder=2)
        axis.set_yticks(range(len(rows)), [row[0] for row in rows])
        axis.set_ylim(len(rows) - 0.4, -0.6)
        axis.grid(axis="y", visible=False)
        axis.set_xlim(low, high)
        if high / low > 4:
            axis.set_xscale("log")
            axis.xaxis.set_major_locator(style.LogTicks("x"))
            axis.xaxis.set_minor_locator(NullLocator())
        else:
            axis.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_title(title, loc="left")
        axis.set_xlabel(f"{ratio_label}: right of 1, B is faster; grey: too little to count")
    present = [kind for kind in COLOURS if any(row[4] == kind for row in drawn)]
    style.legends_right(figure, [("B against A", [Line2D([], [], linestyle="", marker="D" if kind == "mean" else "o", color=COLOURS[kind], label=kind)
                                                  for kind in present])])
    return figure


def read(source):
    try:
        comparison = json.loads(source.read_text(encoding="utf-8"))
        found = any(cell["metric"] == metric for cell in comparison["cells"] for metric, _ in METRICS)
    except OSError as error:
        fail(f"{source}: {error.strerror}; give a file that `compare --json` wrote")
    except (KeyError, TypeError, ValueError) as error:
        refuse(source, error)
    if not found:
        fail(f"{source}: no cell is in both folders: there is nothing to draw")
    return comparison


def refuse(source, error):
    why = f"it lacks {error}" if isinstance(error, KeyError) else error
    fail(f"{source}: not what `compare --json` writes ({why}); give a file that it wrote")


def main():
    if len(sys.argv) != 3:
        fail(f"usage: {sys.argv[0]} COMPARISON.json OUT.png")
    need_matplotlib()
    import style
    from warned import told_in_a_line

    source, target = Path(sys.argv[1]), Path(sys.argv[2])
    comparison = read(source)
    try:
        with told_in_a_line(target.name):
            figure = draw(comparison)
    except (KeyError, TypeError, ValueError) as error:
        refuse(source, error)
    try:
        metadata = {"Date": None, "Creator": None} if target.suffix == ".svg" else {"Software": None} if target.suffix == ".png" else None
        with told_in_a_line(target.name):
            figure.savefig(target, dpi=style.DPI, bbox_inches="tight", metadata=metadata)
    except OSError as error:
        fail(f"{error.filename or target}: {error.strerror}; the figure could not be written")
    except ValueError as error:
        fail(f"{target}: {error}; give a file that ends in .png, .svg or .pdf")


if __name__ == "__main__":
    main()
