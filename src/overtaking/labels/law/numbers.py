"""Declaration of a number of the law, and the numbers that several rules share.

A number without a source is a choice of this package; `why` states its reason. Each name is listed
with value and reason in `docs/reference/rules.md`. `stl-monitor` is a published monitor of highway
rules (Maierhofer and others, IEEE IV 2020); its names, such as R_G1, stand in brackets.
"""

from typing import Any

from overtaking.knowledge.quantities import ENGINEERING_CHOICE, Quantity, parse_quantity
from overtaking.knowledge.toml_reader import sources


def quantity(
    value: float, unit: str, source: str = ENGINEERING_CHOICE, *, why: str | None = None
) -> Quantity:
    """Declare a number of a law, with its unit and its source.

    Args:
        value: The number in `unit`, as its source states it.
        unit: Unit of the number, such as "km/h"; the check of a rule reads it in SI.
        source: Id of a source of `sources.toml`; by default the number is a choice of this package.
        why: Reason for this value. A choice must state one.

    Raises:
        KnowledgeError: The unit or the source is unknown, or a choice has no reason.
    """
    entry: dict[str, Any] = {"value": value, "unit": unit, "source": source}
    if why is not None:
        entry["rationale"] = why
    return parse_quantity(entry, name="", where=f"quantity({value:g}, {unit!r})", sources=sources())


COVERAGE_FACTOR = quantity(
    2.0, "1", "jcgm-100", why="Coverage factor of an expanded uncertainty, about 95 % (6.3.3)"
)
"""A margin within this many standard errors of 0 is undecidable."""

WINDOW_BEFORE = quantity(
    3.0, "s", why="Looking, signalling and following before the start belong to the overtake"
)
"""The judged time before an attempt."""

WINDOW_AFTER = quantity(
    3.0, "s", why="Settling in front of the overtaken vehicle belongs to the overtake"
)
"""The judged time after a return."""

REACTION_TIME = quantity(
    1.0,
    "s",
    why="The reaction of an attentive driver, 33 m at 120 km/h. stl-monitor has 0.3 s for "
    "automated driving; the usual advice of 2 s would make most traffic illegal",
)
"""Reaction time of the driver behind in the safe distance."""

MAX_DECEL = quantity(
    8.0, "m/s^2", why="Good brakes reach it on a dry road; on a wet road friction is the limit"
)
"""Largest deceleration of both vehicles in the safe distance."""

GAP_REGAIN_TIME = quantity(
    3.0, "s", "stl-monitor", why="Time to regain the distance after a vehicle cut in (R_G1)"
)
"""Time in which a driver may restore a gap that another vehicle has taken."""

STOPPING_REACTION_TIME = quantity(1.0, "s", why="As in the safe distance")
"""Reaction time of a driver who stops for an obstacle that comes into sight."""

LINE_TOLERANCE = quantity(
    0.05,
    "m",
    why="Half the width of a narrow line: a body beyond the line is in the next lane, a body on it "
    "is not",
)
"""Distance up to which a corner of the ego may be beyond the middle of a line."""

ABRUPT_BRAKING = quantity(2.0, "m/s^2", "stl-monitor", why="Harder braking is abrupt (a_abrupt)")
"""Largest deceleration to which the ego may force another vehicle."""

ENTRY_TTC = quantity(
    3.0, "s", why="A time to collision below 3 to 4 s is a conflict, below 1.5 s a severe conflict"
)
"""Smallest time to collision with the leader in a lane that is entered."""

LATERAL_ERROR_SHARE = quantity(
    0.25, "1", why="A measured speed of half the limit is then two standard errors below the limit"
)
"""Largest standard error of a lateral speed, as a share of the limit with which it is compared.

The time over which the speed of a recording is measured grows until the error is that small.
"""

LATERAL_NOISE_TIME = quantity(1.0, "s", why="Short against a lane change, which lasts 5 s")
"""Time before and after a frame over which the noise of a recorded lateral position is measured.

It is also the largest time before and after a frame over which a lateral speed is measured.
"""

OBSTRUCTION_TIME = quantity(
    3.0,
    "s",
    why="The time to regain the distance after a cut-in: later braking is not forced by the lane "
    "change",
)
"""Time after a change of lane in which the ego answers for the braking of its follower."""

MAX_FORCED_BRAKING = quantity(
    20.0, "m/s^2", why="No vehicle brakes so hard; the bound keeps margins finite"
)
"""Largest braking demand; a larger one counts as this."""

RETURN_TIME_GAP = quantity(
    2.0, "s", why="The usual advice for time gaps, at which there is space for any vehicle"
)
"""Time gap to the target behind the ego from which a return is possible."""

RETURN_FREE_TIME = quantity(
    10.0, "s", why="A driver that would have to pull out again sooner may stay in the faster lane"
)
"""Time for which the lane to return to must be free."""

RETURN_RANGE = quantity(200.0, "m", why="Margins stay finite where no vehicle bounds the gap")
"""Larger gaps in the lane to return to count as this one."""

ONCOMING_TIME = quantity(
    1.0,
    "s",
    "aashto-green-book-2018",
    why="Clearance at the end of the passing sight distance, at the sum of both speeds",
)
"""Smallest time to an oncoming vehicle when the ego is back in its lane."""

# Numbers of responsibility-sensitive safety (RSS), a measure for comparison that no rule uses.

RSS_REACTION_TIME = quantity(1.0, "s", "rss-2017")
"""Time for which the follower may still accelerate."""

RSS_ACCEL = quantity(3.5, "m/s^2", "rss-2017")
"""Acceleration of the follower in the reaction time."""

RSS_REAR_DECEL = quantity(4.0, "m/s^2", "rss-2017")
"""Weakest deceleration of the follower after the reaction time."""

RSS_LEADER_DECEL = quantity(8.0, "m/s^2", "rss-2017")
"""Strongest deceleration of the leader."""
