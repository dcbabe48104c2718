"""Branches of a simulation from a frame on, and the outcomes of later starts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.analysis.whatif.fan import fan_of
from overtaking.core.errors import ConfigError
from overtaking.core.random_numbers import Stream
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.labels.labelling import label
from overtaking.model.scenario import ForcedDecision, Intervention
from overtaking.scenarios.random_draws import RandomStream
from overtaking.scenarios.specification import PresetWeather
from overtaking.scenarios.weather_sampling import draw_weather
from overtaking.show.contrast import contrast
from overtaking.show.futures import CONDITION_TEXTS, fan_title, values_of_fan
from overtaking.show.view.pack import pack
from overtaking.show.wording import words
from overtaking.sim import branching as branching

if TYPE_CHECKING:
    from collections.abc import Sequence

    from overtaking.analysis.whatif.scenes import Scene
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories
    from overtaking.model.weather import Weather
    from overtaking.show.server.wanted import Branch, Futures, Otherwise

DECISIONS = {
    ForcedDecision.PULL_OUT.name: "pull out, whatever the gaps",
    ForcedDecision.STAY.name: "stay: never begin an overtake",
    ForcedDecision.CANCEL.name: "cancel: turn back while pulling out",
    ForcedDecision.RETURN.name: "return, whatever is there",
}
"""What can be forced on the ego, with words for the page."""

_FUTURES = 25
_EVERY_S = 0.5
_MOST_INSTANTS = 40
_MS_PER_S = 1000.0


def branch(
    labelled: LabelledTrajectories, number: int, before: dict[str, Any], asked: Branch
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
    changes = [_change(run, one) for one in asked.changes]
    begins = min(one.frame for one in changes)
    if begins >= run.num_frames[0]:
        raise _refused("frame", f"0 to {run.num_frames[0] - 1}", begins)
    found = changed(run.scenario, changes)
    packed = pack(label(found), number)
    first = _parting(run, found)
    said = contrast(before, packed["values"])
    return {
        "title": ", then ".join(_title(one, run) for one in asked.changes),
        "frame": begins,
        "parts": first,
        "said": ["Nothing changes."] if first is None else said,
        "run": packed,
    }


def changed(scenario: Scenario, changes: Sequence[Intervention]) -> Trajectories:
    """The simulation with one change after another."""
    return branching.branch(scenario, interventions=changes)


def futures(scene: Scene, asked: Futures) -> dict[str, Any]:
    """Outcomes of an overtake that begins at each of some instants.

    Args:
        scene: The simulation.
        asked: What the futures share, and which rules decide about their class.

    Raises:
        ConfigError: There is no such policy, or the simulation is a branch.
    """
    frames = int(scene.run.num_frames[0])
    every = max(math.ceil(frames / _MOST_INSTANTS), round(_EVERY_S * scene.rate))
    found = fan_of(
        scene,
        condition_on=asked.condition_on,
        futures=_FUTURES,
        every=every / scene.rate,
        policy=asked.policy,
    )
    heading = {"title": fan_title(found.condition_on), "about": CONDITION_TEXTS[found.condition_on]}
    return values_of_fan(found) | heading


def _title(asked: Otherwise, run: Trajectories) -> str:
    seconds = asked.frame * run.scenario.frame_interval_ms / _MS_PER_S
    return f"{words(asked.decision or '') or asked.weather} at {seconds:.2f} s"


def _change(run: Trajectories, asked: Otherwise) -> Intervention:
    if (asked.decision is None) == (asked.weather is None):
        raise _refused("change", "a decision or a weather", "both or none")
    return Intervention(
        frame=asked.frame, decision=_decision(asked), weather=_weather(run.scenario, asked)
    )


def _decision(asked: Otherwise) -> ForcedDecision | None:
    if asked.decision is None:
        return None
    if asked.decision not in DECISIONS:
        raise ConfigError.unknown_choice(
            what="decision", where="view", choices=DECISIONS, got=asked.decision
        )
    return ForcedDecision[asked.decision]


def _weather(scenario: Scenario, asked: Otherwise) -> Weather | None:
    """A preset, with the wind and sun that the simulation would have drawn for it."""
    if asked.weather is None:
        return None
    if asked.weather not in weather_presets():
        raise ConfigError.unknown_choice(
            what="weather", where="view", choices=weather_presets(), got=asked.weather
        )
    spec = PresetWeather(mode="presets", presets={asked.weather: 1.0})
    return draw_weather(spec, RandomStream(scenario.seed, scenario.scenario_index, Stream.WEATHER))


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
    return ConfigError(
        what=what, where="view", expected=expected, got=got, next_step="choose another"
    )
