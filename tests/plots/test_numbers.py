"""Tests of plots/: what is reckoned and read, from results as they are, thin or cut off."""

import json
import math
import random
import re
import subprocess
import sys
import unittest
from pathlib import Path

sys.dont_write_bytecode = True

from made_results import PLOTS, Drawn, Folder, build, other, results_of, trace  # noqa: E402

import pages  # noqa: E402
import ratios  # noqa: E402
import report  # noqa: E402
import style  # noqa: E402
import tables  # noqa: E402
from figures import build_time, epo, rays_by_builder, rays_per_second, sah_cost, sah_vs_time, squares, traversal_ratios  # noqa: E402
from figures.modes import Modes  # noqa: E402
from figures.sah_vs_time import fits_text, linear_fit, plane_fit  # noqa: E402
from results import Cell, NoData, Results, TooMuch, axes_of, estimate, interval_name, interval_words, load, ordered, swept_axes, undetermined_axes  # noqa: E402


class Numbers(Drawn):
    def test_estimate(self):
        for values, low, median, high in (([5.0], 5.0, 5.0, 5.0), ([3.0, 1.0], 1.0, 2.0, 3.0), ([5.0, 1.0, 4.0, 2.0, 3.0], 1.0, 3.0, 5.0),
                                          ([5.0, 1.0, 4.0, 2.0, 3.0, 26.0], 1 + 5 / 14, 3.5, 26 - 21 * 5 / 14),  # the same numbers as in tests/test_results.cpp
                                          ([9.8, 10.1, 10.0, 9.9, 10.2, 10.0, 50.0], 9.8733333333333331, 10.0, 20.813333333333318)):
            found = estimate(values)
            self.assertEqual((found.median, found.samples), (median, len(values)))
            self.assertAlmostEqual(found.low, low, places=12)
            self.assertAlmostEqual(found.high, high, places=12)

    def test_the_interval_covers_the_median(self):
        chance = random.Random(1)
        for n in (6, 7, 9, 15):
            covered = sum(e.low <= 0 <= e.high for e in (estimate([chance.gauss(0, 1) for _ in range(n)]) for _ in range(4000)))
            self.assertTrue(0.93 * 4000 <= covered <= 0.97 * 4000, f"{n}: {covered}")

    def test_three_digits(self):
        self.assertEqual([tables.digits(v) for v in (0, 1234.5, 99.96, 9.999, 1, 0.0123, 0.000321, 4.56e-6)], ["0", "1234", "100", "10.0", "1.00", "0.0123", "0.000321", "0.00000456"])

    def test_slow_cells_are_not_written_as_nothing(self):
        results = load(Folder([trace("brute_force", rate=r, repetition=k) for k, r in enumerate((320.0, 321.0, 322.0))] + [trace("embree", rate=2e6)]).path)
        for table in (tables.throughput_table(results), tables.best_table(results)):
            self.assertIn(">0.000321</td>", table)
            self.assertIn(">0.000160</td>", table)  # × embree
            self.assertNotIn("0.00<", table)
        self.assertIn(">0.000320 – 0.000322</td>", tables.throughput_table(results))

    def test_what_intervals_are_called(self):
        self.assertEqual([interval_name(n) for n in ([1, 1], [2, 5], [6], [5, 6], [])], ["interval", "range", "95 % interval", "95 % interval or range", "interval"])
        self.assertEqual(interval_words([3, 3]), "the range of the 3 repetitions, which covers the median 75 times in 100 (95 take 6 repetitions)")
        self.assertIn("no interval", interval_words([1]))
        for repetitions, name, interval in ((1, "interval", None), (3, "range", "10.0 – 12.0"), (7, "95 % interval", "10.7 – 15.3")):
            folder = Folder([trace(rate=(10 + r) * 1e6, repetition=r) for r in range(repetitions)])
            self.assertEqual(folder.plot("--only", "rays_per_second").returncode, 0)
            self.assertEqual(f"<!-- {name} -->" in (folder.path / "rays_per_second.svg").read_text(), repetitions > 1)
            results = load(folder.path)
            table = tables.throughput_table(results)
            self.assertIn(f">{name}</button>", table)
            self.assertIn(f"<td>{interval or '-'}</td>", table)
            self.assertIn(interval_words([repetitions]), table)
            self.assertIn(interval_words([repetitions]), report.caption(results, rays_per_second))

    def test_plane_fit(self):
        x1, x2 = [1, 2, 3, 4, 5, 6], [2, 0, 5, 1, 1, 7]
        y = [3 * a + 0.5 * b + 2 for a, b in zip(x1, x2)]
        self.assertAlmostEqual(plane_fit(x1, x2, y), 1.0)
        self.assertLess(plane_fit(x1, x2, [1, 9, 1, 9, 1, 9]), 0.9)
        for a, b, c in ((x1[:4], x2[:4], y[:4]), (x1, [None, *x2[1:]], y), (x1, x1, y), (x1, [3] * 6, y), (x1, x2, [4] * 6)):
            self.assertIsNone(plane_fit(a, b, c))

    def test_linear_fit(self):
        slope, offset, r2 = linear_fit([1, 2, 3, 4], [3, 5, 7, 9])
        self.assertAlmostEqual(slope, 2)
        self.assertAlmostEqual(offset, 1)
        self.assertAlmostEqual(r2, 1)
        self.assertLess(linear_fit([1, 2, 3, 4], [1, 9, 1, 9])[2], 0.5)
        for x, y in (([1, 2], [1, 2]), ([2, 2, 2, 2], [1, 2, 3, 4]), ([1, 2, 3, 4], [5, 5, 5, 5]), ([1, 2, 3], [3, 5, 7]), ([1, 2, 3, 3.03], [3, 5, 7, 7]),
                     ([10, 10.1, 10.2, 10.3, 10.4, 10.5], [1, 5, 2, 4, 3, 6])):
            self.assertIsNone(linear_fit(x, y), x)
        self.assertIsNotNone(linear_fit([1, 2, 3, 3.1], [3, 5, 7, 8]))

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

    def test_ratios_of_traversals_are_of_as_many_threads(self):
        rates = {("single", "1"): 2e6, ("packet8", "1"): 3e6, ("single", "4"): 6e6, ("packet8", "4"): 12e6}
        axes = {"structure": "bvh8", "scene": "bunny", "workload": "diffuse", "isa": "avx2", "builder": "b", "leaf": "l", "intersector": "i", "box": "fast"}
        cells = [Cell({**axes, "traversal": t, "threads": n}, [{"rays_per_second": rate}]) for (t, n), rate in rates.items()]
        place = ("diffuse", "bunny")
        told = lambda some: {mode: row[place] for (structure, mode), row in traversal_ratios.ratios(some, Modes(some), "rays_per_second").items() if structure == "bvh8"}
        self.assertEqual(told(cells), {"single, 1 thread": 1.0, "packet8, 1 thread": 1.5, "single, 4 threads": 1.0, "packet8, 4 threads": 2.0})
        embree = Cell({**axes, "structure": "embree", "traversal": "single", "threads": "1"}, [{"rays_per_second": 4e6}])
        self.assertEqual(told([*cells, embree]), {"single, 1 thread": 0.5, "packet8, 1 thread": 0.75, "single, 4 threads": 1.0, "packet8, 4 threads": 2.0})
        self.assertEqual(traversal_ratios.headings_of([place], [*cells, embree], 5.0), ["diffuse\n… Embree's fastest, or own single rays"])
        self.assertEqual(traversal_ratios.headings_of([place], [c for c in [*cells, embree] if c["threads"] == "1"], 5.0), ["diffuse\n… Embree's fastest"])

    def test_squares_for_many_bars(self):
        import matplotlib.pyplot as plt

        bars = [Cell({"structure": s, "builder": b, "scene": "bunny"}, [{"sah_cost": 10.0 + i}])
                for i, (s, b) in enumerate((s, b) for s in ("bvh2", "bvh4", "bvh8", "bvh16", "bih") for b in map("builder{}".format, range(9)))]
        self.assertTrue(squares.are_due([bars], ["builder"]))
        self.assertFalse(squares.are_due([bars[:squares.MOST_BARS]], ["builder"]))
        self.assertTrue(squares.are_due([bars], ["builder", "isa"]))
        self.assertFalse(squares.are_due([bars], []))
        figure, _ = squares.square_panels([("bunny", bars), ("city", bars[:12])], ["builder"], lambda c: (c.value("sah_cost"),) * 3, str, "SAH cost", higher_is_better=False)
        first, second = figure.axes
        self.assertEqual([t.get_text() for t in first.get_yticklabels()], ["bih", "bvh2", "bvh4", "bvh8", "bvh16"])
        written = [[t.get_text() for t in axis.texts if t.get_text() != "–"] for axis in (first, second)]
        self.assertEqual(list(map(len, written)), [45, 12])
        self.assertEqual([len(first.texts), len(second.texts)], [45, 18])  # two structures of nine builders: six squares are empty, and say so
        self.assertLess(min(squares.SHADES(0.0)), 0.92)  # the worst is not white, as nothing is
        self.assertEqual([t.get_text() for t in first.texts if t.get_fontweight() == "bold"], ["10.0"])
        plt.close(figure)

    def test_a_wrong_answer_is_not_in_the_row_of_a_right_one(self):
        def cell(leaf, wrong):
            return Cell({"scene": "bunny", "structure": "bvh8", "builder": "ploc", "leaf": leaf}, [{"rays": 10, "wrong_answers": wrong}])

        rows = squares.rows_of([("bunny", [cell("triangle4", 0), cell("triangle8", 1), cell("triangle8v", 0)])], "builder", ["structure", "leaf"], lambda c: ("1.0", squares.is_wrong(c)))
        self.assertEqual([[leaf for _, leaf in keys] for _, keys in rows], [["triangle4", "triangle8v"], ["triangle8"]])

    def test_squares_of_cells_that_more_than_builders_tell_apart(self):
        def cell(structure, builder, leaf, isa, cost):
            return Cell({"scene": "bunny", "structure": structure, "builder": builder, "leaf": leaf, "isa": isa, "threads": "1"}, [{"sah_cost": cost}])

        cells = [cell(s, f"builder{b}", leaf, isa, 10.0 * (b + 1) + (leaf == "triangle4") + 0.1 * (s == "bvh8" and isa == "sse"))
                 for s in ("bvh4", "bvh8") for b in range(7) for leaf in ("triangle4", "triangle8", "triangle8v") for isa in ("sse", "avx2")]
        figure = self.draw(sah_cost, results_of([], cells + [cell("bvh2", "builder0", "triangle4", "sse", cost) for cost in (5.0,)] +
                                                [cell("bvh16", f"builder{b}", f"triangle{n}", "sse", 100.0 + n + b) for b in range(7) for n in (4, 8)]))
        (axis,) = figure.axes
        self.assertEqual([t.get_text() for t in axis.get_yticklabels()],
                         ["bvh2 triangle4 sse", "bvh4 triangle4", "bvh4 triangle8, triangle8v", "bvh8 triangle4 sse", "bvh8 triangle4 avx2", "bvh8 triangle8, triangle8v sse",
                          "bvh8 triangle8, triangle8v avx2", "bvh16 triangle4 sse", "bvh16 triangle8 sse"])
        self.assertEqual([t.get_text() for t in axis.get_xticklabels()], [f"builder{b}" for b in range(7)])
        self.assertEqual(len([t for t in axis.texts if t.get_text() != "–"]), 1 + 8 * 7)

    def test_names_of_columns_stand_above_many_rows_too(self):
        for structures, above in ((9, False), (30, True)):
            cells = [Cell({"scene": "bunny", "structure": f"s{s}", "builder": f"builder{b}"}, [{"sah_cost": 10.0 + s + b}]) for s in range(structures) for b in range(5)]
            (axis,) = self.draw(sah_cost, results_of([], cells)).axes
            self.assertEqual({t.label2.get_visible() for t in axis.xaxis.get_major_ticks()}, {above})

    def test_a_figure_that_would_be_too_tall_is_left_out_and_says_so(self):
        rows = [build(f"bvh{n}", build_seconds=0.02 + 1e-4 * n + 1e-5 * t) | {"name": f"build/bunny/bvh{n}/b/l/-/-/-/avx2/-/threads:{t}"} for n in range(100) for t in (1, 2, 4, 8)]
        named = Folder(rows, {"plots": ["build_phases"]}).plot()
        self.assertRegex(named.stderr, r"^build_phases: left out, it would be \d+ pixels tall \(8000 at most\); choose fewer scenes, .*--filter\n$")
        self.assertEqual(named.returncode, 0)

    def test_a_figure_that_would_be_too_tall_is_drawn_in_parts(self):
        def built(scenes):
            return [build(f"bvh{n}", scene=s) | {"name": f"build/{s}/bvh{n}/b/l/-/-/-/avx2/-/threads:1"} for s in scenes for n in range(9)]

        scenes = [f"scene{s}" for s in range(40)]
        folder = Folder(built(scenes), {"plots": ["sah_cost"]}, files={"sah_cost.png": "of before", "sah_cost-7.svg": "of before", "sah_cost-a.png": "of nobody's"})
        done = folder.plot()
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(sorted(p.name for p in folder.path.glob("*.*g")), ["sah_cost-1.png", "sah_cost-1.svg", "sah_cost-2.png", "sah_cost-2.svg", "sah_cost-a.png"])
        page = (folder.path / "report.html").read_text()
        captions = re.findall(r"<figcaption>(.*?)</figcaption>", page)
        self.assertEqual([c.partition(".")[0] for c in captions], [f"1 of 2: {', '.join(scenes[:20])}", f"2 of 2: {', '.join(scenes[20:])}"])
        self.assertEqual((page.count("<img"), page.count("Expected cost of a ray")), (2, 1))
        parts = pages.of(sah_cost, load(folder.path))
        for (own, figure), expected in zip(parts, (scenes[:20], scenes[20:])):
            self.addCleanup(style.plt.close, figure)
            self.assertEqual((own, [a.get_title() for a in figure.axes if a.get_visible()]), (expected, expected))
            self.assertTrue(style.fits(figure.get_size_inches()[1]))
        self.assertEqual(pages.shares(list("abcde"), 2), [["a", "b"], ["c", "d", "e"]])
        results = json.loads((folder.path / "results.json").read_text())
        (folder.path / "results.json").write_text(json.dumps(results | {"benchmarks": built(scenes[:2])}))
        self.assertEqual(folder.plot().returncode, 0)  # fewer scenes: one file again
        self.assertEqual(sorted(p.name for p in folder.path.glob("*.png")), ["sah_cost-a.png", "sah_cost.png"])

    def test_ways_of_traversal_of_many_modes_are_those_of_the_fastest(self):
        cells = [Cell({"scene": s, "workload": "primary", "isa": "avx2", "structure": "bvh8", "builder": f"b{b}", "leaf": "l", "intersector": f"i{i}", "box": "fast", "traversal": t,
                       "threads": "1"}, [{"rays_per_second": 1e6 * (1 + b + (t == "packet8"))}])
                 for s in ("bunny", "city") for b in range(8) for i in range(5) for t in ("single", "packet8")]
        axis, key = self.draw(traversal_ratios, results_of(cells)).axes
        self.assertEqual([t.get_text() for t in axis.get_yticklabels()], ["bvh8  packet8", "bvh8  single"])
        self.assertEqual([t.get_text() for t in axis.texts if "primary" not in t.get_text()], ["1.12"] * 3 + ["1.00"] * 3)
        self.assertEqual([t.get_text() for t in axis.texts if "primary" in t.get_text()], ["primary\n… own single rays"])
        self.assertIn("a multiple of", key.get_title(loc="left"))
        self.assertEqual([t.get_text() for t in key.get_yticklabels()], ["half or less", "0.7", "1", "1.4", "twice or more"])
        self.assertEqual(axis.get_title(loc="left"), "avx2: fastest builder, leaf and tests of each")
        few = self.draw(traversal_ratios, results_of([c for c in cells if c["intersector"] == "i0"]))
        self.assertEqual(len(few.axes[0].get_yticks()), 16)

    def test_headings_of_ways_of_traversal_do_not_overlap_and_say_what_ratios_are_to(self):
        scenes = [f"suzanne_of_a_long_name_indeed:stretch={x}" for x in ("1", "0.01")]
        for count in (1, 2):
            cells = [Cell({"scene": s, "workload": w, "isa": "avx2", "structure": structure, "builder": "b", "leaf": "l", "intersector": "i", "box": "fast", "traversal": t, "threads": "1"},
                          [{"rays_per_second": 1e6}])
                     for s in scenes[:count] for w in ("ambient_occlusion", "diffuse:self_intersection=error_bound", "diffuse:self_intersection=exclusion")
                     for structure in (("bvh8",) if w.endswith("exclusion") else ("bvh8", "embree")) for t in ("single", "packet8")]
            figure = self.draw(traversal_ratios, results_of(cells))
            figure.draw_without_rendering()
            axis = figure.axes[0]
            headings = [t for t in axis.texts if "…" in t.get_text()]
            self.assertEqual(len(headings), 3)
            self.assertEqual(["Embree's" in t.get_text() for t in headings], [True, True, False])
            self.assertIn("own", headings[2].get_text())
            boxes = [t.get_window_extent() for t in headings] + [axis.title.get_window_extent(), axis._left_title.get_window_extent()]
            for i, one in enumerate(boxes):
                for two in boxes[i + 1:]:
                    self.assertFalse(one.width and two.width and one.overlaps(two), count)
            names = [t.get_text() for t in axis.get_xticklabels()]
            self.assertEqual(len(set(names)), count + (count > 1))
            self.assertTrue(names[0].endswith(":stretch=1"))

    def test_headings_of_short_names_of_workloads_do_not_overlap(self):
        cells = [Cell({"scene": "bunny", "workload": w, "isa": "avx2", "structure": s, "builder": "b", "leaf": "l", "intersector": "i", "box": "fast", "traversal": t, "threads": "1"},
                      [{"rays_per_second": 1e6}]) for w in ("hard", "path", "primary", "diffuse") for s in ("bvh8", "embree") for t in ("single", "packet8")]
        figure = self.draw(traversal_ratios, results_of(cells))
        figure.draw_without_rendering()
        boxes = [t.get_window_extent() for t in figure.axes[0].texts if "…" in t.get_text()]
        self.assertEqual(len(boxes), 4)
        self.assertFalse([(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)])

    def test_counts_of_wrong_answers_of_many_bars_do_not_touch(self):
        rows = [other("diffuse", isa=isa, structure=s, wrong_answers=700) for isa in ("scalar", "sse", "avx2", "avx512") for s in style.COLOURS]
        figure = self.draw(rays_per_second, load(Folder(rows).path))
        figure.draw_without_rendering()
        boxes = [t.get_window_extent() for t in figure.axes[0].texts]
        self.assertEqual(len(boxes), 60)
        self.assertFalse([(a, b) for a, b in zip(boxes, boxes[1:]) if a.overlaps(b)])

    def test_names_of_places_stay_whole(self):
        self.assertEqual(style.short("suzanne_of_a_long_name:stretch=0.01"), "suzanne_of…:stretch=0.01")
        self.assertEqual(style.short("bunny:offset=1e4"), "bunny:offset=1e4")
        self.assertEqual(style.short("a_scene_of_a_name_without_any_place"), "a_scene_of_…ut_any_place")

    def test_scenes_that_differ_are_called_differently(self):
        for scenes in ([f"random_triangles-{n}00000-seed12" for n in (1, 2)], [f"fractal_terrain-{n}000000-seed7" for n in (1, 5)],
                       [f"sphere-4000:stretch={s}:offset={o:g}" for s in (1, 20, 100) for o in (1, 1e4, 1e6)], [f"{'a' * 12}{x}{'b' * 14}" for x in "xy"]):
            names = style.short_names(scenes)
            self.assertEqual(list(names), scenes)
            self.assertEqual(len(set(names.values())), len(scenes), names)
            self.assertTrue(all(len(name) <= len(scene) for scene, name in names.items()))
            rows = [other("primary", s, structure=b, traversal=t, wrong_answers=0) for s in scenes for b in ("bvh4", "bvh8") for t in ("single", "packet8")]
            figure = self.draw(rays_per_second, load(Folder(rows).path))
            figure.draw_without_rendering()
            boxes = [a.title.get_window_extent() for a in figure.axes if a.get_visible()]
            self.assertEqual(len({a.get_title() for a in figure.axes if a.get_visible()}), len(scenes))
            self.assertFalse([(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)])
            built = [build("bvh8", scene=s) | {"name": f"build/{s}/bvh8/b/l/-/-/-/avx2/-/threads:1"} for s in scenes]
            self.assertEqual(len({a.get_title() for a in self.draw(sah_cost, load(Folder(built).path)).axes if a.get_visible()}), len(scenes))
            labels = self.draw(traversal_ratios, load(Folder(rows).path)).axes[0].get_xticklabels()
            self.assertEqual(len({t.get_text() for t in labels}), len(scenes) + 1)
        for scene, name in (("bunny", "bunny"), ("random_triangles-100000-seed12", "random_tria…100000-seed12"), ("sphere-4000:stretch=10:offset=100", "sphere-4000…10:offset=100"),
                            ("a_scene_of_a_name_without_any_place", "a_scene_of_…ut_any_place")):
            self.assertEqual(style.short_names([scene]), {scene: name})

    def test_a_fit_is_that_of_one_scene(self):
        points = [(Cell({"scene": s, "structure": "bvh8", "workload": "primary", "isa": "avx2"}, []), x, y * (1 + x), None) for s, y in (("bunny", 1.0), ("city", -3.0)) for x in (1.0, 2.0, 2.5, 3.0)]
        figure, axis = style.plt.subplots()
        self.addCleanup(style.plt.close, figure)
        sah_vs_time.panel(axis, points, {"bunny": "o", "city": "s"}, "primary")
        self.assertEqual(axis.get_title(), "primary\nR² = 1.00, 1.00 (n = 8)")
        self.assertEqual(sorted(round(float(line.get_ydata()[-1])) for line in axis.lines if len(line.get_xdata()) == 2), [-12, 4])
        self.assertEqual([fits_text(of) for of in ([(0.5, 0.75)], [(0.5, None), (None, None)], [(0.5, 0.6)] * 2, [(0.1, 0.2), (0.3, 0.4), (None, None), (0.2, 0.9)], [(None, None)] * 4)],
                         ["R² = 0.50, with EPO 0.75", "R² = 0.50, –", "R² = 0.50, 0.50\nwith EPO 0.60, 0.60", "R² = 0.10 to 0.30\nwith EPO 0.20 to 0.90", "R² = –"])

    def test_a_point_of_a_fit_is_a_structure_as_built(self):
        def traced(structure, cost, nanoseconds, **more):
            axes = {"scene": "bunny", "builder": "binned_sah", "leaf": "triangle8", "intersector": "watertight", "workload": "primary", "isa": "avx2", "threads": "1", **more}
            return Cell({"structure": structure, **axes}, [{"sah_cost": cost, "rays_per_second": 1e9 / nanoseconds, "rays_per_cpu_second": 1e9 / nanoseconds}])

        def points(cells):
            figure = self.draw(sah_vs_time, results_of(cells))
            return [(axis.get_title(), sorted((round(line.get_xdata()[0]), round(line.get_ydata()[0])) for line in axis.lines if len(line.get_xdata()) == 1), axis.get_ylabel())
                    for axis in figure.axes if axis.get_visible()]

        trees = [traced("bvh8", 10, 100), traced("bvh4", 20, 210), traced("bvh2", 30, 290), traced("bvh2", 40, 300, builder="morton")]
        told = [("bunny, primary, avx2\nR² = 0.90 (n = 4)", [(10, 100), (20, 210), (30, 290), (40, 300)], "time, ns a ray\n(thread CPU time)")]
        self.assertEqual(points(trees), told)
        self.assertEqual(points(trees[:3]), [("bunny, primary, avx2\nno fit, fewer than 4 costs (n = 3)", told[0][1][:3], told[0][2])])
        slower = [traced("bvh8", 11, 130, leaf="triangle4"), traced("bvh8", 10, 140, intersector="pluecker")]
        aimed = [traced(c["structure"], 10 * k, 50 * k, workload=w) for k, c in enumerate(trees, 1) for w in ("hard", "hard_edge", "camera_edges")]
        alone = [traced("bvh8", 10, 70, scene="city"), traced("bvh4", 20, 80, scene="city")]  # two have no fit
        self.assertEqual(points([*trees, *slower, *aimed, *alone, traced("brute_force", 900, 9000)]), told)
        threads = [traced(c["structure"], c.value("sah_cost"), 44, builder=c["builder"], threads=t) for c in trees for t in ("2", "4")]
        self.assertEqual(points([*threads, *trees]), [(*told[0][:2], "time, ns a ray\n(wall time, 1 thread;\nnot shown: 2, 4)")])
        for few in (trees[:2], alone, aimed, [trees[0], trees[1], traced("brute_force", 900, 9000)], [traced(f"bvh{n}", 10, 100 * n) for n in (2, 4, 8)]):
            with self.assertRaises(NoData):
                sah_vs_time.draw(results_of(few))

    def test_structures_of_several_costs_are_in_panels_apart(self):
        def built(structure, builder, cost, **parameters):
            return build(structure, builder, sah_cost=cost, parameters=parameters) | {"name": f"build/bunny/{structure}/{builder}/triangle8/-/-/-/avx2/-/threads:1"}

        def drawn(module, rows):
            figure = self.draw(module, load(Folder(rows).path))
            return [(a.get_title(), a.get_xlabel(), [t.get_text() for t in a.get_yticklabels()]) for a in figure.axes if a.get_visible()]

        swept = [(f"{b}:intersection_cost=1:traversal_cost={t}", t) for b in ("morton", "ploc:ploc_radius=8") for t in (1, 0.5)]
        rows = [built("bvh8", b, 10.0 + k, traversal_cost=t, intersection_cost=1) for k, (b, t) in enumerate(swept)] + [built("grid", "uniform", 50.0)]
        for module, name in ((sah_cost, "SAH cost"), (epo, "EPO")):
            self.assertEqual([panel[:2] for panel in drawn(module, rows)], [("bunny\n(step 0.5, block 1)", name), ("bunny\n(step 1, block 1)", name)])
        self.assertEqual([panel[2] for panel in drawn(sah_cost, rows)], [["bvh8 morton", "bvh8 ploc:ploc_radius=8"], ["bvh8 morton", "bvh8 ploc:ploc_radius=8", "grid uniform"]])
        for costs, said in (({}, ""), ({"traversal_cost": 1, "intersection_cost": 2}, " (step 1, block 2)"), ({"traversal_cost": 4}, " (step 4, block 1)"), ({"bins": 4}, "")):
            self.assertEqual([panel[:2] for panel in drawn(sah_cost, [built("grid", "two_level", 50.0, **costs)])], [("bunny", "SAH cost" + said)])
        timed = [other("primary", structure=f"bvh{n}", builder=f"morton:traversal_cost={t}", sah_cost=10.0 * n * t, rate=1e8 / n, wrong_answers=0, parameters={"traversal_cost": t})
                 for n in (2, 4, 8, 16) for t in (1, 4)]
        self.assertEqual([panel[0].split("\n") for panel in drawn(sah_vs_time, timed)],
                         [["bunny", f"(step {t}, block 1), primary, avx2", "R² = 1.00 (n = 4)"] for t in (1, 4)])

    def test_what_has_no_tree_does_not_flatten_the_bars_of_others(self):
        rows = [build(s, "b", sah_cost=cost) | {"name": f"build/bunny/{s}/b/l/-/-/-/avx2/-/threads:1"} for s, cost in (("bvh8", 10.0), ("brute_force", 9000.0))]
        for these, bars in ((rows, ["bvh8"]), (rows[1:], ["brute_force"])):
            (axis,) = self.draw(sah_cost, load(Folder(these).path)).axes
            self.assertEqual([t.get_text() for t in axis.get_yticklabels()], bars)

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
        repetitions = [(0.02, 0.015, 0.004), (0.022, 0.0165, 0.0044), (0.092, 0.015, 0.076)]  # the last was disturbed in its leaves
        cell = Cell({}, [{"build_seconds": total, "phase_seconds": {"splits": a, "leaves": b}} for total, a, b in repetitions])
        found = dict(build_time.phases(cell))
        self.assertAlmostEqual(found["splits"], 22.0 * 0.75)
        self.assertAlmostEqual(found["leaves"], 22.0 * 0.2)
        apart = [(1.0, 0.6, 0.4), (1.0, 0.5, 0.5), (1.0, 0.9, 0.1), (1.0, 0.55, 0.45), (1.0, 0.1, 0.7)]  # medians 0.55, 0.45 and nothing
        uneven = [*apart[:4], (1.0, 0.9, 0.0)]
        for these in (apart, uneven):
            cell = Cell({}, [{"build_seconds": total, "phase_seconds": {"splits": a, "leaves": b}} for total, a, b in these])
            self.assertAlmostEqual(sum(milliseconds for _, milliseconds in build_time.phases(cell)), 1000.0)
        self.assertEqual(build_time.phases(Cell({}, [{"build_seconds": 0.0, "phase_seconds": {"splits": 0.0}}])), [])
        self.assertEqual(build_time.phases(Cell({}, [{"build_seconds": 1.0}])), [])

    def test_order(self):
        self.assertEqual(ordered(["bvh16", "embree", "bvh4", "octree"], "structure"), ["bvh4", "bvh16", "octree", "embree"])
        self.assertEqual(ordered(["avx512", "sse", "scalar", "avx2"], "isa"), ["scalar", "sse", "avx2", "avx512"])
        self.assertEqual(ordered(["diffuse", "primary"], "workload"), ["primary", "diffuse"])
        self.assertEqual(ordered(["hard", "path", "diffuse:way=b", "shadow:way=b", "diffuse", "diffuse:way=a"], "workload"), ["shadow:way=b", "diffuse", "diffuse:way=a", "diffuse:way=b", "path", "hard"])

    def test_axes_from_the_name(self):
        axes = axes_of({"name": "trace/bunny/bvh8/binned_sah/triangle8/watertight/padded/single/avx2/diffuse/threads:2"})
        self.assertEqual((axes["scene"], axes["isa"], axes["workload"], axes["threads"]), ("bunny", "avx2", "diffuse", "2"))
        self.assertEqual(axes_of({"name": build()["name"]})["workload"], "")

    def test_what_tells_cells_apart(self):
        cells = [Cell({"structure": s, "builder": b, "isa": i}) for s, b in (("bvh8", "x"), ("embree", "y")) for i in "ab"]
        self.assertEqual(swept_axes(cells), {"isa"})
        self.assertEqual(undetermined_axes(cells, ("structure", "builder", "isa")), ["structure", "isa"])
        self.assertEqual(Modes(cells).labels, ["one mode"])


def comparison(ratios, metric="trace", low=0.99, high=1.01):
    """What `compare --json` writes, as far as the figure reads it."""
    axes = ("scene", "structure", "builder", "leaf", "intersector", "box", "traversal", "isa", "workload", "threads")
    cells = [{**dict.fromkeys(axes, "-"), "metric": metric, "structure": f"s{k}", "ratio": r, "ratio_low": low and r * low, "ratio_high": high and r * high,
              "verdict": "slower" if r == 0.9 else "indistinguishable"} for k, r in enumerate(ratios)]
    total = {"trace": "rays", "build": "builds"}[metric]
    sides = {side: {"folder": f"results/{side}", "context": {"git_revision": 40 * side, "git_dirty": side == "b"}} for side in ("a", "b")}
    return {**sides, "options": {"min_difference_percent": 3}, "cells": cells,
            "geometric_means": [{"axis": "all", "value": total, "cells": len(cells), "ratio": {"median": 1.0, "low": 0.99, "high": 1.01}}]}


class Ratios(Drawn):
    def test_of_many_cells_those_that_differ_most_are_shown_called_or_not(self):
        rows, shared = ratios.rows_of(comparison([0.9, *(1 + 0.001 * k for k in range(150))]), "trace")
        self.assertEqual(len(rows), 1 + ratios.MOST_CELLS)
        self.assertTrue(shared.startswith(f"{ratios.MOST_CELLS} of 151 cells, those that differ most"))
        self.assertEqual([row[1] for row in rows[1:4]], [1.149, 1.148, 1.147])
        self.assertIn(0.9, [row[1] for row in rows])
        self.assertEqual(sorted((abs(math.log(row[1])) for row in rows[1:]), reverse=True), [abs(math.log(row[1])) for row in rows[1:]])

    def test_where_nothing_differs_that_is_what_is_said(self):
        for count, said in ((150, "none of 150 cells differs"), (3, "none of 3 cells differs"), (1, "its cell does not differ")):
            rows, shared = ratios.rows_of(comparison([1.0] * count), "trace")
            self.assertEqual([row[4] for row in rows], ["mean"])
            self.assertIn(said, shared)

    def test_a_title_stays_above_its_panel(self):
        for name in ("sphere_flake-20000", "a_scene_with_a_name_that_is_long:stretch=100:offset=1e4"):
            both = comparison([1.1, 1.2])
            for cell in both["cells"]:
                cell.update(scene=name, builder="binned_sah:bins=16:max_leaf_blocks=4", leaf="triangle8v", intersector="watertight", box="padded", traversal="single", isa="avx2", workload="primary")
            figure = ratios.draw(both)
            self.addCleanup(style.plt.close, figure)
            figure.draw_without_rendering()
            title, legend = figure.axes[0]._left_title, figure.legends[0]
            self.assertTrue(title.get_text().endswith("primary"))
            self.assertIn("\n", title.get_text())
            self.assertFalse(title.get_window_extent().overlaps(legend.get_window_extent()))
            self.assertLessEqual(title.get_window_extent().x1, figure.bbox.x1)
            self.assertLessEqual(title.get_window_extent().y1, figure.bbox.y1)

    def test_panels_have_one_scale_and_one_repetition_has_no_interval(self):
        both = comparison([0.5, 1.2], low=None, high=None)
        builds = comparison([1.01, 1.02], "build")
        both["cells"] += builds["cells"]
        both["geometric_means"] += builds["geometric_means"]
        figure = ratios.draw(both)
        self.addCleanup(style.plt.close, figure)
        first, second = figure.axes
        self.assertEqual(first.get_xlim(), second.get_xlim())
        self.assertLess(first.get_xlim()[0], 0.5)
        self.assertEqual(ratios.rows_of(both, "trace")[0][1][1:4], (0.5, 0.5, 0.5))


    def test_the_figure_names_both_folders_and_the_control(self):
        both = comparison([1.1, 1.2])
        figure = ratios.draw(both)
        self.addCleanup(style.plt.close, figure)
        self.assertEqual(figure._suptitle.get_text(), f"A: results/a, revision {12 * 'a'}\nB: results/b, revision {12 * 'b'} with changes")
        self.assertTrue(figure.axes[0].get_xlabel().startswith("B over A: "))
        both["options"]["control"], both["control"] = "/embree/", {"rays": {"cells": 7, "ratio": {"median": 1.048, "low": 1.0, "high": 1.1}}}
        figure = ratios.draw(both)
        self.addCleanup(style.plt.close, figure)
        said = " ".join(figure._suptitle.get_text().split())
        self.assertIn("Ratios of rays are relative to 7 cells of --control '/embree/', whose own B over A is 1.048", said)
        self.assertTrue(figure.axes[0].get_xlabel().startswith("B over A, relative to the control: "))


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

    def test_what_a_cut_off_run_had_planned(self):
        cell = {"name": "build/bunny/bvh8", "scene": "bunny", "structure": "bvh8", "builder": "binned_sah", "leaf": "triangle4", "isa": "sse", "threads": 1}
        cell["repetitions"] = [{"build_seconds": 0.5, "iterations": 4, "phase_seconds": {"splits": 1.2, "leaves": 0.8}}]
        plan = {"context": {"git_revision": "abc123"}, "skipped": [{"name": "trace/bunny/list", "reason": "no such ray"}]}
        folder = Folder(files={"cells.jsonl": json.dumps(cell) + "\n", "plan.json": json.dumps(plan)})
        results = load(folder.path)
        self.assertEqual(results.structures[0].rows[0]["phase_seconds"], {"splits": 0.3, "leaves": 0.2})  # those of one build
        self.assertEqual(results.skipped, [("trace/bunny/list", "no such ray")])
        self.assertEqual(results.context, {"git_revision": "abc123"})


class RatiosOfAComparison(unittest.TestCase):
    CELL = {"scene": "bunny", "structure": "bvh8", "builder": "binned_sah", "leaf": "triangle8", "intersector": "watertight", "box": "padded", "traversal": "single",
            "isa": "avx2", "workload": "primary", "threads": 1, "metric": "trace", "ratio": 1.1, "ratio_low": 1.0, "ratio_high": 1.2, "verdict": "faster"}
    WHOLE = {"options": {"min_difference_percent": 2}, "cells": [CELL], "geometric_means": [],
             "a": {"folder": "before", "context": {}}, "b": {"folder": "after", "context": {"git_revision": None}}}

    def ratios(self, text, target="out.svg"):
        folder = Folder(files={"comparison.json": text})
        result = subprocess.run([sys.executable, str(PLOTS / "ratios.py"), str(folder.path / "comparison.json"), str(folder.path / target)],
                                capture_output=True, text=True, timeout=300)
        return result.returncode, result.stderr.strip(), folder.path

    def test_drawn(self):
        status, error, folder = self.ratios(json.dumps(self.WHOLE))
        self.assertEqual((status, error), (0, ""))
        self.assertIn("faster", (folder / "out.svg").read_text())

    def test_what_is_no_comparison_is_named(self):
        foreign = {**self.WHOLE, "cells": [{k: v for k, v in self.CELL.items() if k != "ratio_low"}]}
        for text, why in (("{", "Expecting"), ("[]", "list indices"), ("{}", "it lacks 'cells'"), (json.dumps({"cells": [3]}), "not subscriptable"),
                          (json.dumps(foreign), "it lacks 'ratio_low'"), (json.dumps({**self.WHOLE, "options": {}}), "it lacks 'min_difference_percent'")):
            with self.subTest(text=text):
                status, error, folder = self.ratios(text)
                self.assertEqual(status, 2)
                self.assertEqual(len(error.splitlines()), 1, error)
                self.assertIn(f"error: {folder / 'comparison.json'}: not what `compare --json` writes (", error)
                self.assertIn(why, error)

    def test_nothing_to_draw(self):
        for cells in ([], [{**self.CELL, "metric": "quality"}]):
            status, error, folder = self.ratios(json.dumps({**self.WHOLE, "cells": cells}))
            self.assertEqual((status, error), (2, f"error: {folder / 'comparison.json'}: no cell is in both folders: there is nothing to draw"))

    def test_an_ending_that_nothing_draws(self):
        status, error, folder = self.ratios(json.dumps(self.WHOLE), "out.doc")
        self.assertEqual(status, 2)
        self.assertIn(f"error: {folder / 'out.doc'}: ", error)
        self.assertIn(".png, .svg or .pdf", error)


if __name__ == "__main__":
    unittest.main()
