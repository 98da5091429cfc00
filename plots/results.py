"""Reads a result folder: results.json, else cells.jsonl (a run that was cut off). Knows no figure and no style.

A *row* is one repetition as it stands in the file. A *cell* gathers the rows of one combination of the axes. Throughput
is summed up by the median and the interval that it lies in, so that one disturbed repetition does not count.
"""

import json
import math
import re
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

AXES = ("scene", "structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "workload", "threads")
STRUCTURE_AXES = ("scene", "structure", "builder", "leaf", "isa", "threads")  # what a build depends on at most
ISA_ORDER = ("scalar", "sse", "avx2", "avx512")
HARD_PREFIX = "hard"  # workloads of hard rays: hard, hard_edge, ...
CAMERA_EDGES = "camera_edges"  # that of rays from the camera at edges and vertices
WORKLOAD_ORDER = ("primary", "shadow", "ambient_occlusion", "reflection", "diffuse", "random", "whitted", "path")
METRICS = ("trace", "build", "quality", "accuracy")
FEWEST_OF_INTERVAL = 6  # repetitions: fewer have no interval that covers their median in 95 of 100 cases
CONFIDENCE = 0.95
SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}


class ResultError(Exception):
    """One line for the user: what, where, the mend."""


class NoData(Exception):
    """Why a figure cannot be drawn from these results."""


class TooMuch(NoData):
    """Of what there is more than a figure can show, and how to choose from it."""


class TooTall(TooMuch):
    """The same, of a figure that fewer scenes would make less tall: `pages` are as many as it would fill."""

    def __init__(self, message, pages):
        super().__init__(message)
        self.pages = pages


@dataclass(frozen=True)
class Estimate:
    """Median with its 95 % interval; below FEWEST_OF_INTERVAL samples `low` and `high` are the least and the greatest, of one the median itself."""

    median: float
    low: float
    high: float
    samples: int


@dataclass
class Cell:
    """One combination of the axes: `axes` holds the keys, `rows` every repetition of every metric."""

    axes: dict
    rows: list = field(default_factory=list)
    _estimates: dict = field(default_factory=dict)

    def values(self, name):
        """The finite numbers that the rows hold under `name`."""
        found = (row.get(name) for row in self.rows)
        return [float(v) for v in found if is_number(v)]

    def value(self, name):
        """The median of `name` over the rows; None where no row has it."""
        values = self.values(name)
        return float(np.median(values)) if values else None

    def series(self, name):
        """The numbers that a row holds as a list under `name`, the same in all of them; empty where none does."""
        return next((row[name] for row in self.rows if isinstance(row.get(name), list)), [])

    def estimate(self, name):
        """The median with its interval; None where no row has `name`."""
        if name not in self._estimates:
            values = self.values(name)
            self._estimates[name] = estimate(values) if values else None
        return self._estimates[name]

    def per_million(self, name):
        """A count of answers per million of the rays that were checked, the most of any repetition; None where none were."""
        rates = [1e6 * row[name] / rays for row in self.rows if is_number(row.get(name)) and (rays := answered(row))]
        return max(rates) if rates else None

    def hit_share(self):
        """Per cent of the rays that hit something; None where they were not counted."""
        shares = [100 * row["hits"] / rays for row in self.rows if is_number(row.get("hits")) and (rays := answered(row))]
        return float(np.median(shares)) if shares else None

    def __getitem__(self, axis):
        return self.axes.get(axis, "")


@dataclass
class Results:
    folder: Path
    context: dict
    traces: list      # cells that have a throughput
    structures: list  # cells (scene, structure, builder, leaf, isa, threads) with build or quality figures
    skipped: list     # (cell name, reason)
    effective_yaml: str
    complete: bool    # False: read from cells.jsonl
    cells: int        # measured, builds among them, as `run` counts them
    _structure_index: dict = field(default_factory=dict)

    @property
    def name(self):
        return str(self.context.get("experiment") or self.folder.resolve().name)

    def scenes(self):
        """In their order."""
        return ordered((cell["scene"] for cell in self.traces + self.structures), "scene")

    def of_scenes(self, scenes):
        """The same of some scenes."""
        traces, structures = ([cell for cell in cells if cell["scene"] in scenes] for cells in (self.traces, self.structures))
        return replace(self, traces=traces, structures=structures, _structure_index={})

    def throughput(self):
        """Which figure stands for speed, and its label: thread CPU time as long as every cell has one thread."""
        single = all(cell["threads"] in ("", "1") and cell.values("rays_per_cpu_second") for cell in self.traces)
        if self.traces and single:
            return "rays_per_cpu_second", "Mray/s, thread CPU time"
        return "rays_per_second", "Mray/s, wall time"

    def clock(self):
        """What throughput() is measured by: "thread CPU time" or "wall time"."""
        return self.throughput()[1].partition(", ")[2]

    def repetitions(self):
        """How many repetitions each timed cell has."""
        metric, _ = self.throughput()
        return [n for cells, name in ((self.traces, metric), (self.structures, "build_seconds")) for cell in cells if (n := len(cell.values(name)))]

    def checked(self):
        """The cells whose answers were compared with exact arithmetic."""
        return [cell for cell in self.traces if cell.values("wrong_answers")]

    def structure_value(self, cell, name):
        """A figure of the structure that `cell` traces: the cell's own, else that of the build it shares."""
        own = cell.value(name)
        if own is not None:
            return own
        if name not in self._structure_index:
            index = self._structure_index[name] = {}
            for other in self.structures:
                value = other.value(name)
                for length in range(4, len(STRUCTURE_AXES) + 1) if value is not None else ():
                    index.setdefault(tuple(other[a] for a in STRUCTURE_AXES[:length]), value)
        keys = [cell[a] for a in STRUCTURE_AXES]
        found = (self._structure_index[name].get(tuple(keys[:length])) for length in range(len(keys), 3, -1))
        return next((value for value in found if value is not None), None)


def answered(row):
    """How many rays the counts of answers of `row` are of: of a workload that is a picture, those that its renderer sends where exact answers lead it, else
    all; 0 where that is unknown."""
    rays = next((row[name] for name in ("checked_rays", "rays") if is_number(row.get(name))), 0)
    return max(rays, 0)


def is_aimed(workload):
    """Whether the workload's rays are aimed at what goes wrong, and their time so says little."""
    return workload.startswith(HARD_PREFIX) or workload == CAMERA_EDGES


def is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def estimate(values):
    """The median and its interval, as experiments/sampling.h has them: of Hettmansperger and Sheather (1986), below FEWEST_OF_INTERVAL values the range."""
    samples = sorted(map(float, values))
    median, n = float(np.median(samples)), len(samples)
    if n < FEWEST_OF_INTERVAL:
        return Estimate(median, samples[0], samples[-1], n)
    depth = 1
    while coverage(n, depth + 1) >= CONFIDENCE:
        depth += 1
    part = (coverage(n, depth) - CONFIDENCE) / (coverage(n, depth) - coverage(n, depth + 1))
    inner, outer = (n - depth) * part, depth * (1 - part)
    weight = inner / (inner + outer)
    return Estimate(median, *(a + weight * (b - a) for a, b in ((samples[depth - 1], samples[depth]), (samples[n - depth], samples[n - depth - 1]))), n)


@cache
def coverage(n, depth):
    """How often the interval from the `depth`-th of n samples to the `depth`-th from above covers their median."""
    return 1 - 2 * sum(math.comb(n, k) for k in range(depth)) / 2**n


def interval_name(counts):
    """What intervals of samples of so many values are, in a word or two; where each is of one value, which has none, just "interval"."""
    counts = set(counts)
    if max(counts, default=1) < 2:
        return "interval"
    if min(counts) >= FEWEST_OF_INTERVAL:
        return "95 % interval"
    return "range" if max(counts) < FEWEST_OF_INTERVAL else "95 % interval or range"


def interval_words(counts):
    """The same in the words of a caption."""
    counts = {n for n in counts if n > 1}
    fewest = min(counts, default=0)
    return {"interval": "no interval, which a single repetition has not",
            "95 % interval": "the 95 % interval of the median",
            "range": f"the range of the {fewest} repetitions, which covers the median {100 * coverage(fewest, 1):.0f} times in 100 (95 take "
                     f"{FEWEST_OF_INTERVAL} repetitions)" if fewest else "",
            "95 % interval or range": f"the 95 % interval of the median, of fewer than {FEWEST_OF_INTERVAL} repetitions their range"}[interval_name(counts)]


def axis_sort_key(axis):
    """Orders an axis's keys: ISAs by age, workloads as the manual lists them (a variant, behind a colon, after its own), others by their text with numbers as
    numbers (bvh4 before bvh16)."""
    fixed = {"isa": ISA_ORDER, "workload": WORKLOAD_ORDER}.get(axis, ())

    def key(value):
        text, first = str(value), []
        name, _, variant = text.partition(":")
        if name in fixed:
            first, text = [(0, fixed.index(name), "")], variant
        return first + [(1, int(p), "") if p.isdigit() else (2, 0, p) for p in re.split(r"(\d+)", text) if p]
    return key


def ordered(values, axis):
    """Distinct values of an axis in a fixed order, embree last; scenes as they come, which is the configuration's order."""
    if axis == "scene":
        return list(dict.fromkeys(values))
    key = axis_sort_key(axis)
    return sorted(set(values), key=lambda v: (str(v) == "embree", key(v)))


def swept_axes(cells):
    """The axes of which at least two cells differ in nothing else."""
    found = set()
    for axis in AXES:
        seen = {}
        for cell in cells:
            rest = tuple(cell[a] for a in AXES if a != axis)
            seen.setdefault(rest, set()).add(cell[axis])
        if any(len(values) > 1 for values in seen.values()):
            found.add(axis)
    return found


def telling_axes(cells, given, asked):
    """Those of `asked` that the axes `given` and the ones before do not settle: what must be said besides to tell the cells apart."""
    return [axis for axis in undetermined_axes(cells, (*given, *asked)) if axis in asked]


def undetermined_axes(cells, axes):
    """Those of `axes` that the ones before them do not settle: what must be said to tell the cells apart."""
    kept = []
    for axis in axes:
        seen = {}
        for cell in cells:
            seen.setdefault(tuple(cell[a] for a in kept), set()).add(cell[axis])
        if any(len(values) > 1 for values in seen.values()):
            kept.append(axis)
    return kept


def load(folder):
    folder = Path(folder)
    if not folder.is_dir():
        raise ResultError(f"{folder}: no such folder; give the folder that `run` wrote")
    rows, context, skipped, complete = read_rows(folder)
    yaml_file = folder / "effective.yaml"
    effective = yaml_file.read_text(encoding="utf-8", errors="replace") if yaml_file.is_file() else ""
    traces, structures = gather(rows)
    names = {row.get("run_name") or row.get("name") for row in rows}
    return Results(folder, context, traces, structures, skipped, effective, complete, len(names - {None}))


def read_rows(folder):
    whole, lines = folder / "results.json", folder / "cells.jsonl"
    if whole.is_file():
        try:
            document = json.loads(whole.read_text(encoding="utf-8"))
            context, entries = dict(document.get("context") or {}), list(document.get("benchmarks") or [])
        except (ValueError, AttributeError, TypeError) as error:
            raise ResultError(f"{whole}: not the JSON that `run` writes ({error}); measure again, or remove it to "
                              f"read cells.jsonl instead") from error
        skipped = read_skipped(document.get("skipped") or context.pop("skipped", None))
        return choose_rows(entries), context, skipped, True
    if lines.is_file():
        entries, context = [], {}
        for line in lines.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                cell = json.loads(line)
            except ValueError:
                continue  # the line under way when the run was cut off
            if not isinstance(cell, dict):
                continue
            context = cell.get("context") or context
            common = {k: v for k, v in cell.items() if k not in ("repetitions", "benchmarks", "context")}
            repetitions = cell.get("repetitions") or cell.get("benchmarks")
            for row in repetitions if isinstance(repetitions, list) else [{}]:
                entries.append(per_iteration({**common, **row}) if isinstance(row, dict) else dict(common))
        plan = read_plan(folder)
        return choose_rows(entries), context or plan.get("context") or {}, read_skipped(plan.get("skipped")), False
    raise ResultError(f"{folder}: neither results.json nor cells.jsonl here; give the folder that `run` wrote")


def per_iteration(row):
    """A repetition of cells.jsonl, whose phases are those of all its iterations, as results.json has it."""
    phases, iterations = row.get("phase_seconds"), row.get("iterations")
    if isinstance(phases, dict) and is_number(iterations) and iterations > 0:
        row["phase_seconds"] = {name: seconds / iterations for name, seconds in phases.items() if is_number(seconds)}
    return row


def read_plan(folder):
    """plan.json, which stands there before anything is measured: the context, and what was skipped; {} where there is none."""
    try:
        plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return plan if isinstance(plan, dict) else {}


def read_skipped(skipped):
    """[{name, reason}] or {name: reason} -> [(name, reason)]."""
    if isinstance(skipped, dict):
        return [(str(name), str(reason)) for name, reason in skipped.items()]
    found = []
    for item in skipped or []:
        if isinstance(item, dict):
            found.append((str(item.get("name") or item.get("cell") or "?"), str(item.get("reason") or "no reason given")))
        else:
            found.append((str(item), "no reason given"))
    return found


def choose_rows(entries):
    """The repetitions; a cell of which only aggregates were kept gives its median."""
    entries = [e for e in entries if isinstance(e, dict)]
    rows = [e for e in entries if e.get("run_type", "iteration") != "aggregate"]
    known = {e.get("run_name") or e.get("name") for e in rows}
    rows += [e for e in entries if e.get("run_type") == "aggregate" and e.get("aggregate_name") == "median"
             and e.get("run_name") not in known]
    return rows


def axes_of(row):
    """The axes of a row: its own fields, else the parts of its name."""
    parts = str(row.get("run_name") or row.get("name") or "").split("/")
    named = {}
    if parts and parts[0] in METRICS and len(parts) > len(AXES):
        named = dict(zip(AXES, parts[1:]))
    axes = {axis: row.get(axis, named.get(axis, "")) for axis in AXES}
    if isinstance(row.get("threads"), float):
        axes["threads"] = int(row["threads"])
    return {axis: "" if value == "-" else str(value).removeprefix("threads:") for axis, value in axes.items()}


def gather(rows):
    traces, structures = {}, {}
    for row in rows:
        axes = axes_of(row)
        if is_number(row.get("rays_per_second")) or is_number(row.get("rays_per_cpu_second")):
            traces.setdefault(tuple(axes.values()), Cell(axes)).rows.append(row)
    def add_structures(names, known=frozenset()):
        for row in rows:
            axes = axes_of(row)
            part = {axis: axes[axis] for axis in STRUCTURE_AXES}
            key = tuple(part.values())
            if key[:4] not in known and any(is_number(row.get(name)) for name in names):
                structures.setdefault(key, Cell(part)).rows.append(row)

    add_structures(["build_seconds"])  # what a build tells about itself goes before what traces repeat of it
    add_structures(["sah_cost", "bytes"], {key[:4] for key in structures})
    return list(traces.values()), list(structures.values())
