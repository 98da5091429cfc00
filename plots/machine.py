"""What the context of results says of the machine and the build, in the words of a person."""

import json

LABELS = {  # in the order of the report; behind them those that are new
    "date": "begun", "host_name": "host", "cpu": "CPU", "cores": "hardware threads", "mhz_per_cpu": "clock, MHz", "governor": "frequency governor",
    "cpu_scaling_enabled": "frequency scaling", "caches": "caches", "memory_bytes": "memory", "load": "load averages when begun: 1, 5, 15 minutes",
    "isa": "instruction sets", "system": "operating system", "compiler": "compiler", "compiler_flags": "compiler flags", "build_type": "type of build",
    "version": "version of Arboretum", "embree": "Embree", "git_revision": "revision", "git_dirty": "changes that no revision holds",
    "configuration_hash": "hash of the configuration", "seed": "seed of random numbers", "shard": "shard", "cells": "cells measured",
    "excluded_cells": "cells that exclude took away", "filtered_cells": "cells that --filter took away", "skipped_cells": "cells skipped",
    "missing_cells": "cells missing", "merged_from": "merged from"}
ELSEWHERE = ("experiment", "warnings", "plots", "executable", "library_build_type", "command", "scenes",  # in other parts of the report
             "load_avg", "num_cpus")  # the same as others


def facts(context):
    """[(label, text)]."""
    keys = [key for key in (*LABELS, *(k for k in context if k not in LABELS)) if key in context and key not in ELSEWHERE]
    return [(LABELS.get(key, key), words(key, context[key])) for key in keys]


def words(key, value):
    """A value of the context as text; what is not of the type that `run` writes as it is."""
    try:
        if key in SPELT:
            return SPELT[key](value)
    except (AttributeError, KeyError, TypeError, ValueError):
        pass
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
        return "; ".join(", ".join(f"{LABELS.get(k, k)} {v}" for k, v in item.items()) for item in value)
    if isinstance(value, list) and not any(isinstance(v, (dict, list)) for v in value):
        return ", ".join(map(str, value))
    return json.dumps(value) if isinstance(value, (dict, list)) else str(value)


def size(size_in_bytes):
    """300 MiB, 1.5 GiB."""
    power = min(3, (int(size_in_bytes).bit_length() - 1) // 10)
    return f"{size_in_bytes / 2**(10 * power):.{1 if power == 3 else 0}f} {('bytes', 'KiB', 'MiB', 'GiB')[power]}"


def cache(told):
    kind = {"Data": " data", "Instruction": " instruction"}.get(told["type"], "")
    return f"L{told['level']}{kind} {size(told['size'])}" + (f" for {told['num_sharing']} hardware threads" if told["num_sharing"] > 1 else "")


SPELT = {"memory_bytes": size, "caches": lambda caches: ", ".join(map(cache, caches)), "load": lambda load: ", ".join(load.split()[:3])}
