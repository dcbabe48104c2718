"""What another driver of the ego observes: what ours would believe, or how it is."""

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import minimum
from overtaking.model.driver_interface import (
    EGO_COLUMNS,
    NEIGHBOUR_COLUMNS,
    OBSERVATION_SIZE,
    PASSING_COLUMNS,
    split_observation,
)
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.gaps import faster, is_told
from overtaking.sim.reference.intent import (
    can_abort,
    can_remain,
    has_arrived,
    has_passed,
    in_stage,
)
from overtaking.sim.reference.moment import Moment
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.oncoming import Oncoming, look_beyond, usual_closing
from overtaking.sim.reference.orders import can_go_back, can_go_out
from overtaking.sim.reference.passing import is_solid, room_ahead, room_left
from overtaking.sim.reference.plight import can_fall_in, weigh
from overtaking.sim.reference.state import (
    LEAD,
    Fields,
    State,
    pick,
    road_velocity,
    seen_from_each,
)
from overtaking.world.constants import ModelConstants
from overtaking.world.step_parameters import Parameters
from overtaking.world.weather_parameters import SimulationParameters

_ROLES = 6


def observe(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    decision: int,
    *,
    is_true: bool,
) -> F32:
    """The numbers of every simulation, shape (simulation, `WIDTH`).

    Args:
        state: State at a decision.
        given: All inputs.
        p: Vehicle parameters.
        q: Simulation parameters.
        moment: What drivers know.
        decision: Its number.
        is_true: Whether to tell how it is, not what the ego believes.
    """
    table = np.zeros((state.s.shape[1], OBSERVATION_SIZE), np.float32)
    own, around, meeting = split_observation(table)
    around[:, :, list(NEIGHBOUR_COLUMNS).index("gap")] = given.constants.unseen_gap
    _write(own, EGO_COLUMNS, _own(state, given, p, moment))
    for role in range(_ROLES):
        if is_true:
            seen = _true(state, moment.near, given, role)
        else:
            seen = _believed(state, p, moment, role)
        detected = seen["detected"] > 0
        looks = _looks(state, given.constants, p, moment.near, role, detected)
        _write(around[:, role], NEIGHBOUR_COLUMNS, seen | looks)
    if moment.met is not None:
        oncoming = moment.met.coming
        beyond = look_beyond(state, given, p, q, moment.near, oncoming, decision)
        for role, who in enumerate((oncoming, beyond), _ROLES):
            _write(
                around[:, role], NEIGHBOUR_COLUMNS, _coming(state, given, p, who, is_true=is_true)
            )
        _write(meeting, PASSING_COLUMNS, _meeting(state, given, p, q, moment, oncoming))
    return table


def _write(columns: F32, names: dict[str, tuple[str, str]], told: dict[str, F32 | Mask]) -> None:
    """Numbers into their columns, shape (simulation, number)."""
    for place, name in enumerate(names):
        columns[:, place] = told[name]


def _own(state: State, given: Parameters, p: Fields, moment: Moment) -> dict[str, F32 | Mask]:
    """What the ego knows of itself."""
    ego, near = EGO_SLOT, moment.near
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
        "stage": state.stage[ego],
        "stage_time": state.stage_time[ego],
        "waited": state.waited[ego],
        "signalled": state.signalled[ego],
        "wanted": state.wanted[ego],
        "since_change": state.since_change[ego],
        "arrived": has_arrived(state, ego),
        "looks": moment.looks[ego],
        "contested": moment.waits[ego],
        "passed": has_passed(state, given, p, ego),
        "behind_target": state.s[ego] < pick(state.s, state.target[ego]),
        "can_go_out": can_go_out(state, given),
        "can_go_back": can_go_back(state),
        "can_abort": can_abort(state, given, ego) | can_remain(state, given, ego),
    }


def _believed(state: State, p: Fields, moment: Moment, role: int) -> dict[str, F32 | Mask]:
    """What the model's driver decides by: beliefs, and true speeds of approach where it is told."""
    believed = moment.believed
    names = ("detected", "gap", "closing", "accel")
    seen = {name: getattr(believed, name)[role, EGO_SLOT] for name in names}
    if role == LEAD:
        told = is_told(p) & seen["detected"]
        seen["closing"] = np.where(told, faster(state, moment.near), seen["closing"])
    return seen


def _true(state: State, near: Neighbours, given: Parameters, role: int) -> dict[str, F32 | Mask]:
    """How a neighbour moves."""
    slot, zero = near.slot[role, EGO_SLOT], np.float32(0.0)
    there = slot >= 0
    speed, _ = road_velocity(state)
    own, other = speed[EGO_SLOT], pick(speed, slot)
    closing = own - other if role % 2 == 0 else other - own
    return {
        "detected": there,
        "gap": np.where(there, near.gap[role, EGO_SLOT], given.constants.unseen_gap),
        "closing": np.where(there, closing, zero),
        "accel": np.where(there, pick(state.a_lon, slot), zero),
    }


def _looks(
    state: State, c: ModelConstants, p: Fields, near: Neighbours, role: int, detected: Mask
) -> dict[str, F32]:
    """What there is to see of a neighbour besides its motion, zero where it is not seen."""
    slot = near.slot[role, EGO_SLOT]
    brakes = (pick(state.accel, slot) < -c.stop_lamp_decel) | (pick(state.crashed, slot) > 0)
    seen = {
        "aside": near.aside[role, EGO_SLOT],
        "indicator": pick(state.indicator, slot),
        "brake_lamp": brakes.astype(np.float32),
        "length": np.float32(2.0) * near.half_length[role, EGO_SLOT],
        "truck": pick(p.truck, slot),
        "two_wheeler": pick(p.two_wheeler, slot),
    }
    return {name: np.where(detected, value, np.float32(0.0)) for name, value in seen.items()}


def _coming(
    state: State, given: Parameters, p: Fields, who: Oncoming, *, is_true: bool
) -> dict[str, F32 | Mask]:
    """What there is to know of somebody who comes the other way."""
    ego, zero, slot = EGO_SLOT, np.float32(0.0), who.slot[EGO_SLOT]
    there = slot >= 0
    speed, _ = road_velocity(state)
    lateral = np.stack([seen_from_each(state, given, p, j)[1][ego] for j in range(len(state.s))])
    if is_true:
        detected, gap, closing = there, who.gap[ego], speed[ego] + pick(speed, slot)
        accel = pick(state.a_lon, slot)
    else:
        detected, gap, closing = who.detected[ego], who.believed_gap[ego], who.closing[ego]
        accel = np.zeros_like(gap)
    seen = {
        "closing": closing,
        "accel": accel,
        "aside": pick(lateral, slot) - state.d[ego],
        "indicator": -pick(state.indicator, slot),
        "brake_lamp": np.zeros_like(gap),
        "length": np.float32(2.0) * who.half_length[ego],
        "truck": pick(p.truck, slot),
        "two_wheeler": pick(p.two_wheeler, slot),
    }
    told = {name: np.where(detected, value, zero) for name, value in seen.items()}
    gap = np.where(detected, gap, given.constants.unseen_gap)
    return told | {"detected": detected, "gap": gap}


def _meeting(
    state: State,
    given: Parameters,
    p: Fields,
    q: SimulationParameters,
    moment: Moment,
    oncoming: Oncoming,
) -> dict[str, F32 | Mask]:
    """How the ego stands to oncoming traffic."""
    ego = EGO_SLOT
    plight = weigh(state, given, p, q, moment, ego)
    lead = moment.near.slot[LEAD, ego]
    passed = np.where(in_stage(state, ego, Stage.FOLLOW), lead, state.target[ego])
    room = room_ahead(state, p, lead, ego)
    return {
        "sight": oncoming.sight[ego],
        "sure": oncoming.sure[ego],
        "expected": usual_closing(state, q)[ego],
        "room": minimum(room, given.constants.unseen_gap),
        "room_left": room_left(given.constants, p, passed),
        "solid": is_solid(state, given, p, ego, given.constants.line_ahead),
        "hurries": np.float32(0.5) * plight.hurries + np.float32(0.5) * plight.pressed,
        "yields": np.float32(0.5) * plight.yields + np.float32(0.5) * (plight.yields & plight.fits),
        "can_fall_in": can_fall_in(state, given, p, ego),
    }
