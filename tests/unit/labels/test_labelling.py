"""The class under each policy of a simulation in which the ego spins."""

from __future__ import annotations

import numpy as np
from tests.support.cases import Track, case, ramp
from tests.support.worlds import wide_road

from overtaking.labels.labelling import label
from overtaking.model.verdicts import OvertakeClass

FRAMES = 300
AHEAD = Track(s=60.0, speed=20.0)
PULLS_OUT = ramp((3, 0), (6, 1), frames=FRAMES)


def classes(ego_lane: object, turn_at: int) -> list[OvertakeClass]:
    """The classes of a drive that ends across the road."""
    drive = case(Track(speed=28.0, lane=ego_lane), AHEAD, frames=FRAMES, road=wide_road(lanes=3))
    heading = drive.trajectories.states.heading.copy()
    heading[:, 0, turn_at:] = 10_000
    states = drive.trajectories.states.replace(heading=heading)
    labels = label(drive.trajectories.replace(states=states)).labels
    assert labels.policies == ("paper", "default", "strict")
    return [OvertakeClass(int(code)) for code in np.asarray(labels.classes[0])]


def test_a_spin_in_an_overtake_is_not_completed_for_the_study_and_a_departure_for_others():
    departed = [OvertakeClass.UNSUCCESS_DEP] * 2
    assert classes(PULLS_OUT, 150) == [OvertakeClass.UNSUCCESS_NCOL, *departed]


def test_a_spin_before_any_attempt_is_no_attempt_for_the_study_and_a_departure_for_others():
    departed = [OvertakeClass.UNSUCCESS_DEP] * 2
    assert classes(PULLS_OUT, 20) == [OvertakeClass.NO_ATTEMPT, *departed]
