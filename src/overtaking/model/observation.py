"""What another driver of the ego observes: names and units of the numbers, in order."""

from typing import Final

from overtaking.core.arrays import F32

OWN: Final = {
    "speed": ("m/s", "Speed along its axis"),
    "accel": ("m/s^2", "Acceleration that it asks for"),
    "position": ("m", "Position along the road"),
    "lateral": ("m", "Position across the road"),
    "offset": ("m", "Offset from the centre of the lane it drives in or changes to"),
    "heading": ("rad", "Heading from the road"),
    "yaw_rate": ("rad/s", "Turning rate"),
    "lane": ("1", "Lane it drives in or changes to, 0 is the slowest"),
    "stage": ("Stage", "What it is doing"),
    "stage_time": ("s", "For how long"),
    "waited": ("s", "Time behind a slower leader so far"),
    "signalled": ("s", "For how long it has signalled the next lane change"),
    "wanted": ("1", "Side that it signals"),
    "since_change": ("s", "Time since its last lane change began"),
    "arrived": ("flag", "The last lane change is over"),
    "looks": ("flag", "It looks into the mirrors now"),
    "contested": ("flag", "Another signals for the same place and goes first"),
    "passed": ("flag", "The vehicle that is overtaken is behind"),
    "behind_target": ("flag", "The vehicle that is overtaken is ahead"),
    "can_go_out": ("flag", "It can change to a faster lane"),
    "can_go_back": ("flag", "It can change to a slower lane"),
    "can_abort": ("flag", "It can give up the lane change that has begun"),
}
"""Unit and meaning of each number of the ego; sides and angles grow towards the fast side."""

AROUND: Final = {
    "detected": ("flag", "Somebody is seen there"),
    "gap": ("m", "Gap between the bumpers, negative alongside; far where nobody is seen"),
    "closing": ("m/s", "Speed of approach"),
    "accel": ("m/s^2", "Acceleration; of percepts how hard somebody ahead brakes, never positive"),
    "aside": ("m", "Distance of the centres across the road"),
    "indicator": ("1", "Side that it signals"),
    "brake_lamp": ("flag", "Its stop lamps are on"),
    "length": ("m", "Length"),
    "truck": ("flag", "It is a truck"),
    "two_wheeler": ("flag", "It is a motorcycle or bicycle"),
}
"""Unit and meaning of each number of a neighbour, zero where none is seen, but for the gap.

Sides are the ego's. Stop lamps of who comes towards it are not seen.
"""

ROLES: Final = (
    "lead",
    "rear",
    "fast_lead",
    "fast_rear",
    "slow_lead",
    "slow_rear",
    "oncoming",
    "behind_oncoming",
)
"""Neighbours: ahead and behind in its lane, in the next faster and slower one; who comes the other
way, and the next one behind that, where no vehicle is on roads that run one way."""

MEETING: Final = {
    "sight": ("m", "How far it sees who comes: by the road, the weather and past the leader"),
    "sure": ("flag", "It has looked for long enough to know who comes, if anybody"),
    "expected": ("m/s", "Speed of approach that it expects of who comes, before it can tell"),
    "room": ("m", "Gap ahead of the leader, to whoever is next there"),
    "room_left": ("1", "Times the room that it leaves to a car at its return: to a truck more"),
    "solid": ("flag", "The line between the directions is not to be crossed here, or soon"),
    "hurries": (
        "1",
        "Its pedals and lane changes are hasty: 1 where little time would be left, 0.5 "
        "where the line would be solid at its return",
    ),
    "yields": (
        "1",
        "It would not be past in time, and its pedals fall back: 1 where it fits in behind the "
        "vehicle that is overtaken, 0.5 while it is too fast or too near for that",
    ),
    "can_fall_in": ("flag", "It is behind the vehicle that is overtaken, and can give up the pass"),
}
"""Unit and meaning of each number about a pass against oncoming traffic, zero on roads that run one
way. They are the model driver's own, whatever is observed of others; a sensor measures no room."""

WIDTH: Final = len(OWN) + len(ROLES) * len(AROUND) + len(MEETING)
"""Numbers that a simulation has."""


def parted(table: F32) -> tuple[F32, F32, F32]:
    """The numbers of `OWN`, of each of `ROLES`, and of `MEETING`, as views of a whole table.

    Args:
        table: Shape (..., `WIDTH`).

    Returns:
        Shapes (..., `OWN`), (..., `ROLES`, `AROUND`) and (..., `MEETING`).
    """
    own, meeting = len(OWN), WIDTH - len(MEETING)
    around = table[..., own:meeting].reshape(*table.shape[:-1], len(ROLES), len(AROUND))
    return table[..., :own], around, table[..., meeting:]
