"""What another driver of the ego observes: names and units of the numbers, in order."""

from typing import Final

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
"""Unit and meaning of each number of a neighbour, zero where none is seen, but for the gap."""

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
"""Neighbours: ahead and behind in its lane, in the next faster and slower one, and on the other
carriageway, where no vehicle is as long as roads run one way."""

WIDTH: Final = len(OWN) + len(ROLES) * len(AROUND)
"""Numbers that a simulation has."""
