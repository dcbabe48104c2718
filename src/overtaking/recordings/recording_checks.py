"""Checks of recordings: quantities that a recording states twice have to agree.

Speeds are compared with positions, headings with the direction of movement, accelerations with
speeds, sizes in one table with those in another, and positions with the speeds of ordinary traffic.
A contradiction is a finding that names the likely factor between units or the likely convention of
angles. The recording is read as it is: such a finding changes no number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from overtaking.model.trajectories import largest_state
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.messages import refused

if TYPE_CHECKING:
    from collections.abc import Mapping

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

_LENGTH_UNITS = {
    factor: FACTORS[factor] for factor in (0.3048, 1000.0, 100.0, 0.0254, 0.9144, 10.0)
}
"""Those of them that are between units of length."""

_FACTOR_TOLERANCE = 0.03  # Largest difference of logarithms between a ratio and a factor.
_MAX_DISAGREEMENT = 0.1  # Ratios of speeds this near 1 agree: clocks of cameras are off by as much.
_MAX_ACCEL_DISAGREEMENT = 1.0  # Larger: sources smooth accelerations in different ways.
_MAX_SIZE_DIFFERENCE = 0.05  # Sizes that differ by a larger share belong to different vehicles.
_MIN_CORRELATION = 0.8  # Between two series that are one quantity in different units.
_MIN_ROWS = 30  # With fewer rows a median or correlation is not reliable.
_TIME_SPAN = (
    0.5  # Movement is measured over this time, so that noise of positions averages out [s].
)

_MAX_ANGLE_ERROR = 0.26  # Above the slip and noise of sound recordings, far below 90 degrees [rad].
_MIN_LATERAL_SPEED = 0.1  # Slower movement across the road is mostly noise [m/s].
_MAX_LATERAL_SHARE = 0.1  # Largest speed across a straight road, as a share of that along it.
_ACCEL_NOISE = 0.2  # Smaller changes of speed are mostly noise [m/s^2].
_YAW_RATE_NOISE = 0.02  # Smaller changes of heading are mostly noise [rad/s].
_MIN_WAY = 1.0  # Movement over a shorter way has no reliable direction [m].

_MAX_TRAFFIC_SPEED = 70.0  # Above the 95th percentile of the speeds of any traffic [m/s].
_USUAL_SPEEDS = (5.0, 50.0)  # Usual range of the 95th percentile of speeds on a road [m/s].
_VEHICLE_WIDTHS = (1.2, 3.2)  # Possible median width of vehicles with four wheels or more [m].
_MIN_VEHICLES = (
    10  # Of fewer vehicles, most can be motorcycles or bicycles, which highD calls cars.
)
_MIN_LENGTH = 1.5  # Shorter than bicycles: a unit is wrong, however few vehicles there are [m].
_USUAL_WIDTHS = (1.5, 2.7)  # Usual median width; narrower, so that it decides between factors [m].
_LANE_WIDTHS = (2.75, 4.25)  # [m].
_MAX_DRIFT = 0.3  # Faster movement across the road is a lane change [m/s].
_MIN_SHARE_OF_LANE = 0.005  # Smaller shares of the states are vehicles that cross the lane.
_LENGTH_FACTORS = (0.3048, 0.01, 0.001, 0.0254, 0.9144, 1.0 / 0.3048, 100.0, 1000.0)
"""Factors of `FACTORS` between units of length, the most common mistake first."""


def _reported(check: Check, detail: str, rows: int) -> Finding:
    """A finding about the whole file that changes no value."""
    return Finding(check=check, consequence=Consequence.REPORTED, detail=detail, rows=rows)


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
        values, limit = getattr(tracks, name), largest_state(name)
        is_in_range = np.abs(values) <= limit  # Also false for NaN.
        if is_in_range.all():
            continue
        row = int(np.argmin(is_in_range))
        vehicle, unit = tracks.name_of(tracks.vehicle[row]), "m/s" if name == "speed" else "m"
        raise refused(
            recording.name,
            f"{name} of vehicle {vehicle} in frame {tracks.frame[row]}",
            f"at most {limit:g} {unit}",
            f"{values[row]:g} {unit}",
            "correct the unit, or shift the origin of the coordinates",
        )


def compare_sizes(column: str, first: F64, second: F64, num_rows: int) -> list[Finding]:
    """Compare the sizes of vehicles in two tables.

    Args:
        column: Name of the column in both tables.
        first: Sizes in the table of states, NaN where it has none, shape (vehicle,) [m].
        second: Sizes in the table of vehicles, same shape [m].
        num_rows: Number of rows of the recording.

    Returns:
        A finding if they contradict each other, else an empty list.
    """
    is_stated_twice = (first > 0.0) & (second > 0.0)  # Also false for NaN.
    if not is_stated_twice.any():
        return []
    ratio = first[is_stated_twice] / second[is_stated_twice]
    differs = np.abs(np.log(ratio)) > math.log1p(_MAX_SIZE_DIFFERENCE)
    if not differs.any():
        return []
    typical = float(np.median(ratio[differs]))
    share = f"{int(differs.sum())} of {len(ratio)} vehicles"
    detail = (
        f"column {column}: for {share} the table of states and the table of vehicles differ"
        f"{_by_factor(typical, _LENGTH_UNITS)}; the sizes of the table of vehicles are used"
    )
    return [_reported(Check.SIZES, detail, num_rows)]


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
            start: First row of each track, then the number of all rows, shape (track + 1,).
            frame_interval_ms: Time between rows [ms].
        """
        half_span = max(1, round(_TIME_SPAN * 500.0 / frame_interval_ms))  # In frames.
        count, row = np.diff(start), np.arange(start[-1])
        first, last = np.repeat(start[:-1], count), np.repeat(start[1:] - 1, count)
        earlier, later = np.maximum(row - half_span, first), np.minimum(row + half_span, last)
        is_inside = later - earlier == 2 * half_span  # Not cut off by the ends of the track.
        return cls(
            earlier=earlier[is_inside],
            later=later[is_inside],
            elapsed=np.full(int(is_inside.sum()), 2 * half_span * frame_interval_ms * 1e-3),
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


def check_rows(rows: Rows) -> list[Finding]:
    """Compare the columns of a table with each other.

    Args:
        rows: The rows, in the units that the map of columns declares.

    Returns:
        The findings of the rows, and one for each contradiction, with the likely factor or
        convention.
    """
    sentences = [(Check.SIZES, sentence) for sentence in _check_sizes(rows)]
    movement = _Movement.of(rows.start, rows.frame_interval_ms)
    if len(movement.middle) >= _MIN_ROWS:
        sentences += _check_movement(rows, movement)
    num_rows = int(rows.start[-1])
    return [*rows.findings, *(_reported(check, text, num_rows) for check, text in sentences)]


def _check_movement(rows: Rows, movement: _Movement) -> list[tuple[Check, str]]:
    """Compare speeds, headings and accelerations with the movement of the positions."""
    east, north = (movement.rate(rows.values[name]) for name in ("x", "y"))
    derived = np.hypot(east, north)
    checks = [(Check.SPEEDS, _check_speeds(rows, movement, derived))]
    if not checks[0][1]:  # A wrong unit of speeds or positions would also fail these checks.
        checks.append((Check.AXES, _check_axes(rows, movement, east, north)))
        checks.append((Check.SPEEDS, _check_traffic_speed(derived)))
    checks.append((Check.HEADINGS, _check_heading(rows, movement, east, north)))
    checks.append((Check.ACCELERATIONS, _check_accelerations(rows, movement)))
    return [(check, sentence) for check, sentences in checks for sentence in sentences]


def _stated_speeds(values: Mapping[str, F64]) -> dict[str, F64]:
    """The speed that each of the stated quantities gives, by their names [m/s]."""
    speeds: dict[str, F64] = {}
    if "speed" in values:
        speeds["speed"] = np.abs(values["speed"])
    if "vx" in values and "vy" in values:
        speeds["vx and vy"] = np.hypot(values["vx"], values["vy"])
    return speeds


def _check_speeds(rows: Rows, movement: _Movement, derived: F64) -> list[str]:
    """Compare the stated speeds with the movement of the positions."""
    sentences: list[str] = []
    high_speed = float(np.percentile(derived, 95.0))
    for name, speed in _stated_speeds(rows.values).items():
        ratio = _ratio(movement.mean(speed), derived)
        if ratio is None or abs(math.log(ratio)) <= math.log1p(_MAX_DISAGREEMENT):
            continue
        culprit = ""
        if high_speed > _MAX_TRAFFIC_SPEED:
            culprit = f"; movement at {high_speed:.0f} m/s points to the unit of x and y"
        elif high_speed * ratio > _MAX_TRAFFIC_SPEED:
            culprit = f"; a speed of {high_speed * ratio:.0f} m/s points to the unit of {name}"
        sentences.append(
            f"{name} and positions: the speeds are not those of the movement"
            f"{_by_factor(ratio)}{culprit}"
        )
    return sentences


def _ratio(stated: F64, derived: F64) -> float | None:
    """Median of stated / derived speeds, None with too few rows.

    Rows below a fifth of the high speeds are left out: their ratios are mostly noise.
    """
    high_derived, high_stated = np.percentile(derived, 95.0), np.percentile(stated, 95.0)
    is_fast = (derived > 0.2 * high_derived) & (stated > 0.2 * high_stated)
    if min(high_derived, high_stated) <= 0.0 or is_fast.sum() < _MIN_ROWS:
        return None
    return float(np.median(stated[is_fast] / derived[is_fast]))


def _check_axes(rows: Rows, movement: _Movement, east: F64, north: F64) -> list[str]:
    """Compare the axes of speeds with those of positions."""
    if "vx" not in rows.values or "vy" not in rows.values:
        return []
    stated = {name: movement.mean(rows.values[name]) for name in ("vx", "vy")}
    sentences = [
        f"{name} and {axis}: they point in opposite directions; likely the sign of {name}, "
        f"or an axis that is flipped (y_axis)"
        for name, axis, rate in (("vx", "x", east), ("vy", "y", north))
        if _cosine(stated[name], rate) < -_MIN_CORRELATION
    ]
    same_axis = (stated["vx"], east), (stated["vy"], north)
    other_axis = (stated["vx"], north), (stated["vy"], east)
    moves_on_same = any(abs(_cosine(*pair)) > _MIN_CORRELATION for pair in same_axis)
    moves_on_other = [abs(_cosine(*pair)) > _MIN_CORRELATION for pair in other_axis]
    # Along a straight road in the direction of an axis, the speed across it is mostly noise.
    slow = _MAX_LATERAL_SHARE * max(map(_rms, stated.values()))
    agrees = [
        moves or max(_rms(speed), _rms(rate)) < slow
        for moves, (speed, rate) in zip(moves_on_other, other_axis, strict=True)
    ]
    if not moves_on_same and any(moves_on_other) and all(agrees):
        return ["vx and vy: they are the changes of y and x; likely the two are swapped"]
    return sentences


def _cosine(first: F64, second: F64) -> float:
    """Cosine between two series of speeds; 0 where one of them is mostly noise."""
    first_rms, second_rms = _rms(first), _rms(second)
    if min(first_rms, second_rms) < _MIN_LATERAL_SPEED:
        return 0.0
    return float((first * second).mean() / (first_rms * second_rms))


def _rms(values: F64) -> float:
    return float(np.sqrt((values**2).mean()))


def _check_traffic_speed(derived: F64) -> list[str]:
    """Name the unit of positions where vehicles are faster than any traffic."""
    high_speed = float(np.percentile(derived, 95.0))
    if high_speed <= _MAX_TRAFFIC_SPEED:
        return []
    factor = _factor_into(high_speed, _USUAL_SPEEDS)
    return [
        f"positions: vehicles move at up to {high_speed:.0f} m/s, faster than any traffic"
        f"{_of_unit(factor, 'x and y')}"
    ]


def _check_sizes(rows: Rows) -> list[str]:
    """Compare the sizes of vehicles with usual ones."""
    has_four_wheels = ~np.isin(rows.kind, (VehicleKind.MOTORCYCLE, VehicleKind.BICYCLE))
    if not has_four_wheels.any():
        return []
    width, length = (float(np.median(size[has_four_wheels])) for size in (rows.width, rows.length))
    if width > length:  # `examination` refuses exchanged columns.
        return []
    narrowest, widest = _VEHICLE_WIDTHS
    may_be_bicycles = has_four_wheels.sum() < _MIN_VEHICLES and length >= _MIN_LENGTH
    if width <= widest and (width >= narrowest or may_be_bicycles):
        return []
    factor = _factor_into(width, _USUAL_WIDTHS)
    return [
        f"width: vehicles are {width:.3g} m wide in the median, where {narrowest:g} to "
        f"{widest:g} m are usual{_of_unit(factor, 'the sizes')}"
    ]


def check_lanes(road: Road, tracks: Tracks, frame_interval_ms: int) -> list[Finding]:
    """Compare the distance of the lanes that traffic uses with the widths of lanes.

    Args:
        road: A road whose lanes are inferred from the traffic.
        tracks: The vehicles on it.
        frame_interval_ms: Time between frames [ms].

    Returns:
        A finding if the traffic uses every second, third, ... lane only, as it does where the
        positions are in feet; else an empty list.
    """
    movement = _Movement.of(tracks.start, frame_interval_ms)
    # Vehicles that change lanes cross those between, so only states without lateral movement count.
    keeps_lane = np.abs(movement.rate(tracks.d)) < _MAX_DRIFT
    lanes, count = np.unique(tracks.lane_index[movement.middle[keeps_lane]], return_counts=True)
    used_lanes = lanes[(lanes >= 0) & (count >= _MIN_SHARE_OF_LANE * count.sum())]
    lane_step = int(np.gcd.reduce(np.diff(used_lanes))) if len(used_lanes) > 1 else 1
    if lane_step < 2:
        return []
    pitch = lane_step * float(np.abs(np.diff(road.lane_boundaries)).mean())
    factor = _factor_into(pitch, _LANE_WIDTHS)
    if factor is None:
        return []
    detail = (
        f"positions: traffic drives in lanes that are {pitch:.1f} m apart, with none between them"
        f"{_of_unit(factor, 'x and y')}"
    )
    return [_reported(Check.LANES, detail, tracks.num_rows)]


def _check_heading(rows: Rows, movement: _Movement, east: F64, north: F64) -> list[str]:
    """Compare headings with the direction of movement."""
    if "heading" not in rows.values:
        return []
    is_moving = np.hypot(east, north) * movement.elapsed > _MIN_WAY
    if is_moving.sum() < _MIN_ROWS:
        return []
    direction = np.arctan2(north, east)[is_moving]
    heading = rows.values["heading"][movement.middle][is_moving]
    error = _angle_error(heading, direction)
    if error <= _MAX_ANGLE_ERROR:
        return []
    errors = {
        f"{unit}{convention}": _angle_error(turned, direction)
        for unit, scale in _ANGLE_UNITS.items()
        for convention, turned in _conventions(heading * scale).items()
    }
    best = min(errors, key=lambda name: errors[name])
    explanation = f"; likely {best}" if errors[best] < 0.5 * _MAX_ANGLE_ERROR else ""
    return [
        f"heading and positions: the headings are {math.degrees(error):.0f} degrees off the "
        f"direction of movement in the median{explanation}"
    ]


_ANGLE_UNITS = {
    "": 1.0,
    "degrees where the map declares radians, ": math.pi / 180.0,
    "radians where the map declares degrees, ": 180.0 / math.pi,
}
"""Factor that corrects a heading, by the beginning of the words that explain it."""


def _conventions(angle: F64) -> dict[str, F64]:
    """The headings, anticlockwise from x, that angles stand for under each convention [rad]."""
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
    """Compare accelerations with changes of speed, and yaw rates with changes of heading."""
    values = rows.values
    pairs: list[tuple[str, str, F64]] = []
    if "accel_lon" in values:
        pairs += [("accel_lon", *speed) for speed in list(_stated_speeds(values).items())[:1]]
    pairs += [
        (f"a{axis}", f"v{axis}", values[f"v{axis}"])
        for axis in "xy"
        if f"a{axis}" in values and f"v{axis}" in values
    ]
    if "yaw_rate" in values and "heading" in values:
        pairs.append(("yaw_rate", "heading", np.unwrap(values["heading"])))
    sentences: list[str] = []
    for name, source, quantity in pairs:
        noise = _YAW_RATE_NOISE if name == "yaw_rate" else _ACCEL_NOISE
        fault = _compare_rates(movement.mean(values[name]), movement.rate(quantity), noise)
        if fault == _OPPOSITE:
            sentences.append(f"{name} and {source}: likely {name} has the opposite sign")
        elif fault is not None:
            sentences.append(
                f"{name} and {source}: {name} is not the change of {source} per second"
                f"{_by_factor(fault)}"
            )
    return sentences


_OPPOSITE = -1.0  # Stands for rates that have opposite signs.


def _compare_rates(stated: F64, derived: F64, noise: float) -> float | None:
    """The ratio of stated to derived rates; None if they agree or tell nothing.

    In most traffic few vehicles brake or turn, so only the rows count in which one does.

    Args:
        stated: Rate that a column states, shape (pair,).
        derived: Change per second of another column, same shape.
        noise: Smaller derived rates are mostly noise.

    Returns:
        The ratio if it is beyond `_MAX_ACCEL_DISAGREEMENT`; `_OPPOSITE` for opposite signs.
    """
    is_clear = np.abs(derived) > noise
    if is_clear.sum() < _MIN_ROWS or not stated[is_clear].any():
        return None
    stated, derived = stated[is_clear], derived[is_clear]
    stated_rms, derived_rms = _rms(stated), _rms(derived)
    cosine = float((stated * derived).mean() / (stated_rms * derived_rms))
    if abs(cosine) < _MIN_CORRELATION:
        return None
    if cosine < 0.0:
        return _OPPOSITE
    ratio = stated_rms / derived_rms
    return ratio if abs(math.log(ratio)) > math.log1p(_MAX_ACCEL_DISAGREEMENT) else None


def _by_factor(ratio: float, factors: Mapping[float, str] = FACTORS) -> str:
    """The end of a sentence about a ratio: the nearest of some factors and its units."""
    for factor, units in factors.items():
        for value, text in ((factor, f"{factor:.5g}"), (1.0 / factor, f"1/{factor:.5g}")):
            if abs(math.log(ratio / value)) <= _FACTOR_TOLERANCE:
                return f": likely the factor {text} ({units})"
    return f" by a factor of {ratio:.3g}, which is not a factor between usual units"


def _of_unit(factor: float | None, quantity: str) -> str:
    """The end of a sentence about a quantity with an unusual size, and the factor that corrects it.

    Args:
        factor: One of `_LENGTH_FACTORS`, None if no factor corrects the size.
        quantity: The quantity in words.
    """
    if factor is None:
        return f"; check the unit of {quantity}"
    # Between 1 and 10 there is only the factor from metres to feet.
    text = f"{factor:g}" if factor < 1.0 or factor >= 10.0 else "1/0.3048"
    units = next(
        units
        for unit_factor, units in FACTORS.items()
        if any(abs(math.log(factor / value)) < 1e-6 for value in (unit_factor, 1.0 / unit_factor))
    )
    return f": likely the unit of {quantity} is off by the factor {text} ({units})"


def _factor_into(value: float, usual: tuple[float, float]) -> float | None:
    """The first factor that takes a value into its usual range, None without any."""
    low, high = usual
    return next((factor for factor in _LENGTH_FACTORS if low <= value * factor <= high), None)
