"""Tests of plots/: figures of two costs against each other, of any number of points, and of what a ray meets on its way."""

import sys
import unittest
import warnings

sys.dont_write_bytecode = True

from made_results import Drawn, results_of  # noqa: E402

from figures import build_vs_trace, memory_vs_time, trade_offs, visits_per_ray  # noqa: E402
from figures.trade_offs import Point, builder_markers, pareto_front  # noqa: E402
from results import Cell, Estimate, NoData, TooMuch  # noqa: E402


def exactly(value, spread=0.0):
    return Estimate(value, value - spread, value + spread, 3)


def point(x, y, spread=0.0, x_spread=0.0):
    return Point(f"{x}, {y}", exactly(x, x_spread), exactly(y, spread))


def traced(structure="bvh8", builder="ploc", nanoseconds=100.0, scene="bunny", workload="diffuse", threads="1", isa="avx2", leaf="triangle8", traversal="single", **more):
    axes = {"scene": scene, "structure": structure, "builder": builder, "leaf": leaf, "intersector": "exact", "box": "padded", "traversal": traversal, "isa": isa,
            "workload": workload, "threads": threads}
    return Cell({**axes, **{a: more.pop(a) for a in ("intersector", "box") if a in more}},
                [{"rays": 1000, "wrong_answers": 0, "rays_per_second": 1e9 / nanoseconds, "rays_per_cpu_second": 1e9 / nanoseconds, "bytes_per_triangle": 50.0, **more}])


def built(cell, milliseconds):
    return Cell({a: cell[a] for a in ("scene", "structure", "builder", "leaf", "isa", "threads")}, [{"build_seconds": 1e-3 * milliseconds}])


STRUCTURES = ("bvh4_quantised", "bvh8_quantised", "bvh16", "bih")
BUILDERS = ("binned_sah", "sweep_sah", "spatial_sah", "morton", "ploc", "embree_low", "embree_medium", "embree_high")


def many(scenes=("bunny", "a_scene_with_a_name_that_is_long"), workloads=("primary", "ambient_occlusion", "shadow", "diffuse")):
    """As many structures as a sweep of all of them has, with names as long as they come: who takes longer to build is faster, by ever less."""
    kinds = [(s, b + end) for s in STRUCTURES for b in BUILDERS for end in ("", "_reinsertion")]
    cells = [(traced(s, b, 100.0 + 1000.0 / (i + 1), scene, w, bytes_per_triangle=40.0 + i, wrong_answers=i % 2), 2.0 * (i + 1)) for scene in scenes for w in workloads
             for i, (s, b) in enumerate(kinds)]
    return results_of([c for c, _ in cells], [built(c, ms) for c, ms in cells])


class TradeOffs(Drawn):
    def words(self, axis):
        """What stands below a panel: (name, what is said of it), by line."""
        found = [t.get_text() for t in axis.texts]
        lines = sum(text.isdigit() for text in found) // 2  # each number stands at its point, too
        return [(found[3 * i + 1], found[3 * i + 2]) for i in range(lines)]

    def test_pareto_front(self):
        self.assertEqual(pareto_front([(3, 0), (1, 9), (2, 9), (2, 4), (4, 0)]), [(1, 9), (2, 4), (3, 0)])
        self.assertEqual(pareto_front([]), [])

    def test_from_how_many_rays_on_a_slower_build_pays(self):
        def stages(*points):
            return [(p.x.median, rays) for p, rays in build_vs_trace.stages(list(points))]

        quick, middle, best = point(10, 100), point(20, 60), point(100, 50)
        self.assertEqual(stages(best, quick, middle), [(10, 0), (20, 0.25e6), (100, 8e6)])
        self.assertEqual(stages(quick, point(15, 99), middle), [(10, 0), (20, 0.25e6)])  # on the Pareto front, and worth it at no number of rays
        self.assertEqual(stages(quick, point(20, 100), point(30, 120)), [(10, 0)])
        self.assertEqual(stages(point(10, 100), point(10, 60)), [(10, 0)])
        self.assertEqual(stages(quick), [(10, 0)])

    def test_what_intervals_do_not_tell_apart_is_not_better(self):
        stages = build_vs_trace.stages
        quick = point(10, 100, spread=2)
        self.assertEqual([rays for _, rays in stages([quick, point(50, 97, spread=2)])], [0])  # not faster beyond doubt
        self.assertEqual([rays for _, rays in stages([quick, point(50, 90, spread=2)])], [0, 4e6])
        ((only, rays),) = stages([point(10.0, 100, x_spread=0.2), point(10.3, 60, x_spread=0.2)])  # not built later beyond doubt
        self.assertEqual((only.y.median, rays), (60, 0))

    def test_ranges_follow_each_other(self):
        points = [point(1.5 ** i, 50 + 400 / (1 + (i * 7) % 11), spread=i % 3) for i in range(20)]
        found = build_vs_trace.stages(points)
        self.assertGreater(len(found), 2)
        self.assertEqual([r for _, r in found], sorted(r for _, r in found))
        for (before, _), (after, rays) in zip(found, found[1:]):
            for count, best in ((0.99 * rays, before), (1.01 * rays, after)):
                total = [p.x.median + 1e-6 * count * p.y.median for p in (before, after)]
                self.assertEqual(min(total), best.x.median + 1e-6 * count * best.y.median)

    def test_counts_of_rays(self):
        self.assertEqual([build_vs_trace.count(r) for r in (94, 950, 12345, 999_999, 1.24e6, 1.55e8, 1.1e9)], ["94", "950", "12 k", "1 M", "1.2 M", "160 M", "1.1 G"])

    def test_builds_are_those_with_as_many_threads_as_the_rays(self):
        cells = [traced("bvh8", b, ns, threads=t) for t in ("1", "2") for b, ns in (("ploc", 50.0), ("morton", 80.0))]
        builds = [built(c, ms) for c, ms in zip(cells, (30.0, 10.0, 16.0, 8.0))]
        figure = self.draw(build_vs_trace, results_of(cells, builds))
        self.assertEqual([(a.get_title(), a.get_xlabel(), a.get_ylabel()) for a in figure.axes],
                         [(f"bunny, diffuse, avx2, {t}", f"build time, ms (wall time, {t})", f"time, ns a ray\n(wall time, {t})") for t in ("1 thread", "2 threads")])
        self.assertEqual([self.words(a) for a in figure.axes], [[("bvh8 morton", "at first"), ("bvh8 ploc", f"from {n} k rays")] for n in ("670", "270")])
        with self.assertRaisesRegex(NoData, "both"):
            build_vs_trace.draw(results_of(cells, [built(traced(threads="4"), 10.0)]))

    def test_one_thread_is_told_by_its_cpu_time(self):
        cells = [traced("bvh8", b) for b in ("ploc", "morton")]
        (axis,) = self.draw(build_vs_trace, results_of(cells, [built(c, 10.0) for c in cells])).axes
        self.assertEqual((axis.get_xlabel(), axis.get_ylabel()), ("build time, ms (wall time, 1 thread)", "time, ns a ray\n(thread CPU time)"))

    def test_the_fastest_mode_stands_for_a_structure_as_built(self):
        cells = [traced("bvh8", "ploc", ns, traversal=t) for ns, t in ((80.0, "single"), (50.0, "packet8"))] + [traced("bvh2", "ploc", 70.0, bytes_per_triangle=40.0)]
        points = trade_offs.fastest_points(cells, "rays_per_second", lambda c: exactly(1.0))
        self.assertEqual([(p.cell["structure"], round(p.y.median)) for p in points], [("bvh8", 50), ("bvh2", 70)])
        (axis,) = self.draw(memory_vs_time, results_of(cells)).axes
        self.assertEqual(self.words(axis), [("bvh2", "40.0 B, 70.0 ns"), ("bvh8", "50.0 B, 50.0 ns")])

    def test_memory_names_what_is_clearly_faster(self):
        points = [point(10, 100), point(11, 95), point(12, 89), point(13, 85), point(14, 79), point(15, 90)]
        self.assertEqual([p.x.median for p in memory_vs_time.worth_a_name(points)], [10, 12, 14])
        self.assertEqual([p.x.median for p in memory_vs_time.worth_a_name(points[:2])], [10, 11])  # and the fastest

    def test_a_single_structure_is_no_comparison(self):
        with self.assertRaisesRegex(NoData, "nowhere are two"):
            memory_vs_time.draw(results_of([traced(), traced(scene="city")]))

    def test_markers_of_builders(self):
        found = builder_markers([b + end for b in BUILDERS for end in ("", "_reinsertion")] + ["low", "high", "octants", "uniform", "two_level", "a_new_one"])
        self.assertEqual(found["ploc"], found["ploc_reinsertion"])
        self.assertEqual(found["embree_low_reinsertion"], found["low"])
        self.assertEqual(len(set(found.values())), 12)
        variants = builder_markers([f"binned_sah:bins={n}:collapse={c}" for n in (16, 32) for c in ("greedy", "optimal")] + ["low", "medium", "high", "binned_sah_reinsertion:bins=16:collapse=greedy"])
        self.assertEqual(len(set(variants.values())), 7)
        self.assertEqual(variants["binned_sah_reinsertion:bins=16:collapse=greedy"], variants["binned_sah:bins=16:collapse=greedy"])

    def test_no_two_builders_have_one_sign(self):
        few = [f"{b}:bins={n}:max_leaf_blocks={m}" for b in ("binned_sah", "spatial_sah") for n in (4, 16, 64) for m in (1, 4)]
        self.assertEqual(len(set(builder_markers(few).values())), 12)
        many = builder_markers([f"{b}:bins={n}" for b in ("binned_sah", "sweep_sah") for n in range(12)] + ["ploc"])
        self.assertEqual(len(set(many.values())), 3)
        self.assertEqual([h.get_label() for h in trade_offs.builder_legend(many)], ["binned_sah: 12 variants", "ploc", "sweep_sah: 12 variants"])
        with self.assertRaisesRegex(TooMuch, "4 builders are too many to tell apart"):
            builder_markers([f"a_new_one_{n}" for n in "abcd"])

    def test_the_legend_names_builders_that_exist(self):
        def names(*builders):
            return [h.get_label() for h in trade_offs.builder_legend(builder_markers(builders))]

        rounds = [f"binned_sah_reinsertion:reinsertion_rounds={n}" for n in (1, 3)]
        self.assertEqual(names("binned_sah", *rounds), ["binned_sah", *rounds, "…_reinsertion: white dot"])
        self.assertEqual(names("ploc", "ploc_reinsertion", "embree_low"), ["embree_low", "ploc", "…_reinsertion: white dot"])
        self.assertEqual(names("embree_low", "low"), ["low"])

    def test_many_points_have_legible_names_and_numbers(self):
        for module in (build_vs_trace, memory_vs_time):
            with self.subTest(module.TITLE):
                figure = self.draw(module, many())
                figure.draw_without_rendering()
                panels = [axis for axis in figure.axes if axis.get_visible()]
                self.assertEqual(len(panels), 8)
                for axis in panels:
                    named = self.words(axis)
                    self.assertEqual(len(named), trade_offs.MOST_NAMES)
                    texts = [t.get_window_extent() for t in axis.texts] + [axis.xaxis.label.get_window_extent()]
                    self.assertFalse([(a, b) for i, a in enumerate(texts) for b in texts[:i] if a.overlaps(b)])
                    for other in panels:
                        self.assertFalse(other is not axis and any(t.overlaps(other.bbox) or t.overlaps(other.title.get_window_extent()) for t in texts))
                self.assertLess(figure.get_size_inches()[0], 18)


class Visits(Drawn):
    def draw(self, cells):
        return super().draw(visits_per_ray, results_of(cells))

    def counted(self, nodes=9.5, **axes):
        return traced(**axes, nodes_per_ray=nodes, leaves_per_ray=1.9, boxes_per_ray=37.5, triangles_per_ray=0.0)

    def labels(self, axis):
        return [t.get_text() for t in axis.get_yticklabels()]

    def test_a_row_a_way_of_traversal(self):
        cells = [self.counted(nodes, traversal=t, workload=w) for w in ("primary", "shadow", "reflection", "diffuse") for t, nodes in (("single", 10.0), ("packet8", 12345.0))]
        figure = self.draw([*cells, traced("embree", "medium"), self.counted(isa="sse")])
        self.assertEqual([a.get_title(loc="left") for a in figure.axes], ["bunny, primary", "bunny, diffuse"])  # of coherent rays and of incoherent ones
        for axis in figure.axes:
            self.assertEqual([t.get_text() for t in axis.texts], ["12k", "1.9", "37.5", "0", "10.0", "1.9", "37.5", "0"])
        self.assertEqual(self.labels(figure.axes[0]), ["bvh8", "packet8", "single"])
        self.assertEqual(figure.legends[0].get_title().get_text(), "a ray, avx2")
        with self.assertRaises(NoData):
            visits_per_ray.draw(results_of([traced("embree")]))

    def test_workloads_of_a_scene_stay_side_by_side(self):
        figure = self.draw([self.counted(scene=s, workload=w) for s in ("bunny", "dragon", "city") for w in ("primary", "diffuse")])
        row = {axis.get_title(loc="left"): round(axis.get_position().y0, 3) for axis in figure.axes if axis.get_visible()}
        self.assertEqual(len(row), 6)
        self.assertEqual(len(set(row.values())), 2)
        self.assertTrue(all(row[f"{s}, primary"] == row[f"{s}, diffuse"] for s in ("bunny", "dragon", "city")))

    def test_workloads_of_one_kind(self):
        for given, kept in ((["random"], ["random"]), (["whitted", "path"], ["whitted"]), (["primary"], ["primary"]), (["shadow", "reflection"], ["shadow", "reflection"]),
                            (["primary", *(f"diffuse:self_intersection={way}" for way in ("epsilon", "none"))], ["primary", "diffuse:self_intersection=epsilon"])):
            self.assertEqual(visits_per_ray.chosen(given), kept)

    def test_a_row_of_several_tests_is_called_by_them_where_there_are_others(self):
        boxes = ("fast", "ize", "padded")
        (axis,) = self.draw([self.counted(9.5 + (b == "padded"), box=b) for b in boxes]).axes
        self.assertEqual(self.labels(axis), ["bvh8", "fast, ize", "padded"])
        (axis,) = self.draw([self.counted(9.5, box=b) for b in boxes]).axes
        self.assertEqual(self.labels(axis), ["bvh8"])

    def test_titles_of_several_lines_have_room(self):
        figure = self.draw([self.counted(scene=f"sphere-4000:stretch={k}0:offset=100", workload=w) for k in range(5) for w in ("primary", "diffuse:self_intersection=epsilon")])
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of a layout that does not fit
            figure.draw_without_rendering()
        boxes = [a._left_title.get_window_extent() for a in figure.axes if a.get_visible()]
        self.assertEqual(len(boxes), 10)
        self.assertFalse([(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.overlaps(b)])

    def test_tests_that_change_no_number_are_one_row(self):
        tests = ({"leaf": "triangle8", "intersector": "moller_trumbore", "box": "fast"}, {"leaf": "triangle8v", "intersector": "watertight"})
        (axis,) = self.draw([self.counted(n, structure=s, **t) for s in ("bvh4", "bvh8") for t, n in zip(tests, (9.51, 9.52))]).axes
        self.assertEqual(self.labels(axis), ["bvh4, bvh8"])
        figure = self.draw([self.counted(9.5 + (scene == "city") * i, scene=scene, **t) for scene in ("bunny", "city") for i, t in enumerate(tests)])
        self.assertEqual(self.labels(figure.axes[0]), ["bvh8", "triangle8", "triangle8v"])  # they differ in one of the scenes

    def test_many_rows_show_incoherent_rays_alone_and_do_not_run_into_each_other(self):
        cells = [self.counted(9.5 * (i + 1), structure=s, builder=b, scene=scene, workload=w) for scene in ("bunny", "dragon", "a_scene_with_a_name_that_is_long") for w in ("primary", "diffuse")
                 for i, (s, b) in enumerate((s, b + end) for s in STRUCTURES for b in BUILDERS for end in ("", "_reinsertion"))]
        figure = self.draw(cells)
        figure.draw_without_rendering()
        panels = [axis for axis in figure.axes if axis.get_visible()]
        self.assertEqual(len(panels), 3)
        self.assertTrue(all("diffuse" in axis.get_title(loc="left") for axis in panels))
        for axis in panels:
            texts = [t.get_window_extent() for t in axis.texts]
            self.assertFalse([a for a, b in zip(texts, texts[1:]) if a.overlaps(b)])
            self.assertFalse([t for t in texts for other in panels if t.overlaps(other.bbox)])
        self.assertLess(figure.get_size_inches()[0], 18)


if __name__ == "__main__":
    unittest.main()
