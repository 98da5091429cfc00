"""One module a figure. Each has TITLE, CAPTION and draw(results) -> matplotlib figure, or raises NoData.

A new figure is a module here and its name in ALL.
"""

ALL = ("rays_per_second", "sah_cost", "build_time", "sah_vs_time", "accuracy_vs_time")
