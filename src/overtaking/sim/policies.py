"""The drivers that come with the package. They observe `human` and answer `decision`.

They decide about lane changes; the model's own driver accelerates, brakes and steers.
"""

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.model.driver_interface import Move, NeighbourColumns
from overtaking.model.trajectories import Stage
from overtaking.sim.observation import Observation

Moves = NDArray[np.int64]

MIN_SPEED_GAIN = 3.0
"""Smallest amount by which a leader must be slower than the desired speed to be overtaken [m/s]."""

PULL_OUT_TIME_GAP = 4.0
"""Time gap to the leader below which the overtake begins [s]."""

MIN_TIME_GAP = 1.2
"""Time gap kept to the new leader, and left to the new follower [s]."""

INDICATOR_LEAD_TIME = 1.2
"""Time from the indicator to the movement; UN R79 asks for 1 s [s]."""

MAX_IMPOSED_DECEL = 3.0
"""Largest deceleration that a lane change imposes on the new follower (UN R79) [m/s^2]."""

CANCEL_IMPOSED_DECEL = 6.0
"""Deceleration of the new follower above which a lane change is cancelled [m/s^2]."""

MIN_TIME_BETWEEN_CHANGES = 8.0
"""Time between two lane changes; the return need not wait for it [s]."""

ABORT_STATE_THRESHOLD = 0.5
"""Above it the ego fits in behind the target; below it the ego still brakes for that [1]."""

ONCOMING_TIME_MARGIN = 3.0
"""Time that is left until an oncoming vehicle at the end of a pass [s]."""


def stay(observation: Observation) -> Moves:
    """Never change lanes."""
    return np.full(len(observation.is_running), int(Move.KEEP))


def rules(observation: Observation) -> Moves:
    """Change lanes by fixed rules: if it gains speed, and the gaps are larger than UN R79 demands.

    It decides when it checks the mirrors, and keeps indicating in between.
    """
    ego = observation.ego
    checks_mirrors = ego.checks_mirrors > 0
    may_pull_out = (ego.stage == Stage.FOLLOW) & (ego.can_pull_out > 0)
    may_pull_out &= ego.time_since_lane_change >= MIN_TIME_BETWEEN_CHANGES
    pulls_out = may_pull_out & np.where(
        checks_mirrors, _wants_to_overtake(observation), ego.wanted_side > 0
    )
    may_return = (ego.stage == Stage.PASS) & (ego.can_return > 0) & (ego.has_passed_target > 0)
    is_clear = _is_clear_ahead(observation, observation.right_leader)
    is_clear &= _is_clear_behind(observation, observation.right_follower, MAX_IMPOSED_DECEL)
    returns = may_return & np.where(checks_mirrors, is_clear, ego.wanted_side < 0)
    now = (ego.time_indicating >= INDICATOR_LEAD_TIME) & checks_mirrors & (ego.gives_way == 0)
    move = np.where(pulls_out, np.where(now, Move.PULL_OUT, Move.INDICATE_PULL_OUT), Move.KEEP)
    move = np.where(returns, np.where(now, Move.RETURN, Move.INDICATE_RETURN), move)
    may_cancel = (ego.stage == Stage.PULL_OUT) & (ego.can_cancel_lane_change > 0) & checks_mirrors
    cancels = may_cancel & ~_is_clear_behind(
        observation, observation.left_follower, CANCEL_IMPOSED_DECEL
    )
    aborts = observation.passing.abort_state > ABORT_STATE_THRESHOLD
    return np.where(cancels | aborts, Move.CANCEL, move)


def _wants_to_overtake(observation: Observation) -> Mask:
    """Whether the leader is slow and near, and the gaps beside it suffice."""
    ego, leader, passing = observation.ego, observation.leader, observation.passing
    vehicle = observation.vehicle
    leader_speed = ego.speed - leader.closing_speed
    is_slow = vehicle.desired_speed - leader_speed > MIN_SPEED_GAIN
    is_near = (leader.is_detected > 0) & (leader.gap < PULL_OUT_TIME_GAP * ego.speed)
    is_clear = _is_clear_ahead(observation, observation.left_leader)
    is_clear &= _is_clear_behind(observation, observation.left_follower, MAX_IMPOSED_DECEL)
    is_two_way = passing.expected_closing_speed > 0  # On one-way roads all columns are zero.
    min_return_gap = 2.0 * MIN_TIME_GAP * leader_speed + 2.0 * vehicle.half_length
    may_meet_oncoming = (
        (passing.is_certain > 0)
        & (passing.line_is_solid == 0)
        & (passing.gap_ahead_of_leader > min_return_gap)
        & _is_back_in_time(observation)
    )
    return is_slow & is_near & is_clear & (may_meet_oncoming | ~is_two_way)


def _is_back_in_time(observation: Observation) -> Mask:
    """Whether the ego returns `ONCOMING_TIME_MARGIN` before it meets an oncoming vehicle.

    A vehicle that it does not see may be just beyond its sight, at the usual speed.
    """
    ego, leader, vehicle = observation.ego, observation.leader, observation.vehicle
    oncoming, passing = observation.oncoming, observation.passing
    leader_speed = ego.speed - leader.closing_speed
    lengths = leader.length + 2.0 * vehicle.half_length
    distance = leader.gap + lengths + MIN_TIME_GAP * leader_speed
    speed_gain = np.maximum(vehicle.desired_speed - leader_speed, MIN_SPEED_GAIN)
    duration = distance / speed_gain + vehicle.lane_change_duration
    is_seen = oncoming.is_detected > 0
    oncoming_gap = np.minimum(np.where(is_seen, oncoming.gap, np.inf), passing.sight_distance)
    closing_speed = np.where(is_seen, oncoming.closing_speed, 0.0)
    closing_speed = np.maximum(closing_speed, passing.expected_closing_speed)
    return oncoming_gap > (duration + ONCOMING_TIME_MARGIN) * closing_speed


def _is_clear_ahead(observation: Observation, new_leader: NeighbourColumns) -> Mask:
    """Whether the gap to the vehicle ahead in the new lane suffices."""
    closing_speed = np.maximum(new_leader.closing_speed, 0.0)
    min_gap = MIN_TIME_GAP * observation.ego.speed + PULL_OUT_TIME_GAP * closing_speed
    return (new_leader.is_detected == 0) | (new_leader.gap > min_gap)


def _is_clear_behind(
    observation: Observation, new_follower: NeighbourColumns, max_decel: float
) -> Mask:
    """Whether the vehicle behind in the new lane need not brake harder than `max_decel`."""
    closing_speed: F32 = np.maximum(new_follower.closing_speed, 0.0)
    follower_speed = observation.ego.speed + new_follower.closing_speed
    time_gap = MIN_TIME_GAP if max_decel == MAX_IMPOSED_DECEL else 0.0
    braking_distance = closing_speed * closing_speed / (2.0 * max_decel)
    min_gap = 0.4 * closing_speed + braking_distance + np.maximum(time_gap * follower_speed, 2.0)
    return (new_follower.is_detected == 0) | (new_follower.gap > min_gap)
