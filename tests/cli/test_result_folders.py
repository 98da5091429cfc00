#!/usr/bin/env python3
"""Result folders from outside: test_result_folders.py ARBORETUM. Shards, merging and comparing, as a user types them."""

import csv
import json
import os
import unittest
from pathlib import Path

from command_line_case import CommandLineCase, read_jsonl

FEW = ("--skip", "diffuse", "--repetitions", "7")


# Something of every kind that results have fields of.
EVERYTHING = """\
scenes: [{generate: sphere, triangles: 400}, {generate: sphere, triangles: 100, offset: [10]}]
axes: {structure: [bvh8, kdtree, grid], isa: sse, traversal: [single, packet8, hybrid4, queued, stream, auto],
       workload: [primary, diffuse, shadow, hard, camera_edges, whitted]}
include: [{structure: bvh4, builder: [morton, ploc, binned_sah_reinsertion], workload: primary}]
measure: {repetitions: 2, min_time: 0.0001, resolution: [16, 16]}
"""


class ResultFolders(CommandLineCase):
    def shard(self, index, of, *words):
        result = self.run_small("--shard", f"{index}/{of}", *FEW, *words)
        self.assertIn(result.returncode, (0, 1), result.stderr)
        return f"results/small-shard-{index}-of-{of}"

    def test_docs_results_md_has_every_column_of_results_csv(self):
        page, of_parameters = ((Path(__file__).parents[2] / "docs" / name).read_text() for name in ("results.md", "command-line.md"))
        self.assertIn(self.call("run", self.write("all.yaml", EVERYTHING), "--no-plots", "--out", "all").returncode, (0, 1))
        with open(self.folder / "all" / "results.csv", newline="") as table:
            columns = next(csv.reader(table))
        self.assertGreater(len(columns), 85)
        for column in columns:
            with self.subTest(column):
                if column.startswith("parameters."):
                    self.assertIn("`parameters.…`", page)
                    self.assertIn(f"`{column.removeprefix('parameters.')}`", of_parameters)
                    continue
                self.assertIn(f"`{column.removeprefix('phase_seconds.').removesuffix('_per_million')}`", page)

    def edit_cells(self, folder, change, to="edited"):
        """A copy of a result folder's cells and machine, changed: `change` gets each cell, `context` the machine."""
        target = self.folder / to
        target.mkdir()
        (target / "plan.json").write_text((self.folder / folder / "plan.json").read_text())
        cells = read_jsonl(self.folder / folder / "cells.jsonl")
        for cell in cells:
            change(cell)
        (target / "cells.jsonl").write_text("".join(json.dumps(cell) + "\n" for cell in cells))
        return to

    def context(self, folder):
        return json.loads((self.folder / folder / "results.json").read_text())["context"]

    def test_shards_list_the_plan_and_bad_ones_are_one_line(self):
        every = self.cells(*FEW)
        for of in (1, 2, 5, 40):
            shards = [self.cells(*FEW, "--shard", f"{i + 1}/{of}") for i in range(of)]
            self.assertEqual(sorted(sum(shards, [])), sorted(every))
        lesser = {**os.environ, "ARBORETUM_ISA": "scalar"}
        here = self.cells(*FEW, "--shard", "2/3")
        there = self.run_small("--list", *FEW, "--shard", "2/3", env=lesser).stdout.splitlines()
        self.assertEqual(there, [name for name in here if "/scalar/" in name])
        dry = self.run_small("--dry-run", *FEW, "--shard", "2/3").stdout
        self.assertIn(f"{len(here)} cells", dry)
        self.assertIn(f"{len(every) - len(here)} in other shards", dry)
        for bad in ("0/2", "3/2", "2", "1/2/3", "one/two", "-1/2", "1/0", ""):
            self.assert_error(self.run_small(f"--shard={bad}", "--list"), "I/N")
        self.assert_error(self.run_small("--shard", "40/40", "--filter", "trace/.*bvh2.*watertight.*/sse/"), "nothing to measure", status=4)

    def test_a_run_gone_on_with_says_each_time_where_its_results_are_from(self):
        folder = self.shard(1, 3)
        plan = self.folder / folder / "plan.json"
        record = json.loads(plan.read_text())
        record["context"]["git_revision"] = "a" * 40
        plan.write_text(json.dumps(record))
        for _ in range(2):  # the second run must not take the first one's revision for that of all results
            again = self.run_small("--shard", "1/3", *FEW, "--resume")
            self.assertIn("begun at revision aaaaaaaaaaaa", again.stderr)
            self.assertIn("begun at revision aaaaaaaaaaaa", " ".join(self.context(folder)["warnings"]))
            self.assertEqual([c["git_revision"] for c in json.loads(plan.read_text())["earlier_contexts"]], ["a" * 40])
        self.assertIn("A was begun at revision aaaaaaaaaaaa", self.call("compare", folder, folder).stdout)

    def as_if_elsewhere(self, folder, cpu="another processor", revision="b" * 40):
        """Makes a folder one that was measured on another machine at another revision."""
        for name in ("cells.jsonl", "repetitions.jsonl"):
            file = self.folder / folder / name
            here = self.context(folder)
            file.write_text(file.read_text().replace(json.dumps(here["cpu"]), json.dumps(cpu)).replace(here["git_revision"], revision))
        for name in ("plan.json", "results.json"):
            file = self.folder / folder / name
            document = json.loads(file.read_text())
            document["context"].update(cpu=cpu, git_revision=revision)
            file.write_text(json.dumps(document))

    def rows(self, folder):
        return [row for row in json.loads((self.folder / folder / "results.json").read_text())["benchmarks"] if row["run_type"] == "iteration"]

    def test_a_run_gone_on_with_elsewhere_says_of_each_row_where_it_is_from_and_does_not_compare(self):
        out = "results/small"
        self.run_small(*FEW, "--filter", "bvh4")
        self.assertFalse(any("cpu" in row for row in self.rows(out)))  # all of one machine: the context says it
        here = self.context(out)
        self.as_if_elsewhere(out)
        self.assertIn(self.run_small(*FEW, "--resume").returncode, (0, 1))
        self.assertEqual({(row["structure"], row["cpu"], row["git_revision"]) for row in self.rows(out)},
                         {("bvh4", "another processor", "b" * 40), ("bvh2", here["cpu"], here["git_revision"])})
        table = list(csv.DictReader((self.folder / out / "results.csv").read_text().splitlines()))
        self.assertEqual({row["cpu"] for row in table if row["structure"] == "bvh4"}, {"another processor"})
        self.run_small(*FEW, "--out", "here")
        for pair in (("here", out), (out, "here")):
            self.assert_error(self.call("compare", *pair), f"{out} was begun on another machine or build", "another processor")
            allowed = self.call("compare", *pair, "--allow-different-machines", "--json", "c.json")
            self.assertIn(allowed.returncode, (0, 3), allowed.stderr)
            self.assertIn(f"{'B' if pair[1] == out else 'A'} was begun at revision {'b' * 12}", allowed.stdout)
            self.assertTrue(json.loads((self.folder / "c.json").read_text())["b" if pair[1] == out else "a"]["begun"])
        (self.folder / out / "plan.json").unlink()  # results.json alone says it too
        (self.folder / out / "cells.jsonl").unlink()
        self.assert_error(self.call("compare", "here", out), f"{out} was begun on another machine or build")
        self.assertEqual(self.call("compare", "here", "here").returncode, 0)

    def test_merged_parts_are_remembered_by_a_run_that_goes_on_with_them(self):
        first, second = self.shard(1, 3), self.shard(2, 3)
        here = self.context(first)
        self.as_if_elsewhere(second)
        self.assert_error(self.call("merge", "out", first, second), "another processor")
        both = ("--allow-different-machines", "--allow-different-revisions", "--no-plots")
        self.assertIn(self.call("merge", "out", first, second, *both).returncode, (0, 1))
        parts = self.context("out")["merged_from"]
        self.assertEqual({row["cpu"] for row in self.rows("out")}, {here["cpu"], "another processor"})
        done = read_jsonl(self.folder / first / "cells.jsonl")[0]["name"]
        self.assertIn(self.run_small("--repetitions", "7", "--filter", f"^{done}$", "--resume", "--out", "out").returncode, (0, 1))
        self.assertEqual(self.context("out")["merged_from"], parts)
        third = self.shard(3, 3)
        self.assert_error(self.call("merge", "again", "out", third), "out was begun under other conditions", "--allow-different-machines")
        self.assert_error(self.call("merge", "again", "out", third, both[0]), "out was begun under other conditions", "--allow-different-revisions")
        self.assertIn(self.call("merge", "again", "out", third, *both).returncode, (0, 1))
        self.assertEqual(self.context("again")["merged_from"][0]["merged_from"], parts)
        self.assertIn(self.run_small(*FEW, "--resume", "--out", "out").returncode, (0, 1))
        self.assertEqual(self.context("out")["merged_from"], parts)
        self.assertEqual(self.context("out")["cpu"], here["cpu"])
        of_second = {cell["name"] for cell in read_jsonl(self.folder / second / "cells.jsonl")}
        for row in self.rows("out"):
            self.assertEqual(row["cpu"], "another processor" if row["run_name"] in of_second else here["cpu"])
        self.run_small(*FEW, "--out", "here")
        self.assert_error(self.call("compare", "here", "out"), "out was begun on another machine or build")

    def test_scenes_that_changed_between_two_runs_are_other_work(self):
        self.shard(1, 1, "--out", "before")
        scene = read_jsonl(self.folder / "before/cells.jsonl")[0]["scene"]
        for name, hash_ in (("before", "1" * 16), ("same", "1" * 16), ("moved", "2" * 16)):
            if name != "before":
                self.edit_cells("before", lambda cell: None, name)
            plan = self.folder / name / "plan.json"
            plan.write_text(json.dumps({**json.loads(plan.read_text()), "geometry": {scene: hash_}}))
        self.assertIn("no regression", self.call("compare", "before", "same").stdout)
        result = self.call("compare", "before", "moved", "--json", "c.json")
        self.assert_error(result, "nothing to compare", status=4)
        self.assertIn(f"measured with different scenes called {scene}", result.stdout)
        incomparable = json.loads((self.folder / "c.json").read_text())["incomparable"]
        self.assertEqual(len(incomparable), len(self.cells(*FEW)))

    def test_other_settings_of_equal_names_are_other_work(self):
        sweep = "scenes: [sphere:400]\naxes: {structure: [bvh4], isa: scalar, workload: [primary, diffuse]}\nparameters: {bins: [%s]}\nrays: {self_intersection: [%s]}\nmeasure: {repetitions: 3, min_time: 0.001, resolution: [16, 16]}\n"
        for out, bins, way in (("few", 4, "none"), ("many", 64, "none"), ("left_out", 4, "exclusion")):
            self.assertIn(self.call("run", self.write("sweep.yaml", sweep % (bins, way)), "--no-plots", "--out", out).returncode, (0, 1))
        result = self.call("compare", "few", "many", "--json", "c.json")
        self.assert_error(result, "nothing to compare", status=4)
        self.assertIn("differs: parameters: bins: [4] against [64]\n", result.stdout)
        self.assertEqual(json.loads((self.folder / "c.json").read_text())["differences"], ["parameters: bins: [4] against [64]"])
        self.assertIn(self.call("compare", "few", "many", "--allow-different-settings").returncode, (0, 3))
        result = self.call("compare", "few", "left_out", "--json", "c.json")
        self.assertIn("differs: rays: self_intersection: [none] against [exclusion]\n", result.stdout)
        incomparable = json.loads((self.folder / "c.json").read_text())["incomparable"]
        self.assertEqual([cell["reason"] for cell in incomparable], ["self_intersection none in A, exclusion in B"])
        self.assertIn("/diffuse/", incomparable[0]["name"])

    def test_a_filter_says_what_is_measured_now_and_takes_nothing_from_what_was(self):
        out = self.folder / "results/small"
        every = self.cells(*FEW)

        def held():
            rows = list(csv.DictReader((out / "results.csv").read_text().splitlines()))
            document = json.loads((out / "results.json").read_text())
            plan = [cell["name"] for cell in json.loads((out / "plan.json").read_text())["cells"]]
            names = list(dict.fromkeys(row["run_name"] for row in rows))
            self.assertEqual(list(dict.fromkeys(b["run_name"] for b in document["benchmarks"])), names)
            self.assertEqual(document["context"]["cells"], len(names))
            self.assertEqual(plan, names)
            return names, len(rows), document

        first = [name for name in every if "bvh4" in name]
        self.assertIn(self.run_small(*FEW, "--filter", "bvh4").returncode, (0, 1))
        self.assertEqual(held()[:2], (first, 7 * len(first)))
        dry = self.run_small(*FEW, "--resume", "--dry-run", "--filter", "bvh4").stdout
        self.assertIn("about 0 s", dry)  # what is left
        self.assertIn(f"{len(first)} cells done before", dry)
        self.assertNotIn("done before", self.run_small(*FEW, "--dry-run").stdout)
        # Of the plan that is shown, and refused where the run would be
        self.assertNotIn("done before", self.run_small(*FEW, "--resume", "--dry-run", "--filter", "bvh2").stdout)
        self.assert_error(self.run_small(*FEW, "--resume", "--dry-run", "--shard", "1/2", "--out", "results/small"), "results of the whole plan")
        self.assert_error(self.run_small("--repetitions", "2", "--resume", "--dry-run"), "holds another configuration (hash ")
        self.assert_error(self.run_small("--repetitions", "2", "--resume"), "holds another configuration (hash ")
        again = self.run_small(*FEW, "--resume", "--filter", "bvh2/.*/sse/")
        self.assertIn(f"({len(first)} done before)", again.stderr)
        both = [name for name in every if "bvh4" in name or "bvh2" in name and "/sse/" in name]
        names, rows, document = held()
        self.assertEqual((names, rows), (both, 7 * len(both)))
        self.assertEqual(document["context"]["filtered_cells"], len(self.cells()) - len(both))
        lesser = {**os.environ, "ARBORETUM_ISA": "scalar"}
        self.assertIn(self.run_small(*FEW, "--resume", env=lesser).returncode, (0, 1))  # what this machine cannot measure stays as well
        names, rows, document = held()
        self.assertEqual((sorted(names), rows), (sorted(every), 7 * len(every)))
        self.assertFalse({s["name"] for s in document["skipped"]} & set(names))
        self.run_small(*FEW, "--resume", "--filter", "bvh4")
        self.assertEqual(held()[:2], (every, 7 * len(every)))
        self.assertEqual(sorted(cell["name"] for cell in read_jsonl(out / "cells.jsonl")), sorted(every))

    def test_a_run_that_begins_anew_loses_nothing(self):
        folder = self.folder / self.shard(1, 3)
        (folder / "notes.txt").write_text("mine")
        first = {name: (folder / name).read_text() for name in ("cells.jsonl", "results.json", "plan.json", "effective.yaml")}
        again = self.run_small("--shard", "1/3", *FEW)
        self.assertIn("the results of the run before are in", again.stderr)
        self.assertEqual({name: (folder / "previous" / name).read_text() for name in first}, first)
        self.assertEqual({c["name"] for c in read_jsonl(folder / "cells.jsonl")}, {c["name"] for c in read_jsonl(folder / "previous/cells.jsonl")})
        self.assertIn(self.call("compare", str(folder / "previous"), str(folder)).returncode, (0, 3))
        self.assertFalse((folder / "previous/notes.txt").exists())
        second = (folder / "cells.jsonl").read_text()
        self.run_small("--shard", "1/3", *FEW)
        self.assertEqual((folder / "previous/cells.jsonl").read_text(), second)
        self.assertFalse((folder / "previous/previous").exists())
        self.run_small("--shard", "1/3", *FEW, "--resume")
        self.assertEqual((folder / "previous/cells.jsonl").read_text(), second)

    def test_merged_shards_are_the_whole_run(self):
        parts = [self.shard(i, 3) for i in (1, 2, 3)]
        self.assertEqual(self.context(parts[1])["shard"], "2/3")
        self.assertIn("# shard: 2/3", (self.folder / parts[1] / "effective.yaml").read_text())
        result = self.call("merge", "results/small", *parts)
        self.assertIn(result.returncode, (0, 1), result.stderr)
        out = self.folder / "results/small"
        every = self.cells(*FEW)
        self.assertEqual([cell["name"] for cell in read_jsonl(out / "cells.jsonl")], every)
        document = json.loads((out / "results.json").read_text())
        self.assertEqual(list(dict.fromkeys(b["run_name"] for b in document["benchmarks"])), every)
        self.assertNotIn("missing", document)
        self.assertTrue((out / "report.html").exists() or "no plots" in result.stderr)
        rows = list(csv.DictReader((out / "results.csv").read_text().splitlines()))
        self.assertEqual(len(rows), 7 * len(every))
        measured = {(c["name"], r["repetition_index"]): r["wall_seconds"] for part in parts for c in read_jsonl(self.folder / part / "cells.jsonl") for r in c["repetitions"]}
        self.assertEqual({(c["name"], r["repetition_index"]): r["wall_seconds"] for c in read_jsonl(out / "cells.jsonl") for r in c["repetitions"]}, measured)
        wrong = any(cell.get("wrong_answers") for cell in read_jsonl(out / "cells.jsonl"))
        self.assertEqual(result.returncode, 1 if wrong else 0)
        again = self.run_small(*FEW, "--resume", "--out", "results/small")
        self.assertIn(f"({len(every)} done before)", again.stderr)

        self.assert_error(self.call("merge", "results/small", *parts), "already holds results")
        self.assert_error(self.call("merge", "other", "results/small", parts[0]), "is in both")
        self.assert_error(self.call("merge", "other", parts[0], parts[0]), "given twice")
        self.assert_error(self.call("merge", "other", "results"), "did you mean")
        self.assert_error(self.call("merge", "other", "results/smal"), "did you mean 'results/small")
        self.assertNotIn("did you mean", self.call("merge", "other", parts[0], "nonexist").stderr)
        self.assert_error(self.call("merge", "other"), "PART")
        self.assert_error(self.run_small(*FEW, "--shard", "2/3", "--resume", "--out", parts[0]), "holds shard 1/3")
        self.assertFalse((self.folder / "other").exists())

    def test_a_missing_shard_is_told_and_can_be_measured_into_the_merged_folder(self):
        first = self.shard(1, 2)
        self.assert_error(self.call("merge", "out", first, "--require-all"), "shard 2/2")
        self.assertFalse((self.folder / "out").exists())
        result = self.call("merge", "out", first, "--no-plots")
        self.assertIn(result.returncode, (0, 1), result.stderr)
        missing = self.cells(*FEW, "--shard", "2/2")
        self.assertIn(f"{len(missing)} of {len(self.cells(*FEW))} cells of the plan are in none of the parts", result.stderr)
        self.assertEqual(json.loads((self.folder / "out/results.json").read_text())["missing"], missing)
        mend = next(line for line in result.stdout.splitlines() if line.startswith("to measure them: ")).split(": ", 1)[1]
        words = [word.strip("'") for word in mend.split()[1:]]
        again = self.call(*words, "--no-plots")
        self.assertIn(again.returncode, (0, 1), again.stderr)
        self.assertEqual(sorted(cell["name"] for cell in read_jsonl(self.folder / "out/cells.jsonl")), sorted(self.cells(*FEW)))

    def test_other_machines_revisions_and_configurations_are_refused(self):
        first, second = self.shard(1, 2), self.shard(2, 2)
        for key, value, part in (("cpu", "another processor", "CPU"), ("compiler", "clang 99", "compiler"), ("git_revision", "f" * 40, "revision")):
            with self.subTest(key=key):
                document = json.loads((self.folder / second / "results.json").read_text())
                document["context"][key] = value
                copy = self.folder / f"{key}-copy"
                copy.mkdir()
                for name in ("cells.jsonl", "effective.yaml", "plan.json"):
                    (copy / name).write_text((self.folder / second / name).read_text())
                (copy / "results.json").write_text(json.dumps(document))
                self.assert_error(self.call("merge", "out", first, copy), part, value[:12])
                option = "--allow-different-revisions" if key == "git_revision" else "--allow-different-machines"
                result = self.call("merge", f"{key}-out", first, copy, option, "--no-plots")
                self.assertIn(result.returncode, (0, 1), result.stderr)
                self.assertIn(value[:12], result.stderr)
                self.assertTrue(self.context(f"{key}-out")["warnings"])
                if key != "git_revision":
                    self.assert_error(self.call("compare", second, copy), part, value)
                    self.assertEqual(self.call("compare", second, copy, "--allow-different-machines").returncode, 0)
        other = self.run_small("--repetitions", "2", "--shard", "2/2", "--skip", "diffuse", "--out", "other")
        self.assertIn(other.returncode, (0, 1))
        self.assert_error(self.call("merge", "out", first, "other"), "different configurations", "repetitions: 2")

    def test_compare_finds_what_changed_and_nothing_else(self):
        def steady(cell):  # what the machine's load did to the repetitions decides nothing
            for i, repetition in enumerate(cell["repetitions"]):
                if cell["metric"] == "trace":
                    repetition["cpu_seconds"] = cell["repetitions"][0]["cpu_seconds"] * (1 + 0.01 * i)

        before = self.edit_cells(self.shard(1, 1, "--out", "results/small-shard-1-of-1"), steady, "steady")
        same = self.call("compare", before, before)
        self.assertEqual(same.returncode, 0, same.stderr)
        every = len(self.cells(*FEW))
        self.assertIn(f"no regression: of {every} cells {every} indistinguishable", same.stdout)

        def slow(cell):
            if cell["structure"] == "bvh4" and cell["metric"] == "trace":
                for repetition in cell["repetitions"]:
                    repetition["cpu_seconds"] *= 3

        after = self.edit_cells(before, slow)
        result = self.call("compare", before, after, "--json", "out.json", "--csv", "out.csv")
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn("regression", result.stdout.splitlines()[-1])
        cells = json.loads((self.folder / "out.json").read_text())["cells"]
        slower = [cell for cell in cells if cell["verdict"] == "slower"]
        self.assertEqual({cell["structure"] for cell in slower}, {"bvh4"})
        self.assertEqual(len(slower), sum("trace" in name and "bvh4" in name for name in self.cells(*FEW)))
        for cell in slower:
            self.assertAlmostEqual(cell["ratio"], 1 / 3, places=6)
        rows = list(csv.DictReader((self.folder / "out.csv").read_text().splitlines()))
        self.assertEqual([row["name"] for row in rows], [cell["name"] for cell in cells])
        self.assertEqual(self.call("compare", after, before).returncode, 0)
        self.assertEqual(self.call("compare", before, after, "--skip", "bvh4").returncode, 0)
        self.assertEqual(self.call("compare", before, after, "--min-difference", "500").returncode, 0)
        self.assertEqual(json.loads(self.call("compare", before, after, "--json", "-").stdout)["exit_status"], 3)

        drawn = self.call("compare", before, after, "--plot", "ratios.svg")
        self.assertEqual(drawn.returncode, 3, drawn.stderr)
        if "no python3 here has matplotlib" not in drawn.stderr:
            self.assertIn("slower", (self.folder / "ratios.svg").read_text())
            self.assertEqual(drawn.stderr, "")
        self.assertEqual(list(self.folder.glob("*.part")), [])

        def wrong(cell):
            if "wrong_answers" in cell and cell["structure"] == "bvh2":
                cell["wrong_answers"] += 1

        result = self.call("compare", before, self.edit_cells(before, wrong, "wrong"))
        self.assertEqual(result.returncode, 3, result.stdout)
        self.assertIn("with more wrong answers", result.stdout)

    def test_compare_needs_two_result_folders_with_something_in_common(self):
        first, second = self.shard(1, 2), self.shard(2, 2)
        self.assert_error(self.call("compare", first, second), "nothing to compare", status=4)
        nothing = self.call("compare", first, first, "--filter", "zzz", "--json", "nothing.json")
        count = len(self.cells(*FEW, "--shard", "1/2"))
        self.assert_error(nothing, f"nothing to compare: --filter 'zzz' leaves none of A's {count} cells nor of B's {count} cells", status=4)
        self.assertIn("--filter 'zzz' leaves none", json.loads((self.folder / "nothing.json").read_text())["verdict"])
        self.assertIn("A and B are one folder", self.call("compare", first, f"./{first}/").stdout)
        self.assertNotIn("one folder", self.call("compare", first, second).stdout)
        self.assert_error(self.call("compare", first), "B is required")
        self.assert_error(self.call("compare", first, "results/small-shard-2-of-3"), f"did you mean '{second}'")
        self.assert_error(self.call("compare", first, "results"), "no result folder")
        self.assert_error(self.call("compare", first, f"{first}/results.json"), f"did you mean '{first}'")
        self.assert_error(self.call("compare", first, first, "--min-diference", "3"), "did you mean '--min-difference'")
        self.assert_error(self.call("compare", first, first, "--min-difference", "-3"), "--min-difference")
        self.assert_error(self.call("compare", first, first, "--filter", "("), "regular expression")
        self.assert_error(self.call("compare", first, first, "--control", "nothing-is-called-so"), "finds no cell")
        self.assert_error(self.call("compare", first, first, "--plot", "ratios.doc"), ".png, .svg or .pdf")
        for option, file in (("--csv", "/nowhere/out.csv"), ("--json", "/nowhere/out.json"), ("--plot", "/nowhere/out.svg"), ("--json", ".")):
            refused = self.call("compare", first, first, option, file)
            self.assert_error(refused, f"{file}: cannot be written", "a folder that exists")
            self.assertNotIn("--out", refused.stderr)
        self.write("results.json", "{")
        self.assert_error(self.call("compare", first, "."), "results.json")


if __name__ == "__main__":
    unittest.main()
