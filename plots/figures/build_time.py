"""Build time, from mesh to a structure ready for rays: one panel a scene."""

from figures import squares
from figures.bars import bar_panels, digits

TITLE = "Build time"
CAPTION = ("Wall time from mesh to a structure ready for rays, with the 95 % confidence interval of the median where a build "
           "was repeated; beside it, triangles a second. The parts are the build's own phases, grey what none of them covers. "
           "Lower is better."
           + squares.CAPTION)


def draw(results):
    def value(cell):
        found = cell.estimate("build_seconds")
        return found and (1e3 * found.median, 1e3 * found.low, 1e3 * found.high)

    def note(cell):
        rate = cell.value("triangles_per_second")
        return f"{digits(value(cell)[0])} ms" + (f", {rate / 1e6:.2f} Mtri/s" if rate else "")

    def phases(cell):
        """The mean of each phase over the repetitions, in ms, in the order of the build."""
        rows = [row["phase_seconds"] for row in cell.rows if isinstance(row.get("phase_seconds"), dict)]
        names = dict.fromkeys(name for row in rows for name in row)
        return [(name, 1e3 * sum(row.get(name, 0.0) for row in rows) / len(rows)) for name in names]

    return bar_panels(results, value, "build time, ms", note, ("builder", "threads", "isa", "leaf"), phases)
