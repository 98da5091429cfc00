#!/usr/bin/env python3
"""Every unit of the project is compiled with -ffp-contract=off, none with a flag that lets the compiler change values or
pick the instruction set of the machine it runs on.

usage: check_flags.py compile_commands.json
"""
import json
import os
import shlex
import sys

FORBIDDEN = ("-ffast-math", "-Ofast", "-fassociative-math", "-freciprocal-math", "-funsafe-math-optimizations", "-march=",
             "-mavx", "-mfma", "-msse4", "-ffinite-math-only", "-fno-signed-zeros", "-ffp-contract=fast", "-ffp-contract=on")


def faults(words):
    contract = [word for word in words if word.startswith("-ffp-contract=")]
    if not contract or contract[-1] != "-ffp-contract=off":
        yield "no -ffp-contract=off"
    for word in words:
        if word.startswith(FORBIDDEN):
            yield word


def self_test():
    assert list(faults(["c++", "-O3"])) == ["no -ffp-contract=off"]
    assert list(faults(["c++", "-ffp-contract=off", "-mavx2"])) == ["-mavx2"]
    assert list(faults(["c++", "-ffp-contract=off", "-ffp-contract=fast"])) == ["no -ffp-contract=off", "-ffp-contract=fast"]
    assert not list(faults(["c++", "-O3", "-ffp-contract=off"]))


def main(path):
    self_test()
    with open(path) as file:
        units = json.load(file)
    bad = kernels = 0
    for unit in units:
        words = unit.get("arguments") or shlex.split(unit["command"])
        kernels += f"{os.sep}kernels{os.sep}" in unit["file"]
        for fault in faults(words):
            print(f"{unit['file']}: {fault}")
            bad += 1
    print(f"{len(units)} units, {kernels} of kernels, {bad} faults")
    return 1 if bad or kernels == 0 else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
