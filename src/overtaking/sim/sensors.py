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
from overtaking.model.driver_interface import NEIGHBOUR_ROLES, NeighbourColumns, PassingColumns
from overtaking.model.scenario import Scenario
from overtaking.scenarios.specification_values import suggestion
from overtaking.sim.ego_observation import uniform_numbers
from overtaking.world.constants import DECISIONS_PER_SECOND
from overtaking.world.step_parameters import StepParameters

_MAX_FILE_BYTES = 1 << 20


_LOOKS_AHEAD = np.array([role.endswith(("leader", "oncoming")) for role in NEIGHBOUR_ROLES])


_GAP_AHEAD_COLUMN = PassingColumns._fields.index("gap_ahead_of_leader")


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
        closing_speed_error: Standard deviation of speeds of approach [m/s].
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
    closing_speed_error: float
    missed: float
    rain_loss: float
    fog_loss: float

    def __post_init__(self) -> None:
        """Refuse numbers that no sensor has."""
        for name, (most, unit) in _UPPER_LIMITS.items():
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0.0 <= value <= most):
                raise ConfigError.out_of_range(
                    what=name, where="sensor", low=0, high=f"{most:g} {unit}".strip(), got=value
                )

    @classmethod
    def from_file(cls, path: str | Path) -> "Sensor":
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


_UPPER_LIMITS = {
    "range_ahead": (2000.0, "m"),
    "range_behind": (2000.0, "m"),
    "range_around": (2000.0, "m"),
    "field_of_view": (math.tau, "rad"),
    "latency": (2.0, "s"),
    "gap_error": (100.0, "m"),
    "closing_speed_error": (100.0, "m/s"),
    "missed": (1.0, ""),
    "rain_loss": (1.0, ""),
    "fog_loss": (1.0, ""),
}
"""Largest value and unit of each number; the smallest is zero."""


class SensorArray:
    """A sensor in every simulation of a batch.

    Args:
        sensor: The sensor.
        scenario: A batch of scenarios.
        params: Parameters of the batch.
    """

    def __init__(self, sensor: Sensor, scenario: Scenario, params: StepParameters) -> None:
        """Have seen nothing yet."""
        self._sensor, self._scenario = sensor, scenario
        self._unseen = params.constants.unseen_gap
        self._half = params.vehicles.at_slots(0).half_length
        weather = scenario.weather
        kept = 1.0 - sensor.rain_loss * weather.rain / 100.0
        self._clear = (kept * (1.0 - sensor.fog_loss * weather.fog / 100.0)).astype(np.float32)
        delay = round(sensor.latency * float(DECISIONS_PER_SECOND))
        self._delay = delay
        self._past = deque[tuple[int, F32]](maxlen=max(delay, 0) + 1)

    def measure(self, neighbours: F32, is_running: Mask, decision: int) -> F32:
        """Report the neighbours as the sensor measures them, in the shape of `neighbours`.

        Args:
            neighbours: True values at this decision, shape (simulation, `NEIGHBOUR_ROLES`,
                `NEIGHBOUR_COLUMNS`).
            is_running: Whether each simulation runs, shape (simulation,).
            decision: Number of the decision, greater each time.
        """
        self._past.append((decision, self._measure_now(neighbours, decision)))
        while len(self._past) > 1 and self._past[1][0] <= decision - self._delay:
            self._past.popleft()
        return np.where(is_running[:, None, None], self._past[0][1], np.float32(0.0))

    @staticmethod
    def clear_gap_ahead_of_leader(passing: F32) -> None:
        """Set the gap ahead of the leader, which sensors do not measure, to zero.

        Args:
            passing: Columns about a pass, shape (simulation, `PASSING_COLUMNS`).
        """
        passing[:, _GAP_AHEAD_COLUMN] = 0.0

    def _measure_now(self, neighbours: F32, decision: int) -> F32:
        """Measurements of this decision, which are reported after the latency."""
        sensor = self._sensor
        streams = np.arange(len(NEIGHBOUR_ROLES), dtype=np.uint32) + np.uint32(Stream.SENSOR)
        draws = self._draws(streams, decision)
        first, second = box_muller(draws[..., 1], draws[..., 2])
        is_detected = self._is_in_range(neighbours) & (draws[..., 0] >= np.float32(sensor.missed))
        measured = np.where(is_detected[..., None], neighbours, np.float32(0.0))
        true, columns = _columns_of(neighbours), _columns_of(measured)
        gap = true.gap + np.float32(sensor.gap_error) * first
        columns.gap[...] = np.where(is_detected, gap, self._unseen)
        closing_speed = true.closing_speed + np.float32(sensor.closing_speed_error) * second
        columns.closing_speed[...] = np.where(is_detected, closing_speed, np.float32(0.0))
        return measured

    def _draws(self, streams: np.ndarray, decision: int) -> F32:
        columns = [uniform_numbers(self._scenario, int(stream), decision) for stream in streams]
        return np.stack(columns, axis=1)

    def _is_in_range(self, neighbours: F32) -> Mask:
        """Whether each neighbour is within range and field of view."""
        sensor, neighbour = self._sensor, _columns_of(neighbours)
        half_lengths = self._half[:, None] + np.float32(0.5) * neighbour.length
        distance_ahead = neighbour.gap + half_lengths
        lateral_distance = np.abs(neighbour.lateral_distance)
        distance = np.hypot(distance_ahead, lateral_distance)
        angle = np.arctan2(lateral_distance, distance_ahead)
        far = np.where(_LOOKS_AHEAD, sensor.range_ahead, sensor.range_behind) * self._clear[:, None]
        near = sensor.range_around * self._clear[:, None]
        inside = (angle <= 0.5 * sensor.field_of_view) & (distance <= far)
        return (neighbour.is_detected > 0) & (inside | (distance <= near))


def _columns_of(neighbours: F32) -> NeighbourColumns:
    """Columns of all neighbours, each of shape (simulation, `NEIGHBOUR_ROLES`)."""
    return NeighbourColumns._make(np.moveaxis(neighbours, -1, 0))
