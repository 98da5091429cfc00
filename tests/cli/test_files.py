#!/usr/bin/env python3
"""What a run reads and writes, from outside: test_files.py ARBORETUM. Scenes that change, two runs at once, pipes."""

import json
import os
import shutil
import subprocess
import threading
import time
import unittest
from pathlib import Path

from command_line_case import ARBORETUM, CommandLineCase, read_jsonl

CUBE = """\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 2 3\nf 1 3 4\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 3 4 8\nf 3 8 7\n"""

MODEL = """\
scenes: [{file: model.obj}]
axes: {structure: [bvh2, bvh4], isa: scalar}
metrics: [trace]
measure: {repetitions: 3, min_time: 0.001, resolution: [16, 16]}
"""
FEW = ("structure=bvh4", "isa=scalar", "workload=primary", "--skip", "^build")


class Files(CommandLineCase):
    def model(self, *words):
        return self.call("run", self.write("model.yaml", MODEL), "--no-plots", *words)

    def contents(self, folder):
        return {p.name: p.read_bytes() for p in (self.folder / folder).iterdir()}

    def test_a_run_is_not_gone_on_with_where_its_scene_has_changed(self):
        self.write("model.obj", CUBE)
        self.assertEqual(self.model("--out", "out", "--filter", "bvh2").returncode, 0)
        before = self.contents("out")
        self.write("model.obj", CUBE.replace("v 0 0 0", "v 0 0 -1"))
        self.assert_error(self.model("--out", "out", "--resume"), "model.yaml:1: scene model is not what out was measured with")
        self.assertEqual(self.contents("out"), before)
        self.write("model.obj", CUBE + "# a comment changes no triangle\n")
        self.assertEqual(self.model("--out", "out", "--resume").returncode, 0)
        self.assertEqual(len(read_jsonl(self.folder / "out/cells.jsonl")), 2)
        # A folder of an older revision says nothing of geometry: it may be gone on with.
        plan = json.loads((self.folder / "out/plan.json").read_text())
        self.assertEqual(list(plan.pop("geometry")), ["model"])
        (self.folder / "out/plan.json").write_text(json.dumps(plan))
        self.write("model.obj", CUBE.replace("v 0 0 0", "v 0 0 -1"))
        self.assertEqual(self.model("--out", "out", "--resume").returncode, 0)

    def test_what_a_scene_lost_is_told_wherever_its_results_are(self):
        self.write("model.obj", CUBE.replace("v 0 0 0", "v 1e-30 0 0"))  # too small to be scaled down with the rest
        self.write("half.yaml", "meshes: [model.obj]\ninstances: [{mesh: model, transforms: [{translate: [1e20, 0, 0]}, {translate: [0, 0, 0]}]}]\n")
        config = self.write("sweep.yaml", MODEL.replace("{file: model.obj}", "{scene: half.yaml}, sphere:1"))
        lost = "dropped 8 of 16 triangles: 8 out of range"
        whole = self.call("run", config, "--no-plots", "--out", "out")
        self.assertEqual(whole.returncode, 0, whole.stderr)
        self.assertIn(f"warning: half: {lost}", whole.stderr)
        context = json.loads((self.folder / "out/results.json").read_text())["context"]
        self.assertEqual(context["scenes"]["half"]["dropped"], {"non_finite": 0, "out_of_range": 8, "degenerate": 0})
        self.assertEqual((context["scenes"]["half"]["triangles"], context["scenes"]["half"]["triangles_read"]), (8, 16))
        self.assertEqual(context["scenes"]["sphere-1"]["warnings"], ["sphere:1 has 6 triangles, not 1 (closed: the next lower even count, 6 at least)"])
        self.assertIn(f"half: {lost}", context["warnings"])
        self.assertEqual(json.loads((self.folder / "out/plan.json").read_text())["context"]["scenes"]["half"], context["scenes"]["half"])
        # Gone on with, merged, and drawn
        again = self.call("run", config, "--no-plots", "--out", "out", "--resume", "--filter", "sphere")
        self.assertIn(f"warning: half: {lost}", again.stderr)
        for part, words in enumerate(("half", "sphere")):
            self.assertEqual(self.call("run", config, "--no-plots", "--out", f"part{part}", "--filter", words).returncode, 0)
        merged = self.call("merge", "merged", "part0", "part1", "--no-plots")
        self.assertEqual(merged.returncode, 0, merged.stderr)
        self.assertIn(f"warning: half: {lost}", merged.stderr)
        self.assertEqual(json.loads((self.folder / "merged/results.json").read_text())["context"]["scenes"], context["scenes"])
        self.assertIn(f"warning       {lost}\n", self.call("render", "half.yaml", "--resolution", "8x8", "--spp", "1").stdout)
        self.assertIn(f"warning       {lost}\n", self.call("render", "half.yaml", "--resolution", "8x8", "--heatmap", "nodes").stdout)
        self.assertIn("warning       sphere:1 has 6 triangles, not 1", self.call("info", "sphere:1").stdout)

    def test_a_scene_file_with_another_camera_is_another_scene(self):
        self.write("model.obj", CUBE)
        scene = "name: yard\nmeshes: [{file: model.obj}]\ncamera: {position: [%s, 2, 5], look_at: [0, 0, 0]}\n"
        config = self.write("yard.yaml", MODEL.replace("{file: model.obj}", "{scene: yard_scene.yaml}"))
        self.write("yard_scene.yaml", scene % 1)
        self.assertEqual(self.call("run", config, "--no-plots", "--out", "out", "--filter", "bvh2").returncode, 0)
        self.write("yard_scene.yaml", scene % 3)
        self.assert_error(self.call("run", config, "--no-plots", "--out", "out", "--resume"), "scene yard is not what out was measured with (geometry, camera")

    def test_a_scene_that_changes_before_its_turn_ends_the_run(self):
        self.write("model.obj", CUBE)
        scene = "name: yard\nmeshes: [{file: model.obj}]\ncamera: {position: [%s, 2, 5], look_at: [0, 0, 0]}\n"
        config = self.write("yard.yaml", MODEL.replace("{file: model.obj}", "sphere:200, {scene: yard_scene.yaml}"))
        file = self.write("yard_scene.yaml", scene % 1)
        run = subprocess.Popen([ARBORETUM, "run", config, "--no-plots", "--out", "out", "--benchmark_min_time=0.5"],
                               cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for _ in range(3000):
            if (self.folder / "out/plan.json").exists():
                break
            time.sleep(0.01)
        file.write_text(scene % 3)
        errors = run.communicate(timeout=300)[1].splitlines()
        self.assertEqual(run.returncode, 2, errors)
        self.assertIn("arboretum: scene yard is not what it was when the run began (geometry, camera", errors[-1])

    def test_a_scene_with_another_shutter_material_or_image_is_another_scene(self):
        def model(name, material, move=0):
            self.write(f"{name}.obj", f"mtllib all.mtl\nusemtl {material}\n" + CUBE.replace("v 0 0 0", f"v {move} 0 0").replace("f 3 4 8", "usemtl plain\nf 3 4 8"))

        def image(name, *values):  # PGM
            (self.folder / name).write_bytes(b"P5 2 1 255\n" + bytes(values))

        def scene(close):
            self.write("moving.yaml", f"name: moving\nmeshes: [{{keyframes: [a.obj, b.obj]}}]\nshutter: [0, {close}]\nenvironment: {{image: sky.pgm}}\n")

        def as_it_was():
            self.write("all.mtl", "newmtl plain\nKd 1 1 1\nnewmtl mirror\nKd 1 1 1\nKs 1 1 1\nillum 3\nnewmtl worn\nKd 1 1 1\nmap_Kd worn.pgm\n")
            model("a", "mirror"), model("b", "mirror", move=-1), scene(1)
            image("worn.pgm", 0, 255), image("sky.pgm", 0, 255)

        config = self.write("motion.yaml", "scenes: [{scene: moving.yaml}]\naxes: {structure: bvh4_motion, isa: scalar, workload: [primary, shadow]}\n"
                                           "metrics: [trace]\nmeasure: {repetitions: 3, min_time: 0.001, resolution: [16, 16]}\n")
        as_it_was()
        result = self.call("run", config, "--no-plots", "--out", "out", "--filter", "primary")
        self.assertEqual(result.returncode, 0, result.stderr)
        for what, change in (("shutter", lambda: scene(0.25)),
                             ("materials of triangles", lambda: (model("a", "plain"), model("b", "plain", move=-1))),
                             ("image of a material", lambda: image("worn.pgm", 255, 0)),
                             ("image that is gone", lambda: (self.folder / "worn.pgm").unlink()),
                             ("environment's image", lambda: image("sky.pgm", 255, 0))):
            with self.subTest(what=what):
                as_it_was()
                change()
                self.assert_error(self.call("run", config, "--no-plots", "--out", "out", "--resume"), "scene moving is not what out was measured with (geometry, camera, shutter")
        as_it_was()
        self.assertEqual(self.call("run", config, "--no-plots", "--out", "out", "--resume").returncode, 0)

    def test_names_that_are_no_utf8(self):
        def raw(*words):
            return self.call(*words, encoding="utf-8", errors="surrogateescape")

        odd = os.fsdecode(b"mod\xffel")
        self.write(odd + ".obj", CUBE)
        words = ("run", self.write("model.yaml", MODEL.replace("{file: model.obj}", "bunny")), f"scene={odd}.obj", "--no-plots", "--out", odd)
        result = raw(*words, "--filter", "bvh2")
        self.assertEqual(result.returncode, 0, result.stderr)
        result = raw(*words, "--resume")
        self.assertEqual(result.returncode, 0, result.stderr)
        names = [line["name"] for line in read_jsonl(self.folder / odd / "cells.jsonl")]
        self.assertEqual([name.split("/")[1:3] for name in names], [["mod?el", "bvh2"], ["mod?el", "bvh4"]])
        context = json.loads((self.folder / odd / "results.json").read_text(encoding="utf-8"))["context"]
        self.assertIn("mod\ufffdel.obj", context["command"])
        result = raw("compare", odd, odd, "--json", "c.json")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(json.loads((self.folder / "c.json").read_text(encoding="utf-8"))["a"]["folder"], "mod\ufffdel")
        result = raw("info", f"{odd}.obj", "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(json.loads(result.stdout)["name"], "mod?el")
        result = raw("merge", "both", odd, "--no-plots")
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_parts_that_found_a_scene_in_different_folders_merge(self):
        for place, shard in (("here", "1/2"), ("there", "2/2")):
            (self.folder / place).mkdir()
            self.write(f"{place}/model.obj", CUBE)
            config = self.write(f"{place}/model.yaml", MODEL)
            self.assertEqual(self.call("run", config, "--no-plots", "--shard", shard, "--out", f"out_{place}").returncode, 0)
        self.assertEqual(self.call("merge", "both", "out_here", "out_there", "--no-plots").returncode, 0)

    def test_parts_of_different_geometry_do_not_merge(self):
        self.write("model.obj", CUBE)
        self.assertEqual(self.model("--shard", "1/2", "--out", "a").returncode, 0)
        self.write("model.obj", CUBE.replace("v 0 0 0", "v 0 0 -1"))
        self.assertEqual(self.model("--shard", "2/2", "--out", "b").returncode, 0)
        self.assert_error(self.call("merge", "both", "a", "b", "--no-plots"), "a and b were measured with different scenes called model")
        self.assertFalse((self.folder / "both").exists())
        self.write("model.obj", CUBE)
        self.assertEqual(self.model("--shard", "2/2", "--out", "b").returncode, 0)
        self.assertEqual(self.call("merge", "both", "a", "b", "--no-plots").returncode, 0)
        self.assertEqual(list(json.loads((self.folder / "both/plan.json").read_text())["geometry"]), ["model"])

    def test_one_run_at_a_time_writes_into_a_folder(self):
        first = subprocess.Popen([ARBORETUM, "run", self.config, "--no-plots", "--out", "out", "--benchmark_min_time=2"],
                                 cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            for _ in range(3000):
                if (self.folder / "out/plan.json").exists():
                    break
                time.sleep(0.01)
            for words in ((), ("--resume", "--benchmark_min_time=2")):
                self.assert_error(self.run_small("--out", "out", *words), f"out: another run writes here (process {first.pid}); give another --out")
            self.assertEqual(self.run_small("--out", "other", *FEW).returncode, 0)
            self.assert_error(self.call("merge", "out", "other", "--no-plots"), "out: ")
        finally:
            first.kill()
            first.wait()
        self.assertEqual(self.run_small("--out", "out", *FEW).returncode, 0)  # freed by the kernel

    def compared(self, *words, **options):
        result = self.call("compare", "out", "out", *words, **options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def test_what_is_no_regular_file_is_written_to_as_it_stands(self):
        self.assertEqual(self.run_small("--out", "out", *FEW).returncode, 0)
        pipe = self.folder / "pipe"
        os.mkfifo(pipe)
        (self.folder / "link").symlink_to("pipe")
        for name in ("pipe", "link"):
            with self.subTest(name=name):
                read = []
                reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
                reader.start()
                self.compared("--json", name)
                reader.join(60)
                self.assertEqual(json.loads(read[0])["exit_status"], 0)
                self.assertTrue(pipe.is_fifo())
        read = []
        reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
        reader.start()
        self.assertEqual(self.run_small("--out", "out", *FEW, "--benchmark_out=pipe").returncode, 0)
        reader.join(60)
        self.assertTrue(json.loads(read[0])["benchmarks"])
        self.assertEqual(list(self.folder.glob("*.part")), [])

    def test_a_link_stays_and_what_it_leads_to_is_written(self):
        self.assertEqual(self.run_small("--out", "out", *FEW).returncode, 0)
        (self.folder / "kept").mkdir()
        for target in ("kept/there.csv", "kept/not_yet.csv"):
            (self.folder / "link").unlink(missing_ok=True)
            (self.folder / "link").symlink_to(target)
            self.write("kept/there.csv", "old")
            self.compared("--csv", "link")
            self.assertTrue((self.folder / "link").is_symlink())
            self.assertTrue((self.folder / target).read_text().startswith("name,"))

    def test_a_program_that_is_older_than_its_sources_does_not_stand_for_their_revision(self):
        program = self.folder / "arboretum"
        shutil.copy(ARBORETUM, program)
        os.symlink(Path(ARBORETUM).resolve().parent / "share", self.folder / "share")
        os.utime(program, (1e9, 1e9))
        self.write("model.obj", CUBE)
        command = [program, "run", self.write("model.yaml", MODEL), "--no-plots", "--out", "out", *FEW]
        subprocess.run(command, cwd=self.folder, check=True, capture_output=True)
        context = json.loads((self.folder / "out" / "results.json").read_text())["context"]
        if context["git_revision"] == "unknown":
            self.skipTest("no git repository")
        self.assertTrue(context["git_dirty"])

    def test_descriptors_of_the_shell_are_written_to(self):
        self.assertEqual(self.run_small("--out", "out", *FEW).returncode, 0)
        ends = os.pipe()
        self.compared("--json", f"/proc/self/fd/{ends[1]}", pass_fds=[ends[1]])
        os.close(ends[1])
        with os.fdopen(ends[0]) as pipe:
            self.assertEqual(json.load(pipe)["exit_status"], 0)
        with open(self.folder / "all.txt", "w") as out:  # stdout is a file: what is printed comes first, and stays
            subprocess.run([ARBORETUM, "compare", "out", "out", "--csv", "/proc/self/fd/1"], cwd=self.folder, stdout=out, check=True)
        text = (self.folder / "all.txt").read_text()
        self.assertLess(text.index("no regression"), text.index("\nname,"))


if __name__ == "__main__":
    unittest.main()
