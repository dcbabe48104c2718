"""Decisions that can be forced on the ego."""

from enum import IntEnum


class Decision(IntEnum):
    """A decision that can be forced on the ego, from the first instant that allows it."""

    FREE = 0  # decide alone, as in an undisturbed simulation
    PULL_OUT = 1  # begin the overtake, whatever the gaps
    ABORT = 2  # go back while pulling out
    RETURN = 3  # change back to the slower lane, whatever is there
    STAY = 4  # never begin an overtake
