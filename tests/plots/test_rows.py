"""Tests of plots/: figures with a row for each structure as built: what stands in a row, and that many rows are legible."""

import re
import sys
import unittest

sys.dont_write_bytecode = True

from matplotlib.text import Text  # noqa: E402

from made_results import PLOTS, Drawn, results_of  # noqa: E402

from figures import ALL, bars, build_phases, build_time, bytes_per_triangle, leaf_histograms, squares  # noqa: E402
from figures.bars import in_order  # noqa: E402
from figures.names import bar_label  # noqa: E402
from figures.rows import groups_of, places_of  # noqa: E402
from results import Cell  # noqa: E402


def built(structure="bvh8", builder="binned_sah", scene="bunny", **more):
    """A build of 100 triangles: 200 ns each, half of it splits; 10 bytes each, six of leaves; seven leaves."""
    row = {"build_seconds": 2e-5, "phase_seconds": {"references": 2e-6, "splits": 1e-5, "leaves": 4e-6}, "triangles": 100, "bytes": 1000, "bytes_per_triangle": 10.0,
           "node_bytes": 300, "leaf_bytes": 600, "other_bytes": 100, "peak_build_bytes": 1500, "depth_histogram": [0, 0, 1, 6], "leaf_histogram": [0, 3, 0, 4],
           "leaf_fill": 0.75, **more}
    return Cell({"scene": scene, "structure": structure, "builder": builder, "threads": "1", "isa": "avx2", "leaf": "triangle8"}, [row])


def many(scenes=("bunny", "a_scene_with_a_name_that_is_long", "city-300000")):
    """More than bars can be read of, with names as long as they come; builds that differ, so that no rows are shared."""
    kinds = [(s, b) for s in ("bvh4_quantised", "bvh8", "bvh16", "bih") for b in ("binned_sah", "embree_medium_reinsertion", *map("builder{}".format, range(10)))]
    return [built(s, b, scene, build_seconds=1e-5 * (i + 1), bytes_per_triangle=10.0 + i, depth_histogram=[0] * (i % 40) + [1, 2], leaf_histogram=[0] * (i % 33) + [i + 1])
            for scene in scenes for i, (s, b) in enumerate(kinds)]


def labels(axis):
    return [t.get_text() for t in axis.get_yticklabels()]


def written(axis):
    return [t.get_text() for t in axis.texts]


class Rows(Drawn):
    def draw(self, module, cells):
        return super().draw(module, results_of([], cells))

    def legend(self, figure):
        return [t.get_text() for each in figure.legends for t in each.get_texts()]

    def test_structures_of_the_same_values_share_their_rows(self):
        cells = [built(s, b, scene) for s in ("bvh8", "bvh8_quantised", "bvh4") for b in ("ploc", "morton") for scene in ("bunny", "city")]
        value = {"bvh4": 1}
        groups = groups_of(cells, ["builder"], lambda c: value.get(c["structure"], 2))
        self.assertEqual([(heading, [row.label for row in rows]) for heading, rows in groups],
                         [("bvh4", ["morton", "ploc"]), ("bvh8, bvh8_quantised", ["morton", "ploc"])])
        self.assertEqual([place for place, _ in places_of(groups)], [1, 2, 4, 5])  # below the headings
        self.assertEqual([set(row.cells) for _, row in places_of(groups)], [{"bunny", "city"}] * 4)
        apart = groups_of(cells, ["builder"], lambda c: (c["structure"], c["builder"], c["scene"]) == ("bvh8", "ploc", "city"))  # one row of one scene differs
        self.assertEqual([heading for heading, _ in apart], ["bvh4, bvh8_quantised", "bvh8"])
        ((heading, rows),) = groups_of([c for c in cells if c["builder"] == "ploc"], [], lambda c: value.get(c["structure"], 2))
        self.assertEqual((heading, [row.label for row in rows]), ("", ["bvh4", "bvh8, bvh8_quantised"]))

    def test_names_in_the_order_of_their_sequences(self):
        self.assertEqual(in_order([["references", "splits", "leaves"], ["order", "tree", "collapse", "leaves"], ["references", "sort", "splits"], []]),
                         ["references", "sort", "splits", "order", "tree", "collapse", "leaves"])

    def test_phases_are_shares_of_the_build(self):
        cells = [built(), built("embree", "medium", phase_seconds={}), built(builder="morton", phase_seconds={"order": 1e-5, "leaves": 1e-5})]
        figure = self.draw(build_phases, cells)
        (axis,) = figure.axes
        self.assertEqual(labels(axis), ["bvh8", "binned_sah", "morton"])
        self.assertEqual(written(axis), ["200 ns", "200 ns"])
        self.assertEqual(self.legend(figure), ["references", "splits", "order", "leaves", "none of these"])
        drawn = sorted((round(p.get_y() + p.get_height() / 2), round(p.get_x()), round(p.get_width())) for p in axis.patches)
        self.assertEqual(drawn, [(1, 0, 10), (1, 0, 100), (1, 10, 50), (1, 60, 20), (2, 0, 50), (2, 0, 100), (2, 50, 50)])  # what is left of 100 is no phase

    def test_what_no_part_covers_is_in_the_legend_where_there_is_any(self):
        whole = {"phase_seconds": {"splits": 2e-5}}
        for more, rest in ((whole, []), ({}, ["none of these"])):
            for module in (build_phases, build_time):
                legend = self.legend(self.draw(module, [built(**more), built("bvh4", build_seconds=3e-5, phase_seconds={"splits": 3e-5}), built("embree", "medium", phase_seconds={})]))
                self.assertEqual([n for n in legend if n not in ("references", "splits", "leaves")], rest + ["embree"] * (module is build_time), module.TITLE)

    def test_threads_have_rows_of_their_own(self):
        two = built(build_seconds=1e-5)
        two.axes["threads"] = "2"
        (axis,) = self.draw(build_phases, [built(), two]).axes
        self.assertEqual((labels(axis), written(axis)), (["bvh8", "1 thread", "2 threads"], ["200 ns", "100 ns"]))

    def test_a_bar_of_several_threads_is_not_called_by_one_of_them(self):
        def of(structure, threads, **more):
            cell = built(structure, **more)
            cell.axes["threads"] = threads
            return cell

        cells = [of("bvh8", "1"), of("bvh8", "2"), of("embree", "1", bytes_per_triangle=20.0), of("embree", "2", bytes_per_triangle=21.0), of("bvh4", "1"),
                 of("bvh4", "2", peak_build_bytes=1600)]
        (axis,) = self.draw(bytes_per_triangle, cells).axes
        self.assertEqual(labels(axis), ["bvh4 1 thread", "bvh4 2 threads", "bvh8", "embree 1 thread", "embree 2 threads"])

    def test_bars_that_stand_for_several_isas_or_leaves_are_called_by_all_of_them(self):
        def cell(builder, isa, cost, leaf="triangle4"):
            return Cell({"scene": "bunny", "structure": "bvh8", "builder": builder, "leaf": leaf, "isa": isa, "threads": "1"}, [{"sah_cost": cost}])

        def called(cells):
            found, varied = bars.distinct(results_of([], cells), lambda c: c.value("sah_cost"), ("builder", "leaf", "isa"))
            return [bar_label(c, varied) for c in found]

        same = [cell("ploc", isa, 20.0) for isa in ("sse", "avx2", "avx512")]
        self.assertEqual(called(same + [cell("morton", "sse", 30.0), cell("morton", "avx2", 31.0)]), ["bvh8 ploc all ISAs", "bvh8 morton sse", "bvh8 morton avx2"])
        self.assertEqual(called([*same[:2], cell("ploc", "avx512", 21.0)]), ["bvh8 sse, avx2", "bvh8 avx512"])
        self.assertEqual(called(same), ["bvh8"])
        leaves = [cell("ploc", "sse", 20.0, f"triangle{n}") for n in (1, 2, 4)]
        self.assertEqual(called([*leaves, cell("ploc", "sse", 15.0, "triangle8")]), ["bvh8 triangle1, triangle2 …", "bvh8 triangle8"])

    def test_histograms_of_leaves(self):
        self.assertEqual(leaf_histograms.runs([0, 0, 1, 6]), [(3, 2, 3), (5, 3, 4)])  # 14 %, 86 %
        self.assertEqual(leaf_histograms.runs([1, 1, 0, 1, 97]), [(1, 0, 2), (1, 3, 4), (5, 4, 5)])  # no leaf between is a gap
        self.assertEqual(leaf_histograms.runs([1, 199]), [(0, 0, 1), (5, 1, 2)])
        self.assertEqual(len(leaf_histograms.SHADES), len(leaf_histograms.BOUNDS))
        figure = self.draw(leaf_histograms, [built(), built("embree", "medium", depth_histogram=None, leaf_histogram=None), built(builder="ploc", leaf_fill=1.0, leaf_histogram=[0, 7])])
        by_depth, by_triangles = figure.axes
        self.assertEqual(labels(by_depth), ["bvh8", "binned_sah", "ploc"])
        self.assertEqual((written(by_depth), written(by_triangles)), (["2.9", "2.9"], ["75 %", "100 %"]))
        self.assertEqual((by_depth.get_xlim(), by_triangles.get_xlim()), ((-0.5, 3.5), (-0.5, 3.5)))
        self.assertEqual([round(x, 3) for x in by_triangles.lines[0].get_xdata()[::3]], [2.143, 1.0])

    def test_the_mean_of_leaves_of_more_triangles_than_are_told_apart(self):
        full = [0] * leaf_histograms.MOST_TRIANGLES + [5]
        self.assertIsNone(leaf_histograms.mean_triangles(built(leaf_histogram=full)))
        self.assertEqual(leaf_histograms.mean_triangles(built(leaf_histogram=full, references=400, leaves=5)), 80)
        self.assertAlmostEqual(leaf_histograms.mean_triangles(built()), 15 / 7)

    def test_bytes_by_part_of_many_structures(self):
        cells = many(["bunny"])
        self.assertGreater(len(cells), squares.MOST_BARS)
        figure = self.draw(bytes_per_triangle, cells + [built("embree", "medium", node_bytes=None)])
        (axis,) = figure.axes
        self.assertEqual(self.legend(figure), ["nodes", "leaves", "other", "none of these", "embree"])
        self.assertEqual(len(axis.patches), 4 * len(cells) + 1)
        alike = [built(s, c["builder"], bytes_per_triangle=99.0, peak_build_bytes=peak) for c in cells[:12] for s, peak in
                 (("kdtree", 1500), ("grid", 1500), ("octree", 1600))]
        (axis,) = self.draw(bytes_per_triangle, cells + alike).axes
        self.assertEqual([t for t in labels(axis) if "grid" in t or "octree" in t], ["grid, kdtree", "octree"])  # the same bytes of another peak are another row
        self.assertIn("10.0  (1.50 ×)", written(axis))
        few = self.draw(bytes_per_triangle, cells[:squares.MOST_BARS])
        self.assertIn("10.0  (peak 1.50 ×)", written(few.axes[0]))

    def test_many_rows_do_not_run_into_each_other(self):
        for module in (build_phases, bytes_per_triangle, leaf_histograms):
            with self.subTest(module.TITLE):
                figure = self.draw(module, many())
                figure.draw_without_rendering()
                panels = [axis for axis in figure.axes if axis.get_visible()]
                names = [t.get_window_extent() for t in panels[0].get_yticklabels()]
                self.assertEqual(len(names), 48 + 4)  # and the headings
                for axis in panels:
                    beside = [t.get_window_extent() for t in axis.texts]
                    for texts in (names, beside):
                        self.assertFalse([a for a, b in zip(texts, texts[1:]) if a.overlaps(b)])
                    for other in panels:
                        self.assertFalse(other is not axis and any(t.overlaps(other.bbox) for t in beside + [axis.xaxis.label.get_window_extent()]))
                titles = [t.get_window_extent() for axis in panels for t in axis.findobj(Text) if t.get_text() and t.get_text() == axis.get_title(loc="left")]
                self.assertEqual(len(titles), 3)
                self.assertFalse([a for a, b in zip(titles, titles[1:]) if a.overlaps(b)])
                self.assertLess(figure.get_size_inches()[0], 18)

    def test_many_scenes_go_below_each_other(self):
        figure = self.draw(leaf_histograms, [built(scene=f"scene{i}", builder=b) for i in range(11) for b in ("morton", "ploc")])
        panels = [axis for axis in figure.axes if axis.get_visible()]
        self.assertEqual((len(panels), len({round(axis.get_position().y0, 3) for axis in panels})), (22, 3))
        self.assertLess(figure.get_size_inches()[0], 18)

    def test_a_configuration_can_name_every_figure(self):
        source = (PLOTS.parent / "experiments" / "config_plots.cpp").read_text(encoding="utf-8")
        known = re.search(r"kPlots\[\] = \{(.*?)\n\};", source, re.DOTALL).group(1)
        self.assertEqual(sorted(re.findall(r'\{"(\w+)"', known)), sorted(ALL))


if __name__ == "__main__":
    unittest.main()
