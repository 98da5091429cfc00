"""One module a figure. Each has TITLE, CAPTION, NEEDS (columns of the results, and in brackets what of a configuration makes them; said where there is nothing
to draw) and draw(results) -> matplotlib figure, whose `more_caption`, where it has one, the caption goes on with, or raises NoData. ONLY_WHEN_NAMED: a
configuration draws it only where it names it, and is told where it could not be drawn.

Keys are written as a configuration has them, underscores too, so that they can be found there; what is measured, in words.

A new figure is a module here, its name in ALL and in experiments/config_plots.cpp. Other modules here
(bars, costs, names, rows, squares, trade_offs, modes, leak_lines) are what figures share.
"""

ALL = ("rays_per_second", "traversal_ratios", "rays_by_builder", "sah_cost", "epo", "leaf_histograms", "bytes_per_triangle", "build_time",
       "build_phases", "sah_vs_time", "build_vs_trace", "memory_vs_time", "visits_per_ray", "accuracy_vs_time", "lane_utilization", "published_ratios",
       "leaks_vs_distance", "leaks_vs_aspect", "leak_picture", "self_intersection")
