"""A simulation that goes on otherwise from a frame on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.errors import ConfigError
from overtaking.knowledge import presets
from overtaking.labels.label import label
from overtaking.model.decision import Decision
from overtaking.scenarios.schema import PresetWeather
from overtaking.scenarios.weather import sample_weather
from overtaking.show.contrast import contrast
from overtaking.show.view.pack import pack
from overtaking.show.wording import words
from overtaking.sim import branch as branching

if TYPE_CHECKING:
    from overtaking.labels.label import Labelled
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectory import Trajectories
    from overtaking.model.weather import Weather
    from overtaking.show.server.wanted import Branch

DECISIONS = {
    Decision.PULL_OUT.name: "pull out, whatever the gaps",
    Decision.STAY.name: "stay: never begin an overtake",
    Decision.ABORT.name: "abort: go back while pulling out",
    Decision.RETURN.name: "return, whatever is there",
}
"""What can be forced on the ego, with words for the page."""


def branch(
    labelled: Labelled, number: int, before: dict[str, Any], asked: Branch
) -> dict[str, Any]:
    """A branch of a simulation as the page reads it, and what differs, in words.

    Args:
        labelled: A batch of this one simulation, with its labels.
        number: Its number in its data set.
        before: What `describe` says of it.
        asked: What is to be otherwise.

    Raises:
        ConfigError: There is no such frame, decision or weather, or the recording was not made by
            this package's model.
    """
    run = labelled.trajectories
    _refuse_others(run, number)
    if (asked.decision is None) == (asked.weather is None):
        raise _refused("change", "a decision or a weather", "both or none")
    if asked.frame >= run.num_frames[0]:
        raise _refused("frame", f"0 to {run.num_frames[0] - 1}", asked.frame)
    found = changed(run.scenario, asked.frame, _decision(asked), _weather(run.scenario, asked))
    packed = pack(label(found), number)
    first = _parting(run, found)
    said = contrast(before, packed["values"])
    return {
        "title": words(asked.decision or "") or str(asked.weather),
        "frame": asked.frame,
        "parts": first,
        "said": ["Nothing changes."] if first is None else said,
        "run": packed,
    }


def changed(
    scenario: Scenario, frame: int, decision: Decision | None, weather: Weather | None
) -> Trajectories:
    """The simulation with a decision or the weather changed from a frame on."""
    return branching.branch(scenario, frame, decision=decision, weather=weather)


def _decision(asked: Branch) -> Decision | None:
    if asked.decision is None:
        return None
    if asked.decision not in DECISIONS:
        raise ConfigError.not_among("decision", "view", DECISIONS, asked.decision)
    return Decision[asked.decision]


def _weather(scenario: Scenario, asked: Branch) -> Weather | None:
    """A preset, with the wind and sun that the simulation would have drawn for it."""
    if asked.weather is None:
        return None
    if asked.weather not in presets():
        raise ConfigError.not_among("weather", "view", presets(), asked.weather)
    spec = PresetWeather(mode="presets", presets={asked.weather: 1.0})
    return sample_weather(spec, scenario.seed, scenario.index)


def _refuse_others(run: Trajectories, number: int) -> None:
    """Refuse what the model did not simulate, or another driver drove."""
    is_ours = not run.unknown and run.actions is None
    if not (is_ours and (branching.branch(run.scenario, 0).trace_hash == run.trace_hash).all()):
        raise _refused(
            f"simulation {number}",
            "one that the built-in model drove",
            "a recording, or another driver or simulator",
        )


def _parting(run: Trajectories, other: Trajectories) -> int | None:
    """The first frame that differs; None without one."""
    last = int(min(run.num_frames[0], other.num_frames[0]))
    pairs = [
        (getattr(one.states, name)[0, :, :last] for one in (run, other))
        for name in ("s", "d", "speed", "lights")
    ]
    differs = np.logical_or.reduce([(old != new).any(axis=0) for old, new in pairs])
    if differs.any():
        return int(differs.argmax())
    return None if run.num_frames[0] == other.num_frames[0] else last


def _refused(what: str, expected: str, got: object) -> ConfigError:
    return ConfigError.of(
        what=what, where="view", expected=expected, got=got, next_step="choose another"
    )
