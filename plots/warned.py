"""What Python and matplotlib warn of, in lines for the user: no source lines, and none twice."""

import contextlib
import re
import sys
import warnings

GLYPH = re.compile(r"Glyph (\d+) .*missing from")
told = set()  # texts, and characters without a glyph


@contextlib.contextmanager
def told_in_a_line(name):
    """Says on stderr, in a line each, what is warned of while figure `name` is drawn and was not said before."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for line in lines_of(name, [str(warning.message) for warning in caught]):
        print(line, file=sys.stderr)


def lines_of(name, messages):
    """The characters without a glyph as one line, any other message as its own."""
    found = [(GLYPH.match(message), " ".join(message.split())) for message in messages]
    missing = [c for c in dict.fromkeys(chr(int(glyph[1])) for glyph, _ in found if glyph) if c not in told]
    texts = [text for text in dict.fromkeys(text for glyph, text in found if not glyph) if text not in told]
    told.update(missing, texts)
    lines = [f"warning: no font here has {''.join(missing)}, which figures show as boxes; fonts-noto-cjk has Chinese, Japanese and Korean"] if missing else []
    return lines + [f"warning: {name}: {text}" for text in texts]
