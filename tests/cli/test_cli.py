#!/usr/bin/env python3
"""The command line from outside: test_cli.py ARBORETUM. Exit statuses, one-line errors, kill and resume, full disks."""

import csv
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import time
import unittest
from pathlib import Path

from command_line_case import ARBORETUM, CONFIG, CommandLineCase, read_jsonl

CUBE = """\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 2 3\nf 1 3 4\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 3 4 8\nf 3 8 7\n"""


class CommandLine(CommandLineCase):
    def test_usage_errors_name_the_nearest_word(self):
        cases = [
            ((), "no command"),
            (("rum",), "did you mean 'run'"),
            (("run",), "CONFIG is required"),
            (("run", "nowhere.yaml"), "nowhere.yaml: no such file"),
            (("run", self.config, "--resum"), "did you mean '--resume'"),
            (("run", self.config, "--repetitions", "0"), "--repetitions"),
            (("run", self.config, "--repetitions", "many"), "--repetitions"),
            (("run", self.config, "--threads", "-1"), "--threads"),
            (("run", self.config, "--seed", "-1"), "--seed: '-1' is no whole number"),
            (("run", self.config, "--seed=18446744073709551616"), "is no whole number from 0 to 18446744073709551615"),
            (("verify", "sphere:100", "--seed", "-1"), "--seed: '-1' is no whole number"),
            (("verify", "sphere:100", "--rays", "-1"), "--rays: '-1' is no whole number"),
            (("render", "sphere:100", "--seed", "-1"), "--seed: '-1' is no whole number"),
            (("run", self.config, "iza=sse"), "did you mean 'isa'"),
            (("run", self.config, "isa=ssse"), "did you mean 'sse'"),
            (("run", self.config, "isa="), "empty"),
            (("run", self.config, "structure=bvh4", "isa=sse", "structure=bvh2"), "structure is given twice"),
            (("run", self.config, "--out", "a", "--out", "b"), "run: --out is given 2 times; keep one"),
            (("run", self.config, "threads=1", "--threads", "2"), "keep one"),
            (("run", self.config, "scene=sphere_flake:100:2", "--list"), "seed: 2 would change nothing"),
            (("verify", "sphere:100", "isa=scalar", "isa=scalar"), "isa is given twice"),
            (("run", self.config, "--filter", "("), "regular expression"),
            (("run", self.config, "--benchmark_nonsense=1"), "--benchmark_nonsense"),
            (("list", "structurs"), "did you mean 'structures'"),
            (("info", "bunni"), "bunny"),
            (("plot", "nowhere"), "no such folder"),
            (("fetch", "dragoon"), "dragon"),
        ]
        for words, part in cases:
            with self.subTest(words=words):
                result = self.call(*words)
                self.assert_error(result, part)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)

    def test_bad_configurations_name_file_and_line(self):
        cases = [
            ("", "empty"),
            ("scenes:\n\t- bunny\n", "bad.yaml:2: a tab"),
            (CONFIG.replace("axes:", "axis:"), "bad.yaml:3: "),
            (CONFIG.replace("isa:", "iza:"), "did you mean 'isa'"),
            (CONFIG.replace("bvh2", "bhv2"), "bad.yaml:4: unknown structure 'bhv2'; did you mean 'bvh2'"),
            (CONFIG.replace("[scalar, sse]", "[]"), "bad.yaml:6: "),
            (CONFIG.replace("[48, 48]", "[0, 48]"), "bad.yaml:8: resolution"),
            (CONFIG.replace("repetitions: 3", "repetitions: -3"), "bad.yaml:8: repetitions"),
            (CONFIG.replace("generate: sphere_flake, triangles: 2000", "file: none.obj"), "bad.yaml:2: "),
        ]
        for text, part in cases:
            with self.subTest(part=part):
                self.assert_error(self.call("run", self.write("bad.yaml", text), "--no-plots"), "bad.yaml", part)

    def test_structures_are_loaded_from_the_cache_in_the_next_run(self):
        self.config = self.write("cached.yaml", CONFIG.replace("measure: {", "measure: {structure_cache: trees, "))
        words = ("structure=bvh4", "isa=scalar", "workload=primary", "--out", "out")
        self.assertEqual(self.run_small(*words).returncode, 0)
        saved = list((self.folder / "trees").iterdir())
        self.assertEqual(len(saved), 2)  # triangle4 and triangle4v
        damaged = bytearray(saved[0].read_bytes())
        damaged[-9] ^= 1
        saved[0].write_bytes(damaged)
        again = self.run_small(*words)
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual(again.stderr.count("is damaged"), 1, again.stderr)
        traced = [c for c in read_jsonl(self.folder / "out/cells.jsonl") if c["metric"] == "trace"]
        self.assertEqual(sorted(("shared_load_seconds" in c, "shared_build_seconds" in c) for c in traced), [(False, True), (True, False)])

    def test_a_structure_that_another_build_of_the_program_saved_is_built_anew(self):
        self.config = self.write("cached.yaml", CONFIG.replace("measure: {", "measure: {structure_cache: trees, "))
        words = ("run", self.config, "--no-plots", "structure=bvh4", "isa=scalar", "intersector=watertight", "workload=primary", "--out", "out")
        other = Path(shutil.copy(ARBORETUM, self.folder / "another"))
        with open(other, "ab") as program:
            program.write(b"x")
        data = {**os.environ, "ARBORETUM_DATA": str(Path(ARBORETUM).resolve().parent / "share/arboretum")}
        notes = []
        for program in (ARBORETUM, other, other, ARBORETUM):
            result = subprocess.run([program, *map(str, words)], capture_output=True, text=True, cwd=self.folder, timeout=300, env=data)
            self.assertEqual(result.returncode, 0, result.stderr)
            notes.append(result.stderr.count("was built by another build of the program"))
        self.assertEqual(notes[0], 0)
        self.assertGreater(notes[1], 0)
        self.assertEqual(notes[2:], [0, notes[1]])

    def test_bad_scenes(self):
        config = "scenes: [{file: model.obj}]\naxes: {structure: bvh4, isa: scalar}\nmeasure: {resolution: [16, 16], min_time: 0.001}\n"
        path = self.write("scene.yaml", config)
        cases = [("", "model.obj"), (CUBE + "f 1 2 99\n", "model.obj"), ("not an obj file\n", "model.obj")]
        for text, part in cases:
            with self.subTest(text=text[-20:]):
                self.write("model.obj", text)
                self.assert_error(self.call("run", path, "--no-plots"), part)
        self.write("model.obj", CUBE + "v nan 0 0\nf 1 2 9\n")
        result = self.call("run", path, "--no-plots")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("model: dropped 1 of 9 triangles: 1 with NaN or infinity", result.stderr)

    def test_a_scene_that_does_not_load_leaves_earlier_results(self):
        bad = self.write("bad.yaml", CONFIG.replace("[{generate: sphere_flake, triangles: 2000}]", "\n  - {generate: sphere_flake, triangles: 2000}\n  - {file: model.obj}"))
        small = ("--filter", "trace.*bvh4.*watertight.*scalar/primary", "--no-plots")
        self.write("model.obj", CUBE)
        self.assertEqual(self.call("run", bad, *small, "--out", "out").returncode, 0)
        before = {p.name: p.read_bytes() for p in (self.folder / "out").iterdir()}
        self.write("model.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        self.assert_error(self.call("run", bad, *small, "--out", "out"), "bad.yaml:4: ", "model.obj")
        self.assertEqual({p.name: p.read_bytes() for p in (self.folder / "out").iterdir()}, before)
        self.assert_error(self.call("run", bad, *small, "--out", "other"), "bad.yaml:4: ")
        self.assertFalse((self.folder / "other").exists())
        unconcerned = ("--filter", "sphere_flake.*bvh4.*watertight.*scalar/primary", "--skip", "^build", "--no-plots")
        self.assertEqual(self.call("run", bad, *unconcerned, "--out", "other").returncode, 0)

    def test_a_scene_file_is_called_by_its_name(self):
        self.write("model.obj", CUBE)
        (self.folder / "sub").mkdir()
        self.write("sub/model.obj", CUBE)
        config = CONFIG.replace("{generate: sphere_flake, triangles: 2000}", "{file: model.obj}, {file: sub/model.obj}")
        self.assert_error(self.call("run", self.write("two.yaml", config), "--list"), "two.yaml:2: scene 'model' is given twice", "a scene file with a `name:`")
        scene = self.write("sub/scene.yaml", "name: other cube\nmeshes: [model.obj]\n")
        config = config.replace("{file: sub/model.obj}", "{scene: sub/scene.yaml}")
        names = self.call("run", self.write("two.yaml", config), "--list").stdout.splitlines()
        self.assertEqual({name.split("/")[1] for name in names}, {"model", "other_cube"})
        self.assertEqual(json.loads(self.call("info", scene, "--json").stdout)["name"], "other cube")
        out = self.call("run", self.folder / "two.yaml", "--list", "scene=other_cube").stdout.splitlines()
        self.assertEqual(out, [name for name in names if "/other_cube/" in name])
        scene.write_text("meshes: [model.obj]\nname: a/b\n")
        self.assert_error(self.call("run", self.folder / "two.yaml", "--list"), "scene.yaml:2: name 'a/b'")

    def test_figures_of_an_earlier_run_go_and_other_files_stay(self):
        few = ("structure=bvh4", "isa=scalar", "workload=primary", "--skip", "^build", "--out", "out")
        (self.folder / "out").mkdir()
        for name in ("sah_cost.png", "sah_cost-2.png", "rays_per_second.svg", "mine.png", "sah_cost-mine.png", "sah_cost.png.txt", "report.html"):
            self.write(f"out/{name}", "old")
        self.assertEqual(self.run_small(*few).returncode, 0)
        left = {p.name for p in (self.folder / "out").iterdir()}
        self.assertEqual(left & {"sah_cost.png", "sah_cost-2.png", "rays_per_second.svg", "mine.png", "sah_cost-mine.png", "sah_cost.png.txt", "report.html"}, {"mine.png", "sah_cost-mine.png", "sah_cost.png.txt"})

    def test_a_chosen_interpreter_that_cannot_draw_is_an_error(self):
        few = ("structure=bvh4", "isa=scalar", "workload=primary", "--skip", "^build")
        self.assertEqual(self.run_small(*few, "--out", "out").returncode, 0)
        wrong = {**os.environ, "ARBORETUM_PYTHON": "/nonexistent/python3"}
        self.assert_error(self.call("plot", "out", env=wrong), "ARBORETUM_PYTHON is '/nonexistent/python3'")
        self.assert_error(self.call("compare", "out", "out", "--plot", "a.svg", env=wrong), "ARBORETUM_PYTHON")
        self.assert_error(self.call("run", self.config, *few, "--out", "other", env=wrong), "ARBORETUM_PYTHON")
        self.assertFalse((self.folder / "other").exists())
        self.assertEqual(self.run_small(*few, "--out", "other", env=wrong).returncode, 0)

    def test_embree_comes_with_its_version_and_what_its_package_costs_it(self):
        if "embree" not in self.call("list", "structures").stdout.split("not available")[0]:
            self.skipTest("no embree here")
        for structures, ways, said in (("bvh4", "single", False), ("bvh4,embree", "single", False), ("bvh4,embree", "single,stream_coherent", True)):
            few = (f"structure={structures}", f"traversal={ways}", "isa=sse", "workload=primary", "intersector=moller_trumbore", "--out", "out")
            for metric in ("^build", "^trace"):
                result = self.run_small(*few, "--skip", metric)
                self.assertIn(result.returncode, (0, 1), result.stderr)
                self.assertEqual(result.stdout.count("x embree"), 2 if metric == "^build" and "embree" in structures else 0)
                self.assertEqual("keeps its assertions on" in result.stdout, said and metric == "^build", (structures, metric))
        context = json.loads((self.folder / "out/results.json").read_text())["context"]
        self.assertRegex(context["embree"], r"^Intel Embree \d+\.[\d.]+$")

    def test_a_run_leaves_what_the_contract_says(self):
        result = self.run_small()
        self.assertIn(result.returncode, (0, 1), result.stderr)
        self.assertNotIn("x embree", result.stdout)
        out = self.folder / "results" / "small"
        wanted = self.cells()
        document = json.loads((out / "results.json").read_text())
        rows = [b for b in document["benchmarks"] if b["run_type"] == "iteration"]
        self.assertEqual(sorted({b["run_name"] for b in rows}), sorted(wanted))
        self.assertEqual(sorted(cell["name"] for cell in read_jsonl(out / "cells.jsonl")), sorted(wanted))
        for row in rows:
            self.assertGreater(row["real_time"], 0)
            if row["metric"] == "trace":
                self.assertGreater(row["rays_per_second"], 0)
                self.assertEqual(row["wrong_answers"], row["missed_hits"] + row["false_hits"] + row["wrong_surface"])
                if row["intersector"] == "watertight":
                    self.assertEqual(row["box"], "padded")
                    self.assertEqual(row["cracks"], 0)
            else:
                self.assertGreater(row["build_seconds"], 0)
                self.assertEqual("refit_seconds" in row, row["structure"].startswith("bvh"))
        for key in ("cpu", "isa", "compiler", "git_revision", "git_dirty", "configuration_hash", "seed", "date", "memory_bytes"):
            self.assertIn(key, document["context"])
        # The revision is the program's, wherever catalogue and plot scripts are taken from.
        there = self.run_small("--out", "there", "--filter", rows[0]["run_name"], env={**os.environ, "ARBORETUM_DATA": str(Path(__file__).parents[2])})
        self.assertIn(there.returncode, (0, 1), there.stderr)
        context = json.loads((self.folder / "there" / "results.json").read_text())["context"]
        self.assertEqual(context["git_revision"], document["context"]["git_revision"])
        wrong = any(row.get("wrong_answers") for row in rows)
        self.assertEqual(result.returncode, 1 if wrong else 0)
        self.assertEqual(len((out / "results.csv").read_text().splitlines()), len(rows) + 1)
        again = self.call("run", out / "effective.yaml", "--list")
        self.assertEqual(again.stdout.splitlines(), wanted)

    def test_listing_filtering_and_overriding(self):
        every = self.cells()
        self.assertEqual(len(every), len(set(every)))
        self.assertTrue(all(name.count("/") == 10 for name in every))
        self.assertEqual(self.cells("--filter", "bvh4.*sse"), [n for n in every if "bvh4" in n and "/sse/" in n])
        self.assertEqual(self.cells("--skip", "^build"), [n for n in every if n.startswith("trace")])
        self.assertTrue(all("/scalar/" in n for n in self.cells("isa=scalar")))
        dry = self.run_small("--dry-run")
        self.assertIn(f"{len(every)} cells", dry.stdout)
        self.assertFalse((self.folder / "results").exists())
        nothing = self.run_small("--filter", "nothing-has-this-name")
        self.assert_error(nothing, "nothing to measure", status=4)
        self.assert_error(self.run_small("--dry-run", "--filter", "nothing-has-this-name"), "nothing to measure", status=4)

    def test_flags_of_google_benchmark(self):
        few = ("structure=bvh4", "isa=scalar", "workload=primary", "--skip", "^build", "--out", "out")
        every = self.cells()
        self.assertEqual(self.cells("--benchmark_filter=all"), every)
        self.assertEqual(self.cells("--benchmark_filter=-bvh4"), [n for n in every if "bvh4" not in n])
        self.assertEqual(self.cells("--benchmark_filter=bvh4", "--filter", "sse", "--skip", "^build"),
                         [n for n in every if "bvh4" in n and "/sse/" in n and not n.startswith("build")])
        result = self.run_small(*few, "--benchmark_min_warmup_time=0.05", "--benchmark_context=foo=bar,note=two words", "--benchmark_out=copy.json",
                                "--benchmark_time_unit=us", "--benchmark_report_aggregates_only=true")
        self.assertEqual(result.returncode, 0, result.stderr)
        document = json.loads((self.folder / "out/results.json").read_text())
        self.assertEqual((document["context"]["foo"], document["context"]["note"]), ("bar", "two words"))
        cells = read_jsonl(self.folder / "out/cells.jsonl")
        self.assertTrue(all([r["repetition_index"] for r in c["repetitions"]] == [0, 1, 2] for c in cells))
        self.assertIn("min_warmup_time: 0.05", (self.folder / "out/effective.yaml").read_text())
        copy = json.loads((self.folder / "copy.json").read_text())
        self.assertEqual({b["run_type"] for b in copy["benchmarks"]}, {"aggregate"})
        medians = [{b["name"]: b for b in d["benchmarks"] if b.get("aggregate_name") == "median"} for d in (document, copy)]
        self.assertEqual(medians[0].keys(), medians[1].keys())
        for name, entry in medians[0].items():
            self.assertAlmostEqual(medians[1][name]["real_time"] / entry["real_time"], 1000, places=3)
            self.assertEqual(medians[1][name]["time_unit"], "us")
        shown = self.run_small(*few, "--benchmark_format=csv", "--benchmark_display_aggregates_only")
        rows = list(csv.DictReader(shown.stdout.splitlines()))
        self.assertEqual({row["aggregate_name"] for row in rows}, {"mean", "median", "stddev", "cv"})

        drawn = self.call("run", self.config, *few, "--benchmark_format=json")  # of stdout alone: figures and report are drawn all the same
        self.assertEqual({b["name"] for b in json.loads(drawn.stdout)["benchmarks"]}, {b["name"] for b in document["benchmarks"]})
        if "no python3 here has matplotlib" not in drawn.stderr:
            self.assertTrue((self.folder / "out/report.html").exists(), drawn.stderr)
            self.assertTrue((self.folder / "out/rays_per_second.png").exists(), drawn.stderr)

        (self.folder / "out").rename(self.folder / "kept")
        self.assert_error(self.run_small(*few, "--benchmark_context=cpu=mine"), "has a 'cpu' of its own")
        self.assert_error(self.run_small(*few, "--benchmark_repetitions=3", "--repetitions", "3"), "keep one")
        self.assert_error(self.run_small(*few, "--benchmark_color=true"), "no effect")
        self.assertFalse((self.folder / "out").exists())

    def test_the_environment_variables_of_google_benchmark_have_no_effect(self):
        few = ("structure=bvh4", "isa=scalar", "workload=primary", "--skip", "^build", "--out", "out")
        plain = self.run_small(*few)
        self.assertEqual(plain.returncode, 0, plain.stderr)
        cells = self.cells(*few[:-2])

        def lines(run):
            return len([line for line in run.stderr.splitlines() if not line.startswith("warning: noisy machine")])

        for name, value in [("MIN_WARMUP_TIME", "0.1"), ("OUT", "/nonexistent/x.json"), ("OUT", "stray.json"), ("LIST_TESTS", "1"), ("FILTER", "nothing"),
                            ("FORMAT", "xml"), ("OUT_FORMAT", "xml"), ("REPETITIONS", "2"), ("TIME_UNIT", "h"), ("PERF_COUNTERS", "CYCLES"), ("V", "3"), ("COLOR", "sometimes"),
                            ("ENABLE_RANDOM_INTERLEAVING", "false"), ("REPORT_AGGREGATES_ONLY", "true")]:
            with self.subTest(name=name, value=value):
                shutil.rmtree(self.folder / "out")
                result = self.run_small(*few, env={**os.environ, "BENCHMARK_" + name: value})
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual(lines(result), lines(plain), result.stderr)
                self.assertTrue(result.stdout.startswith("\nsphere_flake"), result.stdout)
                self.assertTrue((self.folder / "out/results.json").exists())
                measured = read_jsonl(self.folder / "out/cells.jsonl")
                self.assertEqual(sorted(cell["name"] for cell in measured), sorted(cells))
                self.assertTrue(all(len(cell["repetitions"]) == 3 for cell in measured))
        self.assertFalse((self.folder / "stray.json").exists())

    def test_an_isa_that_is_lacking_is_skipped_by_name(self):
        result = self.run_small("isa=scalar,sse", "workload=primary", env={**os.environ, "ARBORETUM_ISA": "scalar"})
        self.assertIn(result.returncode, (0, 1), result.stderr)
        self.assertIn("no sse", result.stdout)
        skipped = json.loads((self.folder / "results/small/results.json").read_text())["skipped"]
        self.assertEqual({cell["reason"] for cell in skipped}, {"no sse"})

    def test_a_killed_run_resumes_to_the_same_cells(self):
        slow = ("--repetitions", "8", "--out", "out")
        whole = sorted(self.cells("--repetitions", "8"))
        process = subprocess.Popen([ARBORETUM, "run", self.config, "--no-plots", *slow, "--benchmark_min_time=0.02"],
                                   cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        journal = self.folder / "out" / "repetitions.jsonl"
        for _ in range(3000):
            if journal.exists() and journal.read_bytes().count(b"\n") >= 100:
                break
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        self.assertEqual(process.returncode, -signal.SIGKILL, "the run ended before it could be killed")
        before = journal.read_text().splitlines()
        done_before = (self.folder / "out/cells.jsonl").read_text().splitlines()
        with journal.open("a") as torn:
            torn.write('{"name": "torn')
        with (self.folder / "out/cells.jsonl").open("a") as torn:
            torn.write('{"name": "torn')

        self.assert_error(self.run_small("--out", "out", "--resume"), "another configuration")
        result = self.run_small(*slow, "--benchmark_min_time=0.02", "--resume")
        self.assertIn(result.returncode, (0, 1), result.stderr)
        cells = read_jsonl(self.folder / "out/cells.jsonl")
        self.assertEqual(sorted(c["name"] for c in cells), whole)
        self.assertTrue(all(len(c["repetitions"]) == 8 for c in cells))
        self.assertEqual([json.loads(line) for line in done_before], cells[:len(done_before)])
        times = {(c["name"], r["repetition_index"]): r["wall_seconds"] for c in cells for r in c["repetitions"]}
        for line in map(json.loads, before):  # nothing was measured twice
            self.assertEqual(times[line["name"], line["repetition_index"]], line["wall_seconds"])

        result = self.run_small(*slow, "--benchmark_min_time=0.02", "--resume")
        self.assertIn(result.returncode, (0, 1))
        self.assertIn(f"({len(whole)} done before)", result.stderr)
        self.assertIn("about 0 s", result.stderr)  # nothing is left

    def test_an_interrupted_run_says_how_it_goes_on(self):
        words = ("--out", "out", "--benchmark_min_time=0.05")
        for sent in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(signal=sent):
                shutil.rmtree(self.folder / "out", ignore_errors=True)
                process = subprocess.Popen([ARBORETUM, "run", self.config, "--no-plots", *words], cwd=self.folder, stdout=subprocess.DEVNULL,
                                           stderr=subprocess.PIPE, text=True, preexec_fn=lambda: signal.signal(sent, signal.SIG_DFL))
                journal = self.folder / "out" / "repetitions.jsonl"
                for _ in range(3000):
                    if journal.exists() and journal.read_bytes().count(b"\n") >= 3:
                        break
                    time.sleep(0.01)
                process.send_signal(sent)
                error = process.communicate(timeout=60)[1]
                self.assertEqual(process.returncode, -sent)
                self.assertEqual(error.splitlines()[-1], "arboretum: interrupted; what was measured is kept, and the same command with --resume goes on from there")
        result = self.run_small(*words, "--resume")
        self.assertIn(result.returncode, (0, 1), result.stderr)

    def crash(self, command, sent, patience):
        """What the program says that gets a signal so many seconds after it began, `run` after its first repetition."""
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        process = subprocess.Popen([ARBORETUM, *command], cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CORE, (0, 0)))
        journal = self.folder / "out" / "repetitions.jsonl"
        for _ in range(3000 if command[0] == "run" else 0):
            if journal.exists() and journal.read_bytes():
                break
            time.sleep(0.01)
        time.sleep(patience)
        process.send_signal(sent)
        error = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, -sent, error)
        return error

    def test_a_crash_names_its_cell(self):
        crashes = {signal.SIGSEGV: "SIGSEGV", signal.SIGBUS: "SIGBUS", signal.SIGFPE: "SIGFPE", signal.SIGILL: "SIGILL", signal.SIGABRT: "SIGABRT"}
        # Nearly all of their time is within cells.
        run = ("run", self.config, "--no-plots", "--out", "out", "--benchmark_min_time=1")
        verify = ("verify", "sphere_flake:20000", "structure=brute_force", "intersector=exact", "isa=scalar", "--rays", "100000000")
        names = self.run_small("--list").stdout.splitlines()
        for sent, word in crashes.items():
            for command in (run, verify):
                with self.subTest(signal=word, command=command[0]):
                    # A repetition that has just been written ends a cell; the next takes a second at least. `verify` tells nothing of where it is: on a busy
                    # machine it may not have begun its first cell.
                    for patience in (0.4,) if command == run else (1.4, 5, 20):
                        error = self.crash(command, sent, patience)
                        if "between cells" not in error:
                            break
                    said = re.fullmatch(r"arboretum: crashed \((\w+)\) in (?:the build for )?([^ ;]+)(; .+)?", error.splitlines()[-1])
                    self.assertTrue(said, error)
                    self.assertEqual(said[1], word)
                    self.assertIn("/brute_force/" if command == verify else "/", said[2])
                    if command == run:
                        self.assertIn(said[2], names)
                        self.assertIn("--resume", said[3])

    def test_resume_leaves_out_what_crashed(self):
        self.assertIn(self.run_small("--out", "out").returncode, (0, 1))
        out = self.folder / "out"
        cells = [cell["name"] for cell in read_jsonl(out / "cells.jsonl") if cell["metric"] == "trace"]
        crashed = cells[-1]
        for file in ("cells.jsonl", "repetitions.jsonl"):
            lines = (out / file).read_text().splitlines(keepends=True)
            (out / file).write_text("".join(line for line in lines if json.loads(line)["name"] != crashed))
        (out / "crashes.txt").write_text(crashed + "\n")
        result = self.run_small("--out", "out", "--resume")
        self.assertIn(f"left out, since {crashed} crashed before", result.stdout + result.stderr)
        self.assertNotIn(crashed, [cell["name"] for cell in read_jsonl(out / "cells.jsonl")])
        (out / "crashes.txt").unlink()
        self.assertIn(self.run_small("--out", "out", "--resume").returncode, (0, 1))
        self.assertIn(crashed, [cell["name"] for cell in read_jsonl(out / "cells.jsonl")])

    def test_resume_on_a_full_disk_leaves_the_results_there(self):
        self.assertIn(self.run_small("--out", "out", "--filter", "bvh4").returncode, (0, 1))
        before = {p.name: p.read_bytes() for p in (self.folder / "out").iterdir()}
        for size in (10, 2000):  # not even effective.yaml; not the plan
            result = self.run_small("--out", "out", "--resume", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))
            self.assert_error(result, "cannot be written", "--resume")
            self.assertEqual((self.folder / "out/results.json").read_bytes(), before["results.json"])
            self.assertEqual((self.folder / "out/results.csv").read_bytes(), before["results.csv"])

    def test_output_that_cannot_be_written(self):
        self.write("file", "")
        self.assert_error(self.run_small("--out", self.folder / "file" / "below"), "output folder")
        self.assert_error(self.run_small("--out", self.folder / "file"), "a file of that name")
        self.assert_error(self.run_small("--out", "/proc/arboretum"), "/proc/arboretum")
        with open("/dev/full", "w") as full:
            result = subprocess.run([ARBORETUM, "list"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
        self.assert_error(result, "output cannot be written")

    def test_a_full_disk_keeps_what_was_measured(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (12000, 12000))

        result = self.run_small("--out", "out", preexec_fn=limit)
        self.assert_error(result, "cannot be written", "--resume")
        lines = (self.folder / "out/repetitions.jsonl").read_text().splitlines()
        self.assertGreater(len(lines), 10)
        for line in lines:
            json.loads(line)
        result = self.run_small("--out", "out", "--resume")
        self.assertIn(result.returncode, (0, 1), result.stderr)
        cells = [cell["name"] for cell in read_jsonl(self.folder / "out/cells.jsonl")]
        self.assertEqual(sorted(cells), sorted(self.cells()))

        (self.folder / "full").mkdir()
        (self.folder / "full/cells.jsonl").symlink_to("/dev/full")
        self.assert_error(self.run_small("--out", "full"), "No space left")

    def test_lists(self):
        listed = json.loads(self.call("list", "--json").stdout)
        for title in ("structures", "builders", "leaves", "intersectors", "boxes", "traversals", "calls", "isas", "workloads", "parameters", "scenes"):
            self.assertTrue(listed[title], title)
            for entry in listed[title]:
                self.assertTrue(entry["summary"], f"{title}: {entry['name']} has no summary")
        self.assertEqual(json.loads(self.call("list", "structures", "--json").stdout), listed["structures"])
        self.assertIn("bvh8", self.call("list", "structures").stdout)
        self.assertLess(max(map(len, self.call("list", "structures").stdout.splitlines())), 320)  # two_level names the builders of all others
        ways = {s["name"]: s["traversals"] for s in listed["structures"] if s["available"]}
        self.assertEqual(ways["brute_force"], ["single"])
        self.assertEqual(ways["grid"], ["single", "packet4", "packet8", "packet16", "packet32", "packet64", "hybrid4", "hybrid8", "hybrid16", "auto"])
        self.assertLess({"single", "packet8", "queued", "stream", "auto"}, set(ways["bvh8"]))
        read = {s["name"]: s["parameters"] for s in listed["structures"] if s["available"]}
        self.assertIn("ploc_radius", read["bvh8"]["ploc"])
        self.assertNotIn("ploc_radius", read["bvh8"]["binned_sah"])
        bins = next(p for p in listed["parameters"] if p["name"] == "bins")
        self.assertEqual((bins["values"], bins["default"]), ("an integer from 4 to 64", "32"))
        self.assertIn("binned_sah, spatial_sah, binned_sah_reinsertion, spatial_sah_reinsertion (bih, bvh2, ", bins["readers"])
        self.assertEqual([p["name"] for p in listed["parameters"] if not p["readers"]], [])
        text = {line.split()[0]: line for line in self.call("list", "parameters").stdout.splitlines()}
        for name, readers in (("bins", "read by binned_sah, spatial_sah, also as …_reinsertion (bih, bvh2, bvh4, bvh8 and 5 more); binned_sah (kdtree)]"), ("reinsertion_rounds", "read by …_reinsertion (bih, bvh2, bvh4, bvh8 and 5 more)]"), ("max_depth", "read by kdtree, octree]"), ("rays_in_flight", "read by queued]")):
            self.assertTrue(text[name].endswith(readers), text[name])
        self.assertEqual(next(b for b in listed["builders"] if b["name"] == "uniform")["parameters"], {"grid": ["grid_density"], "two_level": read["two_level"]["uniform"]})

    def test_info(self):
        info = json.loads(self.call("info", "sphere_flake:2000", "--json").stdout)
        self.assertGreater(info["triangles"], 1000)
        self.assertIn("triangles", self.call("info", "sphere_flake:2000").stdout)
        self.write("a.mtl", "newmtl wall\nKd 1 1 1\nmap_Kd none.png\n")
        self.write("a.obj", "mtllib a.mtl\nusemtl wall\n" + CUBE)
        self.write("b.obj", CUBE.replace("v 0 0 0", "v 0 0 -1"))
        scene = self.write("moving.yaml", "meshes: [a.obj, {keyframes: [a.obj, b.obj]}]\nshutter: [0, 1]\n"
                           "instances: [{mesh: 0, transforms: [{translate: [2, 0, 0]}, {translate: [4, 0, 0]}]}]\n")
        info = json.loads(self.call("info", scene, "--json").stdout)
        self.assertEqual((info["instances"], info["instances_in_scene_file"]), (0, 2))
        self.assertEqual(len([w for w in info["warnings"] if "a.mtl:3: map_Kd" in w and "none.png: no such file" in w]), 1)
        text = self.call("info", scene).stdout
        self.assertIn("instances     2 named by the scene, laid out in one mesh because it moves", text)
        self.assertIn("none.png: no such file", text)

    def test_scenes_of_the_command_line_are_looked_for_where_those_of_a_configuration_are(self):
        (self.folder / "away" / "deep").mkdir(parents=True)
        self.write("away/cube.obj", CUBE)
        self.write("away/deep/yard.yaml", "name: yard\nmeshes: [../cube.obj]\n")
        there = {**os.environ, "ARBORETUM_SCENES": str(self.folder / "away")}
        for word in ("cube.obj", "deep/yard.yaml"):
            self.assert_error(self.call("info", word), word)
            self.assertEqual(json.loads(self.call("info", word, "--json", env=there).stdout)["triangles"], 8)
            self.assertEqual(self.call("run", self.config, f"scene={word}", "--dry-run", env=there).returncode, 0)
            self.assertEqual(self.call("render", word, "--resolution", "4x4", "--spp", "1", env=there).returncode, 0)

    def test_fail_fast_stops_at_the_first_wrong_answer(self):
        words = ("workload=hard_edge", "intersector=moller_trumbore", "isa=scalar", "--skip", "^build")
        wrong = []
        for stops in (False, True):
            result = self.run_small(*words, *["--fail-fast"] * stops)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertEqual("stopped at the first wrong answer" in result.stdout, stops)
            document = json.loads((self.folder / "results/small/results.json").read_text())
            wrong.append({b["run_name"] for b in document["benchmarks"] if b["run_type"] == "iteration" and b["wrong_answers"]})
        self.assertGreater(len(wrong[0]), 1)
        self.assertEqual(len(wrong[1]), 1)
        self.assertLess(wrong[1], wrong[0])


if __name__ == "__main__":
    unittest.main()
