"""Build time, from mesh to a structure ready for rays: one panel a scene."""

from statistics import median

from figures.bars import bar_panels
from results import is_number
from tables import digits

TITLE = "Build time"
NEEDS = "build_seconds (`metrics: [build]`)"
CAPTION = ("Wall time from mesh to a structure ready for rays, with {interval}; "
           "beside it, triangles a second. The parts are the build's own phases: of each, and of the rest, the median of its shares of the repetitions, "
           "all drawn to make up the median together; grey is what no phase covers. "
           "Lower is better.")


def draw(results):
    def value(cell):
        found = cell.estimate("build_seconds")
        return found and (1e3 * found.median, 1e3 * found.low, 1e3 * found.high)

    def note(cell):
        milliseconds, triangles = value(cell)[0], cell.value("triangles")
        return f"{digits(milliseconds)} ms" + (f", {digits(1e-3 * triangles / milliseconds)} Mtri/s" if triangles and milliseconds > 0 else "")

    return bar_panels(results, value, "build time, ms", note, ("builder", "threads", "isa", "leaf"), phases, lambda cell: cell.estimate("build_seconds"))


def phases(cell):
    """(name, ms) in the order of the build: the median of each phase's shares of the repetitions, so that a disturbed repetition does not count, of the
    median of the whole. As medians do not add up, all are scaled by one factor, with what no phase covers, to make up that."""
    rows = [row for row in cell.rows if isinstance(row.get("phase_seconds"), dict) and is_number(row.get("build_seconds")) and row["build_seconds"] > 0]
    names = dict.fromkeys(name for row in rows for name in row["phase_seconds"])
    shares = {name: median(row["phase_seconds"].get(name, 0.0) / row["build_seconds"] for row in rows) for name in names}
    rest = median(max(0.0, 1 - sum(row["phase_seconds"].values()) / row["build_seconds"]) for row in rows) if rows else 0.0
    total = sum(shares.values()) + rest
    return [(name, 1e3 * cell.value("build_seconds") * share / total) for name, share in shares.items()] if total > 0 else []
