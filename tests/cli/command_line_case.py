"""What the tests of the command line share: a folder of their own, a small configuration, calls and their errors."""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ARBORETUM = sys.argv.pop(1)

CONFIG = """\
experiment: small
scenes: [{generate: sphere_flake, triangles: 2000}]
axes:
  structure: [bvh2, bvh4]
  intersector: [moller_trumbore, watertight]
  isa: [scalar, sse]
  workload: [primary, diffuse]
measure: {repetitions: 3, min_time: 0.001, resolution: [48, 48]}
"""


def read_jsonl(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


class CommandLineCase(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = Path(self.temporary.name)
        self.config = self.write("small.yaml", CONFIG)

    def tearDown(self):
        self.temporary.cleanup()

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text)
        return path

    def call(self, *words, **options):
        return subprocess.run([ARBORETUM, *map(str, words)], capture_output=True, text=True, cwd=self.folder, timeout=300, **options)

    def run_small(self, *words, **options):
        return self.call("run", self.config, "--no-plots", *words, **options)

    def assert_error(self, result, *parts, status=2):
        """One line on stderr beginning with `arboretum: ` and the status."""
        self.assertEqual(result.returncode, status, result.stderr)
        lines = [line for line in result.stderr.splitlines() if line.startswith("arboretum: ")]
        self.assertEqual(len(lines), 1, result.stderr)
        self.assertEqual(result.stderr.splitlines()[-1], lines[0])
        for part in parts:
            self.assertIn(part, lines[0])

    def cells(self, *words):
        return self.run_small("--list", *words).stdout.splitlines()
