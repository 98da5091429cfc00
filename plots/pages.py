"""A figure that would be taller than can be read, on several pages: of some of its scenes each."""

from dataclasses import dataclass

from results import NoData, TooMuch, TooTall
from style import plt


@dataclass(frozen=True)
class Picture:
    name: str  # of its files
    scenes: list  # empty where one picture has all
    more_caption: str


def of(module, results):
    """[(scenes, figure)]: one figure, without scenes; or, where it would be too tall, as few as there can be, of as many scenes each."""
    try:
        return [([], module.draw(results))]
    except TooTall as reason:
        scenes = results.scenes()
        for count in range(min(reason.pages, len(scenes)), len(scenes) + 1):
            if count > 1 and (found := drawn(module, results, shares(scenes, count))):
                return found
        raise


def shares(scenes, count):
    """The scenes in so many parts, in order, of which none has two more than another."""
    ends = [len(scenes) * k // count for k in range(count + 1)]
    return [scenes[a:b] for a, b in zip(ends, ends[1:])]


def drawn(module, results, parts):
    """[(scenes, figure)] of those parts of which there is something to show; none where one is too tall still."""
    found = []
    for scenes in parts:
        try:
            found.append((scenes, module.draw(results.of_scenes(scenes))))
        except TooTall:
            for _, figure in found:
                plt.close(figure)
            return []
        except TooMuch:
            raise
        except NoData:
            continue
    return found
