"""Sensors of an automated vehicle: what of the truth reaches another driver, when and how well."""

import math
from collections import deque
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.errors import ConfigError
from overtaking.core.files import read_toml
from overtaking.core.random_numbers import Stream, box_muller
from overtaking.model.driver_interface import NEIGHBOUR_COLUMNS, NEIGHBOUR_ROLES, PASSING_COLUMNS
from overtaking.model.scenario import Scenario
from overtaking.scenarios.specification_values import suggestion
from overtaking.sim.observation import uniforms
from overtaking.world.constants import DECISIONS_PER_SECOND
from overtaking.world.step_parameters import Parameters

_MAX_FILE_BYTES = 1 << 20
_COLUMN = {name: place for place, name in enumerate(NEIGHBOUR_COLUMNS)}
_AHEAD = np.array([role.endswith(("lead", "oncoming")) for role in NEIGHBOUR_ROLES])
_ROOM = list(PASSING_COLUMNS).index("room")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """Numbers of a sensor around the vehicle; whose they are, the user says.

    What is nearest in a lane is detected where its centre is within range and field of view, unless
    it is missed. Ranges shrink with the weather.

    Attributes:
        range_ahead: Range ahead [m].
        range_behind: Range behind [m].
        range_around: Range in every direction [m].
        field_of_view: Whole angle of the view ahead, and of that behind [rad].
        latency: Age of what is observed, in whole decisions of 50 ms [s].
        gap_error: Standard deviation of gaps [m].
        closing_error: Standard deviation of speeds of approach [m/s].
        missed: Share of detections that are missed at a decision.
        rain_loss: Share of the range that is lost in CARLA's heaviest rain.
        fog_loss: Share of the range that is lost in CARLA's thickest fog.
    """

    range_ahead: float
    range_behind: float
    range_around: float
    field_of_view: float
    latency: float
    gap_error: float
    closing_error: float
    missed: float
    rain_loss: float
    fog_loss: float

    def __post_init__(self) -> None:
        """Refuse numbers that no sensor has."""
        for name, (most, unit) in _LIMITS.items():
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0.0 <= value <= most):
                raise ConfigError.out_of_range(
                    what=name, where="sensor", low=0, high=f"{most:g} {unit}".strip(), got=value
                )

    @classmethod
    def read(cls, path: str | Path) -> "Sensor":
        """The sensor of a TOML file with a value for each attribute.

        Raises:
            ConfigError: It cannot be read, or says something else.
        """
        try:
            numbers = read_toml(Path(path), _MAX_FILE_BYTES)
        except (OSError, ValueError, RecursionError) as error:
            reason = error.strerror if isinstance(error, OSError) else None
            raise ConfigError(
                what="sensor",
                where=str(path),
                expected="a TOML file",
                got=reason or str(error),
                next_step="correct the path or the file",
            ) from error
        known = {one.name for one in fields(cls)}
        for name in numbers:
            if name not in known:
                raise ConfigError(
                    what=name,
                    where=str(path),
                    expected="a known key",
                    got=repr(name),
                    next_step=suggestion(name, sorted(known)),
                )
        if missing := sorted(known - set(numbers)):
            raise ConfigError(
                what=missing[0],
                where=str(path),
                expected="a number",
                got="nothing",
                next_step=f"add {', '.join(missing)}",
            )
        return cls(**numbers)


_LIMITS = {
    "range_ahead": (2000.0, "m"),
    "range_behind": (2000.0, "m"),
    "range_around": (2000.0, "m"),
    "field_of_view": (math.tau, "rad"),
    "latency": (2.0, "s"),
    "gap_error": (100.0, "m"),
    "closing_error": (100.0, "m/s"),
    "missed": (1.0, ""),
    "rain_loss": (1.0, ""),
    "fog_loss": (1.0, ""),
}
"""Largest value and unit of each number; the smallest is zero."""


class Sensing:
    """A sensor in every simulation of a batch.

    Args:
        sensor: The sensor.
        scenario: A batch of scenarios.
        given: Its parameters.
    """

    def __init__(self, sensor: Sensor, scenario: Scenario, given: Parameters) -> None:
        """Have seen nothing yet."""
        self._sensor, self._scenario = sensor, scenario
        self._unseen = given.constants.unseen_gap
        self._half = given.of_vehicles.of(0).half_length
        weather = scenario.weather
        kept = 1.0 - sensor.rain_loss * weather.rain / 100.0
        self._clear = (kept * (1.0 - sensor.fog_loss * weather.fog / 100.0)).astype(np.float32)
        delay = round(sensor.latency * float(DECISIONS_PER_SECOND))
        self._delay = delay
        self._past = deque[tuple[int, F32]](maxlen=max(delay, 0) + 1)

    def sense(self, around: F32, active: Mask, decision: int) -> F32:
        """What the sensors tell, in the shape of `around`.

        Args:
            around: The truth at a decision, shape (simulation, `ROLES`, `AROUND`).
            active: Which simulations run, shape (simulation,).
            decision: Number of the decision, greater each time.
        """
        self._past.append((decision, self._measured(around, decision)))
        while len(self._past) > 1 and self._past[1][0] <= decision - self._delay:
            self._past.popleft()
        return np.where(active[:, None, None], self._past[0][1], np.float32(0.0))

    @staticmethod
    def without_room(meeting: F32) -> F32:
        """The numbers of `MEETING`, without the room ahead of the leader."""
        told = meeting.copy()
        told[:, _ROOM] = 0.0
        return told

    def _measured(self, around: F32, decision: int) -> F32:
        """What is measured now, and told after the latency."""
        sensor = self._sensor
        streams = np.arange(len(NEIGHBOUR_ROLES), dtype=np.uint32) + np.uint32(Stream.SENSOR)
        draws = self._draws(streams, decision)
        first, second = box_muller(draws[..., 1], draws[..., 2])
        sees = self._sees(around) & (draws[..., 0] >= np.float32(sensor.missed))
        told = np.where(sees[..., None], around, np.float32(0.0))
        gap, closing = around[..., _COLUMN["gap"]], around[..., _COLUMN["closing"]]
        measured = gap + np.float32(sensor.gap_error) * first
        told[..., _COLUMN["gap"]] = np.where(sees, measured, self._unseen)
        speed = closing + np.float32(sensor.closing_error) * second
        told[..., _COLUMN["closing"]] = np.where(sees, speed, np.float32(0.0))
        return told

    def _draws(self, streams: np.ndarray, decision: int) -> F32:
        columns = [uniforms(self._scenario, int(stream), decision) for stream in streams]
        return np.stack(columns, axis=1)

    def _sees(self, around: F32) -> Mask:
        """Whether each neighbour is within range and field of view."""
        sensor = self._sensor
        there = around[..., _COLUMN["detected"]] > 0
        half = self._half[:, None] + np.float32(0.5) * around[..., _COLUMN["length"]]
        along = around[..., _COLUMN["gap"]] + half
        aside = np.abs(around[..., _COLUMN["aside"]])
        distance = np.hypot(along, aside)
        angle = np.arctan2(aside, along)
        far = np.where(_AHEAD, sensor.range_ahead, sensor.range_behind) * self._clear[:, None]
        near = sensor.range_around * self._clear[:, None]
        inside = (angle <= 0.5 * sensor.field_of_view) & (distance <= far)
        return there & (inside | (distance <= near))
