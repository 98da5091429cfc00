"""Rays lost through a closed surface, as it stands farther and farther from the origin."""

from figures.leak_lines import CAPTION as LINES, draw_lines, without

TITLE = "Leaks against distance from the origin"
NEEDS = "cracks and offset (`metrics: [trace, accuracy]`, `workload: [hard_edge]`, a scene with `offset: [...]`)"
CAPTION = ("A leak is a ray that passes through a closed surface, away from its silhouette and border, and is answered by a miss or by something "
           "behind. The rays are aimed at edges and vertices. Far out the grid of float32 is coarse against the scene, which loses its finer "
           "triangles by it; what is left of it is still closed." + LINES)


def draw(results):
    def label(family, of):
        radii = [c.value("radius") for c in of.traces if without(c["scene"], "offset")[0] == family and c.value("radius")]
        return "distance of the scene from the origin" + (f" (half its diagonal: {max(radii):.3g})" if radii else "")
    return draw_lines(results, "offset", lambda cell: cell.value("offset"), label, "no scene is placed at several offsets and met by hard rays")
