"""Labels by the readable functions alone, in place of their compiled twins."""

import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from overtaking.labels.events import engine as events
from overtaking.labels.events import reference as readable_events
from overtaking.labels.features import encounters, past
from overtaking.labels.features import engine as measures
from overtaking.labels.features import reference as readable_measures
from overtaking.labels.law import engine as margins
from overtaking.labels.law import frames
from overtaking.labels.law import reference as readable_margins
from overtaking.labels.signals import engine as signals
from overtaking.labels.signals import reference as readable_signals
from overtaking.labels.signals import target as readable_target


def _largest(values: Any, span: frames.Span) -> Any:
    return frames.reduced(np.maximum, values, span)


TWINS: dict[Callable[..., Any], Callable[..., Any]] = {
    signals.signals: readable_signals.signals,
    signals.neighbours_at: readable_signals.neighbours_at,
    signals.target_signals: readable_target.target_signals,
    events.find_events: readable_events.find_events,
    margins.lowest: frames.lowest,
    margins.highest: _largest,
    margins.stop_margin: readable_margins.stop_margin,
    margins.follow_margin: readable_margins.follow_margin,
    margins.duty_to_return: readable_margins.duty_to_return,
    margins.braking_margin: readable_margins.braking_margin,
    margins.of_target: readable_margins.of_target,
    margins.below: readable_margins.below,
    margins.above: readable_margins.above,
    margins.dark: readable_margins.dark,
    measures.encounter: encounters.encounter,
    measures.first_past: past.first_past,
    measures.worst: readable_measures.worst,
    measures.sums: readable_measures.sums,
}
"""Compiled functions and what a person reads instead."""


@contextmanager
def readable() -> Generator[None]:
    """While it lasts, whoever imported a compiled function calls the readable one."""
    undo: list[Callable[[], None]] = []
    for module in list(sys.modules.values()):
        for name, value in list(vars(module).items()):
            if module.__name__.startswith("overtaking.") and _is_twin(value):
                setattr(module, name, TWINS[value])
                undo.append(partial(setattr, module, name, value))
    try:
        yield
    finally:
        for step in undo:
            step()


def _is_twin(value: object) -> bool:
    return callable(value) and getattr(value, "__hash__", None) is not None and value in TWINS
