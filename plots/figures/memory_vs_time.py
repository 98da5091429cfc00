"""Memory against speed: what tracing needs besides the mesh against the time of a ray."""

from figures.trade_offs import MOST_NAMES, draw_panels, fastest_points, of_places, pareto_front
from results import estimate
from tables import digits

TITLE = "Memory against time"
NEEDS = "bytes_per_triangle and rays_per_second (`metrics: [trace]`)"
CAPTION = ("A point is a structure as built, its rays traced in its fastest mode; lower left is better, both scales are logarithmic. Memory is what tracing "
           "needs besides the mesh, a triangle of the mesh. The grey steps join the points that no other beats in both. Numbered are those of them that are a "
           "tenth faster than the number before (or more, where there would be more than ten), and the fastest; behind their names bytes a triangle and "
           "nanoseconds a ray.")
WORTH = 0.9  # of the time of the number before


def draw(results):
    metric, _ = results.throughput()

    def size(cell):
        found = results.structure_value(cell, "bytes_per_triangle")
        return estimate([found]) if found else None

    points = fastest_points(results.traces, metric, size)
    return draw_panels(of_places(points), lambda _: "memory, bytes a triangle", lambda _: f"time, ns a ray\n({results.clock()})",
                       lambda here: [(p, f"{digits(p.x.median)} B, {digits(p.y.median)} ns") for p in worth_a_name(here)])


def worth_a_name(points, worth=WORTH):
    """Those of the Pareto front that are clearly faster than the one before that has a name, and the fastest; MOST_NAMES at most."""
    by_place = {(p.x.median, p.y.median): p for p in points}
    named = []
    for x, y in (front := pareto_front(by_place)):
        if not named or y <= worth * named[-1].y.median or y == front[-1][1]:
            named.append(by_place[x, y])
    return named if len(named) <= MOST_NAMES else worth_a_name(points, 0.97 * worth)
