#!/usr/bin/env python3
"""Draws the figures and the report of a result folder: plot.py RESULTS [--only name,...]. Measures nothing.

The report holds at least the figures that the configuration names: where --only leaves out one of them, it stays as it is.

Exit status: 0 done, 2 the folder cannot be read or a figure is unknown, 3 a figure could not be drawn (the others and the report are).
"""

import argparse
import difflib
import importlib
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

SYSTEM_PYTHON = "/usr/bin/python3"


def need_matplotlib():
    """A python3 earlier on the PATH may lack matplotlib where the system's own has it: then that one goes on."""
    try:
        import matplotlib  # noqa: F401
        import numpy  # noqa: F401
    except ImportError as error:
        if os.path.realpath(sys.executable) != os.path.realpath(SYSTEM_PYTHON) and os.access(SYSTEM_PYTHON, os.X_OK):
            os.execv(SYSTEM_PYTHON, [SYSTEM_PYTHON, *sys.argv])
        fail(f"{error}; install it with: sudo apt-get install -y python3-matplotlib python3-numpy")


def fail(message):
    print(f"error: {message}", file=sys.stderr)
    sys.exit(2)


def configured(known, plots):
    """The figures that the configuration names, else all."""
    return [name for name in known if name in plots] if isinstance(plots, list) else list(known)


def chosen(only, known, default):
    """The figures that --only names, else the default."""
    if not only:
        return default
    names = [name.strip() for name in only.split(",") if name.strip()]
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1, 0.0)[0]
            fail(f"no figure is called '{name}'; the nearest is '{near}' (all: {', '.join(known)})")
    return names


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", metavar="RESULTS", help="a folder that `run` wrote")
    parser.add_argument("--only", metavar="name,...", help="these figures (default: those that the configuration names)")
    parser.add_argument("--no-report", action="store_true", help="the figures, without report.html")
    arguments = parser.parse_args()
    need_matplotlib()

    import figures
    import pages
    import report
    import style
    from results import NoData, ResultError, TooMuch, load
    from warned import told_in_a_line

    try:
        results = load(arguments.results)
        drawn, default = [], configured(figures.ALL, results.context.get("plots"))
        names = chosen(arguments.only, figures.ALL, default)
        named = not arguments.only and isinstance(results.context.get("plots"), list)
        failed = []
        for name in names:
            module = importlib.import_module(f"figures.{name}")
            try:
                with told_in_a_line(name):
                    parts = pages.of(module, results)
                    style.discard_files(results.folder, name)
                    pictures = [pages.Picture(f"{name}-{number}" if len(parts) > 1 else name, scenes, getattr(figure, "more_caption", ""))
                                for number, (scenes, figure) in enumerate(parts, 1)]
                    for picture, (_, figure) in zip(pictures, parts):
                        style.save(figure, results.folder, picture.name)
            except OSError:  # the disk's, not the figure's: the next one could not be written either
                raise
            except NoData as reason:
                # `run` hides what is written here to stdout; that a figure which somebody named is not there must be seen.
                why = str(reason) if isinstance(reason, TooMuch) else f"{reason}; it shows {module.NEEDS}"
                print(f"{name}: left out, {why}", file=sys.stderr if named and (getattr(module, "ONLY_WHEN_NAMED", False) or isinstance(reason, TooMuch))
                      else sys.stdout)
                style.discard(results.folder, name)  # of a drawing before
                drawn.append((name, module, [], why))
                continue
            except Exception as error:  # noqa: BLE001  of a figure: it takes no other with it
                why = " ".join(f"{type(error).__name__}: {error}".split())
                style.discard(results.folder, name)
                drawn.append((name, module, [], f"an error of the figure's own, {why}"))
                failed.append(f"{name}: {why}")
                continue
            for picture in pictures:
                print(f"{results.folder / picture.name}.png .svg")
            drawn.append((name, module, pictures, None))
        if set(default) <= set(names) and not arguments.no_report:
            print(report.write(results, drawn))
        elif not arguments.no_report:
            print("report.html: left as it is; it is written with all figures, without --only")
        if failed:
            print(f"error: could not be drawn: {'; '.join(failed)}", file=sys.stderr)
            sys.exit(3)  # 1 is Python's own, of an error that is none of a figure's
    except ResultError as error:
        fail(str(error))
    except OSError as error:
        fail(f"{error.filename or arguments.results}: {error.strerror}; the figures could not be written")


if __name__ == "__main__":
    main()
