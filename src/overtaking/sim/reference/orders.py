"""Another driver at the ego's wheel: what it asks for, as far as that is possible."""

from dataclasses import dataclass

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.model.driver_interface import ACTION_KINDS, Actions, Move
from overtaking.model.trajectories import Stage
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.intent import (
    Intent,
    can_abort,
    can_remain,
    has_arrived,
    has_passed,
    in_stage,
    signal,
)
from overtaking.sim.reference.plight import can_fall_in
from overtaking.sim.reference.state import Fields, State
from overtaking.world.step_parameters import StepParameters

_FREE = np.float32(1e9)  # Behind nobody [m/s^2].


@dataclass(slots=True, kw_only=True)
class Orders:
    """What another driver asks for at a decision.

    Attributes:
        kind: A name in `ACTION_KINDS`.
        values: Its numbers in SI units, each of shape (simulation,).
    """

    kind: str
    values: tuple[F32, ...]

    def of(self, name: str) -> F32 | None:
        """One of its numbers; None where it has none of that name."""
        names = [part.name for part in ACTION_KINDS[self.kind]]
        return self.values[names.index(name)] if name in names else None

    @property
    def steers(self) -> bool:
        """Whether the other driver turns the wheels itself."""
        return self.of("wheel_angle") is not None


def orders_at(actions: Actions | None, decision: int) -> Orders | None:
    """The orders of a decision; those of the last one where there are no more."""
    if actions is None:
        return None
    row = actions.values[:, min(decision, actions.values.shape[1] - 1)]
    return orders_of(actions.kind, row)


def orders_of(kind: str, steps: np.ndarray) -> Orders:
    """Orders from whole numbers of steps, shape (simulation, part)."""
    scales = [np.float32(round(1.0 / part.resolution)) for part in ACTION_KINDS[kind]]
    values = (steps[:, k].astype(np.float32) / scale for k, scale in enumerate(scales))
    return Orders(kind=kind, values=tuple(values))


def pedals(orders: Orders | None, leader: F32, old_leader: F32) -> tuple[F32, F32]:
    """The accelerations that drivers want for two reasons, the ego's as another driver asks."""
    asked = None if orders is None else orders.of("accel")
    if asked is None:
        return leader, old_leader
    leader, old_leader = leader.copy(), old_leader.copy()
    leader[EGO_SLOT], old_leader[EGO_SLOT] = asked, _FREE
    return leader, old_leader


def wheel(orders: Orders | None) -> F32 | None:
    """Angle of the front wheels that another driver asks for, (simulation,) [rad]."""
    return None if orders is None else orders.of("wheel_angle")


def show(state: State, orders: Orders) -> None:
    """Light the indicator that another driver asks for, if that is a part of its action.

    A wish for a lane beside a wheel angle is nothing but the indicator. A `Move` that names a side
    shows it, whether or not the scenario's driver uses indicators.
    """
    if orders.kind not in ("accel_move", "accel_steer_signal"):
        return
    side = _side(orders)
    told = (state.crashed[EGO_SLOT] == 0) & (orders.steers | (side != 0))
    state.indicator[EGO_SLOT] = np.where(told, side, state.indicator[EGO_SLOT])


def can_go_out(state: State, given: StepParameters) -> Mask:
    """Whether there is a faster lane for the ego, and no lane change under way, (simulation,)."""
    settled = in_stage(state, EGO_SLOT, Stage.FOLLOW) | in_stage(state, EGO_SLOT, Stage.PASS)
    has_lane = state.lane[EGO_SLOT] < np.float32(given.road.num_lanes - 1)
    return settled & has_arrived(state, EGO_SLOT) & has_lane


def can_go_back(state: State) -> Mask:
    """Whether there is a slower lane, and no change under way that cannot be given up."""
    follows = in_stage(state, EGO_SLOT, Stage.FOLLOW) & has_arrived(state, EGO_SLOT)
    return (follows | in_stage(state, EGO_SLOT, Stage.PASS)) & (
        state.lane[EGO_SLOT] >= np.float32(1.0)
    )


def obey(state: State, given: StepParameters, p: Fields, orders: Orders) -> Intent:
    """What the ego sets out to do: what another driver asks for, where that is possible."""
    if orders.steers:
        return _drift(state, given, p)
    side = _side(orders)
    # Who changes their mind shows the other side for as long.
    turned = state.wanted[EGO_SLOT] * side < 0
    state.signalled[EGO_SLOT] = np.where(turned, np.float32(0.0), state.signalled[EGO_SLOT])
    start = can_go_out(state, given) & (side > 0)
    back = can_go_back(state) & (side < 0)
    signal(state, given, EGO_SLOT, start, back)
    now = _now(state, p, orders)
    drops_out, drops_back, falls_in = _gives_up(orders)
    return Intent(
        start=start,
        back=back,
        go_out=start & now,
        go_back=back & now,
        abort=(can_abort(state, given, EGO_SLOT) & drops_out)
        | (can_fall_in(state, given, p, EGO_SLOT) & falls_in),
        remain=can_remain(state, given, EGO_SLOT) & drops_back,
        passed=has_passed(state, given, p, EGO_SLOT),
        arrived=has_arrived(state, EGO_SLOT),
    )


def _side(orders: Orders) -> F32:
    """Where the ego is to go: 1 towards the fast side, -1 towards the slow side, 0 nowhere."""
    if (wish := orders.of("lane_change")) is not None:
        return wish
    move, one = orders.of("move"), np.float32(1.0)
    out = (move == np.float32(Move.INDICATE_PULL_OUT)) | (move == np.float32(Move.PULL_OUT))
    back = (move == np.float32(Move.INDICATE_RETURN)) | (move == np.float32(Move.RETURN))
    return np.where(out, one, np.where(back, -one, np.float32(0.0)))


def _now(state: State, p: Fields, orders: Orders) -> Mask:
    """Whether the ego moves over now: when told to, or once it has signalled for its usual time."""
    if (move := orders.of("move")) is None:
        return state.signalled[EGO_SLOT] > p.indicator_lead_time[EGO_SLOT]
    return (move == np.float32(Move.PULL_OUT)) | (move == np.float32(Move.RETURN))


def _gives_up(orders: Orders) -> tuple[Mask, Mask, Mask]:
    """Whether the ego is to give up pulling out, changing back, and a pass that it is out for."""
    if (wish := orders.of("lane_change")) is not None:
        return wish < 0, wish > 0, np.zeros(wish.shape, np.bool_)
    aborts = np.asarray(orders.of("move") == np.float32(Move.CANCEL))
    return aborts, aborts, aborts


def _drift(state: State, given: StepParameters, p: Fields) -> Intent:
    """What the ego has set out to do, told from the lane that it is in: nothing is shown before."""
    road = given.road
    lane = np.zeros_like(state.stage[EGO_SLOT])
    for k in range(1, road.num_lanes):
        lane = np.where(state.d[EGO_SLOT] >= road.boundaries[k], np.float32(k), lane)
    faster, slower = lane > state.lane[EGO_SLOT], lane < state.lane[EGO_SLOT]
    out = in_stage(state, EGO_SLOT, Stage.PULL_OUT)
    comes_back = in_stage(state, EGO_SLOT, Stage.RETURN) | in_stage(state, EGO_SLOT, Stage.ABORT)
    never = np.zeros_like(out)
    signal(state, given, EGO_SLOT, never, never)
    return Intent(
        start=never,
        back=never,
        go_out=faster & ~comes_back,
        go_back=slower & ~out,
        abort=slower & out,
        remain=faster & comes_back,
        passed=has_passed(state, given, p, EGO_SLOT),
        arrived=has_arrived(state, EGO_SLOT),
    )
