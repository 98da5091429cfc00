#!/usr/bin/env python3
"""What is typed and what is said, from outside: test_words.py ARBORETUM. Values without sense, and one-line messages."""

import json
import subprocess
import unittest

from command_line_case import ARBORETUM, CONFIG, CommandLineCase

FEW = ("structure=bvh4", "isa=scalar", "workload=primary", "--skip", "^build")


class Words(CommandLineCase):
    def test_values_without_sense_are_one_line(self):
        cases = [
            (("compare", "a", "b", "--min-difference", "nan"), "--min-difference: 'nan' is no number from 0 to 1000"),
            (("compare", "a", "b", "--significance", "nan"), "--significance: 'nan' is no number from 1e-06 to 0.5"),
            (("render", "sphere:100", "--clamp", "nan"), "--clamp: 'nan' is no number above 0"),
            (("verify", "sphere:100", "--offset", "nan"), "--offset nan is not within"),
            (("run", self.config, "--benchmark_min_time=nan"), "a number from 0 to 3600"),
            (("run", self.config, "--out", ""), "run: --out has an empty value"),
            (("run", self.config, "--filter", ""), "run: --filter has an empty value"),
            (("run", self.config, "--benchmark_filter="), "--benchmark_filter has an empty value"),
            (("render", "sphere:100", "--out", ""), "render: --out has an empty value"),
            (("verify", "sphere:100", "--out", ""), "verify: --out has an empty value"),
            (("compare", "a", "b", "--json", ""), "compare: --json has an empty value"),
            (("compare", "a", "b", "--plot", ""), "compare: --plot has an empty value"),
            (("verify", "sphere:100", "--kinds", "vertex,vertex"), "--kinds: 'vertex' is given twice"),
            (("verify", "sphere:100", "--offset", "0,1,0"), "--offset: '0' is given twice"),
            (("verify", "sphere:100", "--scale", "8,8"), "--scale: '8' is given twice"),
            (("render", "sphere:100", "--effects", "dof,dof"), "--effects: 'dof' is given twice"),
            (("render", "sphere:100", "--resolution", "0x0"), "--resolution 0x0: width and height must each be 1 or more"),
            (("run", self.config, "--rep", "3"), "unknown option '--rep'; did you mean '--repetitions'?"),
            (("run", self.config, "--res"), "did you mean '--resume'?"),
        ]
        for words, part in cases:
            with self.subTest(words=words):
                result = self.call(*words)
                self.assert_error(result, part)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)

    def test_a_missing_kernel_comes_with_what_is_possible(self):
        if "embree" not in self.call("list", "structures").stdout.split("not available")[0]:
            self.skipTest("no embree here")
        result = self.call("render", "sphere:100", "--structure", "embree", "--isa", "scalar")
        self.assert_error(result, "embree has no scalar kernels; possible with --structure embree: --isa sse")

    def test_a_path_that_the_system_refuses_is_named(self):
        name = 300 * "x"
        result = self.call("plot", name)
        self.assert_error(result, f"arboretum: {name}: ", "File name too long")
        self.assertNotIn("output", result.stderr)

    def test_a_closed_stdout_is_said_to_be_closed(self):
        result = subprocess.run(["sh", "-c", f"'{ARBORETUM}' list >&-"], stderr=subprocess.PIPE, text=True, check=False)
        self.assert_error(result, "output cannot be written: stdout is closed")

    def test_the_command_of_results_can_be_typed_again(self):
        self.assertEqual(self.run_small(*FEW, "--filter", "bvh4|bvh2", "--out", "two words").returncode, 0)
        self.assertEqual(self.run_small(*FEW, "--filter", "bvh4|bvh2", "--out", "two words", "--resume").returncode, 0)
        command = json.loads((self.folder / "two words/results.json").read_text())["context"]["command"]
        self.assertNotIn("--resume", command)
        again = subprocess.run(command.replace("arboretum", f"'{ARBORETUM}'", 1), shell=True, cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertIn("the results of the run before are in", again.stderr)

    def test_folders_may_be_called_like_options(self):
        self.assertEqual(self.run_small(*FEW, "--out=-x").returncode, 0)
        drawn = self.call("plot", "./-x", "--only", "epo")
        if "has matplotlib" in drawn.stderr:
            self.skipTest("no python3 here has matplotlib")
        run = self.call("run", self.config, *FEW, "--out=-x")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertTrue((self.folder / "-x/report.html").exists(), run.stderr)
        self.assert_error(self.call("plot", "./-x", "--only", "epo,epo"), "--only: 'epo' is given twice")
        (self.folder / "-x/results.json").write_text("{")
        (self.folder / "-x/cells.jsonl").unlink()
        broken = self.call("plot", "./-x")
        self.assert_error(broken, "no plots: ")
        self.assertEqual(len(broken.stderr.splitlines()), 1, broken.stderr)

    def test_broken_json_is_named_by_its_line(self):
        self.assertEqual(self.run_small(*FEW, "--out", "out").returncode, 0)
        plan = self.folder / "out/plan.json"
        for text, part in (('{\n "context": {,', "plan.json:2: no JSON: unexpected ','; expected string literal"), ("{}", "plan.json: not the plan")):
            plan.write_text(text)
            for words in (("compare", "out", "out"), ("run", self.config, *FEW, "--no-plots", "--out", "out", "--resume")):
                result = self.call(*words)
                self.assert_error(result, part)
                self.assertNotIn("json.exception", result.stderr)

    def test_what_cannot_be_read_in_a_result_folder_is_not_taken_for_missing(self):
        self.assertEqual(self.run_small(*FEW, "--out", "out").returncode, 0)
        again = ("run", self.config, *FEW, "--no-plots", "--out", "out", "--resume")
        for name, calls in (("plan.json", (("compare", "out", "out"), again)), ("cells.jsonl", (("compare", "out", "out"), again)),
                            ("camera_edges-flake.json", (("merge", "joined", "out", "--no-plots"),))):
            file = self.folder / "out" / name
            text = file.read_bytes() if file.exists() else None
            file.unlink(missing_ok=True)
            file.mkdir()
            for words in calls:
                self.assert_error(self.call(*words), f"out/{name}: is a folder")
            file.rmdir()
            if text is not None:
                file.write_bytes(text)

    def test_verify_leaves_no_cases_of_a_run_before(self):
        (self.folder / "out").mkdir()
        old = self.write("out/cases.json", "old")
        words = ("verify", "sphere:100", "structure=bvh4", "isa=scalar", "intersector=exact", "--rays", "500", "--out", "out")
        result = self.call(*words)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertFalse(old.exists())
        self.assertTrue((self.folder / "out/verify.csv").exists())

    def test_a_cache_that_cannot_be_written_is_said_before_the_run(self):
        self.write("trees", "a file")
        self.config = self.write("cached.yaml", CONFIG.replace("measure: {", "measure: {structure_cache: trees, "))
        self.assert_error(self.run_small("--out", "out"), "cached.yaml:8: ", "trees: the structure cache cannot be made", "name another folder")
        self.assertFalse((self.folder / "out").exists())

    def test_listings_tell_what_became_of_includes(self):
        config = CONFIG + "include: [{structure: bvh8, isa: avx2}, {structure: bvh8, isa: sse}]\nexclude: [{structure: bvh8, workload: diffuse}]\n"
        self.config = self.write("small.yaml", config)
        left = "small.yaml:9: this include is left out: the command line names no isa of it"
        listed = self.run_small("--list", "isa=sse")
        self.assertIn(left, listed.stderr)
        self.assertNotIn("avx2", listed.stdout)
        self.assertTrue(all(line.count("/") == 10 for line in listed.stdout.splitlines()))
        dry = self.run_small("--dry-run", "isa=sse").stdout
        self.assertIn(left, dry)
        excluded = [line for line in dry.splitlines() if "  excluded: " in line]
        self.assertEqual(len(excluded), 2)
        self.assertTrue(all("/bvh8/" in line and "/diffuse/" in line and "small.yaml:10 takes away" in line for line in excluded))


if __name__ == "__main__":
    unittest.main()
