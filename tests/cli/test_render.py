#!/usr/bin/env python3
"""`render` and the renderers as workloads, from outside: test_render.py ARBORETUM."""

import json
import unittest

from command_line_case import CommandLineCase

CUBE = """\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 2 3\nf 1 3 4\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 3 4 8\nf 3 8 7\n"""


class Render(CommandLineCase):
    def render(self, *words, spp=2):
        result = self.call("render", "cornell_box:600", "--resolution", "16x12", *(("--spp", spp) if spp else ()), *words)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def test_render_writes_a_picture_and_says_what_it_simulates(self):
        text = self.render()
        self.assertEqual((self.folder / "image.png").read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        for line in ("  + mirror ", "  + shadow_soft ", "  - dof ", "  camera                  384 ", "picture       image.png"):
            self.assertIn(line, text)
        self.assertNotIn("env_light  ", text.split("rays  ")[1])
        self.assertIn("  - mirror        LEFT OUT as asked", self.render("--effects", "shadow_soft,diffuse_gi", "--out", "less.png"))
        self.assertIn("  + dof           as asked, though the scene does not call for it", self.render("--effects", "all"))

    def test_render_is_the_same_for_all_effects_structures_and_threads(self):
        pictures = set()
        for i, words in enumerate(((), ("--effects", "all"), ("--structure", "kdtree"), ("--structure", "bvh16", "--traversal", "queued"), ("--threads", "2"))):
            self.assertIn(f"picture       {i}.pfm (radiance; ", self.render("--out", f"{i}.pfm", *words))
            pictures.add((self.folder / f"{i}.pfm").read_bytes())
        self.assertEqual(len(pictures), 1)
        self.render("--seed", "2", "--out", "other.pfm")
        self.assertNotIn((self.folder / "other.pfm").read_bytes(), pictures)

    def test_render_other_integrators_and_heat_maps(self):
        for integrator in ("whitted", "ambient_occlusion", "normals"):
            self.assertIn(f"integrator    {integrator}", self.render("--integrator", integrator))
        self.assertNotIn("warning", self.render())
        self.assertIn("heat maps take single rays where the traversal is auto\n", self.render("--heatmap", "nodes", spp=None))
        self.assertNotIn("take single rays", self.render("--heatmap", "nodes", "--traversal", "packet8", spp=None))
        normals = self.render("--integrator", "normals", "--effects", "mirror,env_light", "--threads", "2")
        self.assertIn("  - mirror        no part of normals; the scene has", normals)
        self.assertIn("  - env_light     no part of normals, though asked for", normals)
        self.assertIn(", seed 1, 2 threads\n", normals)
        self.assertIn("(exposure +0.00 stops", normals)
        self.assertIn("(exposure +0.00 stops", self.render("--integrator", "ambient_occlusion"))
        self.assertIn("(automatic exposure", self.render("--integrator", "normals", "--exposure", "auto"))
        self.assertIn("(exposure +1.50 stops", self.render("--integrator", "normals", "--exposure", "+1.5"))
        self.assertIn("paths         depth 7, clamp 2.5\n", self.render("--depth", "7", "--clamp", "2.5"))
        for what in ("nodes", "triangles"):
            result = self.call("render", "cornell_box:600", "--resolution", "16x12", "--heatmap", what)
            self.assertIn(f"heat map      {what} a camera ray: mean", result.stdout)
        result = self.call("render", "cornell_box:600", "--resolution", "16x12", "--heatmap", "nodes", "--effects", "mirror,motion_blur")
        self.assertIn("effects       no part of heat maps, though asked for: mirror\n", result.stdout)
        # Without motion_blur the cloth stands still, which structures that hold no motion can trace.
        still = self.call("render", "waving_cloth:200", "--resolution", "8x8", "--heatmap", "nodes", "--effects", "dof", "--structure", "bvh8")
        self.assertEqual(still.returncode, 0, still.stderr)
        self.assert_error(self.call("render", "waving_cloth:200", "--resolution", "8x8", "--heatmap", "nodes", "--structure", "bvh8"), "bvh4_motion")
        (self.folder / "cube.obj").write_text(CUBE)
        dark = self.call("render", "cube.obj", "--resolution", "8x8")
        self.assertIn("ambient_occlusion", dark.stdout)  # nothing emits light
        self.assertNotIn("warning", dark.stdout)
        for integrator in ("path", "whitted"):
            black = self.call("render", "cube.obj", "--resolution", "8x8", "--spp", "1", "--integrator", integrator, "--effects", "all")
            self.assertIn(f"warning       nothing in the scene emits light, so {integrator} draws it black; take --integrator ambient_occlusion", black.stdout)
        self.assertIn("warning       --effects leaves out all light that the scene has", self.render("--effects", "mirror,env_light"))
        idle = self.call("render", "cornell_box:600", "--resolution", "8x8", "--integrator", "normals", "--effects", "mirror,env_light")
        self.assertEqual((idle.returncode, idle.stderr), (0, "--effects mirror,env_light changes nothing: normals has no part for effects but dof, motion_blur, alpha_cutout and instancing\n"))
        lens = self.call("render", "cornell_box:600", "--resolution", "8x8", "--integrator", "normals", "--effects", "dof")
        self.assertEqual((lens.returncode, lens.stderr), (0, ""))
        self.assert_error(self.call("render", "cube.obj", "--resolution", "8x8", "--depth", "9"), "--depth has no effect: ambient_occlusion", "nothing in the scene emits light")

    def test_render_errors(self):
        cases = [
            (("--effects", "mirrors"), "did you mean 'mirror'"),
            (("--integrator", "paht"), "did you mean 'path'"),
            (("--heatmap", "nods"), "did you mean 'nodes'"),
            (("--structure", "bvh9"), "did you mean 'bvh"),
            (("--builder", "sah"), "builder"),
            (("--structure", "kdtree", "--builder", "ploc"), "ploc"),
            (("--resolution", "16"), "WIDTHxHEIGHT"),
            (("--resolution", "0x5"), "resolution 0x5"),
            (("--spp", "0"), "--spp"),
            (("--exposure", "bright"), "--exposure"),
            *((("--exposure", word), f"--exposure '{word}' is neither 'auto' nor a number of stops") for word in ("0x1p3", " 1", "1 ", "nan", "inf", "+-1", "+", "1e999")),
            (("--out", "a.jpg"), ".png"),
            (("--out", "nowhere/a.png"), "no such folder"),
            (("--heatmap", "nodes", "--out", "a.pfm"), ".png"),
            (("--heatmap", "nodes", "--resolution", "65000x65000"), ".pfm"),
            (("--resolution", "40000x40000"), ".pfm"),
            (("--out", "folder.png"), "cannot be written"),
            (("--exposure", "1", "--out", "a.pfm"), "--exposure has no effect: a.pfm holds the radiance itself; take it out"),
            (("--clamp", "nan"), "clamp"),
            (("--clamp", "0"), "--clamp"),
            (("--integrator", "whitted", "--depth", "33"), "0 to 32"),
            (("--integrator", "ambient_occlusion", "--depth", "9"), "--depth has no effect: ambient_occlusion follows no paths; take it out"),
            (("--integrator", "normals", "--clamp", "2"), "--clamp has no effect: normals follows no paths; take it out"),
            (("--effects", "all,mirror"), "'all' stands alone"),
            (("--effects", "mirror,"), "an empty name"),
            (("--heatmap", "nodes", "--effects", "mirrors"), "did you mean 'mirror'"),
            (("--isa", "ssse"), "did you mean 'sse'"),
            (("--sppp", "4"), "did you mean '--spp'"),
        ]
        (self.folder / "folder.png").mkdir()
        for option, value in (("--spp", "4"), ("--depth", "3"), ("--clamp", "2"), ("--exposure", "0"), ("--integrator", "path"), ("--seed", "2")):
            cases.append((("--heatmap", "nodes", option, value), option))
        for words, part in cases:
            with self.subTest(words=words):
                self.assert_error(self.call("render", "cornell_box:600", *words), part)
        self.assert_error(self.call("render", "waving_cloth:200", "--structure", "bvh8"), "bvh4_motion")

    def test_renderers_are_workloads(self):
        cells = [c for c in self.cells("workload=whitted,path") if c.startswith("trace/")]
        self.assertEqual({c.split("/")[-2] for c in cells}, {"whitted", "path"})
        result = self.run_small("workload=whitted,path", "isa=sse", "--repetitions", "2")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("all answers right", result.stdout)
        names = [b["name"] for b in json.loads((self.folder / "results/small/results.json").read_text())["benchmarks"] if b.get("shading_share")]
        self.assertEqual({n.split("/")[9] for n in names}, {"whitted", "path"})


if __name__ == "__main__":
    unittest.main()
