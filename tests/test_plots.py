"""Tests of plots/: numbers, figures from whole, thin and broken results, and a report that escapes what it shows."""

import json
import subprocess
import sys
import tempfile
import unittest
from html.parser import HTMLParser
from pathlib import Path

PLOTS = Path(__file__).resolve().parent.parent / "plots"
sys.path.insert(0, str(PLOTS))
sys.dont_write_bytecode = True

import report  # noqa: E402
import style  # noqa: E402
import tables  # noqa: E402
from figures import ALL, build_time, published_ratios, rays_by_builder, rays_per_second, squares, traversal_ratios  # noqa: E402
from figures.accuracy_vs_time import draw_workloads, hard_points, measure_of, pareto_front  # noqa: E402
from figures.leak_lines import without  # noqa: E402
from figures.leak_picture import by_test  # noqa: E402
from figures.modes import Modes  # noqa: E402
from figures.sah_vs_time import linear_fit  # noqa: E402
from results import Cell, Results, axes_of, estimate, load, ordered, swept_axes, undetermined_axes  # noqa: E402

AXES = ("scene", "structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "workload", "threads")


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
        "leaf_bytes": 600, "other_bytes": 100, "peak_build_bytes": 1500, "leaf_histogram": [0, 3, 4],
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
    counted = {"lane_utilization_by_depth": [1.0, 0.75, None], "visits_by_depth": [1.0, 0.5, 0.0], "children_hit": [0.25, 0.5, 0.25, 0.0, 0.0]}
    return whole() + [trace("bvh4", isa, "moller_trumbore", rate + r, r, scene="crown", workload="primary", traversal=traversal, **counted)
                      for isa, traversal, rate in (("sse", "single", 2e6), ("sse", "packet4", 3e6), ("avx2", "packet8", 5e6)) for r in range(3)]


SPACE = tempfile.TemporaryDirectory(prefix="arboretum-plots-")


def tearDownModule():
    SPACE.cleanup()


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


class Strict(HTMLParser):
    """Fails on a tag that is closed without having been opened, and keeps the text."""

    EMPTY = {"meta", "img", "input", "br"}

    def __init__(self):
        super().__init__()
        self.open, self.text, self.tags = [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open[-1] != tag:
            raise AssertionError(f"</{tag}> closes {self.open[-1:]}")
        self.open.pop()

    def handle_data(self, data):
        self.text.append(data)


class Numbers(unittest.TestCase):
    def test_estimate(self):
        for values, median in (([5.0], 5.0), ([1.0, 3.0], 2.0), ([1.0, 2.0, 900.0], 2.0)):
            found = estimate(values)
            self.assertEqual(found.median, median)
            self.assertLessEqual(found.low, median)
            self.assertGreaterEqual(found.high, median)
        self.assertEqual(estimate([5.0]).low, 5.0)
        self.assertEqual(estimate([3.0, 1.0, 2.0, 7.0]), estimate([3.0, 1.0, 2.0, 7.0]))

    def test_linear_fit(self):
        slope, offset, r2 = linear_fit([1, 2, 3, 4], [3, 5, 7, 9])
        self.assertAlmostEqual(slope, 2)
        self.assertAlmostEqual(offset, 1)
        self.assertAlmostEqual(r2, 1)
        self.assertLess(linear_fit([1, 2, 3, 4], [1, 9, 1, 9])[2], 0.5)
        for x, y in (([1, 2], [1, 2]), ([2, 2, 2], [1, 2, 3]), ([1, 2, 3], [5, 5, 5])):
            self.assertIsNone(linear_fit(x, y))

    def test_pareto_front(self):
        self.assertEqual(pareto_front([(3, 0), (1, 9), (2, 9), (2, 4), (4, 0)]), [(1, 9), (2, 4), (3, 0)])
        self.assertEqual(pareto_front([]), [])

    def test_ratios_of_traversals(self):
        rates = {("bvh8", "single", "bunny"): 2e6, ("bvh8", "packet8", "bunny"): 6e6, ("embree", "single", "bunny"): 3e6, ("embree", "stream", "bunny"): 4e6,
                 ("bvh8", "single", "city"): 5e6, ("bvh8", "packet8", "city"): 10e6}
        cells = [Cell(dict(zip(("structure", "traversal", "scene"), k), workload="diffuse", isa="avx2"), [{"rays_per_second": v}]) for k, v in rates.items()]
        modes = Modes(cells)
        table = traversal_ratios.ratios(cells, modes, "rays_per_second")
        self.assertEqual(table["bvh8", "packet8"], {("diffuse", "bunny"): 1.5, ("diffuse", "city"): 2.0})  # Embree's best; without Embree, single rays
        self.assertEqual(table["embree", "single"], {("diffuse", "bunny"): 0.75})
        fastest = traversal_ratios.fastest_cells([*cells, Cell(cells[0].axes, [{"rays_per_second": 1e6}])], modes, "rays_per_second")
        self.assertIs(fastest["bvh8", "single"]["diffuse", "bunny"], cells[0])
        self.assertAlmostEqual(traversal_ratios.value_at(table["bvh8", "packet8"], "diffuse", traversal_ratios.MEAN), 3 ** 0.5)
        self.assertIsNone(traversal_ratios.value_at(table["embree", "single"], "primary", traversal_ratios.MEAN))
        self.assertEqual(traversal_ratios.columns_of(cells), [("diffuse", "bunny"), ("diffuse", "city"), ("diffuse", "mean")])

    def test_squares_for_many_bars(self):
        import matplotlib.pyplot as plt

        bars = [Cell({"structure": s, "builder": b, "scene": "bunny"}, [{"sah_cost": 10.0 + i}])
                for i, (s, b) in enumerate((s, b) for s in ("bvh2", "bvh4", "bvh8", "bvh16", "bih") for b in map("builder{}".format, range(9)))]
        self.assertTrue(squares.are_due([bars], ["builder"]))
        self.assertFalse(squares.are_due([bars[:squares.MOST_BARS]], ["builder"]))
        self.assertFalse(squares.are_due([bars], ["builder", "isa"]))  # a square would stand for two cells
        figure = squares.square_panels([("bunny", bars), ("city", bars[:12])], lambda c: (c.value("sah_cost"),) * 3, str, "SAH cost", higher_is_better=False)
        first, second = figure.axes
        self.assertEqual([t.get_text() for t in first.get_yticklabels()], ["bih", "bvh2", "bvh4", "bvh8", "bvh16"])
        written = [[t.get_text() for t in axis.texts if t.get_text() != "–"] for axis in (first, second)]
        self.assertEqual(list(map(len, written)), [45, 12])
        self.assertEqual([len(first.texts), len(second.texts)], [45, 18])  # two structures of nine builders: six squares are empty, and say so
        self.assertLess(min(squares.SHADES(0.0)), 0.92)  # the worst is not white, as nothing is
        self.assertEqual([t.get_text() for t in first.texts if t.get_fontweight() == "bold"], ["10.0"])
        plt.close(figure)

    def test_wrong_answers_are_marked(self):
        import matplotlib.pyplot as plt
        from matplotlib.colors import to_hex

        def of(structure, builder, wrong, **more):
            axes = {"scene": "bunny", "workload": "diffuse", "isa": "avx2", "structure": structure, "builder": builder, "threads": "1", **more}
            return Cell(axes, [{"rays_per_second": 1e6 + len(builder), "rays": 1000, **({} if wrong is None else {"wrong_answers": wrong})}])

        def red(figure):
            return [t.get_text() for a in figure.axes for t in a.texts if to_hex(t.get_color()) == style.WRONG.lower()]

        def legend(figure):
            return [t.get_text() for each in figure.legends for t in each.get_texts()]

        self.assertEqual([style.wrong_text(of("bvh8", "x", n)) for n in (1, 190, 1000)], ["1,000", "190,000", "1,000,000"])
        self.assertEqual(style.wrong_text(Cell({}, [{"wrong_answers": 1, "rays": 2_500_000}])), "0.4")
        cells = [of("bvh8", "x", 0), of("bvh8", "long", 190), of("bvh4", "x", 0), of("grid", "x", None)]
        results = Results(Path(), {}, cells, [], [], "", True, 4)
        for module in (rays_per_second, rays_by_builder):
            figure = module.draw(results)
            self.assertEqual(red(figure)[:1], ["190,000"], module.TITLE)
            self.assertTrue(any("some wrong" in t for t in legend(figure)))
            self.assertIn("1 of 4 cells not checked", legend(figure))
            plt.close(figure)
        right = Results(Path(), {}, [cells[0], cells[2], of("bvh8", "long", 0)], [], [], "", True, 3)
        for module in (rays_per_second, rays_by_builder):
            figure = module.draw(right)
            self.assertEqual([t for t in legend(figure) if "wrong" in t or "checked" in t] + red(figure), [])
            plt.close(figure)
        many = [of(f"bvh{s}", f"b{b}", 7 if (s, b) == (2, 3) else 0) for s in range(5) for b in range(9)]
        figure = rays_by_builder.draw(Results(Path(), {}, many, [], [], "", True, 45))
        (axis,) = figure.axes
        self.assertEqual([(round(p.get_x() + p.get_width() / 2), round(p.get_y() + p.get_height() / 2)) for p in axis.patches], [(3, 2)])
        self.assertEqual(axis.get_xlabel(), "framed: up to 7,000\nwrong answers per million")
        plt.close(figure)

    def test_shades_of_squares(self):
        shade = squares.shades([1.0, 10.0, 100.0], higher_is_better=True)
        self.assertEqual([round(shade(v), 6) for v in (1, 10, 100)], [0, 0.5, 1])
        shade = squares.shades([0.0, 1e-9, 10.0, 100.0], higher_is_better=False)  # what is next to nothing does not take the colours from the others
        self.assertEqual([round(shade(v), 3) for v in (0, 1e-9, 10, 100)], [1, 1, 0.5, 0])
        self.assertEqual(squares.shades([0.0, 0.0], higher_is_better=False)(0.0), 0)

    def test_phases_of_a_build_make_up_the_median(self):
        # One disturbed repetition: the means add up to 44, the median is 20.
        repetitions = [(0.02, 0.015, 0.005), (0.02, 0.01, 0.01), (0.092, 0.059, 0.033)]
        cell = Cell({}, [{"build_seconds": total, "phase_seconds": {"splits": a, "leaves": b}} for total, a, b in repetitions])
        found = dict(build_time.phases(cell))
        self.assertAlmostEqual(sum(found.values()), 20.0)
        self.assertAlmostEqual(found["splits"], 20.0 * 84 / 132)
        self.assertEqual(build_time.phases(Cell({}, [{"build_seconds": 0.0, "phase_seconds": {"splits": 0.0}}])), [])
        self.assertEqual(build_time.phases(Cell({}, [{"build_seconds": 1.0}])), [])

    def test_order(self):
        self.assertEqual(ordered(["bvh16", "embree", "bvh4", "octree"], "structure"), ["bvh4", "bvh16", "octree", "embree"])
        self.assertEqual(ordered(["avx512", "sse", "scalar", "avx2"], "isa"), ["scalar", "sse", "avx2", "avx512"])
        self.assertEqual(ordered(["diffuse", "primary"], "workload"), ["primary", "diffuse"])

    def test_axes_from_the_name(self):
        axes = axes_of({"name": "trace/bunny/bvh8/binned_sah/triangle8/watertight/padded/single/avx2/diffuse/threads:2"})
        self.assertEqual((axes["scene"], axes["isa"], axes["workload"], axes["threads"]), ("bunny", "avx2", "diffuse", "2"))
        self.assertEqual(axes_of({"name": build()["name"]})["workload"], "")

    def test_what_tells_cells_apart(self):
        cells = [Cell({"structure": s, "builder": b, "isa": i}) for s, b in (("bvh8", "x"), ("embree", "y")) for i in "ab"]
        self.assertEqual(swept_axes(cells), {"isa"})
        self.assertEqual(undetermined_axes(cells, ("structure", "builder", "isa")), ["structure", "isa"])
        self.assertEqual(Modes(cells).labels, ["one mode"])


class Loading(unittest.TestCase):
    def test_repetitions_are_one_cell(self):
        folder = Folder([trace(rate=r, repetition=k) for k, r in enumerate((1e6, 2e6, 9e6))] + [build()])
        results = load(folder.path)
        self.assertEqual(len(results.traces), 1)
        self.assertEqual(results.traces[0].value("rays_per_second"), 2e6)
        self.assertEqual(results.traces[0].per_million("wrong_answers"), 1000)
        self.assertEqual(results.structure_value(results.traces[0], "sah_cost"), 31.5)

    def test_aggregates_are_no_repetitions(self):
        aggregate = {**trace(rate=77.0), "run_type": "aggregate", "aggregate_name": "median"}
        self.assertEqual(load(Folder([trace(), aggregate]).path).traces[0].value("rays_per_second"), 10e6)
        self.assertEqual(load(Folder([aggregate]).path).traces[0].value("rays_per_second"), 77.0)

    def test_a_run_that_was_cut_off(self):
        cell = {k: v for k, v in trace().items() if not k.startswith("rays_per")}
        cell["repetitions"] = [{"rays_per_second": 1e6, "rays_per_cpu_second": 1e6}, {"rays_per_second": 3e6}]
        folder = Folder(files={"cells.jsonl": json.dumps(cell) + '\n{"name": "trace/bun'})
        results = load(folder.path)
        self.assertFalse(results.complete)
        self.assertEqual(results.traces[0].value("rays_per_second"), 2e6)
        self.assertEqual(folder.plot().returncode, 0)
        self.assertIn("--resume", (folder.path / "report.html").read_text())


class Hard(unittest.TestCase):
    def test_accuracy_is_of_hard_rays_and_time_of_ordinary_ones(self):
        results = load(Folder(whole() + hard()).path)
        points = hard_points(results, "rays_per_cpu_second")
        self.assertEqual({(c["workload"], h["workload"]) for c, _, h in points}, {("diffuse", "hard")})
        self.assertTrue(all(h["intersector"] == c["intersector"] and h["box"] == c["box"] for c, _, h in points))
        watertight = next(p for p in points if p[0]["intersector"] == "watertight")
        self.assertEqual(watertight[2].per_million("wrong_answers"), 10000)
        self.assertAlmostEqual(watertight[1], 1e9 / watertight[0].value("rays_per_cpu_second"))

    def test_accuracy_of_ordinary_rays_by_instruction_set(self):
        import matplotlib.pyplot as plt

        def points(wrong, error):
            rows = [other("primary", isa=i, structure=s, wrong_answers=wrong, t_error_ulp_p99=error) for i in ("sse", "avx2") for s in ("bvh4", "bvh8")]
            return [(c, 100.0) for c in load(Folder(rows).path).traces]

        for wrong, error, measure, said in ((3, 2.0, "wrong_answers", ""), (0, 2.0, "t_error_ulp_p99", "No wrong answer in 4 checked cells; upwards: the error of t"),
                                            (0, None, "wrong_answers", "No wrong answer in 4 checked cells")):
            with self.subTest(measure=measure, error=error):
                name, label, told = measure_of([c for c, _ in points(wrong, error)])
                self.assertEqual((name, told), (measure, said))
                figure = draw_workloads(points(wrong, error))
                self.assertEqual([a.get_title() for a in figure.axes], ["bunny, primary, sse", "bunny, primary, avx2"])
                self.assertEqual("".join(t.get_text() for t in figure.texts), said)
                self.assertEqual({a.get_ylabel() for a in figure.axes}, {label})
                plt.close(figure)

    def test_scenes_without_a_part_of_their_placing(self):
        self.assertEqual(without("ball:size=100:offset=1e4", "offset"), ("ball:size=100", True))
        self.assertEqual(without("ball:size=100", "offset"), ("ball:size=100", False))

    def test_a_panel_of_the_picture_is_a_test_with_both_boxes(self):
        cells = load(Folder(hard()).path).traces
        panels = by_test([c for c in cells if c["workload"] == "camera_edges"])
        self.assertEqual(list(panels), sorted(panels))
        self.assertEqual({k: list(v) for k, v in panels.items() if k[0] == ""}, {("", "a_new_one"): ["padded"], ("", "moller_trumbore"): ["fast"],
                                                                               ("", "watertight"): ["padded"]})

    def test_a_scale_with_a_place_for_zero(self):
        import matplotlib.pyplot as plt
        from style import log_with_zero, plain
        figure, axis = plt.subplots()
        axis.plot([1, 2, 3], [0, 15, 2e6])
        log_with_zero(axis, "y", [0, 15, 2e6])
        at = [axis.transData.transform((1, v))[1] for v in (0, 15, 2e6)]
        self.assertTrue(axis.bbox.y0 < at[0] < at[1] < at[2] < axis.bbox.y1)
        figure.canvas.draw()
        self.assertEqual([t.get_text() for t in axis.get_yticklabels()][:2], ["0", "10"])
        log_with_zero(axis, "x", [0, 0])
        log_with_zero(axis, "y", [0, 1.9e5, 2.3e5])  # within a decade: ticks between the powers of ten
        self.assertEqual(list(axis.get_yticks()), [0, 1e5, 2e5, 5e5])
        plt.close(figure)
        self.assertEqual([plain(v) for v in (0, 0.01, 1, 1000, 1e5, 2e5)], ["0", "0.01", "1", "1000", "$10^{5}$", r"$2\cdot10^{5}$"])


class Drawing(unittest.TestCase):
    def test_every_figure_of_whole_results(self):
        whole_folder = Folder(everything(), {"experiment": PUBLISHED, "plots": [n for n in ALL if n not in HARD]}, files={"effective.yaml": "experiment: quick\n"})
        hard_folder = Folder(hard() + [trace(intersector="watertight", rate=4e6)], {"plots": ["accuracy_vs_time", *HARD]}, files=SEEN)
        for folder in (whole_folder, hard_folder):
            done = folder.plot()
            self.assertEqual((done.returncode, done.stderr), (0, ""), done.stderr)
            for name in load(folder.path).context["plots"]:
                self.assertEqual((folder.path / f"{name}.png").read_bytes()[:4], b"\x89PNG", name)
                self.assertIn("</svg>", (folder.path / f"{name}.svg").read_text(), name)

    def test_published_ratios(self):
        folder = Folder(everything(), {"experiment": PUBLISHED})
        results = load(folder.path)
        table = json.loads((PLOTS / "published" / f"{PUBLISHED}.json").read_text())
        rows = [published_ratios.rows_of(results, c, "rays_per_cpu_second") for c in table["comparisons"]]
        self.assertEqual([len(r) for r in rows], [1, 1, 0])  # no hybrid was measured, and nothing on the dragon
        place, published, ours = rows[1][0]
        self.assertEqual(place, "crown\nprimary")
        self.assertAlmostEqual(published, 41.5 / 32.0)
        self.assertAlmostEqual(ours["bvh4"][0], 2.5, places=5)
        self.assertLessEqual(ours["bvh4"][1], 2.5)
        self.assertTrue(ours["bvh4"][3])  # each of these cells has a wrong answer
        self.assertIn("nothing published", Folder(whole()).plot("--no-report", "--only", "published_ratios").stdout)

    def test_thin_results_never_crash(self):
        cases = {
            "nothing": [],
            "one cell": [trace()],
            "one build": [build()],
            "embree alone": [trace("embree"), build("embree")],
            "no accuracy": [{k: v for k, v in trace().items() if k != "wrong_answers"}],
            "no field but the name": [{"name": trace()["name"], "rays_per_second": 1.0}],
            "zero rays and speed": [trace(rate=0.0, rays=0)],
            "not finite": [trace(rate=float("nan")), trace("bvh4"), build(sah_cost=float("inf"))],
            "text for a number": [trace(rate="fast"), trace("bvh4", wrong_answers="none")],
            "hard rays without ordinary ones": [other("hard", t_error_ulp_p99=1.0)],
            "one place": [other("hard_edge", "ball:offset=1", cracks=2, offset=1)],
            "leaks nowhere": [other("camera_edges", "ball", cracks=0, leak_points=[])],
            "one way": [other("diffuse", self_intersection="none", self_hits_per_million=1.0)],
            "strange names": [trace("$x_1$ <&>"), build("$x_1$ <&>"), trace("bvh8", intersector="$")],
        }
        for case, rows in cases.items():
            with self.subTest(case):
                folder = Folder(rows)
                done = folder.plot()
                self.assertEqual((done.returncode, done.stderr), (0, ""), f"{case}: {done.stderr}")
                self.assertTrue((folder.path / "report.html").is_file())
        self.assertIn("rays_per_second: left out, ", Folder([]).plot("--no-report").stdout)

    def test_report_is_well_formed_and_escaped(self):
        evil = "<script>alert(1)</script>&\"'"
        folder = Folder(everything() + [trace(evil)], {"experiment": PUBLISHED, "cpu": evil, "warnings": [evil], "command": f"./arboretum run {evil}", "git_revision": "abc"},
                        [{"name": evil, "reason": "no avx512"}, {"name": "b", "reason": "no avx512"}, {"name": "c", "reason": evil}],
                        {"effective.yaml": f"experiment: {evil}\n"})
        self.assertEqual(folder.plot().returncode, 0)
        page = (folder.path / "report.html").read_text()
        reader = Strict()
        reader.feed(page)
        self.assertEqual(reader.open, [])
        self.assertEqual(reader.tags.count("script"), 1)
        self.assertEqual(reader.tags.count("img"), len(ALL) - len(HARD))
        shown = "".join(reader.text)
        self.assertGreaterEqual(shown.count(evil), 6)
        self.assertEqual(shown.count(tables.SAH_STEP), 2)  # below both figures that set SAH costs side by side
        for words in ("25 50 25 0 0", "(2 cells)", "git checkout abc", "wrong per million", "× embree", "SAH cost: a visit of a node counts as one step whatever the number of its children"):
            self.assertIn(words, shown)
        self.assertNotIn("http", page.replace("http://www.w3.org", ""))

    def test_report_says_what_was_checked(self):
        unchecked = {k: v for k, v in other("primary").items() if k != "wrong_answers"}
        right = other("shadow", wrong_answers=0)
        for rows, cells, said in (
                ([unchecked, build()], "2 cells measured (1 of rays, 1 of builds)", "Answers were not checked."),
                ([right, right, build()], "2 cells measured (1 of rays, 1 of builds)", "No wrong answer in 1 checked cell."),
                ([right, unchecked], "2 cells measured,", "No wrong answer in 1 checked cell. <strong>The answers of 1 cell were not checked.</strong>"),
                ([right, unchecked, trace()], "3 cells measured,", "1 wrong answer, in 1 of 2 checked cells"),
                ([build()], "1 cell measured,", "No rays were traced.")):
            with self.subTest(said):
                results = load(Folder(rows).path)
                self.assertIn(cells, report.measured(results))
                self.assertIn(said, report.answers(results))
        self.assertNotIn("rong answer", report.answers(load(Folder([unchecked, build()]).path)))
        self.assertNotIn("not checked", report.answers(load(Folder([right]).path)))

    def test_only_some(self):
        folder = Folder(whole())
        self.assertEqual(folder.plot("--only", "sah_cost").returncode, 0)
        self.assertTrue((folder.path / "sah_cost.png").is_file())
        self.assertFalse((folder.path / "build_time.png").exists())
        self.assertFalse((folder.path / "report.html").exists())
        folder = Folder(whole(), {"plots": ["sah_vs_time"]})
        self.assertEqual(folder.plot().returncode, 0)
        self.assertEqual([p.stem for p in folder.path.glob("*.png")], ["sah_vs_time"])
        page = (folder.path / "report.html").read_text()
        for other_figure in ("sah_cost", "leak_picture"):  # one with data, one without
            self.assertIn("report.html: left as it is", folder.plot("--only", other_figure).stdout)
            self.assertEqual((folder.path / "report.html").read_text(), page)
        folder.plot("--only", "sah_cost,sah_vs_time")
        self.assertEqual((folder.path / "report.html").read_text().count("<img"), 2)

    def test_errors_are_one_line(self):
        cases = ((Folder(whole()), ["--only", "sah_costs"], "the nearest is 'sah_cost'"), (Folder(), [], "neither results.json"),
                 (Folder(files={"results.json": "{"}), [], "results.json: not the JSON"),
                 (Folder(files={"results.json": "[]"}), [], "results.json: not the JSON"))
        for folder, words, message in cases:
            with self.subTest(message):
                done = folder.plot(*words)
                self.assertEqual(done.returncode, 2)
                self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
                self.assertIn(message, done.stderr)


if __name__ == "__main__":
    unittest.main()
