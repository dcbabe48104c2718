"""Sensors of an automated vehicle, through which an external driver observes the true traffic.

A sensor limits range and field of view, misses vehicles, adds errors to gaps and closing speeds,
and reports late. Its random errors depend on seed, scenario index and decision alone, not on the
batch.
"""

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
from overtaking.model.vehicles import EGO_SLOT
from overtaking.scenarios.specification_values import suggestion
from overtaking.sim.ego_observation import uniform_numbers
from overtaking.world.constants import DECISIONS_PER_SECOND
from overtaking.world.step_parameters import StepParameters

_MAX_FILE_BYTES = 1 << 20
"""Size of the largest sensor file that is read. Chosen: far above ten numbers with comments."""


_IS_AHEAD = np.array([role.endswith(("leader", "oncoming")) for role in NEIGHBOUR_ROLES])
"""Whether the neighbour in each role is ahead of the ego; followers are behind."""


_GAP_AHEAD_OF_LEADER_COLUMN = PassingColumns._fields.index("gap_ahead_of_leader")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """Properties of the ego's sensor system, which a user states for a product.

    The sensor detects a neighbour of the ego if its centre is within range and field of view, or
    within `range_around`, except for random misses. Rain and fog shorten all ranges.

    Attributes:
        range_ahead: Range ahead, from centre to centre [m].
        range_behind: Range behind, from centre to centre [m].
        range_around: Range in every direction, also outside the field of view [m].
        field_of_view: Full angle of the view ahead, and full angle of the view behind [rad].
        latency: Age of the reported measurements, rounded to decisions of 0.05 s [s].
        gap_error: Standard deviation of the error of a gap [m].
        closing_speed_error: Standard deviation of the error of a closing speed [m/s].
        missed: Share of detections that are missed, independently at each decision [1].
        rain_loss: Share of the range that is lost in rain of 100 % in CARLA's scale [1].
        fog_loss: Share of the range that is lost in fog of 100 % in CARLA's scale [1].
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
        """Reject values that are not numbers or outside `_UPPER_LIMITS`."""
        for name, (limit, unit) in _UPPER_LIMITS.items():
            value = getattr(self, name)
            # `not (... <= ...)` also rejects NaN: all comparisons with it are false.
            if not (isinstance(value, int | float) and 0.0 <= value <= limit):
                raise ConfigError.out_of_range(
                    what=name, where="sensor", low=0, high=f"{limit:g} {unit}".strip(), got=value
                )

    @classmethod
    def from_file(cls, path: str | Path) -> "Sensor":
        """The sensor that a TOML file describes, with one key for each attribute.

        Args:
            path: The file.

        Raises:
            ConfigError: The file cannot be read, a key is missing or unknown, or a value is out of
                range.
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
        keys = {field.name for field in fields(cls)}
        for name in numbers:
            if name not in keys:
                raise ConfigError(
                    what=name,
                    where=str(path),
                    expected="a known key",
                    got=repr(name),
                    next_step=suggestion(name, sorted(keys)),
                )
        if missing := sorted(keys - set(numbers)):
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
"""Largest value and unit of each attribute; the smallest value is zero.

The limits are chosen wide enough for any sensor, to catch values in wrong units.
"""


class SensorArray:
    """A sensor in every simulation of a batch.

    Args:
        sensor: The sensor.
        scenario: A batch of scenarios.
        params: Parameters of the batch.
    """

    def __init__(self, sensor: Sensor, scenario: Scenario, params: StepParameters) -> None:
        """Compute the ranges in the weather of each simulation; nothing is measured yet."""
        self._sensor, self._scenario = sensor, scenario
        self._unseen_gap = params.constants.unseen_gap
        self._ego_half_length = params.vehicles.at_slots(EGO_SLOT).half_length
        weather = scenario.weather
        # CARLA states rain and fog in per cent. Losses in rain and fog multiply.
        share_in_rain = 1.0 - sensor.rain_loss * weather.rain / 100.0
        share_in_fog = 1.0 - sensor.fog_loss * weather.fog / 100.0
        self._range_share = (share_in_rain * share_in_fog).astype(np.float32)
        self._latency_decisions = round(sensor.latency * float(DECISIONS_PER_SECOND))
        # Numbers of decisions with their measurements, oldest first.
        self._measurements = deque[tuple[int, F32]](maxlen=self._latency_decisions + 1)

    def measure(self, neighbours: F32, is_running: Mask, decision_index: int) -> F32:
        """Measure the neighbours now, and report the measurements that are as old as the latency.

        Before the latency has passed for the first time, the sensor reports its first measurements.
        It does not measure while an action of the external driver holds for several decisions; its
        reports can then be older than the latency.

        Args:
            neighbours: True values at this decision, shape (simulation, `NEIGHBOUR_ROLES`,
                `NEIGHBOUR_COLUMNS`).
            is_running: Whether each simulation runs, shape (simulation,).
            decision_index: Number of the decision, greater than at the previous call.

        Returns:
            Reported values in the shape of `neighbours`, zero for simulations that have ended.
        """
        measurements = self._measurements
        measurements.append((decision_index, self._measure_now(neighbours, decision_index)))
        # Drop entries until the first one is the newest that is at least as old as the latency.
        newest_reported = decision_index - self._latency_decisions
        while len(measurements) > 1 and measurements[1][0] <= newest_reported:
            measurements.popleft()
        _, reported = measurements[0]
        return np.where(is_running[:, None, None], reported, np.float32(0.0))

    @staticmethod
    def clear_gap_ahead_of_leader(passing: F32) -> None:
        """Set the gap ahead of the leader, which sensors do not measure, to zero.

        The driver then assumes no space ahead of the leader. The gap of undetected neighbours,
        1000 m (`perception.unseen_gap` in `model.toml`), would state that the road there is free.

        Args:
            passing: Columns about a pass, shape (simulation, `PASSING_COLUMNS`).
        """
        passing[:, _GAP_AHEAD_OF_LEADER_COLUMN] = 0.0

    def _measure_now(self, neighbours: F32, decision_index: int) -> F32:
        """Measurements of this decision, which are reported after the latency.

        Only gap and closing speed have errors; the other columns of a detected vehicle are true.
        """
        sensor = self._sensor
        # Each role has its own stream of four numbers: the first decides whether the sensor misses
        # the vehicle, the next two give the errors, the last is unused. `Stream` reserves 256
        # streams from `SENSOR` on.
        streams = np.arange(len(NEIGHBOUR_ROLES), dtype=np.uint32) + np.uint32(Stream.SENSOR)
        draws = self._draw_uniform_numbers(streams, decision_index)
        # Two independent numbers with the standard normal distribution.
        gap_deviation, speed_deviation = box_muller(draws[..., 1], draws[..., 2])
        is_detected = self._is_in_range(neighbours) & (draws[..., 0] >= np.float32(sensor.missed))
        measured = np.where(is_detected[..., None], neighbours, np.float32(0.0))
        # The columns are views: the assignments below change `measured`.
        true, columns = _columns_of(neighbours), _columns_of(measured)
        gap = true.gap + np.float32(sensor.gap_error) * gap_deviation
        columns.gap[...] = np.where(is_detected, gap, self._unseen_gap)
        speed_error = np.float32(sensor.closing_speed_error) * speed_deviation
        closing_speed = true.closing_speed + speed_error
        columns.closing_speed[...] = np.where(is_detected, closing_speed, np.float32(0.0))
        return measured

    def _draw_uniform_numbers(self, streams: np.ndarray, decision_index: int) -> F32:
        """Random numbers in (0, 1), shape (simulation, stream, 4)."""
        columns = [
            uniform_numbers(self._scenario, int(stream), decision_index) for stream in streams
        ]
        return np.stack(columns, axis=1)

    def _is_in_range(self, neighbours: F32) -> Mask:
        """Whether each neighbour exists and is within range and field of view.

        Distances are between centres. Angles are measured from the direction of the road, not from
        the heading of the ego.
        """
        sensor, neighbour = self._sensor, _columns_of(neighbours)
        half_lengths = self._ego_half_length[:, None] + np.float32(0.5) * neighbour.length
        # Ahead for leaders and oncoming vehicles, behind for followers.
        distance_along = neighbour.gap + half_lengths
        lateral_distance = np.abs(neighbour.lateral_distance)
        # The last bits of NumPy's hypot and arctan2 may differ between processors. That does no
        # harm: simulations are repeated from their recorded actions, without the sensor.
        distance = np.hypot(distance_along, lateral_distance)
        angle = np.arctan2(lateral_distance, distance_along)
        range_share = self._range_share[:, None]
        max_distance = np.where(_IS_AHEAD, sensor.range_ahead, sensor.range_behind) * range_share
        is_in_view = (angle <= 0.5 * sensor.field_of_view) & (distance <= max_distance)
        is_around = distance <= sensor.range_around * range_share
        # In true values `is_detected` is 1 for every vehicle that exists.
        return (neighbour.is_detected > 0) & (is_in_view | is_around)


def _columns_of(neighbours: F32) -> NeighbourColumns:
    """Columns of all neighbours as views, each of shape (simulation, `NEIGHBOUR_ROLES`)."""
    return NeighbourColumns._make(np.moveaxis(neighbours, -1, 0))
