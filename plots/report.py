"""report.html: one page that needs nothing beside it, with the figures, the tables, what was skipped, and how to repeat it."""

import base64
import json
import re
import shlex
from html import escape
from pathlib import Path
from string import Template

import machine
import tables
from results import interval_words

LARGEST_SVG = 1_500_000  # bytes; a drawing of more goes into the page as PNG


def write(results, drawn):
    """`drawn`: (name, module, its pictures, why left out or None). Returns the page's path."""
    parts = [f"<h1>{escape(results.name)}</h1>", f'<p class="soft">{escape(subtitle(results))}</p>']
    parts.append('<nav><a href="#fastest-structures">Fastest</a><a href="#figures">Figures</a>'
                 '<a href="#all-cells">All cells</a><a href="#built">Structures</a><a href="#skipped">Skipped</a>'
                 + ('<a href="#scenes">Scenes</a>' if results.context.get("scenes") else "") +
                 '<a href="#machine">Machine</a><a href="#again">Reproduce</a></nav>')
    if not results.complete:
        parts.append('<p class="bad">The run was cut off: these are the cells that had ended. '
                     "<code>--resume</code> measures the rest.</p>")
    parts += [f'<p class="bad">Warning: {escape(text)}</p>' for text in results.context.get("warnings", [])]
    parts.append(f"<p>{measured(results)} {answers(results)}</p>")
    beside = tables.embree_note(results, results.traces)
    parts.append('<h2 id="fastest-structures">Fastest structure</h2>' + beside + tables.best_table(results))
    parts.append('<h2 id="figures">Figures</h2>' + tables.embree_note(results, results.traces + results.structures)
                 + "\n".join(figure(results, *each) for each in drawn))
    parts.append('<h2 id="all-cells">All cells</h2>' + beside + tables.throughput_table(results))
    parts.append('<h2 id="built">Structures as built</h2>' + tables.embree_note(results, results.structures) + tables.structure_table(results))
    parts.append('<h2 id="skipped">Skipped cells</h2>' + tables.skipped_list(results.skipped, results.complete))
    if results.context.get("scenes"):
        parts.append('<h2 id="scenes">Scenes</h2>' + tables.facts_table(scene_facts(results.context["scenes"])))
    parts.append('<h2 id="machine">Machine and build</h2>' + tables.facts_table(machine.facts(results.context)) + raw(results.context))
    parts.append('<h2 id="again">How to reproduce</h2>' + reproduce(results))
    template = Template((Path(__file__).parent / "report_template.html").read_text(encoding="utf-8"))
    page = template.substitute(title=escape(f"{results.name}: Arboretum report"), body="\n".join(parts))
    path = results.folder / "report.html"
    path.write_text(page, encoding="utf-8")
    return path


def measured(results):
    """How many cells, counted as `run` does in its last line."""
    others = results.cells - len(results.traces)
    of_these = f" ({len(results.traces)} of rays, {others} of builds)" if others > 0 and results.traces else ""
    return f"{counted(results.cells, 'cell')} measured{of_these}, {len(results.skipped)} skipped."


def answers(results):
    """What was compared with exact arithmetic and came out how, and what was not."""
    checked, traced = results.checked(), len(results.traces)
    if not traced:
        return "No rays were traced."
    if not checked:
        return "<strong>Answers were not checked.</strong>"
    counts = [max(cell.values("wrong_answers")) for cell in checked]
    wrong = sum(count > 0 for count in counts)
    text = f"{counted(round(sum(counts)), 'wrong answer')}, in {wrong} of {counted(len(checked), 'checked cell')}: cell by cell below." if wrong else (
        f"No wrong answer in {counted(len(checked), 'checked cell')}.")
    return text + (f" <strong>The answers of {counted(traced - len(checked), 'cell')} were not checked.</strong>" if traced > len(checked) else "")


def counted(number, noun):
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def subtitle(results):
    found = [results.context.get(key) for key in ("date", "cpu", "host_name")]
    return ", ".join(str(v) for v in found if v)


def figure(results, name, module, pictures, reason):
    head = f'<h3 id="{escape(name)}">{escape(module.TITLE)}</h3>'
    if reason:
        return f'{head}<p class="soft">Not drawn: {prose(reason)}.</p>'
    shown = []
    for number, picture in enumerate(pictures, 1):
        path, kind = results.folder / f"{picture.name}.svg", "svg+xml"
        if path.stat().st_size > LARGEST_SVG:
            path, kind = results.folder / f"{picture.name}.png", "png"
        data = base64.b64encode(path.read_bytes()).decode("ascii")
        which = f"{number} of {len(pictures)}: {', '.join(picture.scenes)}. " if len(pictures) > 1 else ""
        words = which + (caption(results, module) if number == 1 else "As above.") + picture.more_caption
        shown.append(f'<figure><img alt="{escape(which + module.TITLE)}" src="data:image/{kind};base64,{data}">'
                     f'<figcaption>{prose(words)}</figcaption></figure>')
    return head + "\n".join(shown)


def prose(text):
    """The text escaped, with what stands between a pair of backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def caption(results, module):
    """What a figure says of itself, with what the intervals of these results are."""
    return module.CAPTION.replace("{interval}", interval_words(results.repetitions()))


def raw(context):
    """The context as it stands in results.json, but for the scenes, which have a section of their own."""
    text = json.dumps({key: value for key, value in context.items() if key != "scenes"}, indent=2, ensure_ascii=False)
    return f"<details><summary>As <code>results.json</code> has it</summary><pre>{escape(text)}</pre></details>"


def scene_facts(scenes):
    """Of each scene its triangles, and what the loader found wrong."""
    def words(told):
        return [counted(told["triangles"], "triangle"), told.get("dropped_in_words"), *told.get("warnings", [])]
    return [(name, "; ".join(w for w in words(told) if w)) for name, told in scenes.items()]


def without_resume(command):
    """Results of older revisions have --resume in their command, which would measure nothing anew."""
    try:
        words = shlex.split(command)
    except ValueError:  # of an older revision, not quoted
        return command
    return shlex.join(word for word in words if word != "--resume") if "--resume" in words else command


def reproduce(results):
    context = results.context
    parts = []
    revision = context.get("git_revision")
    several = " | " in str(revision)  # of merged parts
    lines = [f"git checkout {revision}"] if revision and revision != "unknown" and not several else []
    if several:
        parts.append(f"<p>Parts are of several revisions: <code>{escape(revision)}</code>; the rows say which.</p>")
    command = without_resume(context.get("command") or "arboretum run effective.yaml")
    lines.append(f"./{command}" if command.startswith("arboretum ") else command)
    parts.append(f"<pre>{escape(chr(10).join(lines))}</pre>")
    if "true" in str(context.get("git_dirty")).lower():  # of merged parts "false | true"
        parts.append('<p class="bad">The tree had changes that no revision holds: these figures cannot be repeated exactly.</p>')
    if context.get("configuration_hash"):
        parts.append(f"<p>Hash of the configuration: <code>{escape(context['configuration_hash'])}</code></p>")
    if results.effective_yaml:
        parts.append("<p>The effective configuration, every default filled in (<code>effective.yaml</code>):</p>"
                     f"<pre>{escape(results.effective_yaml)}</pre>")
    return "\n".join(parts)
