"""The six neighbours of a vehicle. Left is the overtaking side, also in left-hand traffic."""

from enum import IntEnum


class NeighbourRole(IntEnum):
    """Neighbours of the ego, the order of the `neighbour` axis.

    A leader's centre is not behind the ego's centre, a follower's is; each is the nearest one whose
    centre lies in that lane. Alongside, a gap is negative.
    """

    LEADER = 0
    FOLLOWER = 1
    LEFT_LEADER = 2
    LEFT_FOLLOWER = 3
    RIGHT_LEADER = 4
    RIGHT_FOLLOWER = 5
