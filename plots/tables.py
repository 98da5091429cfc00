"""The tables of the report as HTML: every text is escaped, every throughput stands beside its wrong answers."""

import math
from html import escape

from results import STRUCTURE_AXES, axis_sort_key, interval_name, interval_words, ordered

PER_MILLION = (("wrong_answers", "wrong"), ("missed_hits", "missed"), ("false_hits", "false"),
               ("wrong_surface", "wrong surface"), ("wrong_primitive", "wrong primitive"), ("wrong_uv", "wrong u, v"),
               ("cracks", "cracks"))

SAH_STEP = ("A visit of a node counts as one step whatever the number of its children (of a grid, each cell crossed), and a leaf block as one test whatever "
            "the number of its triangles: a lower cost of wider nodes or blocks is not less work by as much.")


def number(value, form="{:.3g}".format):
    """A table cell that sorts by the value itself; empty where there is none."""
    if value is None:
        return '<td class="number"></td>'
    return f'<td class="number" data-v="{value!r}">{escape(form(value))}</td>'


def digits(value):
    """Three digits or all before the point; without an exponent, but where zeros would hide it."""
    if value == 0:
        return "0"
    if abs(value) < 1e-9:
        return f"{value:.3g}"
    before = math.floor(math.log10(abs(float(f"{value:.3g}"))))  # of the rounded value: 9.999 is 10.0
    return f"{value:.{max(0, 2 - before)}f}"


def per_million_text(rate):
    """A number of answers per million rays, to three digits, as figures and tables write it: 172,000, 12, 0.5."""
    return "0" if rate == 0 else f"{float(f'{rate:.3g}'):,.0f}" if rate >= 10 else f"{rate:.2g}"


def per_million(rate):
    """A table cell of it; empty where there is none."""
    return number(None) if rate is None else f'<td class="number" data-v="{rate!r}">{per_million_text(rate)}</td>'


def figure(value):
    """Four digits for what is measured, all of them for what is counted."""
    whole = value is not None and (abs(value) >= 1000 or value == int(value))
    return number(value, ("{:,.0f}" if whole else "{:#.4g}").format)


def text(value, key=False):
    return f'<td{" class=key" if key else ""}>{escape(str(value))}</td>'


def table(identity, heads, rows):
    """`heads`: (label, numeric); `rows`: (html cells, css class). Sortable, with a filter above."""
    head = "".join(f'<th scope="col"{" class=number" if numeric else ""}><button type="button">{escape(label)}</button></th>'
                   for label, numeric in heads)
    body = "\n".join(f'<tr{f" class={css}" if css else ""}>{"".join(cells)}</tr>' for cells, css in rows)
    search = (f'<input type="search" data-table="{identity}" placeholder="filter, e.g. bvh8 avx2 diffuse" '
              'aria-label="filter the rows">') if len(rows) > 15 else ""
    return (f'{search}<div class="scroll"><table class="sortable" id="{identity}"><thead><tr>{head}'
            f"</tr></thead><tbody>\n{body}\n</tbody></table></div>")


def sorted_cells(cells, axes):
    order = {a: {v: i for i, v in enumerate(ordered((c[a] for c in cells), a))} for a in axes}
    return sorted(cells, key=lambda c: [order[a][c[a]] for a in axes])


def embree_rates(results, metric):
    """The fastest embree cell of each scene, workload, ISA and thread count: what ratios are to."""
    best = {}
    for cell in results.traces:
        if cell["structure"] == "embree" and cell.value(metric):
            key = beside(cell)
            best[key] = max(best.get(key, 0.0), cell.value(metric))
    return best


ASSERTIONS = "Debian's package keeps its assertions on, which costs it about 12 % on streams: ratios to it have to be read with that in mind."
BOTH_FLAGS = ("A comparison with its packets and streams needs its cells …_coherent and …_incoherent both: which is faster depends on scene and workload, "
              "not on the workload's name alone.")


def embree_note(results, shown):
    """What has to be known where cells of embree's are among those `shown`; nothing where there are none."""
    cells = [c for c in shown if c["structure"] == "embree"]
    if not cells:
        return ""
    version = results.context.get("embree")
    words = [f"embree: {version}, as it is installed." if version else "embree: as it is installed."]
    if any(cell["traversal"].startswith("stream") for cell in cells):
        words.append(ASSERTIONS)
    if any(cell["traversal"].startswith(("packet", "stream")) for cell in cells):
        words.append(BOTH_FLAGS)
    return f'<p class="soft">{escape(" ".join(words))}</p>'


def beside(cell):
    return tuple(cell[a] for a in ("scene", "workload", "isa", "threads"))


def shown_axes(cells, axes, always=("scene", "structure")):
    """Axes worth a column: those that vary, and `always`."""
    return [a for a in axes if a in always or len({c[a] for c in cells}) > 1]


def constant_axes(cells, axes):
    """'threads: 1, box: fast' for the axes that every cell shares."""
    return ", ".join(f"{a}: {cells[0][a]}" for a in axes if len({c[a] for c in cells}) == 1 and cells[0][a])


THROUGHPUT_AXES = ("scene", "workload", "isa", "structure", "builder", "leaf", "intersector", "box", "traversal", "threads")


def throughput_table(results):
    metric, unit = results.throughput()
    cells = sorted_cells([c for c in results.traces if c.value(metric)], THROUGHPUT_AXES)
    if not cells:
        return "<p>No cell has a throughput.</p>"
    axes = shown_axes(cells, THROUGHPUT_AXES)
    reference = embree_rates(results, metric)
    counts = [(name, label) for name, label in PER_MILLION if any(c.per_million(name) is not None for c in cells)]
    extra = [(name, label) for name, label in (("nodes_per_ray", "nodes/ray"), ("triangles_per_ray", "tri/ray"),
                                               ("simd_utilization", "lane use"), ("t_error_ulp_p99", "t error p99, ulp"),
                                               ("interval_tests_per_ray", "interval tests/ray"), ("rays_per_node_visit", "rays/node visit"),
                                               ("rays_per_leaf_visit", "rays/leaf visit"), ("packet_share", "rays in packets"),
                                               ("stream_share", "rays in streams"), ("queued_share", "rays in flight"), ("single_share", "rays singly"),
                                               ("switches_per_packet", "switches/packet"), ("rays_per_switch", "rays/switch"),
                                               ("node_queue_length", "nodes queued"), ("leaf_queue_length", "leaves queued"))
             if any(c.value(name) is not None for c in cells)]
    if any(cell.value("hits") == 0 for cell in cells):
        extra.insert(0, ("hits", "rays that hit, %"))
    children = any(cell.series("children_hit") for cell in cells)
    if any(":self_intersection=" in c["workload"] for c in cells):  # every secondary ray has these figures: shown where they are the subject
        extra += [("self_hits_per_million", "own surface met per million"), ("near_hits_per_million", "neighbour met per million"),
                  ("leaks_per_million", "passed through per million"), ("start_distance", "start's distance, diagonals")]
    best = {}
    for cell in cells:
        best[beside(cell)] = max(best.get(beside(cell), 0.0), cell.value(metric))

    heads = [(a, False) for a in axes] + [(unit, True), (interval_name(c.estimate(metric).samples for c in cells), False), ("wrong per million", True)]
    heads += [("× embree", True)] if reference else []
    heads += [(f"ns/ray, {results.clock()}", True)] + [(f"{label} per million", True) for name, label in counts if name != "wrong_answers"]
    heads += [(label, True) for _, label in extra] + ([("children hit: 0, 1, 2, 3, 4+, %", False)] if children else [])
    rows = []
    for cell in cells:
        rate = cell.estimate(metric)
        out = [text(cell[a], key=a == "structure") for a in axes]
        out += [number(rate.median / 1e6, digits), text(f"{digits(rate.low / 1e6)} – {digits(rate.high / 1e6)}" if rate.samples > 1 else "-")]
        out.append(per_million(cell.per_million("wrong_answers"))
                   if cell.per_million("wrong_answers") is not None else text("not checked"))
        if reference:
            base = reference.get(beside(cell))
            out.append(number(rate.median / base if base else None, digits))
        out.append(number(1e9 / rate.median, digits))
        out += [per_million(cell.per_million(name)) for name, _ in counts if name != "wrong_answers"]
        out += [number(cell.hit_share() if name == "hits" else cell.value(name)) for name, _ in extra]
        if children:
            out.append(text(" ".join(f"{100 * share:.0f}" for share in cell.series("children_hit"))))
        rows.append((out, "best" if rate.median == best[beside(cell)] else ""))
    note = constant_axes(cells, [a for a in THROUGHPUT_AXES if a not in axes])
    return (f'<p class="soft">Throughput: {escape(unit)}, the median of the repetitions, with '
            f'{escape(interval_words(c.estimate(metric).samples for c in cells))}. Wrong answers are missed hits, false '
            f"hits and wrong surfaces against exact arithmetic; “wrong primitive” and “wrong u, v” (off by more than 2⁻¹⁰) count apart. The fastest "
            f"structure of a scene, workload and ISA is green. {escape('Same for all: ' + note + '.' if note else '')}</p>"
            + table("throughput", heads, rows))


STRUCTURE_COLUMNS = (("build_seconds", "build, ms", 1e3), ("triangles_per_second", "Mtri/s", 1e-6), ("refit_seconds", "refit, ms", 1e3),
                     ("sah_cost", "SAH cost", 1), ("sah_child_cost", "SAH, child boxes", 1), ("epo", "EPO", 1), ("lcv", "LCV", 1),
                     ("duplication", "references/triangle", 1), ("leaf_fill", "leaf fill", 1), ("nodes", "nodes", 1), ("leaves", "leaves", 1),
                     ("depth", "depth", 1), ("bytes_per_triangle", "bytes/triangle", 1), ("bytes", "MiB", 2.0**-20),
                     ("peak_build_bytes", "peak while building, MiB", 2.0**-20))


def structure_table(results):
    if not results.structures:
        return "<p>No structure has build or quality figures.</p>"
    cells = sorted_cells(results.structures, STRUCTURE_AXES)
    axes = shown_axes(cells, STRUCTURE_AXES)
    columns = [c for c in STRUCTURE_COLUMNS if any(cell.value(c[0]) is not None for cell in cells)]
    heads = [(a, False) for a in axes] + [(label, True) for _, label, _ in columns]
    rows = []
    for cell in cells:
        values = [(cell.value(name), scale) for name, _, scale in columns]
        numbers = [figure(None if v is None else v * scale) for v, scale in values]
        rows.append(([text(cell[a], key=a == "structure") for a in axes] + numbers, ""))
    note = f"SAH cost: {SAH_STEP[0].lower()}{SAH_STEP[1:]} With child boxes: a node counts a step for each box of its children."
    return (f'<p class="soft">{escape(note)}</p>' if any(name == "sah_cost" for name, _, _ in columns) else "") + table("structures", heads, rows)


def best_table(results):
    """One row a scene, workload and ISA: the fastest structure of ours, and how it stands to embree."""
    metric, unit = results.throughput()
    reference, best = embree_rates(results, metric), {}
    for cell in results.traces:
        rate = cell.value(metric)
        if rate and cell["structure"] != "embree" and (beside(cell) not in best or rate > best[beside(cell)].value(metric)):
            best[beside(cell)] = cell
    if not best:
        return f"<p>{'No structure of ours was traced' if reference else 'No cell has a throughput'}.</p>"
    heads = [("scene", False), ("workload", False), ("ISA", False), ("threads", False), ("fastest structure", False),
             (unit, True), ("wrong per million", True)]
    heads += ([("× embree", True)] if reference else []) + [("how", False)]
    rows = []
    order = [axis_sort_key(a) for a in ("scene", "workload", "isa", "threads")]
    for key in sorted(best, key=lambda k: [o(v) for o, v in zip(order, k)]):
        cell = best[key]
        wrong = cell.per_million("wrong_answers")
        out = [text(v) for v in key] + [text(cell["structure"])]
        out.append(number(cell.value(metric) / 1e6, digits))
        out.append(per_million(wrong) if wrong is not None else text("not checked"))
        if reference:
            out.append(number(cell.value(metric) / reference[key] if reference.get(key) else None, digits))
        out.append(text(" / ".join(cell[a] for a in ("builder", "leaf", "intersector", "box", "traversal") if cell[a])))
        rows.append((out, ""))
    return table("fastest", heads, rows)


def skipped_list(skipped, complete):
    """The skipped cells by reason, the most frequent first; each reason opens to its cells."""
    if not skipped:
        return f"<p>None: every combination of the sweep {'was' if complete else 'can be'} measured.</p>"
    reasons = {}
    for name, reason in skipped:
        reasons.setdefault(reason, []).append(name)
    parts = []
    for reason, names in sorted(reasons.items(), key=lambda item: (-len(item[1]), item[0])):
        cells = "".join(f"<li>{escape(name)}</li>" for name in names)
        parts.append(f"<details><summary>{escape(reason)} <span class=soft>({len(names)} cell{'s' if len(names) != 1 else ''})"
                     f"</span></summary><ul>{cells}</ul></details>")
    return "\n".join(parts)


def facts_table(facts):
    rows = "".join(f'<tr><th scope="row">{escape(str(k))}</th><td>{escape(str(v))}</td></tr>' for k, v in facts)
    return f'<table class="facts">{rows}</table>'
