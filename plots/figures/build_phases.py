"""What builds spend their time on: a row a structure and builder, a column a scene."""

from figures.bars import distinct
from figures.build_time import phases
from figures.rows import bar_rows, groups_of
from results import ordered
from tables import digits

TITLE = "Build phases"
NEEDS = "build_seconds and phase_seconds (`metrics: [build]`)"
CAPTION = ("Each phase's share of the build's wall time, the median of the repetitions, in the order of the build; grey is what none of them covers. "
           "As medians do not add up, all are scaled to make up 100 %. Beside it, the time of the whole build, "
           "in nanoseconds a triangle of the mesh, the median of the repetitions. Structures that tell no phases, as embree, are left out.")
AXES = ("builder", "threads", "isa", "leaf")


def draw(results):
    def seconds(cell):
        return cell.estimate("build_seconds") if phases(cell) else None

    def shares(cell):
        milliseconds = 1e3 * cell.value("build_seconds")
        return [(name, 100 * value / milliseconds) for name, value in phases(cell)]

    def note(cell):
        triangles = cell.value("triangles")
        return f"{digits(1e9 * cell.value('build_seconds') / triangles)} ns" if triangles else ""

    cells, varied = distinct(results, seconds, AXES)
    return bar_rows(groups_of(cells, varied, seconds), ordered((c["scene"] for c in cells), "scene"), lambda _: (100, 100, 100), shares, note,
                    "share of the build time, %\n(beside it: ns a triangle)", part="phase", most=100)
