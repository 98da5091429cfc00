#!/usr/bin/env python3
"""The installed package from outside, as a user meets it.

usage: test_package.py STEP SETTINGS.json    (written by CMake: tests/CMakeLists.txt)
  install    installs the build tree and moves the result: nothing of it may know where it was built
  library    examples/library, built against the installation and against the build tree, and run
  structure  examples/structure, built out of tree: its structure is listed, passes the tests and is swept with right answers
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

STEP = sys.argv[1]
SETTINGS = json.loads(Path(sys.argv[2]).read_text())
BUILD, SOURCE = Path(SETTINGS["build"]), Path(SETTINGS["source"])
WORK = BUILD / "package-test"
PREFIX = WORK / "moved"
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith("ARBORETUM_DATA")}


def call(*words, expect=0, **options):
    result = subprocess.run([str(w) for w in words], capture_output=True, text=True, env=ENVIRONMENT, timeout=600, **options)
    if (result.returncode == 0) != (expect == 0):
        sys.exit(f"{' '.join(map(str, words))}\nended with status {result.returncode}\n{result.stdout}\n{result.stderr}")
    return result


def check(condition, message):
    if not condition:
        sys.exit(f"failed: {message}")


def configure(source, build, *words, expect=0):
    shutil.rmtree(build, ignore_errors=True)
    return call(SETTINGS["cmake"], "-S", source, "-B", build, "-G", SETTINGS["generator"], f"-DCMAKE_CXX_COMPILER={SETTINGS['compiler']}",
                f"-DCMAKE_BUILD_TYPE={SETTINGS['build_type']}", f"-DCMAKE_CXX_FLAGS={SETTINGS['flags']}", *words, expect=expect)


def build(folder):
    result = call(SETTINGS["cmake"], "--build", folder, "--parallel", os.cpu_count() or 2)
    check("warning:" not in result.stdout + result.stderr, f"{folder} is built with warnings: {result.stdout}{result.stderr}")


def step_install():
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir()
    call(SETTINGS["cmake"], "--install", BUILD, "--prefix", WORK / "prefix")
    (WORK / "prefix").rename(PREFIX)
    # With assertions or debugging information a library names its sources; a release must not.
    names = [str(p).encode() for p in (BUILD, SOURCE)] if SETTINGS["build_type"] == "Release" and not SETTINGS["sanitize"] else []
    for path in (p for p in PREFIX.rglob("*") if p.is_file()):
        content = path.read_bytes()
        for name in names:
            check(name not in content, f"{path} names {name.decode()}")
        if path.suffix == ".h" and PREFIX / "include" in path.parents:
            found = re.search(rb'#\s*include\s+"(?!arboretum/)[^"]*/', content)
            check(not found, f"{path} includes {found and found[0]}")
    check((PREFIX / "include/arboretum/arboretum.h").is_file(), "no <arboretum/arboretum.h>")
    program = PREFIX / "bin/arboretum"
    ours, theirs = (call(p, "list", "--json", cwd="/").stdout for p in (BUILD / "arboretum", program))
    check(ours == theirs, "the installed program lists something else than the built one")
    check("bunny" in call(program, "list", "scenes", cwd="/").stdout, "the installed program does not find its catalogue")
    check((PREFIX / "share/arboretum/plots/plot.py").is_file(), "no plot scripts")
    revision = (PREFIX / "share/arboretum/revision").read_text()
    check(re.fullmatch(r"(unknown|[0-9a-f]{40})( dirty)?\n", revision), f"revision '{revision}'")


def step_library():
    example = PREFIX / "share/arboretum/examples/library"
    for name, where in (("installed", f"-DCMAKE_PREFIX_PATH={PREFIX}"), ("build tree", f"-Darboretum_DIR={BUILD}")):
        folder = WORK / f"library {name}"
        configure(example, folder, where)
        build(folder)
        for words in (["24"], ["12", "bvh2"]):
            output = call(folder / "sphere", *words).stdout
            print(f"{name}: {output}", end="")
            check(", 0 wrong" in output, "the three ways differ")
    error = call(folder / "sphere", "12", "bhv8", expect=2).stderr
    check("did you mean 'bvh8'" in error, error)

    wrong = WORK / "wrong"
    wrong.mkdir(exist_ok=True)
    (wrong / "CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.22)\nproject(wrong LANGUAGES CXX)\n"
                                          "find_package(arboretum REQUIRED COMPONENTS forest)\n")
    error = configure(wrong, wrong / "build", f"-DCMAKE_PREFIX_PATH={PREFIX}", expect=1).stderr
    check("forest" in error, f"an unknown component passes, or is not named: {error}")

    # A build tree of the program alone: its tests are not built. Where they are asked for they are missing, else left out.
    half = WORK / "half built"
    half.mkdir(exist_ok=True)
    for path in (*BUILD.glob("arboretum*.cmake"), BUILD / "ArboretumStructures.cmake"):
        shutil.copy(path, half)
    targets = half / "arboretum-tests-targets.cmake"
    targets.write_text(targets.read_text().replace("libarboretum_catch_main", "libnot_there"))
    (half / "share").unlink(missing_ok=True)
    (half / "share").symlink_to(BUILD / "share")
    for words, status in (("OPTIONAL_COMPONENTS", 0), ("COMPONENTS", 1)):
        (wrong / "CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.22)\nproject(half LANGUAGES CXX)\n"
                                              f"find_package(arboretum REQUIRED {words} tests)\nif(TARGET arboretum::tests OR arboretum_tests_FOUND)\n"
                                              "  message(FATAL_ERROR \"tests are there\")\nendif()\n")
        result = configure(wrong, wrong / "build", f"-Darboretum_DIR={half}", expect=status)
        told = " ".join((result.stdout + result.stderr).split())
        check("libnot_there.a is not built yet" in told and "tests are there" not in told, f"{words} tests of a half-built tree: {told}")
    for function in ("arboretum_executable", "arboretum_kernel_tests"):
        (wrong / "CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.22)\nproject(wrong LANGUAGES CXX)\n"
                                              f"find_package(arboretum REQUIRED)\n{function}(mine STRUCTURE sorted_boxes)\n")
        error = configure(wrong, wrong / "build", f"-DCMAKE_PREFIX_PATH={PREFIX}", expect=1).stderr
        check("unknown words 'STRUCTURE;sorted_boxes'" in " ".join(error.split()), f"{function} takes any word: {error}")


def step_structure():
    configure(SOURCE / "examples/structure", WORK / "structure of the build tree", f"-Darboretum_DIR={BUILD}")
    misspelt = WORK / "misspelt"
    shutil.rmtree(misspelt, ignore_errors=True)
    shutil.copytree(SOURCE / "examples/structure", misspelt)
    said = misspelt / "sorted_boxes/sorted_boxes_parameters.h"
    text = said.read_text()
    for name in ("builder_parameters", "builder_summary", "own_parameters"):
        said.write_text(text.replace(f" {name}(", f" {name}s("))
        error = " ".join(configure(misspelt, misspelt / "build", f"-Darboretum_DIR={BUILD}", expect=1).stderr.split())
        check(f"sorted_boxes_parameters.h: {name}s(std::type_identity<...>) would never be called" in error, f"{name}s: {error}")
    folder = WORK / "structure"
    configure(PREFIX / "share/arboretum/examples/structure", folder, f"-DCMAKE_PREFIX_PATH={PREFIX}")
    build(folder)
    program = folder / "my_arboretum"

    objects = sorted(folder.rglob("*sorted_boxes_SortedBoxes_*.o"))
    check(objects, "no kernel objects")
    call(sys.executable, SOURCE / "tests/symbols/check_symbols.py", *objects)

    cases = call(folder / "test_my_structures", "--list-test-names-only", expect=1).stdout  # Catch's status is their number
    check(all(f"\nB{number:02}: " in cases for number in range(1, 31)), f"not all of the cases B01 to B30: {cases}")
    tests = call(folder / "test_my_structures").stdout
    check("All tests passed" in tests, tests)

    built_in = [line.split()[0] for line in call(BUILD / "arboretum", "list", "structures").stdout.splitlines()]
    listed = [line.split()[0] for line in call(program, "list", "structures", cwd="/").stdout.splitlines()]
    check(sorted(listed) == sorted([*built_in, "sorted_boxes"]), f"list structures: {listed}")
    entry = [e for e in json.loads(call(program, "list", "--json").stdout)["structures"] if e["name"] == "sorted_boxes"]
    check(len(entry) == 1 and entry[0]["available"] and "binned_sah" in entry[0]["builders"], f"list --json: {entry}")

    builders = {b["name"]: b for b in json.loads(call(program, "list", "builders", "--json").stdout)}
    check(builders["mesh_order"]["summary"] == "blocks of triangles that follow each other in the mesh", f"list builders: {builders['mesh_order']}")
    check(builders["mesh_order"]["parameters"]["sorted_boxes"] == ["run_length"], f"list builders: {builders['mesh_order']}")
    parameters = {p["name"]: p for p in json.loads(call(program, "list", "parameters", "--json").stdout)}
    told = [parameters["run_length"][key] for key in ("values", "default", "readers")]
    check(told == ["an integer from 1 to 16", "16", "mesh_order (sorted_boxes)"], f"list parameters: {told}")

    results = WORK / "results"
    shutil.rmtree(results, ignore_errors=True)
    call(program, "run", PREFIX / "share/arboretum/examples/structure/sweep.yaml", "--no-plots", "--out", results)
    rows = json.loads((results / "results.json").read_text())["benchmarks"]
    traces = [r for r in rows if r["name"].startswith("trace/") and r.get("run_type", "iteration") == "iteration"]
    own = [r for r in traces if r["structure"] == "sorted_boxes"]
    hits = {}
    for row in traces:
        check(row["wrong_answers"] == 0, f"{row['name']}: {row['wrong_answers']} wrong answers")
        hits.setdefault((row["workload"], row["intersector"], row["box"]), set()).add(row["hits"])
    check(len({(r["workload"], r["intersector"], r["box"]) for r in own}) == 12, f"{len(own)} rows of sorted_boxes")
    runs = {r["parameters"]["run_length"]: r for r in traces if r["builder"].startswith("mesh_order")}
    check({n: r["builder"] for n, r in runs.items()} == {n: f"mesh_order:run_length={n}" for n in (4, 8)}, f"rows of mesh_order: {list(runs)}")
    block = {n: min(n, int(re.search(r"\d+", r["leaf"])[0])) for n, r in runs.items()}
    check(all(r["leaves"] == -(-r["triangles"] // block[n]) for n, r in runs.items()), "run_length does not arrive in the build")
    check(all("run_length" not in r.get("parameters", {}) for r in traces if not r["builder"].startswith("mesh_order")), "all read run_length")
    check(all(len(numbers) == 1 for numbers in hits.values()), f"structures differ in their hits: {hits}")
    check(all(0 < r["triangles_per_ray"] and 0 < r["nodes_per_ray"] for r in own), "no counters")
    sweep = WORK / "sweep.yaml"
    sweep.write_text((PREFIX / "share/arboretum/examples/structure/sweep.yaml").read_text().replace("[4, 8]", "[4, 17]"))
    error = call(program, "run", sweep, expect=2).stderr
    check("sweep.yaml:" in error and "run_length must be an integer from 1 to 16, not '17'" in error, f"a value beyond the limits: {error}")
    quality = [r for r in rows if r["structure"] == "sorted_boxes" and r.get("sah_cost")]
    check(quality, "no SAH cost")
    print(f"{len(traces)} timed repetitions, {len(own)} of sorted_boxes, no wrong answer")


{"install": step_install, "library": step_library, "structure": step_structure}[STEP]()
