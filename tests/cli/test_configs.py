#!/usr/bin/env python3
"""The configurations that come with the project: test_configs.py ARBORETUM. Each has a plan, and each published comparison has its cells in one."""

import json
import sys
import unittest
from pathlib import Path

sys.dont_write_bytecode = True

from command_line_case import CommandLineCase

PROJECT = Path(__file__).resolve().parent.parent.parent
CONFIGS = sorted(PROJECT.glob("configs/**/*.yaml"))
sys.path.insert(0, str(PROJECT / "plots"))


class Configurations(CommandLineCase):
    def listed(self, config, option):
        done = self.call("run", config, option)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.splitlines()

    def plan(self, config):
        """The names of the cells, of those that cannot be measured here, too."""
        return [line.split("  ")[0] for line in self.listed(config, "--dry-run") if line.startswith(("trace/", "build/", "quality/"))]

    def test_each_has_a_plan(self):
        self.assertTrue(CONFIGS)
        for config in CONFIGS:
            with self.subTest(config.name):
                self.assertTrue(self.listed(config, "--list"))

    def test_a_paper_is_drawn_beside_its_figures(self):
        papers = {c.stem for c in CONFIGS if c.parent.name == "papers"}
        self.assertEqual({p.stem for p in PROJECT.glob("plots/published/*.json")}, papers)
        for name in papers:
            text = (PROJECT / "configs/papers" / f"{name}.yaml").read_text(encoding="utf-8")
            self.assertIn(f"\nexperiment: {name}\n", text)
            self.assertIn("\nplots: [published_ratios", text)

    def test_each_published_comparison_has_its_cells(self):
        try:
            from figures.published_ratios import BUILT, TIME, series_of
        except ImportError as error:
            self.skipTest(f"{error.name} is not here")
        from results import AXES, STRUCTURE_AXES, axes_of
        embree = "embree" in self.call("list", "structures").stdout
        for file in sorted(PROJECT.glob("plots/published/*.json")):
            cells = [axes_of({"name": name}) for name in self.plan(PROJECT / "configs/papers" / f"{file.stem}.yaml")]
            for comparison in json.loads(file.read_text(encoding="utf-8"))["comparisons"]:
                self.assertLessEqual(set(comparison), {"name", "claim", "quantity", "unit", "of", "to", "series", "published"})
                for place in comparison["published"]:
                    self.assertLessEqual(set(place), {"label", "quantity", "element", "scene", "workload", "of", "to", "value"})
                    quantity = place.get("quantity", comparison.get("quantity", TIME))
                    axes = STRUCTURE_AXES if quantity in BUILT else AXES
                    for series in series_of(comparison):
                        self.assertLessEqual({*series["of"], *series.get("to", {})}, set(AXES))
                        for side in ("of", "to") if "to" in series else ("of",):
                            wanted = {**series[side], **{a: place[a] for a in ("scene", "workload") if a in place}}
                            if "embree" in wanted.values() and not embree:
                                continue
                            self.assertTrue(any(all(c[a] == v for a, v in wanted.items() if a in axes) for c in cells),
                                            f"{file.name}, {comparison['name']}: no cell has {wanted}")


if __name__ == "__main__":
    unittest.main()
