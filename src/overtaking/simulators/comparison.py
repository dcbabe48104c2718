"""The same scenarios on several simulators: how each ended, where and when they first differ."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64, I32, U8, U64, Mask
from overtaking.knowledge.carla_catalogue import weather_presets
from overtaking.knowledge.toml_reader import constant as known_number
from overtaking.model.batch import Batch
from overtaking.model.trajectories import NO_VEHICLE, POSITION_RESOLUTION, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Labels
from overtaking.model.weather import NO_PRESET, Weather
from overtaking.world.constants import model_constants
from overtaking.world.visibility import meteorological_range

PARTING_DISTANCE = 2.0
"""Distance between the places of the same vehicle from which two simulations have parted [m].

About the width of a car: beyond it, one of them may be beside a vehicle that the other would hit.
"""

Labelled = tuple[Trajectories, Labels]
"""Recorded simulations and their labels."""

TOGETHER = np.int32(-1)
"""Frame of a parting that does not happen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending(Batch):
    """How simulations ended; every array has shape (simulation,).

    Attributes:
        classes: `OvertakeClass` under the policy of the comparison.
        outcome: `Outcome`, legality aside.
        has_contact: Whether any two vehicles touched.
        lane_changes: Lane changes that the ego completed.
        num_frames: Recorded frames.
    """

    classes: U8
    outcome: U8
    has_contact: Mask
    lane_changes: I32
    num_frames: I32


@dataclass(frozen=True, slots=True, kw_only=True)
class Parting(Batch):
    """Where and when two recordings first differ; every array has shape (simulation,).

    Attributes:
        frame: First frame at which some vehicle is farther than `PARTING_DISTANCE` from where it is
            in the other recording; `TOGETHER` if that never happens while both last.
        vehicle: Slot of the vehicle that is farthest from itself then, `NO_VEHICLE` without one.
        s: Where it is then in the first recording [m].
        along: How far ahead it is in the second recording [m].
        left: How far to the left it is in the second recording [m].
    """

    frame: I32
    vehicle: U8
    s: F64
    along: F64
    left: F64


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(Batch):
    """The same scenarios on several simulators.

    Attributes:
        simulators: Their names; the others are held against the first.
        policy: Name of the policy of the classes.
        frame_interval_ms: Time between two frames [ms].
        index: Number of each simulation, shape (simulation,).
        weather: Name of its weather, shape (simulation,).
        endings: How it ended on each simulator.
        partings: Where and when each of the others parts from the first.
    """

    simulators: tuple[str, ...]
    policy: str
    frame_interval_ms: int
    index: U64
    weather: NDArray[np.str_]
    endings: tuple[Ending, ...]
    partings: tuple[Parting, ...]

    @classmethod
    def of(
        cls, simulators: Sequence[str], recordings: Sequence[Labelled], *, policy: str
    ) -> "Comparison":
        """Compare recordings of the same scenarios.

        Args:
            simulators: Names, two or more.
            recordings: What each of them recorded.
            policy: Name of the policy of the classes.

        Raises:
            ValueError: They are not of the same scenarios.
        """
        first = recordings[0][0]
        return cls(
            simulators=tuple(simulators),
            policy=policy,
            frame_interval_ms=first.scenario.frame_interval_ms,
            index=first.scenario.scenario_index,
            weather=weather_names(first.scenario.weather),
            endings=tuple(ending(recording, policy) for recording in recordings),
            partings=tuple(parting(first, other) for other, _ in recordings[1:]),
        )

    @property
    def times(self) -> F64:
        """When each of the others parts from the first, +inf if never, (other, simulation) [s]."""
        frames = np.stack([one.frame for one in self.partings])
        return np.where(frames == TOGETHER, np.inf, frames * (self.frame_interval_ms * 1e-3))

    @property
    def is_same_class(self) -> Mask:
        """Whether each of the others ends in the class of the first, shape (other, simulation)."""
        first, *others = (one.classes for one in self.endings)
        return np.stack([other == first for other in others])


def weather_names(weather: Weather) -> NDArray[np.str_]:
    """A name for each weather: its preset, or night and day with what falls or hangs in the air."""
    known = tuple(weather_presets())
    foggy = meteorological_range(weather.fog) < known_number("model.perception.fog_range")
    return np.array(
        [
            known[preset] if preset != NO_PRESET else _described(night, rain > 0, fog)
            for preset, night, rain, fog in zip(
                weather.preset.tolist(), weather.night, weather.rain, foggy, strict=True
            )
        ],
        dtype=np.str_,
    )


def _described(night: bool, rains: bool, is_foggy: bool) -> str:
    sky = "fog" if is_foggy else "rain" if rains else "dry"
    return f"{'night' if night else 'day'}, {sky}"


def ending(recording: Labelled, policy: str) -> Ending:
    """How the simulations of a batch ended.

    Args:
        recording: The recorded simulations and their labels.
        policy: Name of the policy of the classes.

    Raises:
        ValueError: The labels do not have the policy.
    """
    trajectories, labels = recording
    touched = trajectories.contacts.partner != NO_VEHICLE
    return Ending(
        classes=labels.classes[:, labels.policies.index(policy)],
        outcome=labels.outcome,
        has_contact=(touched & trajectories.scenario.vehicles.valid).any(axis=1),
        lane_changes=lane_changes(trajectories),
        num_frames=trajectories.num_frames.copy(),
    )


def lane_changes(trajectories: Trajectories) -> I32:
    """Lane changes that the ego completed, shape (simulation,).

    One is complete when the ego is near the middle of another lane than the one in whose middle it
    was last.
    """
    centres = trajectories.road.lane_centres / POSITION_RESOLUTION
    d, lane = trajectories.states.d[:, EGO_SLOT], trajectories.states.lane[:, EGO_SLOT]
    on_road = lane < len(centres)
    offset = np.abs(d - centres[np.where(on_road, lane, 0)])
    settled = on_road & trajectories.frame_mask
    settled &= offset < float(model_constants().settled_offset) / POSITION_RESOLUTION
    counts = [
        np.count_nonzero(np.diff(row[mask].astype(np.int32)))
        for row, mask in zip(lane, settled, strict=True)
    ]
    return np.array(counts, dtype=np.int32)


def parting(one: Trajectories, other: Trajectories) -> Parting:
    """Where and when two recordings of the same scenarios first part.

    Args:
        one: The first recording.
        other: The second one, of the same scenarios in the same order.

    Raises:
        ValueError: They are not of the same scenarios.
    """
    _check_same(one, other)
    count = min(one.stage.shape[1], other.stage.shape[1])
    along, left = (
        (getattr(other.states, name)[:, :, :count] - getattr(one.states, name)[:, :, :count])
        * POSITION_RESOLUTION
        for name in ("s", "d")
    )
    both = one.state_mask[:, :, :count] & other.state_mask[:, :, :count]
    distance = np.where(both, np.hypot(along, left), 0.0)
    apart = np.asarray((distance > PARTING_DISTANCE).any(axis=1))
    parted = np.asarray(apart.any(axis=1))
    row = np.arange(one.scenario.num_simulations)
    frame = apart.argmax(axis=1)
    vehicle = distance[row, :, frame].argmax(axis=1)
    at = (row, vehicle, frame)
    return Parting(
        frame=np.where(parted, frame, TOGETHER).astype(np.int32),
        vehicle=np.where(parted, vehicle, NO_VEHICLE).astype(np.uint8),
        s=np.where(parted, one.states.s[at] * POSITION_RESOLUTION, 0.0),
        along=np.where(parted, along[at], 0.0),
        left=np.where(parted, left[at], 0.0),
    )


def _check_same(one: Trajectories, other: Trajectories) -> None:
    """Two recordings can be compared if they begin with the same vehicles in the same scenarios."""
    ours, theirs = one.scenario, other.scenario
    same = (
        ours.seed == theirs.seed
        and np.array_equal(ours.scenario_index, theirs.scenario_index)
        and np.array_equal(ours.vehicles.valid, theirs.vehicles.valid)
        and np.array_equal(ours.start_s, theirs.start_s)
        and ours.frame_interval_ms == theirs.frame_interval_ms
    )
    if not same:
        raise ValueError("parting: the recordings are not of the same scenarios")
