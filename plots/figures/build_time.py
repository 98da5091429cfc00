"""Build time, from mesh to a structure ready for rays: one panel a scene."""

from figures.bars import bar_panels
from results import is_number
from tables import digits

TITLE = "Build time"
CAPTION = ("Wall time from mesh to a structure ready for rays, with {interval}; "
           "beside it, triangles a second. The parts are the build's own phases, each with its share of the repetitions' time "
           "together, drawn to the length of the median; grey is what none of them covers. "
           "Lower is better.")


def draw(results):
    def value(cell):
        found = cell.estimate("build_seconds")
        return found and (1e3 * found.median, 1e3 * found.low, 1e3 * found.high)

    def note(cell):
        milliseconds, triangles = value(cell)[0], cell.value("triangles")
        return f"{digits(milliseconds)} ms" + (f", {1e-3 * triangles / milliseconds:.2f} Mtri/s" if triangles and milliseconds > 0 else "")

    return bar_panels(results, value, "build time, ms", note, ("builder", "threads", "isa", "leaf"), phases, lambda cell: cell.estimate("build_seconds"))


def phases(cell):
    """(name, ms) in the order of the build: each phase's share of all repetitions' time, of the median. Medians of phases would not add up
    to the median of their sums, and means would add up to another bar than that of the median."""
    rows = [row for row in cell.rows if isinstance(row.get("phase_seconds"), dict) and is_number(row.get("build_seconds"))]
    total = sum(row["build_seconds"] for row in rows)
    if total <= 0:
        return []
    names = dict.fromkeys(name for row in rows for name in row["phase_seconds"])
    scale = 1e3 * cell.value("build_seconds") / total
    return [(name, scale * sum(row["phase_seconds"].get(name, 0.0) for row in rows)) for name in names]
