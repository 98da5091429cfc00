"""What structures as built are called beside a figure."""


def bar_label(cell, varied):
    """The structure, and the keys of the axes `varied` that tell it apart."""
    return " ".join([cell["structure"]] + [label(a, cell[a]) for a in varied if cell[a]])


def label(axis, key):
    return f"{key} thread{'' if key == '1' else 's'}" if axis == "threads" else key
