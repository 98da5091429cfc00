"""Tests of plots/: figures from whole, thin and broken results, and a report that escapes what it shows."""

import json
import math
import re
import sys
import unittest
from html.parser import HTMLParser

sys.dont_write_bytecode = True

from made_results import HARD, PLOTS, PUBLISHED, SEEN, Drawn, Folder, build, everything, hard, other, trace, whole  # noqa: E402

import report  # noqa: E402
import style  # noqa: E402
import tables  # noqa: E402
import warned  # noqa: E402
from figures import ALL, accuracy_vs_time, lane_utilization, leak_picture, leaks_vs_aspect, leaks_vs_distance, published_ratios, rays_per_second, self_intersection, squares  # noqa: E402
from figures.accuracy_vs_time import draw_workloads, hard_points, measure_of  # noqa: E402
from figures.leak_lines import slots, wider, without  # noqa: E402
from figures.leak_picture import by_test, sizes  # noqa: E402
from figures.modes import Modes  # noqa: E402
from results import TooMuch, load  # noqa: E402


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


class Hard(Drawn):
    def test_accuracy_is_of_hard_rays_and_time_of_ordinary_ones(self):
        results = load(Folder(whole() + hard()).path)
        points = hard_points(results.traces, "rays_per_cpu_second")
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
                figure = draw_workloads(points(wrong, error), "(a clock)")
                self.assertEqual([a.get_title() for a in figure.axes], ["bunny, primary, sse", "bunny, primary, avx2"])
                self.assertEqual("".join(t.get_text() for t in figure.texts), said)
                self.assertEqual({a.get_ylabel() for a in figure.axes}, {label})
                plt.close(figure)

    def test_accuracy_is_of_one_number_of_threads_by_a_clock_that_is_named(self):
        for threads, clock in (((1,), "(thread CPU time)"), ((2,), "(wall time)"), ((1, 2, 4), "(wall time, 1 thread; not shown: 2, 4)"), ((4, 2), "(wall time, 2 threads; not shown: 4)")):
            for more, words in ((), "time, ns a ray"), ([other("hard", threads=min(threads), wrong_answers=3)], "time of primary rays, ns a ray"):
                rows = [other("primary", threads=t, wrong_answers=3) for t in threads] + list(more)
                figure = self.draw(accuracy_vs_time, load(Folder(rows).path))
                axes = [a for a in figure.axes if a.get_visible()]
                self.assertEqual({a.get_xlabel() for a in axes}, {f"{words}\n{clock}"})
                self.assertEqual(sum(line.get_marker() != "None" for line in axes[0].lines), 1)

    def test_bars_are_of_one_number_of_threads(self):
        for threads, label in (((1,), "Mray/s, thread CPU time"), ((2,), "Mray/s, wall time"), ((1, 2, 8), "Mray/s\n(wall time, 1 thread;\nnot shown: 2, 8)"), ((4, 2), "Mray/s\n(wall time, 2 threads;\nnot shown: 4)")):
            (axis,) = self.draw(rays_per_second, load(Folder([other("primary", threads=t, rate=1e6 * t) for t in threads]).path)).axes
            self.assertEqual((axis.get_ylabel(), [p.get_height() for p in axis.patches]), (label, [min(threads)]))

    def test_lanes_are_of_one_builder_and_leaf_which_is_said(self):
        def counted(lanes, **more):
            return other("primary", lane_utilization_by_depth=[lanes, 0.5], visits_by_depth=[1.0, 0.5], **more)

        def legend(figure):
            return [t.get_text() for t in figure.legends[-1].get_texts()]

        rows = [counted(0.1 * n, structure=s, builder=b, box=box) for s in ("bvh4", "bvh8") for n, (b, box) in enumerate((("ploc", "padded"), ("morton", "padded"), ("ploc", "fast")), 1)]
        for order in (rows, [*rows[3:], *rows[:3]]):
            figure = self.draw(lane_utilization, load(Folder(order).path))
            self.assertEqual([round(line.get_ydata()[0]) for line in figure.axes[0].lines], [10, 10])
            text = " ".join(" ".join(legend(figure)).split())
            self.assertIn("builder ploc; not shown: morton", text)
            self.assertIn("box padded; not shown: fast", text)
            self.assertNotIn("leaf", text)
        self.assertEqual(legend(self.draw(lane_utilization, load(Folder(rows[:1]).path))), ["one mode"])
        # Where the first has no cell, nothing else takes its place.
        figure = self.draw(lane_utilization, load(Folder([*rows[:2], counted(0.4, scene="city", structure="bvh4", builder="morton")]).path))
        self.assertEqual([[round(line.get_ydata()[0]) for line in axis.lines] for axis in figure.axes if axis.get_visible()], [[10]])

    def test_every_structure_has_a_sign_of_its_own(self):
        for more in ((), [other("hard", structure=s) for s in style.COLOURS]):
            figure = self.draw(accuracy_vs_time, load(Folder([other("primary", structure=s) for s in style.COLOURS] + list(more)).path))
            signs = [line.get_marker() for line in figure.axes[0].lines if line.get_marker() != "None"]
            self.assertEqual((len(signs), len(set(signs))), (15, 15))
            self.assertEqual([t.get_text() for t in figure.legends[-1].get_texts()], ["padded boxes: filled"])
        with self.assertRaisesRegex(TooMuch, "16 structures are too many to tell apart"):
            accuracy_vs_time.draw(load(Folder([other("primary", structure=s) for s in (*style.COLOURS, "a_new_one")]).path))

    def test_panels_that_would_be_empty_are_left_out(self):
        rows = [other(w, s, isa=i, wrong_answers=0, **({} if w == "shadow" else {"t_error_ulp_p99": 1.5})) for s in ("bunny", "city") for w in ("primary", "shadow", "diffuse")
                for i in ("sse", "avx2") if (s, w) != ("city", "primary")]
        figure = self.draw(accuracy_vs_time, load(Folder(rows).path))
        titles = [a.get_title() for a in figure.axes if a.get_visible()]
        self.assertEqual(titles, ["bunny, primary, sse", "bunny, primary, avx2", "bunny, diffuse, sse", "bunny, diffuse, avx2", "city, diffuse, sse", "city, diffuse, avx2"])
        self.assertTrue(all(a.lines for a in figure.axes if a.get_visible()))

    def test_panels_of_hard_rays_stand_beside_each_other(self):
        rows = [other(w, f"scene{k}", wrong_answers=1, t_error_ulp_p99=0.5) for k in range(4) for w in ("primary", "hard")]
        figure = self.draw(accuracy_vs_time, load(Folder(rows).path))
        self.assertEqual([len({round(getattr(a.get_position(), edge), 3) for a in figure.axes}) for edge in ("x0", "y0")], [4, 2])
        self.assertEqual([a.get_title() for a in figure.axes][:4], ["scene0, avx2", "scene0, avx2", "scene1, avx2", "scene1, avx2"])

    def test_labels_of_leaving_a_surface_do_not_overlap_and_scenes_without_are_named(self):
        rows = [other(f"diffuse:self_intersection={way}", "ball", self_intersection=way, self_hits_per_million=hits, near_hits_per_million=0.0, leaks_per_million=0.0)
                for way, hits in (("none", 4.9e5), ("epsilon", 9.9e5), ("exclusion", 0.0))]
        figure = self.draw(self_intersection, load(Folder([*rows, other("primary", "city"), other("primary", "forest")]).path))
        figure.draw_without_rendering()
        for axis in figure.axes:
            ticks = [t.get_window_extent() for t in axis.get_xticklabels() if t.get_text()]
            self.assertGreater(len(ticks), 1)
            self.assertFalse([a for a, b in zip(ticks, ticks[1:]) if a.overlaps(b)])
        self.assertEqual(figure._supxlabel.get_text(), "not shown, as no secondary rays were measured: city, forest")

    def test_an_axis_has_two_labels_at_least(self):
        for cracks in ((10, 30, 10), (1, 1, 1), (1000, 9, 0)):
            rows = [other("hard_edge", f"ball:stretch={x}", cracks=c, rays=10**6, triangle_aspect_median=a) for x, c, a in zip((1, 2, 3), cracks, (2.07, 3.1, 5.0))]
            (axis,) = self.draw(leaks_vs_aspect, load(Folder(rows).path)).axes
            axis.figure.draw_without_rendering()
            for ticks, (low, high) in ((axis.xaxis, axis.get_xlim()), (axis.yaxis, axis.get_ylim())):
                labels = [t.label1.get_text() for t in ticks.get_major_ticks() if low <= t.get_loc() <= high and t.label1.get_text() != "0"]
                self.assertGreater(len(set(labels)), 1, (cracks, labels))

    def test_scenes_without_a_part_of_their_placing(self):
        self.assertEqual(without("ball:size=100:offset=1e4", "offset"), ("ball:size=100", True))
        self.assertEqual(without("ball:size=100", "offset"), ("ball:size=100", False))

    def test_a_panel_of_the_picture_is_a_test_with_both_boxes(self):
        cells = load(Folder(hard()).path).traces
        panels = by_test([c for c in cells if c["workload"] == "camera_edges"])
        self.assertEqual(list(panels), sorted(panels))
        self.assertEqual({k: list(v) for k, v in panels.items() if k[0] == ""}, {("", "a_new_one"): ["padded"], ("", "moller_trumbore"): ["fast"],
                                                                               ("", "watertight"): ["padded"]})

    def test_every_box_test_of_a_leak_is_drawn_and_in_the_legend(self):
        for boxes in (["fast", "ize", "padded"], ["ize"], ["fast", "padded"], ["ize", "padded", "a_new_one"]):
            rows = [other("hard_edge", f"ball:offset={x}", box=b, cracks=3 * x, offset=x, radius=1.0) for b in boxes for x in (1, 100)]
            figure = self.draw(leaks_vs_distance, load(Folder(rows).path))
            legend = [t for each in figure.legends for t in each.get_texts()][1:]
            self.assertEqual([t.get_text() for t in legend], [b for b in ("fast", "ize", "padded", "a_new_one") if b in boxes])
            handles = [h.get_linestyle() for h in figure.legends[1].get_lines()]
            self.assertEqual(len(set(handles)), len(boxes))
            self.assertEqual(set(handles), {line.get_linestyle() for line in figure.axes[0].lines if len(line.get_xdata()) == 2 and line.get_marker() == "o"})
            rows = [other("camera_edges", "ball", box=b, cracks=k, rays=1000000, leak_points=[[3.5, 4]]) for k, b in enumerate(boxes)]
            figure = self.draw(leak_picture, load(Folder(rows, files=SEEN).path))
            drawn = [(line.get_color(), line.get_markersize()) for line in figure.axes[0].lines[1:]]
            self.assertEqual((len(drawn), len(set(drawn))), (len(boxes), len(boxes)))
            self.assertEqual([t.get_text() for t in figure.legends[0].get_texts()], [f"{b} boxes" for b in sizes(boxes)])
            self.assertTrue(all(f"{b} {k}" in figure.axes[0].get_title() for k, b in enumerate(boxes)))

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
        self.assertEqual([plain(v) for v in (0, 0.01, 1, 1000, 1e5, 2e5, 1e-12)], ["0", "0.01", "1", "1000", "10⁵", "2·10⁵", "10⁻¹²"])


class Drawing(Drawn):
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
        rows = [published_ratios.rows_of(results, c) for c in table["comparisons"]]
        # no hybrid and no Morton build was measured, and nothing on the dragon; three numbers of children are published
        self.assertEqual([len(r) for r in rows], [1, 1, 0, 0, 3])
        row = rows[1][0]
        self.assertEqual(row.name, "crown\nprimary")
        self.assertEqual(row.published, (41.5 / 32.0,) * 2)
        self.assertAlmostEqual(row.ours["bvh4"][0], 2.5, places=5)
        self.assertLessEqual(row.ours["bvh4"][1], 2.5)
        self.assertTrue(row.ours["bvh4"][3])  # each of these cells has a wrong answer
        self.assertEqual([(r.name, r.published[0], r.ours["bvh4"][0]) for r in rows[4]],
                         [("none\ncrown\nprimary", 0.2, 0.25), ("one\ncrown\nprimary", 0.5, 0.5), ("two\ncrown\nprimary", 0.2, 0.25)])
        self.assertIn("nothing published", Folder(whole()).plot("--no-report", "--only", "published_ratios").stdout)

    def test_published_ratios_of_any_axis_and_quantity(self):
        rows = [other("diffuse", structure="bvh2", builder=b, rate=r) for b, r in (("binned_sah", 4e6), ("sweep_sah", 5e6))]
        rows += [other("diffuse", "city", structure="kdtree", rate=2e6), other("diffuse", "city", structure="bvh2", rate=8e6)]
        rows += [{**build("bvh2", b, sah_cost=s, bytes=n), "name": f"build/bunny/bvh2/{b}/triangle8/-/-/-/avx2/-/threads:1"} for b, s, n in (("binned_sah", 20.0, 100), ("sweep_sah", 15.0, 150))]
        results = load(Folder(rows).path)

        def ratios(published, **comparison):
            comparison = {"of": {"builder": "sweep_sah"}, "to": {"builder": "binned_sah"}, "series": ["bvh2"], **comparison}
            return [(r.name, r.published, *(round(v[0], 6) for v in r.ours.values())) for r in published_ratios.rows_of(results, {**comparison, "published": published})]

        self.assertEqual(ratios([{"value": [1.1, 1.3]}]), [("bunny\ndiffuse", (1.1, 1.3), 1.25)])
        self.assertEqual(ratios([{}], quantity="time"), [("bunny\ndiffuse", None, 0.8)])
        self.assertEqual(ratios([{"label": "SAH cost", "quantity": "sah_cost", "of": 3, "to": 4}, {"quantity": "bytes"}, {"quantity": "epo", "scene": "city"}]),
                         [("SAH cost\nbunny", (0.75, 0.75), 0.75), ("bunny", None, 1.5)])
        self.assertEqual(ratios([{}], of={"structure": "kdtree"}, to={"structure": "bvh2"}, series=["kdtree"]), [("city\ndiffuse", None, 0.25)])
        self.assertEqual(ratios([{}], of={}, to={}, series=[{"name": "ours", "structure": "bvh2", "of": {"builder": "binned_sah"}, "to": {"builder": "sweep_sah"}}]),
                         [("bunny\ndiffuse", None, 0.8)])

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
            "dollars that are no formula": [row | {"scene": "odd/cost_$5_and_$6.ply", "name": row["name"].replace("bunny", "$5_and_$6")} for row in
                                            (trace(rate=9e6), trace("bvh4"), build("bvh8", "ploc_$5_and_$6"), build("bvh4"))],
        }
        for case, rows in cases.items():
            with self.subTest(case):
                folder = Folder(rows)
                done = folder.plot()
                self.assertEqual((done.returncode, done.stderr), (0, ""), f"{case}: {done.stderr}")
                self.assertTrue((folder.path / "report.html").is_file())
        self.assertIn("rays_per_second: left out, ", Folder([]).plot("--no-report").stdout)

    def test_a_figure_that_was_named_and_is_left_out_is_told_where_run_does_not_hide_it(self):
        counted = {"lane_utilization_by_depth": [1.0, 0.75], "visits_by_depth": [1.0, 0.5]}
        rows = [other("primary", traversal=f"mode{k}", **counted) for k in range(len(style.MARKERS) + 1)]
        done = Folder(rows, {"plots": ["sah_cost", "lane_utilization"]}).plot("--no-report")
        self.assertEqual((done.returncode, done.stderr), (0, "lane_utilization: left out, 11 modes are too many to tell apart; choose some with --filter\n"))
        few = Folder(rows[1:], {"plots": ["lane_utilization"]})
        self.assertEqual(few.plot("--no-report").stderr, "")
        self.assertTrue((few.path / "lane_utilization.png").is_file())

    def test_a_figure_that_fails_takes_no_other_with_it(self):
        rows = whole() + [other("camera_edges", "ball", cracks=1, leak_points=[[3.5]])]  # a point of one coordinate
        folder = Folder(rows, {"plots": ["sah_cost", "leak_picture", "build_time"]}, files=SEEN)
        (folder.path / "leak_picture.png").write_bytes(b"of an earlier run")
        done = folder.plot()
        self.assertEqual((done.returncode, done.stderr), (3, "error: could not be drawn: leak_picture: IndexError: list index out of range\n"))
        self.assertEqual(sorted(p.stem for p in folder.path.glob("*.png")), ["build_time", "sah_cost"])
        page = (folder.path / "report.html").read_text()
        self.assertIn("Not drawn: an error of the figure&#x27;s own, IndexError: list index out of range.", page)
        self.assertEqual(page.count("<img"), 2)

    def test_characters_without_a_glyph_are_told_in_one_line(self):
        done = Folder([row | {"scene": "日本語"} for row in (trace("bvh8"), trace("bvh4"))]).plot("--no-report")
        self.assertEqual(done.returncode, 0)
        self.assertIn(done.stderr, ("", "warning: no font here has 日本語, which figures show as boxes; fonts-noto-cjk has Chinese, Japanese and Korean\n"))

    def test_fonts_that_are_installed_are_asked_for_what_the_first_lacks(self):
        self.assertEqual(style.font_families({"IPAGothic", "Noto Sans CJK JP", "cmr10"}), ["DejaVu Sans", "Noto Sans CJK JP", "IPAGothic"])
        self.assertEqual(style.font_families(set()), ["DejaVu Sans"])
        self.assertEqual(style.plt.rcParams["font.family"][0], "DejaVu Sans")

    def test_warnings_are_lines_that_are_said_once(self):
        messages = ["Glyph 26085 (\\N{CJK UNIFIED IDEOGRAPH-65E5}) missing from current font."] * 2 + ["two\nlines"] * 2
        told = warned.lines_of("a", messages)
        self.assertEqual([line.split(",")[0] for line in told], ["warning: no font here has 日", "warning: a: two lines"])
        self.assertEqual(warned.lines_of("b", messages), [])

    def test_the_report_shows_what_auto_chose_and_what_rays_share(self):
        shared = {"packet_share": 0.0, "stream_share": 0.75, "queued_share": 0.0, "single_share": 0.25, "rays_per_node_visit": 5.625,
                  "rays_per_leaf_visit": 3.375, "interval_tests_per_ray": 1.875}
        folder = Folder([other("diffuse", traversal="auto", **shared), other("primary")], {"plots": []})
        self.assertEqual(folder.plot().returncode, 0)
        report = (folder.path / "report.html").read_text()
        for label in ("rays in packets", "rays in streams", "rays in flight", "rays singly", "rays/node visit", "rays/leaf visit", "interval tests/ray"):
            self.assertIn(f">{label}<", report)
        for value in shared.values():
            self.assertIn(f'data-v="{value!r}"', report)

    def test_colours_of_a_figure_are_distinct(self):
        phases = ("top", "moving_boxes", "instances", "a new phase")
        for palette, names in ((style.part_colour, phases + tuple(style.PART_COLOURS)), (style.colour, ("ab", "ba", *style.COLOURS)),
                               (style.intersector_colour, ("ab", "ba", *style.INTERSECTOR_COLOURS))):
            fresh = style.Palette(palette.own, palette.spare)
            self.assertEqual(len({fresh(name) for name in names}), len(names))
            self.assertEqual([fresh(name) for name in names], [fresh(name) for name in names])

    def test_titles_of_neighbouring_panels_do_not_overlap(self):
        rows = [other(f"{workload}:self_intersection={way}", scene) for scene in ("suzanne", "a_scene_with_a_name_that_is_long:offset=1e4")
                for workload in ("ambient_occlusion", "diffuse", "shadow") for way in ("none", "integer_offset", "error_bound")]
        figure = rays_per_second.draw(load(Folder(rows).path))
        figure.draw_without_rendering()
        boxes = [axis.title.get_window_extent() for axis in figure.axes if axis.get_visible()]
        self.assertEqual(len(boxes), len(rows))
        self.assertFalse([(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)])
        style.plt.close(figure)

    def test_a_figure_that_would_be_too_tall_is_wider(self):
        workloads = ("primary", "shadow", "ambient_occlusion", "reflection", "diffuse", "random", "whitted", "path")
        results = load(Folder([other(w, f"a_scene_of_a_long_name_{k}", structure=s, isa=i, wrong_answers=0, **({} if w in ("shadow", "ambient_occlusion") else {"t_error_ulp_p99": 1.5})) for k in range(7) for w in workloads
                               for s in ("bvh8", "bvh4_motion") for i in ("avx2", "avx512") if (w, i) != ("random", "avx512")]).path)
        few = load(Folder([other(w, f"scene{k}", wrong_answers=0) for k in range(3) for w in workloads]).path)
        for module, held, columns in ((rays_per_second, results, 4), (accuracy_vs_time, results, 6), (rays_per_second, few, 3)):
            figure = self.draw(module, held)
            figure.draw_without_rendering()
            panels = [axis for axis in figure.axes if axis.get_visible()]
            self.assertEqual(len(panels), {(rays_per_second, 7): 56, (accuracy_vs_time, 7): 77, (rays_per_second, 3): 24}[module, 7 if held is results else 3])
            self.assertLessEqual(figure.get_size_inches()[0], style.WIDEST)
            self.assertTrue(style.fits(figure.get_size_inches()[1]))
            self.assertEqual(len({round(axis.get_subplotspec().colspan.start, 3) for axis in panels}), columns)
            boxes = [axis.title.get_window_extent() for axis in panels]
            self.assertFalse([(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)])

    def test_leaks_of_zero_are_drawn_in_a_band_of_their_own_each_line_apart(self):
        rows = [other("hard_edge", f"ball:offset={x:g}", cracks=cracks if x > 1 else 0, offset=x, radius=1.0, intersector=i)
                for i, cracks in (("watertight", 0), ("exact", 0), ("pluecker", 3)) for x in (1, 10, 1e4)]
        results = load(Folder(rows).path)
        figure = leaks_vs_distance.draw(results)
        axis = figure.axes[0]
        figure.draw_without_rendering()
        leaks = math.log10(max(cell.per_million("cracks") for cell in results.traces))
        least = math.floor(leaks)
        lines = sorted(tuple(line.get_ydata()) for line in axis.lines if len(line.get_xdata()) == 3)
        zeros = [y for line in lines for y in line if y < least]
        self.assertEqual((len(lines), len(zeros), len(set(zeros))), (3, 7, 3))
        self.assertTrue(axis.get_ylim()[0] < min(zeros) and max(zeros) < least)
        labels = dict(zip(axis.get_yticks(), (t.get_text() for t in axis.get_yticklabels())))
        self.assertEqual([label for y, label in labels.items() if y < least], ["0"])
        self.assertTrue(all(label != "0" for y, label in labels.items() if y >= least))
        self.assertAlmostEqual(max(y for line in lines for y in line), leaks)
        style.plt.close(figure)

    def test_lines_of_leaks_beneath_others_are_wider(self):
        self.assertEqual(slots([{0: 0, 1: 0}, {0: 2, 1: 5}, {1: 0, 2: 0}]), [0.25, 0.5, 0.75])
        self.assertEqual(wider([{0: 1, 1: 2, 2: 3}, {0: 7, 1: 2, 2: 3}, {0: 1, 1: 2, 2: 3}, {0: 0, 1: 0}]), [2, 1, 0, 0])
        self.assertEqual(wider([{0: 0, 1: 0}] * 3), [0, 0, 0])

    def test_leaks_of_a_scene_that_stands_at_the_origin_are_drawn(self):
        rows = [other("hard_edge", f"ball:offset={x:g}", cracks=2, offset=x, radius=1.0) for x in (0, 1, 1e4)]
        figure = leaks_vs_distance.draw(load(Folder(rows).path))
        self.assertEqual([list(line.get_xdata()) for line in figure.axes[0].lines if len(line.get_xdata()) == 3], [[0, 1, 1e4]])
        self.assertIn(0, figure.axes[0].get_xticks())
        low, high = figure.axes[0].get_xlim()
        self.assertTrue(low < 0 and high > 1e4)
        style.plt.close(figure)

    def test_no_checkout_of_an_unknown_revision(self):
        for revision, told in (("unknown", False), ("", False), ("abc", True), ("abc | def", False)):
            page = report.reproduce(load(Folder(whole(), {"git_revision": revision}).path))
            self.assertEqual("git checkout" in page, told)
            self.assertEqual("of several revisions: <code>abc | def</code>" in page, "|" in revision)

    def test_what_is_repeated_is_measured_anew(self):
        for command, shown in (("arboretum run a.yaml --resume --filter 'a|b'", "./arboretum run a.yaml --filter &#x27;a|b&#x27;"),
                               ("arboretum run a.yaml --filter it's --resume", "./arboretum run a.yaml --filter it&#x27;s --resume")):
            self.assertIn(f"{shown}</pre>", report.reproduce(load(Folder(whole(), {"command": command}).path)))

    def test_a_tree_with_changes_is_said(self):
        for dirty, said in ((True, True), ("false | true", True), (False, False)):
            self.assertEqual("cannot be repeated exactly" in report.reproduce(load(Folder(whole(), {"git_dirty": dirty}).path)), said, dirty)

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

    def test_report_says_what_scenes_lost(self):
        scenes = {"half": {"triangles": 528, "dropped_in_words": "dropped 528 of 1056 triangles: 528 out of range", "warnings": ["a.mtl: <odd>"]}, "whole": {"triangles": 1}}
        folder = Folder(whole(), {"scenes": scenes})
        self.assertEqual(report.scene_facts(scenes), [("half", "528 triangles; dropped 528 of 1056 triangles: 528 out of range; a.mtl: <odd>"), ("whole", "1 triangle")])
        page = report.write(load(folder.path), []).read_text()
        self.assertIn("528 out of range; a.mtl: &lt;odd&gt;</td>", page)
        self.assertEqual(page.count("out of range"), 1)

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

    def test_report_writes_wrong_answers_as_figures_do(self):
        results = load(Folder([trace(rays=1000000, wrong_answers=171819, missed_hits=12), trace("bvh4", rays=1000000, wrong_answers=0, missed_hits=0)]).path)
        for table in (tables.throughput_table(results), tables.best_table(results)):
            self.assertIn(">172,000</td>", table)
            self.assertNotIn("e+05", table)
        self.assertEqual(style.wrong_text(results.traces[0]), "172,000")
        self.assertEqual([tables.per_million_text(v) for v in (0, 0.123, 12.3, 999.6)], ["0", "0.12", "12", "1,000"])

    def test_report_shows_the_share_of_hits_where_rays_hit_nothing(self):
        some = tables.throughput_table(load(Folder([trace(hits=250)]).path))
        self.assertNotIn("rays that hit", some)
        none = tables.throughput_table(load(Folder([trace(hits=250), trace("bvh4", hits=0)]).path))
        self.assertIn("rays that hit, %", none)
        self.assertIn('data-v="25.0"', none)

    def test_answers_of_pictures_are_of_the_rays_that_were_checked(self):
        picture = other("whitted", rays=4000, checked_rays=1000, wrong_answers=5, hits=250)
        results = load(Folder([picture, other("primary", rays=4000, wrong_answers=4, hits=0)]).path)
        whitted, primary = results.traces
        self.assertEqual((whitted.per_million("wrong_answers"), primary.per_million("wrong_answers")), (5000, 1000))
        self.assertEqual((whitted.hit_share(), primary.hit_share()), (25, 0))
        table = tables.throughput_table(results)
        self.assertIn(">5,000</td>", table)
        self.assertIn('data-v="25.0"', table)

    def test_the_clock_stands_in_the_heads_of_columns_and_at_axes(self):
        for threads, clock in ((1, "thread CPU time"), (2, "wall time")):
            ways = [other(f"diffuse:self_intersection={way}", threads=threads, self_intersection=way, self_hits_per_million=1.0) for way in ("none", "exclusion")]
            results = load(Folder(ways).path)
            self.assertIn(f">Mray/s, {clock}</button>", tables.best_table(results))
            self.assertIn(f">Mray/s, {clock}</button>", tables.throughput_table(results))
            self.assertIn(f">ns/ray, {clock}</button>", tables.throughput_table(results))
            self.assertEqual(self.draw(self_intersection, results).axes[-1].get_xlabel(), f"time, ns a ray\n({clock})")

    def test_that_nothing_of_ours_was_traced_is_said(self):
        for rows, said in (([trace("embree")], "No structure of ours was traced."), ([build()], "No cell has a throughput."), ([trace("embree", rate=0.0)], "No cell has a throughput.")):
            self.assertEqual(tables.best_table(load(Folder(rows).path)), f"<p>{said}</p>")

    def test_the_report_leads_to_all_of_its_parts(self):
        for context, parts in (({}, 7), ({"scenes": {"bunny": {"triangles": 1}}}, 8)):
            page = report.write(load(Folder(whole(), context).path), []).read_text()
            targets = re.findall(r'<a href="#([\w-]+)">', page)
            self.assertEqual(targets, re.findall(r'<h2 id="([\w-]+)"', page))
            self.assertEqual(len(targets), parts)

    def test_captions_speak_of_squares_where_there_are_some(self):
        def cell(structure, axis, k):
            axes = {"builder": "binned_sah", "leaf": "triangle8", axis: f"triangle{k}"}
            return build(structure, axes["builder"], sah_cost=10.0 + k, leaf=axes["leaf"]) | {"name": f"build/bunny/{structure}/{axes['builder']}/{axes['leaf']}/-/-/-/avx2/-/threads:1"}

        for few, axis in ((True, "builder"), (False, "builder"), (False, "leaf")):
            folder = Folder([cell(s, axis, k) for s in ("bvh2", "bvh4", "bvh8", "bvh16", "bih") for k in range(1, 4 if few else 10)], {"plots": ["sah_cost"]})
            self.assertEqual(folder.plot().returncode, 0)
            caption = re.search(r"<figcaption>(.*?)</figcaption>", (folder.path / "report.html").read_text()).group(1)
            self.assertEqual(re.findall(r"more than 40 bars, there is a square for each structure and (\w+) instead", caption), [] if few else [axis], caption)
        self.assertIn("and builder instead, in a row for each leaf or instruction set that makes a difference:", squares.caption("builder", ["leaf", "isa"]))

    def test_one_thread_is_one(self):
        cells = load(Folder([trace(), trace(threads=2, run_name="trace/two")]).path).traces
        self.assertEqual(Modes(cells).labels, ["1 thread", "2 threads"])

    def test_report_says_how_embree_was_built(self):
        stream = trace("embree", traversal="stream_coherent")
        stream["run_name"] = stream["name"] = stream["name"].replace("/single/", "/stream_coherent/")
        for rows, context, notes, said, unsaid in (
                ([trace(), build()], {"embree": "Intel Embree 3.13.5"}, 0, (), ("assertions", "3.13.5, as it is installed")),
                ([trace(), trace("embree")], {"embree": "Intel Embree 3.13.5"}, 0, ("embree: Intel Embree 3.13.5, as it is installed.",), ("12 % on streams", "_incoherent both")),
                ([trace(), build("embree")], {}, 0, ("embree: as it is installed.",), ("_incoherent both",)),
                ([trace(), stream, build("embree")], {}, 3, ("_incoherent both", "12 % on streams"), ())):
            with self.subTest(said=said):
                folder = Folder(rows, context)
                self.assertEqual(folder.plot().returncode, 0)
                page = (folder.path / "report.html").read_text(encoding="utf-8")
                self.assertEqual(page.count("keeps its assertions on"), notes)  # of streams: fastest, figures, all cells
                for words in said:
                    self.assertIn(words, page)
                for words in unsaid:
                    self.assertNotIn(words, page)

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
