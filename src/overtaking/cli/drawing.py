"""Small pictures made of characters: sparklines, a bar of stages, positions over time.

No information depends on colour alone. A terminal without Unicode gets ASCII.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.show.wording import symbol

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

_REACHES = (30.0, 50.0, 75.0, 100.0, 150.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Glyphs:
    """The characters to draw with.

    Attributes:
        levels: From the lowest to the highest bar.
        line: Filling of a bar of stages.
        edge: Between two stages.
        dot: Where a position is empty but worth a mark.
        times: Between two lengths.
        arrow: From one value to another.
        dash: Between two ends of a range.
        breach: Filling of the bar of a broken rule.
        separator: Between two facts of a line.
    """

    levels: str = "▁▂▃▄▅▆▇█"
    line: str = "─"
    edge: str = "│"
    dot: str = "·"
    times: str = "×"
    arrow: str = "→"
    dash: str = "–"
    breach: str = "━"
    separator: str = "·"

    @classmethod
    def for_terminal(cls, *, ascii_only: bool) -> Glyphs:
        """The characters that a terminal can show."""
        if not ascii_only:
            return cls()
        alike = {"line": "-", "edge": "|", "dot": ".", "times": "x", "dash": "-", "breach": "="}
        return cls(levels="_.-=+*%#", arrow="->", separator="|", **alike)


def sparkline(
    values: NDArray[np.floating], *, width: int, low: float, high: float, glyphs: Glyphs
) -> str:
    """Values over time as bars of one character.

    Args:
        values: One value per frame, shape (time,).
        width: Number of characters; fewer if there are fewer values.
        low: Value of the lowest bar.
        high: Value of the highest bar.
        glyphs: The characters to draw with.
    """
    parts = np.array_split(values, min(width, len(values)))
    means = np.array([part.mean() for part in parts])
    share = (means - low) / max(high - low, 1e-9)
    level = np.clip((share * len(glyphs.levels)).astype(int), 0, len(glyphs.levels) - 1)
    return "".join(glyphs.levels[one] for one in level)


def bar_lengths(durations: Sequence[float], width: int) -> list[int]:
    """Columns of each part of a bar, in proportion, but at least one each.

    Their sum is `width`, or the number of parts if that is more.
    """
    ends = np.cumsum(np.maximum(durations, 1e-9))
    lengths = np.diff(np.rint(ends / ends[-1] * width).astype(int), prepend=0)
    while (lengths < 1).any() and lengths.max() > 1:
        lengths[np.argmin(lengths)] += 1
        lengths[np.argmax(lengths)] -= 1
    return np.maximum(lengths, 1).tolist()


def centred(word: str, width: int, fill: str) -> str:
    """A word in the middle of a line, shortened to what fits."""
    if width >= len(word) + 2:
        word = f" {word} "
    return word[:width].center(width, fill)


def placed(marks: Sequence[tuple[int, str]], width: int) -> list[str]:
    """Marks of one character at their columns, in as many lines as it takes to hide none.

    Args:
        marks: Column and character of each.
        width: Number of columns.

    Returns:
        Lines of exactly `width` characters.
    """
    lines: list[list[str]] = []
    for column, mark in marks:
        free = next((line for line in lines if line[column] == " "), None)
        if free is None:
            free = [" "] * width
            lines.append(free)
        free[column] = mark
    return ["".join(line) for line in lines]


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """Positions around the ego over time, to be drawn line by line.

    Attributes:
        position: Position relative to the ego along the road, (vehicle, instant) [m].
        lane: Lane relative to the ego's, positive to the left, (vehicle, instant).
        slots: Slot of each vehicle, (vehicle,); the ego is among them.
        reach: Distance from the middle to either end [m].
    """

    position: NDArray[np.floating]
    lane: NDArray[np.integer]
    slots: NDArray[np.integer]
    reach: float

    def lines(self, width: int, glyphs: Glyphs) -> Iterator[str]:
        """One line of exactly `width` characters for each instant.

        A vehicle is its letter, then ' if it is in a lane to the left of the ego's and , if in one
        to the right.
        """
        column = np.rint((self.position / self.reach + 1.0) * 0.5 * (width - 2)).astype(int)
        for instant in range(self.position.shape[1]):
            line = [" "] * width
            line[(width - 2) // 2] = glyphs.dot
            # The ego last, so that nothing hides it.
            for vehicle in np.argsort(-self.slots):
                place = column[vehicle, instant]
                if not 0 <= place <= width - 2:
                    continue
                line[place] = symbol(int(self.slots[vehicle]))
                side = self.lane[vehicle, instant]
                if side and line[place + 1] in (" ", glyphs.dot):
                    line[place + 1] = "'" if side > 0 else ","
            yield "".join(line)


def nice_reach(distances: NDArray[np.floating]) -> float:
    """A round distance that shows most of the vehicles around the ego.

    Args:
        distances: From the ego to each other vehicle, (vehicle, instant) [m].

    Returns:
        Enough for most of all distances, and for nearly all to the vehicle that stays nearest [m].
    """
    if not distances.size:
        return _REACHES[0]
    nearest = distances[np.argmin(distances.mean(axis=1))]
    wanted = max(np.percentile(distances, 70), np.percentile(nearest, 95))
    return next((reach for reach in _REACHES if wanted <= reach), _REACHES[-1])
