"""Rays lost through a closed surface, as its triangles become longer and thinner."""

from figures.leak_lines import CAPTION as LINES, draw_lines

TITLE = "Leaks against the shape of triangles"
NEEDS = "cracks and triangle_aspect_median (`metrics: [trace, accuracy]`, `workload: [hard_edge]`, a scene with `stretch: [...]`)"
CAPTION = ("The scene is stretched along one axis; a triangle's aspect is its longest edge over the height on it, the median of the mesh's "
           "triangles. A leak is a ray that passes through a closed surface, away from its silhouette and border, and is answered by a miss or by "
           "something behind." + LINES)


def draw(results):
    return draw_lines(results, "stretch", lambda cell: cell.value("triangle_aspect_median"),
                      lambda family, of: "longest edge over height of a triangle, median", "no scene is stretched in several ways and met by hard rays")
