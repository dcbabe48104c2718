"""What another driver of the ego observes: what ours would believe, or how it is."""

import numpy as np

from overtaking.core.elementary import F32, Mask
from overtaking.model.observation import AROUND, OWN, ROLES, WIDTH
from overtaking.model.vehicles import Role
from overtaking.sim.reference.ego import faster, is_told
from overtaking.sim.reference.intent import (
    can_abort,
    can_go_back,
    can_go_out,
    can_remain,
    has_arrived,
    has_passed,
)
from overtaking.sim.reference.mobil import must_wait
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.run import Moment
from overtaking.sim.reference.state import LEAD, Fields, State, pick, road_velocity
from overtaking.world.constants import Constants
from overtaking.world.parameters import Parameters

_ROLES = 6


def observe(state: State, given: Parameters, p: Fields, moment: Moment, *, is_true: bool) -> F32:
    """The numbers of every simulation, shape (simulation, `WIDTH`).

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        moment: What drivers know.
        is_true: Whether to tell how it is, not what the ego believes.
    """
    table = np.zeros((WIDTH, state.s.shape[1]), np.float32)
    own = _own(state, given, p, moment)
    for row, name in zip(table, OWN, strict=False):
        row[...] = own[name]
    rows = table[len(OWN) :].reshape(len(ROLES), len(AROUND), -1)
    rows[:, list(AROUND).index("gap")] = given.constants.unseen_gap
    for role in range(_ROLES):
        if is_true:
            seen = _true(state, moment.near, given, role)
        else:
            seen = _believed(state, p, moment, role)
        detected = seen["detected"] > 0
        around = seen | _looks(state, given.constants, p, moment.near, role, detected)
        for row, name in zip(rows[role], AROUND, strict=True):
            row[...] = around[name]
    return np.ascontiguousarray(table.T)


def _own(state: State, given: Parameters, p: Fields, moment: Moment) -> dict[str, F32 | Mask]:
    """What the ego knows of itself."""
    ego, near = Role.EGO, moment.near
    centre = np.float32(0.5) * (near.lane_low[ego] + near.lane_high[ego])
    return {
        "speed": state.vx[ego],
        "accel": state.accel[ego],
        "position": state.s[ego],
        "lateral": state.d[ego],
        "offset": state.d[ego] - centre,
        "heading": state.psi[ego],
        "yaw_rate": state.r[ego],
        "lane": state.lane[ego],
        "stage": state.stage,
        "stage_time": state.stage_time,
        "waited": state.waited,
        "signalled": state.signalled,
        "wanted": state.wanted[ego],
        "since_change": state.since_change[ego],
        "arrived": has_arrived(state),
        "looks": moment.looks[ego],
        "contested": must_wait(state, given, state.wanted, moment.claims)[ego],
        "passed": has_passed(state, given, p),
        "behind_target": state.s[ego] < pick(state.s, state.target),
        "can_go_out": can_go_out(state, given),
        "can_go_back": can_go_back(state),
        "can_abort": can_abort(state, given) | can_remain(state, given),
    }


def _believed(state: State, p: Fields, moment: Moment, role: int) -> dict[str, F32 | Mask]:
    """What the model's driver decides by: beliefs, and true speeds of approach where it is told."""
    believed = moment.believed
    names = ("detected", "gap", "closing", "accel")
    seen = {name: getattr(believed, name)[role, Role.EGO] for name in names}
    if role == LEAD:
        told = is_told(p) & seen["detected"]
        seen["closing"] = np.where(told, faster(state, moment.near), seen["closing"])
    return seen


def _true(state: State, near: Neighbours, given: Parameters, role: int) -> dict[str, F32 | Mask]:
    """How a neighbour moves."""
    slot, zero = near.slot[role, Role.EGO], np.float32(0.0)
    there = slot >= 0
    speed, _ = road_velocity(state)
    own, other = speed[Role.EGO], pick(speed, slot)
    closing = own - other if role % 2 == 0 else other - own
    return {
        "detected": there,
        "gap": np.where(there, near.gap[role, Role.EGO], given.constants.unseen_gap),
        "closing": np.where(there, closing, zero),
        "accel": np.where(there, pick(state.a_lon, slot), zero),
    }


def _looks(
    state: State, c: Constants, p: Fields, near: Neighbours, role: int, detected: Mask
) -> dict[str, F32]:
    """What there is to see of a neighbour besides its motion, zero where it is not seen."""
    slot = near.slot[role, Role.EGO]
    brakes = (pick(state.accel, slot) < -c.stop_lamp_decel) | (pick(state.crashed, slot) > 0)
    seen = {
        "aside": near.aside[role, Role.EGO],
        "indicator": pick(state.indicator, slot),
        "brake_lamp": brakes.astype(np.float32),
        "length": np.float32(2.0) * near.half_length[role, Role.EGO],
        "truck": pick(p.truck, slot),
        "two_wheeler": pick(p.two_wheeler, slot),
    }
    return {name: np.where(detected, value, np.float32(0.0)) for name, value in seen.items()}
