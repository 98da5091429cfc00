"""Results as experiments write them, made up, and folders of them: what the tests of plots/ are drawn from."""

import atexit
import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PLOTS = Path(__file__).resolve().parent.parent.parent / "plots"
sys.path.insert(0, str(PLOTS))

import style  # noqa: E402
from figures import ALL  # noqa: E402
from results import Results  # noqa: E402

AXES = ("scene", "structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "workload", "threads")


def results_of(traces, structures=()):
    """Of cells, not of a folder."""
    return Results(Path(), {}, list(traces), list(structures), [], "", True, len(traces))


class Drawn(unittest.TestCase):
    def draw(self, module, results):
        """A module's figure, which is closed when the test is over."""
        figure = module.draw(results)
        self.addCleanup(style.plt.close, figure)
        return figure


def trace(structure="bvh8", isa="avx2", intersector="watertight", rate=10e6, repetition=0, **more):
    axes = dict(zip(AXES, ("bunny", structure, "medium" if structure == "embree" else "binned_sah", "triangle8", intersector,
                           "padded", "single", isa, "diffuse", 1)))
    name = "trace/" + "/".join(str(axes[a]) for a in AXES[:-1]) + "/threads:1"
    return {"name": name, "run_name": name, "run_type": "iteration", "repetition_index": repetition, "time_unit": "ms",
            "real_time": 1.0, "cpu_time": 1.0, "rays": 1000, "rays_per_second": rate, "rays_per_cpu_second": rate,
            "wrong_answers": 1, **axes, **more}


def other(workload, scene="bunny", **more):
    """A cell of another workload or scene."""
    row = trace(**{"scene": scene, "workload": workload, **more})
    row["name"] = row["run_name"] = "/".join(["trace"] + [str(row[a]) for a in AXES])
    return row


def hard():
    """What the figures of accuracy are drawn from: hard rays, placed scenes, a picture, ways of leaving a surface."""
    rows = []
    for k, (intersector, box) in enumerate((("moller_trumbore", "fast"), ("watertight", "padded"), ("a_new_one", "padded"))):
        ways = {"intersector": intersector, "box": box}
        rows.append(other("hard", **ways, wrong_answers=10 * k, t_error_ulp_p99=0.5 + k))
        rows += [other(w, f"ball:size=100:offset={x:g}", **ways, cracks=k * n, offset=x, radius=173.2) for w in ("hard_edge", "hard_vertex")
                 for n, x in enumerate((1, 1e4, 1e8))]
        rows += [other("hard_edge", f"ball:stretch={x}", **ways, cracks=k, offset=0, triangle_aspect_median=2.5 * x) for x in (1, 100)]
        rows += [other("camera_edges", s, **ways, structure=s2, cracks=1, leak_points=[[3.5, 4], [10, 12]]) for s in ("ball",) for s2 in ("bvh8", "embree")]
        rows += [other(f"diffuse:self_intersection={way}", **ways, self_intersection=way, self_hits_per_million=4e5 * (way == "none"), near_hits_per_million=k,
                       leaks_per_million=0.0) for way in ("none", "error_bound")]
    return rows


SEEN = {"camera_edges-ball.json": json.dumps({"scene": "ball", "width": 32, "height": 32, "points": [[1, 2], [3.5, 4], [30, 20]]})}


def build(structure="bvh8", builder="binned_sah", **more):
    name = f"build/bunny/{structure}/{builder}/triangle8/-/-/-/avx2/-/threads:1"
    figures = {} if structure == "embree" else {
        "sah_cost": 31.5, "nodes": 10, "epo": 4.5, "lcv": 3.0, "triangles": 100, "bytes_per_triangle": 10.0, "node_bytes": 300,
        "leaf_bytes": 600, "other_bytes": 100, "peak_build_bytes": 1500, "leaf_histogram": [0, 3, 4], "depth_histogram": [0, 0, 1, 6], "leaf_fill": 0.75,
        "phase_seconds": {"splits": 0.01, "leaves": 0.005, "a new phase": 0.001}}
    return {"name": name, "run_type": "iteration", "build_seconds": 0.02, "triangles_per_second": 3e6, "bytes": 1000,
            **figures, **more}


def whole():
    rows = [trace(s, i, x, 1e6 * (3 + k) + r, r) for k, s in enumerate(("bvh2", "bvh4", "bvh8", "embree", "a_new_one"))
            for i in ("sse", "avx2") for x in ("moller_trumbore", "watertight") for r in range(5)]
    rows += [trace("bvh4", "avx2", "watertight", 2e6 + r, r, builder="ploc",
                   run_name="trace/bunny/bvh4/ploc/triangle8/watertight/padded/single/avx2/diffuse/threads:1") for r in range(3)]
    rows.append(build("bvh4", "ploc"))
    return rows + [build(s, sah_cost=30.0 + k) if s != "embree" else build(s)
                   for k, s in enumerate(("bvh2", "bvh4", "bvh8", "embree"))]


HARD = [name for name in ALL if name.startswith("leak") or name == "self_intersection"]
PUBLISHED = "embree_siggraph_2013"  # an experiment with published figures


def everything():
    """What every figure but those of HARD has something to show of, as an experiment called PUBLISHED."""
    counted = {"lane_utilization_by_depth": [1.0, 0.75, None], "visits_by_depth": [1.0, 0.5, 0.0], "children_hit": [0.25, 0.5, 0.25, 0.0, 0.0],
               "nodes_per_ray": 9.5, "leaves_per_ray": 1.9, "boxes_per_ray": 37.5, "triangles_per_ray": 0.0}
    return whole() + [trace("bvh4", isa, "moller_trumbore", rate + r, r, scene="crown", workload="primary", traversal=traversal, **counted)
                      for isa, traversal, rate in (("sse", "single", 2e6), ("sse", "packet4", 3e6), ("avx2", "packet8", 5e6)) for r in range(3)]


SPACE = tempfile.TemporaryDirectory(prefix="arboretum-plots-")
atexit.register(SPACE.cleanup)


class Folder:
    """A result folder of its own, gone when the tests have ended."""

    def __init__(self, rows=None, context=None, skipped=None, files=None):
        self.path = Path(tempfile.mkdtemp(dir=SPACE.name))
        if rows is not None:
            document = {"context": context or {}, "benchmarks": rows, "skipped": skipped or []}
            (self.path / "results.json").write_text(json.dumps(document))
        for name, content in (files or {}).items():
            (self.path / name).write_text(content)

    def plot(self, *words):
        return subprocess.run([sys.executable, str(PLOTS / "plot.py"), str(self.path), *words], capture_output=True, text=True,
                              timeout=300)
