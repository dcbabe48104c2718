"""Who is where on a two-way road: who comes, who overtakes, and who is being passed."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.model.trajectories import Stage
from overtaking.sim.reference.neighbours import lane_borders, shows_change
from overtaking.sim.reference.state import NOBODY, Fields, State, seen_from_each
from overtaking.world.step_parameters import StepParameters

_FAR = np.float32(1e9)  # Distance without anybody [m].

Met = tuple[F32, F32]
"""Slots of oncoming vehicles, `NOBODY` for none, and the distance of the centres [m]."""


def nearest(state: State, given: StepParameters, p: Fields, but: F32) -> tuple[Met, Met]:
    """The nearest oncomer of each vehicle in any lane, and in its own; slots `but` do not count.

    One that is visibly on its way into the own lane is there.
    """
    c, road = given.constants, given.road
    low, high = lane_borders(state, given, 0.0)
    edges = road.boundaries[0], road.boundaries[road.num_lanes]
    slot = np.full((2, *state.s.shape), NOBODY)
    distance = np.full_like(slot, _FAR)
    for j in range(len(state.s)):
        s, d = seen_from_each(state, given, p, j)
        ahead = s - state.s
        low_side, high_side = d - p.half_width[j], d + p.half_width[j]
        lane = np.float32(road.num_lanes - 1) - state.lane[j]
        comes = shows_change(state, given, j) & (lane == state.lane)
        opposed = (p.valid[j] > 0) & (p.travel_sign[j] != p.travel_sign) & (p.valid > 0)
        opposed = opposed & (ahead >= 0) & (but != np.float32(j))
        for k, (begin, end) in enumerate((edges, (low, high))):
            there = (high_side > begin + c.corridor_margin) & (low_side < end - c.corridor_margin)
            there = there | comes if k else there
            nearer = opposed & there & (ahead < distance[k])
            slot[k] = np.where(nearer, np.float32(j), slot[k])
            distance[k] = np.where(nearer, ahead, distance[k])
    return (slot[0], distance[0]), (slot[1], distance[1])


def is_passed(state: State, given: StepParameters, p: Fields) -> Mask:
    """Whom others pass in the next lane, as they notice it, (vehicle, simulation)."""
    out, passed = is_out(state), np.zeros(state.s.shape, bool)
    for j in range(len(state.s)):
        apart = np.abs(state.s - state.s[j]) - (p.half_length + p.half_length[j])
        beside = (apart < given.constants.passed_awareness_margin) & (
            p.travel_sign == p.travel_sign[j]
        )
        passed = passed | (beside & (state.lane[j] > state.lane) & out[j])
    return passed & (state.crashed == 0)


def is_out(state: State) -> Mask:
    """Who is overtaking, or on the way back from there, (vehicle, simulation)."""
    stage = state.stage
    away = (stage != np.float32(Stage.FOLLOW)) & (stage != np.float32(Stage.DONE))
    return away & (state.crashed == 0)
