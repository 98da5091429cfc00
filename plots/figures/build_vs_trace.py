"""What a slower build buys: build time against the time of a ray, and from how many rays on it pays."""

from figures.names import label
from figures.trade_offs import MOST_NAMES, draw_panels, fastest_points, of_places
from results import STRUCTURE_AXES

TITLE = "Build time against trace time"
NEEDS = "build_seconds and rays_per_second (`metrics: [trace, build]`)"
CAPTION = ("A point is a structure as built, its rays traced in its fastest mode; lower left is better, both scales are logarithmic. The grey steps join the "
           "points that no other beats in both. Numbered are those that take the least time for build and rays together, each with the number of rays from "
           "which on it does: what its build takes more than that of the number before, by what each ray takes less. Any other is best at no number of rays, "
           "or, where there are more than ten of them, over the shortest ranges. Of two points whose intervals overlap in build time or in the time of a ray, "
           "neither is taken to be better in that; intervals are {interval}. Builds are measured in wall time, with as many threads as the rays beside them; "
           "with more threads both are faster, builds as a rule by less, and then slow ones pay later.")
POWERS = ((1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k"), (1, ""))


def draw(results):
    metric, _ = results.throughput()
    builds = {tuple(c[a] for a in STRUCTURE_AXES): c for c in results.structures}

    def seconds(cell):  # with the threads of the rays alone: another number of them would make another trade
        build = builds.get(tuple(cell[a] for a in STRUCTURE_AXES))
        found = build and build.estimate("build_seconds")
        return found if found and found.low > 0 else None

    def rays_are_of(threads):
        return results.clock() if "CPU" in results.clock() else wall(threads)

    points = [p.scaled(1e3) for p in fastest_points(results.traces, metric, seconds)]
    return draw_panels(of_places(points), lambda threads: f"build time, ms ({wall(threads)})", lambda threads: f"time, ns a ray\n({rays_are_of(threads)})",
                       labelled)


def wall(threads):
    return f"wall time, {label('threads', threads)}" if threads else "wall time"


def labelled(points):
    return [(p, f"from {count(rays)} rays" if rays else "at first") for p, rays in longest_stages(points)]


def longest_stages(points):
    """The stages of `points`, or of those of them whose ranges are longest, by ratio: MOST_NAMES at most."""
    found = stages(points)
    while len(found) > MOST_NAMES:
        shortest = min(range(1, len(found) - 1), key=lambda i: found[i + 1][1] / found[i][1])
        points = [p for p in points if p is not found[shortest][0]]
        found = stages(points)
    return found


def stages(points):
    """[(point, rays)]: which point takes the least time for build and so many rays or more, up to the next one's number. x in ms, y in ns a ray."""
    left = [p for p in points if not any(q.y.high < p.y.low and q.x.low <= p.x.high for q in points)]
    now = min(left, key=lambda p: (p.x.median, p.y.median))
    found = [(now, 0.0)]
    while True:
        slower = [(1e6 * (p.x.median - now.x.median) / (now.y.median - p.y.median), p) for p in left if p.x.low > now.x.high and p.y.high < now.y.low]
        if not slower:
            return found
        rays, now = min(slower, key=lambda pair: (pair[0], pair[1].y.median))
        found.append((now, rays))


def count(rays):
    """Two digits: 950, 12 k, 1.2 M."""
    rays = float(f"{rays:.2g}")
    size, name = next(((s, n) for s, n in POWERS if rays >= s), POWERS[-1])
    return f"{rays / size:.2g}{name}" if rays / size < 100 else f"{rays / size:.0f}{name}"
