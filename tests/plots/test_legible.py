"""Tests of plots/: what figures say can be read, and says what was measured."""

import json
import sys
import unittest

sys.dont_write_bytecode = True

from made_results import SEEN, Drawn, Folder, hard, other, results_of  # noqa: E402

import style  # noqa: E402
from figures import leak_picture, rays_per_second, self_intersection, traversal_ratios  # noqa: E402
from results import load  # noqa: E402


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

    def test_a_picture_of_leaks_says_what_was_traced(self):
        figure = self.draw(leak_picture, load(Folder(hard(), files=SEEN).path))
        self.assertEqual(figure._suptitle.get_text(), "ball")
        self.assertEqual([a.get_title().split("\n")[0] for a in figure.axes][::3], ["bvh8 a_new_one", "embree a_new_one", ""])
        seen = {**SEEN, "camera_edges-city.json": SEEN["camera_edges-ball.json"]}
        figure = self.draw(leak_picture, load(Folder([other("camera_edges", s, leak_points=[[3, 4]], cracks=1) for s in ("ball", "city")], files=seen).path))
        self.assertEqual([a.get_title().split("\n")[:2] for a in figure.axes], [["ball", "bvh8 watertight"], ["city", "bvh8 watertight"]])


if __name__ == "__main__":
    unittest.main()
