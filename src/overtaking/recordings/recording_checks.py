"""Checks of recordings: quantities that a recording states twice have to agree.

Speeds are held against positions, headings against movement, accelerations against speeds, sizes of
one table against those of another, and positions against what vehicles can do. A contradiction is a
warning that names the likely factor between units or the likely convention of angles. The recording
is read as it is: a warning changes no number.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.core.errors import RecordingWarning
from overtaking.model.trajectory import largest_state
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.messages import refused

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from overtaking.core.arrays import F64, I64
    from overtaking.model.road import Road
    from overtaking.recordings.recording import Recording, Tracks
    from overtaking.recordings.rows import Rows

FACTORS = {
    3.6: "km/h and m/s",
    0.3048: "feet and metres",
    1000.0: "a thousandth of the unit",
    100.0: "centimetres and metres",
    0.44704: "mph and m/s",
    1.609344: "mph and km/h",
    0.0254: "inches and metres",
    0.9144: "yards and metres",
    9.80665: "g and m/s^2",
    180.0 / math.pi: "degrees and radians",
    10.0: "a tenth of the unit",
}
"""Factors between units that are often mixed up, and the units."""

_FACTOR_TOLERANCE = 0.03  # A ratio this near a factor is that factor.
_MAX_DISAGREEMENT = 0.1  # Ratios of speeds this near 1 agree: clocks of cameras are off by as much.
_MAX_ACCEL_DISAGREEMENT = 0.4  # Accelerations are smoothed in many ways.
_MAX_SIZE_DIFFERENCE = 0.05  # Sizes that differ by more are not those of one vehicle.
_MIN_CORRELATION = 0.8  # Of two series that shall be one quantity in two units.
_MIN_ROWS = 30  # Fewer rows say nothing.
_TIME_SPAN = 0.5  # Time over which movement is measured, against noise of positions [s].

_MAX_ANGLE_ERROR = 0.26  # Headings and movement differ by more in no sound recording [rad].
_MIN_LATERAL_SPEED = 0.1  # Below this there is noise [m/s].
_MIN_WAY = 1.0  # Movement over a shorter way has no reliable direction [m].

_MAX_TRAFFIC_SPEED = 70.0  # Faster than 19 of 20 vehicles of any traffic [m/s].
_USUAL_SPEEDS = (5.0, 50.0)  # Of vehicles on a road, 19 of 20 are slower than such a speed [m/s].
_VEHICLE_WIDTHS = (1.2, 3.2)  # In the median of vehicles with four wheels or more [m].
_USUAL_WIDTHS = (1.5, 2.7)
_LANE_WIDTHS = (2.75, 4.25)  # [m].
_MAX_DRIFT = 0.3  # Faster movement across the road is a lane change [m/s].
_MIN_SHARE_OF_LANE = 0.005  # Fewer states in a lane are of vehicles that pass over it.
_LENGTH_FACTORS = (0.3048, 0.01, 0.001, 0.0254, 0.9144, 1.0 / 0.3048, 100.0, 1000.0)


def issue_warnings(where: str, sentences: Iterable[str]) -> None:
    """Issue a `RecordingWarning` for each sentence.

    Args:
        where: What the recording is called.
        sentences: One for each contradiction.
    """
    for sentence in sentences:
        warnings.warn(f"{where}: {sentence}", RecordingWarning, stacklevel=2)


def check_ranges(recording: Recording) -> None:
    """Refuse quantities that the recorded integers cannot hold.

    Args:
        recording: The recording.

    Raises:
        ImportFormatError: A position or speed is too large or no number; the message names vehicle
            and frame.
    """
    tracks = recording.tracks
    for name in ("x", "y", "s", "d", "speed"):
        values, most = getattr(tracks, name), largest_state(name)
        is_right = np.abs(values) <= most  # Also false for NaN.
        if is_right.all():
            continue
        row = int(np.argmin(is_right))
        vehicle, unit = tracks.ids[tracks.vehicle[row]], "m/s" if name == "speed" else "m"
        raise refused(
            recording.name,
            f"{name} of vehicle {vehicle} in frame {tracks.frame[row]}",
            f"at most {most:g} {unit}",
            f"{values[row]:g} {unit}",
            "correct the unit, or shift the origin of the coordinates",
        )


def compare_sizes(column: str, first: F64, second: F64) -> list[str]:
    """Compare the sizes of vehicles in two tables.

    Args:
        column: Name of the column in both tables.
        first: Sizes in the table of states, NaN where it has none, shape (vehicle,) [m].
        second: Sizes in the table of vehicles, same shape [m].

    Returns:
        A sentence if they contradict each other, else nothing.
    """
    both = (first > 0.0) & (second > 0.0)  # Also false for NaN.
    if not both.any():
        return []
    ratio = first[both] / second[both]
    differs = np.abs(np.log(ratio)) > math.log1p(_MAX_SIZE_DIFFERENCE)
    if not differs.any():
        return []
    typical = float(np.median(ratio[differs]))
    number = f"{int(differs.sum())} of {len(ratio)} vehicles"
    return [
        f"column {column}: for {number} the table of states and the table of vehicles differ"
        f"{_by_factor(typical)}; the sizes of the table of vehicles are used"
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Movement:
    """Movement between rows of a track some time apart; arrays have shape (pair,).

    Attributes:
        earlier: Row at the beginning.
        later: Row at the end.
        elapsed: Time between them [s].
    """

    earlier: I64
    later: I64
    elapsed: F64

    @classmethod
    def of(cls, start: I64, frame_interval_ms: int) -> _Movement:
        """The movement in rows of tracks.

        Args:
            start: First row of each track, and the number of rows, shape (track + 1,).
            frame_interval_ms: Time between rows [ms].
        """
        step = max(1, round(_TIME_SPAN * 500.0 / frame_interval_ms))
        count, number = np.diff(start), np.arange(start[-1])
        first, last = np.repeat(start[:-1], count), np.repeat(start[1:] - 1, count)
        earlier, later = np.maximum(number - step, first), np.minimum(number + step, last)
        whole = later - earlier == 2 * step
        return cls(
            earlier=earlier[whole],
            later=later[whole],
            elapsed=np.full(int(whole.sum()), 2 * step * frame_interval_ms * 1e-3),
        )

    @property
    def middle(self) -> I64:
        """Row half-way."""
        return (self.earlier + self.later) // 2

    def rate(self, values: F64) -> F64:
        """Change per second of a quantity of each row."""
        return (values[self.later] - values[self.earlier]) / self.elapsed

    def mean(self, values: F64) -> F64:
        """Mean of a quantity of each row at both ends and half-way."""
        return (values[self.earlier] + values[self.later] + 2.0 * values[self.middle]) / 4.0


def check_rows(rows: Rows) -> list[str]:
    """Hold the columns of a table against each other.

    Args:
        rows: The rows, in the units that the map of columns declares.

    Returns:
        A sentence for each contradiction, with the likely factor or convention.
    """
    movement = _Movement.of(rows.start, rows.frame_interval_ms)
    if len(movement.middle) < _MIN_ROWS:
        return [*rows.warnings, *_check_sizes(rows)]
    east, north = (movement.rate(rows.values[name]) for name in ("x", "y"))
    derived = np.hypot(east, north)
    sentences = [*rows.warnings, *_check_sizes(rows)]
    speed_sentences = _check_speeds(rows, movement, derived)
    sentences += speed_sentences
    if not speed_sentences:
        sentences += _check_axes(rows, movement, east, north)
        sentences += _check_traffic_speed(derived)
    sentences += _check_heading(rows, movement, east, north)
    sentences += _check_accelerations(rows, movement)
    return sentences


def _stated_speed(values: Mapping[str, F64]) -> tuple[str, F64] | None:
    """The quantities that state the speed, and the speed; None where none does."""
    if "speed" in values:
        return "speed", np.abs(values["speed"])
    if "vx" in values and "vy" in values:
        return "vx and vy", np.hypot(values["vx"], values["vy"])
    return None


def _check_speeds(rows: Rows, movement: _Movement, derived: F64) -> list[str]:
    """Hold the stated speeds against those of the positions."""
    stated = _stated_speed(rows.values)
    if stated is None:
        return []
    name, speed = stated
    ratio = _ratio(movement.mean(speed), derived)
    if ratio is None or abs(math.log(ratio)) <= math.log1p(_MAX_DISAGREEMENT):
        return []
    fast = float(np.percentile(derived, 95.0))
    side = ""
    if fast > _MAX_TRAFFIC_SPEED:
        side = f"; movement at {fast:.0f} m/s points to the unit of x and y"
    elif fast * ratio > _MAX_TRAFFIC_SPEED:
        side = f"; a speed of {fast * ratio:.0f} m/s points to the unit of {name}"
    factor = _by_factor(ratio)
    return [f"{name} and positions: the speeds are not those of the movement{factor}{side}"]


def _ratio(stated: F64, derived: F64) -> float | None:
    """Median ratio of two quantities where there is enough of both, None where there is not."""
    reach = np.percentile(derived, 95.0), np.percentile(stated, 95.0)
    enough = (derived > 0.2 * reach[0]) & (stated > 0.2 * reach[1])
    if min(reach) <= 0.0 or enough.sum() < _MIN_ROWS:
        return None
    return float(np.median(stated[enough] / derived[enough]))


def _check_axes(rows: Rows, movement: _Movement, east: F64, north: F64) -> list[str]:
    """Hold the axes of speeds against those of positions."""
    if "vx" not in rows.values or "vy" not in rows.values:
        return []
    stated = {name: movement.mean(rows.values[name]) for name in ("vx", "vy")}
    sentences = [
        f"{name} and {axis}: they point in opposite directions; likely the sign of {name}, "
        f"or an axis that is flipped (y_axis)"
        for name, axis, rate in (("vx", "x", east), ("vy", "y", north))
        if _likeness(stated[name], rate) < -_MIN_CORRELATION
    ]
    own = _likeness(stated["vx"], east), _likeness(stated["vy"], north)
    crossed = _likeness(stated["vx"], north), _likeness(stated["vy"], east)
    if min(np.abs(crossed)) > _MIN_CORRELATION > max(np.abs(own)):
        return ["vx and vy: they are the changes of y and x; likely the two are swapped"]
    return sentences


def _likeness(first: F64, second: F64) -> float:
    """Cosine between two series, 0 where one of them is nearly nothing."""
    sizes = np.sqrt((first**2).mean()), np.sqrt((second**2).mean())
    if min(sizes) < _MIN_LATERAL_SPEED:
        return 0.0
    return float((first * second).mean() / (sizes[0] * sizes[1]))


def _check_traffic_speed(derived: F64) -> list[str]:
    """Refer to the unit of positions where vehicles are faster than any traffic."""
    fast = float(np.percentile(derived, 95.0))
    if fast <= _MAX_TRAFFIC_SPEED:
        return []
    factor = _factor_into(fast, _USUAL_SPEEDS)
    return [
        f"positions: vehicles move at up to {fast:.0f} m/s, faster than any traffic"
        f"{_of_unit(factor, 'x and y')}"
    ]


def _check_sizes(rows: Rows) -> list[str]:
    """Hold the sizes of vehicles against those that vehicles have."""
    wide = ~np.isin(rows.kind, (VehicleKind.MC, VehicleKind.B))
    if not wide.any():
        return []
    width, length = float(np.median(rows.width[wide])), float(np.median(rows.length[wide]))
    if width > length:
        return [
            f"length and width: vehicles are {width:.3g} m wide and {length:.3g} m long in the "
            "median; likely the two columns are swapped"
        ]
    least, most = _VEHICLE_WIDTHS
    if least <= width <= most:
        return []
    factor = _factor_into(width, _USUAL_WIDTHS)
    return [
        f"width: vehicles are {width:.3g} m wide in the median, where {least:g} to {most:g} m are "
        f"usual{_of_unit(factor, 'the sizes')}"
    ]


def check_lanes(road: Road, tracks: Tracks, frame_interval_ms: int) -> list[str]:
    """Hold the lanes that traffic uses against the widths of lanes.

    Args:
        road: A road whose lanes are inferred from the traffic.
        tracks: The vehicles on it.
        frame_interval_ms: Time between frames [ms].

    Returns:
        A sentence if the traffic uses lanes that are regularly apart, and none between them.
    """
    movement = _Movement.of(tracks.start, frame_interval_ms)
    # Vehicles that change lanes pass over those between.
    keeps_lane = np.abs(movement.rate(tracks.d)) < _MAX_DRIFT
    lanes, count = np.unique(tracks.lane_index[movement.middle[keeps_lane]], return_counts=True)
    used = lanes[(lanes >= 0) & (count >= _MIN_SHARE_OF_LANE * count.sum())]
    every = int(np.gcd.reduce(np.diff(used))) if len(used) > 1 else 1
    if every < 2:
        return []
    pitch = every * float(np.abs(np.diff(road.boundaries)).mean())
    factor = _factor_into(pitch, _LANE_WIDTHS)
    if factor is None:
        return []
    return [
        f"positions: traffic drives in lanes that are {pitch:.1f} m apart, with none between them"
        f"{_of_unit(factor, 'x and y')}"
    ]


def _check_heading(rows: Rows, movement: _Movement, east: F64, north: F64) -> list[str]:
    """Hold headings against the direction of movement."""
    if "heading" not in rows.values:
        return []
    moves = np.hypot(east, north) * movement.elapsed > _MIN_WAY
    if moves.sum() < _MIN_ROWS:
        return []
    direction = np.arctan2(north, east)[moves]
    heading = rows.values["heading"][movement.middle][moves]
    miss = _angle_error(heading, direction)
    if miss <= _MAX_ANGLE_ERROR:
        return []
    misses = {
        f"{unit}{convention}": _angle_error(turned, direction)
        for unit, scale in _ANGLE_UNITS.items()
        for convention, turned in _conventions(heading * scale).items()
    }
    likely = min(misses, key=lambda name: misses[name])
    found = f"; likely {likely}" if misses[likely] < 0.5 * _MAX_ANGLE_ERROR else ""
    return [
        f"heading and positions: the headings are {math.degrees(miss):.0f} degrees off the "
        f"direction of movement in the median{found}"
    ]


_ANGLE_UNITS = {
    "": 1.0,
    "degrees where the map declares radians, ": math.pi / 180.0,
    "radians where the map declares degrees, ": 180.0 / math.pi,
}


def _conventions(angle: F64) -> dict[str, F64]:
    """Headings, anticlockwise from x, if angles follow another convention [rad]."""
    return {
        "anticlockwise from x": angle,
        "clockwise from x (y is flipped)": -angle,
        "clockwise from y, as a compass has it": 0.5 * math.pi - angle,
        "anticlockwise from y": 0.5 * math.pi + angle,
        "the opposite direction": angle + math.pi,
        "clockwise from -x": math.pi - angle,
        "anticlockwise from -y": angle - 0.5 * math.pi,
        "clockwise from -y": -0.5 * math.pi - angle,
    }


def _angle_error(heading: F64, direction: F64) -> float:
    """Median angle between headings and directions [rad]."""
    apart = heading - direction
    return float(np.median(np.abs(apart - math.tau * np.round(apart / math.tau))))


def _check_accelerations(rows: Rows, movement: _Movement) -> list[str]:
    """Hold accelerations against changes of speed, and turning against changes of heading."""
    values = rows.values
    pairs: list[tuple[str, str, F64]] = []
    stated = _stated_speed(values)
    if "accel_lon" in values and stated is not None:
        pairs.append(("accel_lon", stated[0], stated[1]))
    pairs += [(f"a{k}", f"v{k}", values[f"v{k}"]) for k in "xy" if {f"a{k}", f"v{k}"} <= {*values}]
    if "yaw_rate" in values and "heading" in values:
        pairs.append(("yaw_rate", "heading", np.unwrap(values["heading"])))
    sentences: list[str] = []
    for name, of, quantity in pairs:
        stated_rate, derived = movement.mean(values[name]), movement.rate(quantity)
        least = 0.02 if name == "yaw_rate" else 0.2  # Below this there is noise [rad/s, m/s^2].
        size = tuple(float(np.sqrt((one**2).mean())) for one in (stated_rate, derived))
        if size[1] < least or size[0] <= 0.0:
            continue
        likeness = float((stated_rate * derived).mean() / (size[0] * size[1]))
        if abs(likeness) < _MIN_CORRELATION:
            continue
        if likeness < 0.0:
            sentences.append(f"{name} and {of}: likely the sign of {name} is the opposite one")
            continue
        ratio = size[0] / size[1]
        if abs(math.log(ratio)) > math.log1p(_MAX_ACCEL_DISAGREEMENT):
            sentences.append(
                f"{name} and {of}: {name} is not the change of {of} per second{_by_factor(ratio)}"
            )
    return sentences


def _by_factor(ratio: float) -> str:
    """The end of a sentence about a ratio: the factor, and the units that it stands between."""
    for factor, units in FACTORS.items():
        for value, text in ((factor, f"{factor:.5g}"), (1.0 / factor, f"1/{factor:.5g}")):
            if abs(math.log(ratio / value)) <= _FACTOR_TOLERANCE:
                return f": likely the factor {text} ({units})"
    return f" by a factor of {ratio:.3g}, which is between no two usual units"


def _of_unit(factor: float | None, quantity: str) -> str:
    """The end of a sentence that names the factor which makes a quantity usual."""
    if factor is None:
        return f"; check the unit of {quantity}"
    shown = f"{factor:g}" if factor < 1.0 or factor >= 10.0 else "1/0.3048"
    units = next(
        units
        for known, units in FACTORS.items()
        if any(abs(math.log(factor / one)) < 1e-6 for one in (known, 1.0 / known))
    )
    return f": likely the unit of {quantity} is off by the factor {shown} ({units})"


def _factor_into(value: float, usual: tuple[float, float]) -> float | None:
    """The most common factor that takes a value into its usual range, None if none does."""
    return next((f for f in _LENGTH_FACTORS if usual[0] <= value * f <= usual[1]), None)
