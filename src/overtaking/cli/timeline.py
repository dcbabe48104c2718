"""The time line of a simulation: stages, events and breaches below each other on one axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from overtaking.cli.drawing import bar_lengths, centred, placed
from overtaking.show.judgement import EVENTS
from overtaking.show.wording import sentence, words

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.cli.drawing import Glyphs
    from overtaking.show.judgement import Values

# Okabe and Ito's colours, which people with any kind of colour vision can tell apart.
STAGE_STYLES = {
    "FOLLOW": "black on #56b4e9",
    "PULL_OUT": "black on #f0e442",
    "PASS": "white on #0072b2",
    "RETURN": "black on #e69f00",
    "DONE": "white on #009e73",
    "ABORT": "black on #cc79a7",
    "CRASHED": "white on #d55e00",
}
_GUTTER = 5
_ENDS = 2
_TICK_ROOM = 9
_TICKS_S = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)


def time_line(values: Values, width: int, glyphs: Glyphs) -> Iterator[Text]:
    """Stages, marks of events, a bar for each broken rule, and seconds.

    Args:
        values: What `describe` says of the simulation.
        width: Columns to fill.
        glyphs: The characters to draw with.
    """
    inner = width - _GUTTER - _ENDS
    yield _stages(values["stages"], inner, glyphs)

    def column(time_s: float) -> int:
        return round(time_s / max(values["duration_s"], 1e-9) * (inner - 1))

    marks = [(column(one["time_s"]), EVENTS[one["event"]].letter) for one in values["events"]]
    for row in placed(marks, inner):
        yield Text(" " * (_GUTTER + 1) + row.rstrip())
    for one in values["broken"]:
        first, last = column(one["from_s"]), column(one["to_s"])
        bar = " " * first + glyphs.breach * (last - first + 1)
        yield Text.assemble(f"{one['rule']:<{_GUTTER}} ", (bar, "bold #d55e00"))
    yield Text(" " * (_GUTTER + 1) + _seconds(values["duration_s"], inner), style="dim")


def stage_times(values: Values, glyphs: Glyphs) -> Iterator[Text]:
    """The stages in numbers."""
    spans = [
        f"{words(one['stage'])} {one['from_s']:.2f}{glyphs.dash}{one['to_s']:.2f}"
        for one in values["stages"]
    ]
    if spans:
        yield Text(f"{', '.join(spans)} s")


def event_lines(values: Values) -> Iterator[Text]:
    """The events in order, one line each."""
    for one in values["events"]:
        told = EVENTS[one["event"]]
        text = sentence(one["event"], values)
        yield Text(f"{told.letter:<{_GUTTER}} {one['time_s']:6.2f} s  {told.symbol:<9}  {text}")


def _stages(stages: list[Values], inner: int, glyphs: Glyphs) -> Text:
    """The ego's stages in proportion to their durations; a plain line where none was recorded."""
    bar = Text(" " * _GUTTER + glyphs.edge)
    if not stages:
        return bar.append(glyphs.line * inner + glyphs.edge)
    lengths = bar_lengths([one["to_s"] - one["from_s"] for one in stages], inner + 1)
    for one, length in zip(stages, lengths, strict=True):
        word = centred(words(one["stage"]), length - 1, glyphs.line)
        bar.append(word, style=STAGE_STYLES[one["stage"]])
        bar.append(glyphs.edge)
    return bar


def _seconds(duration_s: float, inner: int) -> str:
    """The axis of time: round seconds at their positions."""
    most = max(inner // _TICK_ROOM, 1)
    step = next((one for one in _TICKS_S if duration_s <= one * most), _TICKS_S[-1])
    line = ""
    for tick in range(int(duration_s / step + 1e-6) + 1):
        text = f"{tick * step:g}" + ("" if tick else " s")
        at = round(tick * step / max(duration_s, 1e-9) * (inner - 1))
        if at + len(text) <= inner + 1:
            line = line.ljust(at) + text
    return line
