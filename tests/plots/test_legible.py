"""Tests of plots/: what figures say can be read, and says what was measured."""

import html
import importlib
import json
import math
import sys
import unittest

sys.dont_write_bytecode = True

from made_results import SEEN, Drawn, Folder, build, hard, other, whole  # noqa: E402

from matplotlib.colors import to_rgb  # noqa: E402

import machine  # noqa: E402
import ratios  # noqa: E402
import report  # noqa: E402
import style  # noqa: E402
import tables  # noqa: E402
from figures import (ALL, epo, lane_utilization, leak_picture, rays_by_builder, rays_per_second, sah_cost, sah_vs_time, self_intersection, squares, traversal_ratios,  # noqa: E402
                     visits_per_ray)
from results import AXES, load  # noqa: E402


class Labels(Drawn):
    def assert_apart(self, texts):
        boxes = [box for t in texts if (box := t.get_window_extent()).width]
        self.assertFalse([(i, k) for i, one in enumerate(boxes) for k in range(i) if one.overlaps(boxes[k])])

    def test_ticks_of_a_logarithmic_axis_are_apart_however_wide_its_span(self):
        for low in (3, 13, 70, 130, 1300):
            for span in (2, 8, 30, 60, 200, 600, 3000):
                rows = [other(f"diffuse:self_intersection={way}", self_intersection=way, self_hits_per_million=0.0, rate=1e9 / time)
                        for way, time in (("none", low), ("epsilon", low * span))]
                figure = self.draw(self_intersection, load(Folder(rows).path))
                figure.draw_without_rendering()
                ticks = [t for t in figure.axes[-1].get_xticklabels() if t.get_text()]
                self.assertGreater(len(ticks), 1)
                self.assert_apart(ticks)
                style.plt.close(figure)

    def test_logarithmic_axes_of_any_size_have_labels_with_room_between_them(self):
        for width, height in ((1.3, 1.0), (2.0, 1.8), (4.0, 3.0)):
            figure, axis = style.plt.subplots(figsize=(width + 0.6, height + 0.6))
            figure.subplots_adjust(0.4 / (width + 0.6), 0.4 / (height + 0.6), 1 - 0.2 / (width + 0.6), 1 - 0.2 / (height + 0.6))
            for low in (0.0013, 1, 130, 210, 96e3):
                for span in (1, 1.3, 2, 3.3, 5, 9, 40, 1e3, 1e9):
                    for which in "xy":
                        style.log_axis(axis, which, [low, low * span])
                    figure.draw_without_rendering()
                    for ticks, edges, room in ((axis.xaxis, ("x1", "x0"), 0.6), (axis.yaxis, ("y1", "y0"), 0.3)):
                        shown = [t.label1 for t in ticks.get_major_ticks() if t.label1.get_text()]
                        boxes = [text.get_window_extent() for text in shown]
                        gaps = [getattr(b, edges[1]) - getattr(a, edges[0]) for a, b in zip(boxes, boxes[1:])]
                        words = (width, low, span, [text.get_text() for text in shown])
                        self.assertGreater(len(set(words[-1])), 0 if min(width, height) < 1.5 else 1, words)
                        self.assertEqual(len(set(words[-1])), len(words[-1]), words)
                        self.assertGreater(min(gaps, default=99), room * shown[0].get_size() * figure.dpi / 72, words)
            style.plt.close(figure)

    def test_markers_of_ways_of_leaving_a_surface_do_not_hide_each_other(self):
        for scenes, intersectors, workloads in ((1, 1, 1), (1, 3, 4), (3, 3, 4), (2, 10, 4)):
            rows = [other(f"{w}:self_intersection={way}", f"scene{s}", intersector=f"i{i}", self_intersection=way, self_hits_per_million=float(way == "none"),
                          near_hits_per_million=0.0, leaks_per_million=0.0)
                    for s in range(scenes) for i in range(intersectors) for w in ("shadow", "ambient_occlusion", "reflection", "diffuse")[:workloads] for way in self_intersection.WAYS]
            figure = self.draw(self_intersection, load(Folder(rows).path))
            figure.draw_without_rendering()
            self.assertEqual(len(figure.axes), 2 * scenes)  # of the fault that some ray has, and of time
            self.assertEqual([t.get_text() for t in figure.legends[-1].get_texts()], ["neighbour met too early", "passed through"])
            for axis in figure.axes:
                at = sorted(axis.transData.transform((0, line.get_ydata()[0]))[1] for line in axis.lines if line.get_marker() != "None")
                self.assertEqual(len(at), intersectors * workloads * len(self_intersection.WAYS))
                size = (self_intersection.SIZE - 0.1) * figure.dpi / 72
                self.assertGreater(min(b - a for a, b in zip(at, at[1:])), 0.97 * size)

    def test_panels_of_ratios_are_as_tall_as_their_rows(self):
        for wrong, name in ((0, "bunny"), (1, "a_scene_with_a_name_that_is_long")):
            rows = [other(w, name + s, isa=i, structure="bvh8", traversal=f"queued{k}" if k else "single", wrong_answers=wrong) for i, count in (("sse", 2), ("avx2", 7), ("avx512", 30))
                    for k in range(count) for w in ("primary", "diffuse") for s in ("", "2")]
            figure = self.draw(traversal_ratios, load(Folder(rows).path))
            figure.draw_without_rendering()
            heights = [a.get_window_extent().height / figure.dpi / n for a, n in zip(figure.axes, (2, 7, 30))]
            self.assertTrue(all(abs(h - traversal_ratios.ROW) < 0.04 for h in heights), heights)

    def test_heads_of_a_single_scene_are_apart_beside_long_names_of_rows(self):
        rows = [other(w, builder=f"binned_sah:bins={bins}", intersector=i, box="padded", traversal=t) for w in ("primary", "ambient_occlusion", "diffuse")
                for bins in (16, 32) for i in ("moller_trumbore_double", "watertight") for t in ("single", "stream_incoherent")]
        for workloads in (("primary", "diffuse"), ("primary", "ambient_occlusion")):
            figure = self.draw(traversal_ratios, load(Folder([r for r in rows if r["workload"] in workloads]).path))
            figure.draw_without_rendering()
            heads = [t for t in figure.axes[0].texts if "…" in t.get_text()]
            self.assertEqual(["".join(t.get_text().split("\n…")[0].split()) for t in heads], list(workloads))
            self.assert_apart([*heads, figure.axes[0]._left_title, figure.axes[1].title])

    def test_keys_are_written_as_configurations_have_them(self):
        figure = self.draw(rays_per_second, load(Folder([other("ambient_occlusion")]).path))
        self.assertEqual(figure.axes[0].get_title(), "bunny, ambient_occlusion")
        self.assertEqual(style.panel_title("city", "diffuse:self_intersection=integer_offset", 1.6), "city,\ndiffuse:\nself_intersection=\ninteger_offset")
        rows = [other(f"ambient_occlusion:self_intersection={way}", self_intersection=way, self_hits_per_million=0.0) for way in ("none", "error_bound")]
        figure = self.draw(self_intersection, load(Folder(rows).path))
        self.assertEqual([t.get_text() for t in figure.axes[0].get_yticklabels()], ["none", "error_bound"])
        self.assertEqual([t.get_text() for t in figure.legends[1].get_texts()], ["ambient_occlusion"])

    def test_modes_are_told_apart_or_else_their_traversal(self):
        def rows(traversals, intersectors):
            return [other("primary", traversal=f"single{t}", intersector=f"i{i}", wrong_answers=0) for t in range(traversals) for i in range(intersectors)]

        for many, title, labels in ((rows(style.MOST_MODES, 1), "mode", [f"single{t}" for t in range(style.MOST_MODES)]),
                                    (rows(2, style.MOST_MODES), f"traversal, of {2 * style.MOST_MODES} modes", ["single0", "single1"]),
                                    (rows(1, style.MOST_MODES + 1), "mode", [f"each of {style.MOST_MODES + 1}"])):
            figure = self.draw(rays_per_second, load(Folder(many).path))
            legend = figure.legends[1]
            self.assertEqual((legend.get_title().get_text(), [t.get_text() for t in legend.get_texts()]), (title, labels))
            looks = [{(line.get_marker(), line.get_markerfacecolor()) for line in lines if line.get_marker() != "_"}
                     for lines in (legend.get_lines(), figure.axes[0].lines)]  # _: the ends of intervals
            self.assertEqual(looks[0], looks[1])
            self.assertEqual(len(looks[0]), len(labels))

    def test_bars_of_structures_that_an_instruction_set_lacks_take_no_room(self):
        rows = [other("primary", isa=i, structure=s) for i, own in (("sse", ("bvh8", "embree")), ("avx512", ("bvh16", "embree"))) for s in own]
        (axis,) = self.draw(rays_per_second, load(Folder(rows).path)).axes
        middles = sorted(round(p.get_x() + p.get_width() / 2, 6) for p in axis.patches)
        self.assertEqual(middles, [round(group + at, 6) for group in (0, 1) for at in (-1 / 6, 1 / 6)])

    def test_bars_are_as_thick_in_each_panel(self):
        rows = [build(s, scene=scene) for scene, count in (("one", 1), ("two", 2), ("many", 9), ("last", 3)) for s in list(style.COLOURS)[:count]]
        rows = [{**row, "name": row["name"].replace("bunny", row["scene"])} for row in rows]
        traced = [other("primary", scene, builder=f"b{k}", wrong_answers=0) for scene, count in (("one", 1), ("two", 2), ("many", 9)) for k in range(count)]
        for module, held, panels in ((epo, rows, 4), (rays_by_builder, traced, 3)):
            figure = self.draw(module, load(Folder(held).path))
            figure.draw_without_rendering()
            shown = [axis for axis in figure.axes if axis.get_visible()]
            self.assertEqual(len(shown), panels)
            thick = [patch.get_window_extent().height * 72 / figure.dpi for axis in shown for patch in axis.patches]
            self.assertLess(max(thick), 1.25 * min(thick))

    def test_markers_on_bars_stand_out_from_them(self):
        rows = [other("primary", builder=b, intersector=i, rate=r * 1e6) for b in ("ploc", "morton") for i, r in (("exact", 3), ("watertight", 4))]
        for module, rows in ((rays_by_builder, rows), (rays_per_second, rows), (rays_by_builder, rows[::2])):
            (axis,) = self.draw(module, load(Folder(rows).path)).axes
            self.assertEqual({p.get_alpha() for p in axis.patches}, {1.0 if len(rows) == 2 else style.PALE})

    def test_lines_of_panels_have_no_gaps_where_all_panels_of_a_scene_fit_beside_each_other(self):
        workloads = ("primary", "shadow", "ambient_occlusion", "reflection", "diffuse")
        for count, columns in ((2, 2), (3, 3), (4, 2), (5, 5)):
            figure = self.draw(rays_per_second, load(Folder([other(w, s) for w in workloads[:count] for s in ("bunny", "city")]).path))
            self.assertTrue(all(axis.get_visible() for axis in figure.axes))
            self.assertEqual(len({axis.get_subplotspec().colspan.start for axis in figure.axes}), columns)
            self.assertLessEqual(figure.get_size_inches()[0], style.WIDEST)

    def test_ticks_stand_above_rows_too_where_those_below_are_far(self):
        for count in (2, squares.MOST_ROWS_BELOW, squares.MOST_ROWS_BELOW + 1):
            rows = [other("primary", structure=f"bvh{k}", nodes_per_ray=k + 1.0, leaves_per_ray=1.0, boxes_per_ray=8.0, triangles_per_ray=4.0) for k in range(count)]
            (axis,) = self.draw(visits_per_ray, load(Folder(rows).path)).axes
            axis.figure.draw_without_rendering()
            above = [t.label2 for t in axis.xaxis.get_major_ticks() if t.label2.get_visible() and t.label2.get_text()]
            self.assertEqual(bool(above), count > squares.MOST_ROWS_BELOW)

    def test_titles_beside_each_other_are_apart(self):
        rows = [other("primary", "sphere_flake-100000", structure=s, isa=i, sah_cost=cost, rate=1e8 / cost) for i in ("sse", "avx2", "avx512")
                for s, cost in (("bvh2", 30.0), ("bvh4", 20.0), ("bvh8", 15.0), ("bvh16", 10.0))]
        figure = self.draw(sah_vs_time, load(Folder(rows).path))
        figure.draw_without_rendering()
        boxes = [axis.title.get_window_extent() for axis in figure.axes]
        self.assertEqual(len(boxes), 3)
        self.assertGreater(min(b.x0 - a.x1 for a, b in zip(boxes, boxes[1:])) / figure.dpi, 0.15)

    def test_ticks_of_bars_have_few_digits(self):
        for most in (1.9, 8, 19.0, 20, 24):
            rows = [other("primary", rate=1e6 * most), build(sah_cost=most)]
            for module in (rays_per_second, sah_cost):
                (axis,) = self.draw(module, load(Folder(rows).path)).axes
                axis.figure.draw_without_rendering()
                labels = [t.get_text() for t in (axis.get_yticklabels() if module is rays_per_second else axis.get_xticklabels())]
                self.assertFalse([label for label in labels if label.endswith(".5") and most > 5], labels)

    def test_modes_of_lanes_are_in_the_order_of_instruction_sets(self):
        def legend(**more):
            rows = [other("primary", isa=i, lane_utilization_by_depth=[1.0, 0.5], visits_by_depth=[1.0, 0.5], **{k: v for k, v in zip(more, values)})
                    for i in ("avx512", "sse", "avx2") for values in (zip(*more.values()) if more else [()])]
            return [t.get_text() for t in self.draw(lane_utilization, load(Folder(rows).path)).legends[1].get_texts()]

        self.assertEqual(legend(), ["sse", "avx2", "avx512"])
        self.assertEqual(legend(traversal=("packet16", "packet4")), [f"{t}, {i}" for t in ("packet4", "packet16") for i in ("sse", "avx2", "avx512")])

    def test_spare_colours_are_told_from_those_that_are_given(self):
        def lab(colour):
            linear = [((c + 0.055) / 1.055) ** 2.4 if c > 0.04045 else c / 12.92 for c in to_rgb(colour)]
            x, y, z = (sum(a * b for a, b in zip(row, linear)) for row in ((0.4339, 0.3762, 0.1899), (0.2126, 0.7152, 0.0722), (0.0177, 0.1095, 0.8729)))
            x, y, z = (c ** (1 / 3) if c > 0.008856 else 7.787 * c + 16 / 116 for c in (x, y, z))
            return 116 * y - 16, 500 * (x - y), 200 * (y - z)

        for own in (style.COLOURS, style.INTERSECTOR_COLOURS, {s: s for s in style.SPARE_COLOURS}):
            for spare in style.SPARE_COLOURS:
                near = {name: round(math.dist(lab(spare), lab(c))) for name, c in own.items() if c != spare}
                self.assertGreater(min(near.values()), 24, (spare, near))

    def test_a_picture_of_leaks_says_what_was_traced(self):
        figure = self.draw(leak_picture, load(Folder(hard(), files=SEEN).path))
        self.assertEqual(figure._suptitle.get_text(), "ball")
        self.assertEqual([a.get_title().split("\n")[0] for a in figure.axes][::3], ["bvh8 a_new_one", "embree a_new_one", ""])
        seen = {**SEEN, "camera_edges-city.json": SEEN["camera_edges-ball.json"]}
        figure = self.draw(leak_picture, load(Folder([other("camera_edges", s, leak_points=[[3, 4]], cracks=1) for s in ("ball", "city")], files=seen).path))
        self.assertEqual([a.get_title().split("\n")[:2] for a in figure.axes], [["ball", "bvh8 watertight"], ["city", "bvh8 watertight"]])


class Words(Drawn):
    def test_a_comparison_calls_threads_so(self):
        def cells(*threads):
            return [{**{axis: "-" for axis in AXES}, "structure": "bvh8", "workload": w, "threads": t} for w in ("primary", "diffuse") for t in threads]

        self.assertEqual(ratios.labels(cells(1, 2)), (["primary  1 thread", "primary  2 threads", "diffuse  1 thread", "diffuse  2 threads"], "bvh8"))
        self.assertEqual(ratios.labels(cells(1)), (["primary", "diffuse"], "bvh8"))
        self.assertEqual(ratios.labels(cells(4)), (["primary", "diffuse"], "bvh8, 4 threads"))

    def test_a_figure_without_data_says_what_it_shows_and_what_makes_it(self):
        folder = Folder([other("primary")], {"plots": ["build_time", "leaks_vs_distance"]})
        said = folder.plot("--only", ",".join(ALL), "--no-report").stdout
        for name, column, metrics in (("build_time", "build_seconds", "metrics: [build]"), ("epo", "epo", "metrics: [quality]"), ("leaks_vs_distance", "cracks", "offset: [")):
            self.assertRegex(said, rf"(?m)^{name}: left out, .*; it shows .*\b{column}\b.*{metrics.replace('[', '.')}")
        self.assertEqual(folder.plot().returncode, 0)
        self.assertIn("it shows build_seconds (<code>metrics: [build]</code>).</p>", (folder.path / "report.html").read_text())
        for name in ALL:
            self.assertTrue(importlib.import_module(f"figures.{name}").NEEDS, name)

    def test_machine_and_build_have_labels_and_units(self):
        context = {"memory_bytes": 25276510208, "mhz_per_cpu": 2100, "load": "2.35 1.58 1.83 3/97 784", "cpu_scaling_enabled": False, "isa": ["sse", "avx2"], "num_cpus": 2,
                   "caches": [{"type": "Data", "level": 1, "size": 49152, "num_sharing": 1}, {"type": "Unified", "level": 3, "size": 3 << 20, "num_sharing": 8}],
                   "git_dirty": "false | true", "merged_from": [{"shard": "1/2", "cpu": "<one>"}], "a_new_key": 3}
        found = dict(machine.facts(context))
        self.assertEqual(found, {"memory": "23.5 GiB", "clock, MHz": "2100", "load averages when begun: 1, 5, 15 minutes": "2.35, 1.58, 1.83", "frequency scaling": "no",
                                 "instruction sets": "sse, avx2", "caches": "L1 data 48 KiB, L3 3 MiB for 8 hardware threads", "changes that no revision holds": "false | true",
                                 "merged from": "shard 1/2, CPU <one>", "a_new_key": "3"})
        self.assertEqual([machine.size(n) for n in (1, 1023, 1024, 3 << 20, 3 << 29, 1 << 45)], ["1 bytes", "1023 bytes", "1 KiB", "3 MiB", "1.5 GiB", "32768.0 GiB"])
        for odd in ("8 GiB | 16 GiB", None, {"a": [1]}):
            self.assertTrue(machine.facts(dict.fromkeys(context, odd)))
        page = report.write(load(Folder(whole(), context).path), []).read_text()
        raw = page.partition("has it</summary><pre>")[2].partition("</pre>")[0]
        self.assertEqual(json.loads(html.unescape(raw)), context)

    def test_tiny_numbers_are_short(self):
        results = load(Folder([build("kdtree", epo=2.8e-20, lcv=3.0), build("octree", epo=1.2345e-5, lcv=3.0)]).path)
        (axis,) = self.draw(epo, results).axes
        self.assertEqual([t.get_text() for t in axis.texts], ["2.8e-20  (LCV 3.00)", "0.0000123  (LCV 3.00)"])
        self.assertIn('data-v="2.8e-20">2.800e-20</td>', tables.structure_table(results))

    def test_code_in_captions_is_marked_up(self):
        self.assertEqual(report.prose("a `b_c: [<d>]` e `f`; g`"), "a <code>b_c: [&lt;d&gt;]</code> e <code>f</code>; g`")
        folder = Folder(whole(), {"plots": ["sah_cost"], "excluded_cells": 3})
        self.assertEqual(folder.plot().returncode, 0)
        page = (folder.path / "report.html").read_text()
        self.assertIn("own <code>traversal_cost</code> (a step at a node)", page)
        self.assertIn("cells that exclude took away", page)
        self.assertIn("#fastest td:last-child { white-space: normal", page)

    def test_figures_do_not_dazzle_on_a_dark_page(self):
        page = report.write(load(Folder(whole()).path), []).read_text()
        self.assertRegex(page, r"prefers-color-scheme: dark\) \{ figure img \{ filter: brightness")


if __name__ == "__main__":
    unittest.main()
