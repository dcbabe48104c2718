"""The state of a batch between two steps, and the questions that many functions ask about it.

A batch is a set of simulations. A slot is the number of a vehicle in its simulation; the ego, the
vehicle under study, has slot 0. A step is 10 ms, a decision comes every 50 ms. Left is the
overtaking side, and angles, lateral positions and their derivatives are positive to the left.
Numbers of slots, lanes and stages are float32, as all of the state, with whole values.
"""

from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import sincos
from overtaking.model.trajectories import Stage
from overtaking.world.step_parameters import StepParameters

HISTORY_LENGTH = 64
"""Decisions whose motion is remembered.

It covers the longest reaction delay (58 decisions) and the four decisions before it, by which
drivers judge braking. A power of two, because the engine computes the row of a decision, its number
modulo this length, by a float32 division and floor, which is exact only then.
"""

NEVER_LOOKED = np.float32(-2.0)
"""Value of `Attention.slot_in_view` and `Attention.oncoming_slot` before the first decision."""

LEADER, FOLLOWER, LEFT_LEADER, LEFT_FOLLOWER, RIGHT_LEADER, RIGHT_FOLLOWER = range(6)
"""Roles of neighbours, as `model.neighbours.NeighbourRole`; left is the overtaking side."""

ONCOMING_ROLE = 6
"""Role of an oncoming vehicle where the recorder stores beliefs by role."""

NO_SLOT = np.float32(-1.0)
"""Slot of a neighbour, a target or a partner that does not exist."""

NO_ACCEL_LIMIT = np.float32(1e9)
"""An acceleration that limits nothing [m/s^2]."""

FAR = np.float32(1e9)
"""Distance [m] or time [s] to a vehicle that does not exist."""

SlotSelection = int | slice
"""Slots of drivers. An int gives arrays of shape (simulation,), a slice (vehicle, simulation)."""

Group = TypeVar("Group")


@dataclass(slots=True, kw_only=True)
class Motion:
    """Where vehicles are and how they move; arrays of shape (vehicle, simulation).

    Coordinates follow each vehicle's direction of travel: for oncoming vehicles both axes are
    reversed.

    Attributes:
        s: Station of the body's centre [m].
        d: Lateral position of the centre, growing to the left [m].
        heading: Angle to the road, positive to the left [rad].
        vx, vy: Velocity ahead and to the left, in the vehicle's axes [m/s].
        yaw_rate: Yaw rate [rad/s]. A two-wheeler turns by its lean, and its value is the yaw rate
            in the middle of the last step.
        accel_lon, accel_lat: Mean acceleration by tyre and wind forces over the last step, in the
            vehicle's axes [m/s^2]. Contacts are left out: they change the velocity at once, so
            that their acceleration would depend on the length of the step and outweigh all other
            accelerations in statistics.
        yaw_accel: Mean yaw acceleration over the last step [rad/s^2].
        is_wreck: 1 if the vehicle has collided or has left the road, else 0.
    """

    s: F32
    d: F32
    heading: F32
    vx: F32
    vy: F32
    yaw_rate: F32
    accel_lon: F32
    accel_lat: F32
    yaw_accel: F32
    is_wreck: F32


@dataclass(slots=True, kw_only=True)
class Controls:
    """Controls of drivers; arrays of shape (vehicle, simulation).

    Attributes:
        requested_accel: Acceleration that the driver requests by its pedals [m/s^2].
        wheel_angle: Front wheel angle [rad], or lateral acceleration of a two-wheeler [m/s^2].
        wind_trim: Part of the wheel angle that holds against the wind, same unit.
        indicator: 1 to the left, -1 to the right, 0 off.
        flashes_high_beam: 1 while the driver flashes at a vehicle in its lane, else 0.
    """

    requested_accel: F32
    wheel_angle: F32
    wind_trim: F32
    indicator: F32
    flashes_high_beam: F32


@dataclass(slots=True, kw_only=True)
class LateralPath:
    """The lateral path of the last lane change, a polynomial of time.

    Attributes:
        coefficients: Lateral position as a polynomial of `elapsed`: the coefficient of its power k
            is in row k, (6, vehicle, simulation) [m/s^k].
        elapsed: Time since the path began, (vehicle, simulation) [s].
        duration: Time after which the lateral position stays, (vehicle, simulation) [s].
    """

    coefficients: F32
    elapsed: F32
    duration: F32


@dataclass(slots=True, kw_only=True)
class LaneChoice:
    """The lane of each vehicle, and the lane change that its driver wants; (vehicle, simulation).

    Attributes:
        lane: Index of the lane that it drives in or changes to, counted from the right.
        time_since_lane_change: Time since the last lane change began [s].
        wanted_side: Side of the lane change that the driver wants, as `Controls.indicator`.
        time_wanted: Time for which a MOBIL driver has wanted that side [s].
        checks_blind_spot: 1 if the driver looks over the shoulder before the next lane change.
        edge_shift: How far the driver keeps to the edge of its lane for another vehicle [m].
    """

    lane: F32
    time_since_lane_change: F32
    wanted_side: F32
    time_wanted: F32
    checks_blind_spot: F32
    edge_shift: F32


@dataclass(slots=True, kw_only=True)
class OvertakeState:
    """Progress of drivers in an overtake; arrays of shape (vehicle, simulation).

    On one-way roads only the ego passes through stages; the others stay in `FOLLOW` there.

    Attributes:
        stage: A `Stage`.
        time_in_stage: Time in this stage [s].
        target_slot: Slot of the vehicle that is overtaken, or `NO_SLOT`.
        time_waiting: Time spent behind a slower leader [s].
        time_indicating: Time for which the driver has wanted its next manoeuvre, which it
            indicates if it uses its indicator [s].
        must_abort: 1 while the driver falls back behind its target, else 0.
        must_return_urgently: 1 while the driver hurries back into its lane, else 0.
        has_attempted: 1 once the ego has begun an overtake, else 0, (simulation,).
    """

    stage: F32
    time_in_stage: F32
    target_slot: F32
    time_waiting: F32
    time_indicating: F32
    must_abort: F32
    must_return_urgently: F32
    has_attempted: F32


@dataclass(slots=True, kw_only=True)
class RandomProcesses:
    """Ornstein-Uhlenbeck processes of unit variance; arrays of shape (vehicle, simulation).

    Attributes:
        gust: Turbulence of the wind at the vehicle.
        distance_error: Error of the driver's judgement of distances.
        speed_error: Error of its judgement of speeds.
        lane_wander: Deviation of the driver's aim from its lateral path.
    """

    gust: F32
    distance_error: F32
    speed_error: F32
    lane_wander: F32


@dataclass(slots=True, kw_only=True)
class FrictionAndWind:
    """Friction and wind of a vehicle until the next decision, each (vehicle, simulation).

    Attributes:
        mu_left, mu_right: Friction coefficient under the wheels of either side [1].
        wind_force: Lateral force of the wind, positive to the left [N].
        wind_moment: Yaw moment of the wind, positive to the left [N m].
        tail_wind: Wind along the vehicle's direction of travel [m/s].
    """

    mu_left: F32
    mu_right: F32
    wind_force: F32
    wind_moment: F32
    tail_wind: F32


@dataclass(slots=True, kw_only=True)
class LocalRoad:
    """The road at each vehicle until the next decision; arrays of shape (vehicle, simulation).

    Attributes:
        curvature: Curvature of the vehicle's path along the road, positive to the left [1/m].
        curvature_ahead: Curvature at the place where the vehicle will be when it responds to its
            steering [1/m].
        station_per_metre: Stations passed for each metre driven along the road [1].
        sin_slope: Sine of the slope, positive uphill.
        bend_speed: Largest speed that the driver chooses for the bends ahead [m/s].
        accel_limit: Largest acceleration on the way to a lower speed limit [m/s^2].
        sight_distance: Sight distance along the road, limited by bends and crests [m].
    """

    curvature: F32
    curvature_ahead: F32
    station_per_metre: F32
    sin_slope: F32
    bend_speed: F32
    accel_limit: F32
    sight_distance: F32


@dataclass(slots=True, kw_only=True)
class Attention:
    """Attention and memory of drivers.

    Attributes:
        slot_in_view: Neighbour in each role at the last look, `NEVER_LOOKED` at first,
            (role, vehicle, simulation).
        time_in_view: Time for which the neighbour has been in view, same shape [s].
        oncoming_slot: Oncoming vehicle in view in any lane and in the driver's own lane,
            `NEVER_LOOKED` at first, `NO_SLOT` without a vehicle, (2, vehicle, simulation).
        oncoming_time_in_view: Time for which the same vehicle, or none, has been in view, same
            shape [s].
        past_s, past_speed: Station [m] and speed along the road [m/s] of all vehicles at the last
            decisions, (HISTORY_LENGTH, vehicle, simulation). The row is the number of the decision
            modulo `HISTORY_LENGTH`.
    """

    slot_in_view: F32
    time_in_view: F32
    oncoming_slot: F32
    oncoming_time_in_view: F32
    past_s: F32
    past_speed: F32


@dataclass(slots=True, kw_only=True)
class FirstContact:
    """The first contact of each vehicle; arrays of shape (vehicle, simulation).

    Attributes:
        partner: Slot of the vehicle that is touched, `NO_SLOT` before a contact.
        time: Time of the contact [s].
        impulse: Size of the impulse [N s].
        closing_speed: Closing speed along the normal of the contact [m/s].
    """

    partner: F32
    time: F32
    impulse: F32
    closing_speed: F32


@dataclass(slots=True, kw_only=True)
class State:
    """Everything that changes between two steps, in groups; functions change it in place.

    Attributes:
        end_step: Last step of each simulation, (simulation,).
        num_percepts: Number of recorded percepts of each simulation, (simulation,). A percept is a
            record of the ego's beliefs at a manoeuvre.
    """

    motion: Motion
    controls: Controls
    path: LateralPath
    lane_choice: LaneChoice
    overtake: OvertakeState
    noise: RandomProcesses
    friction_and_wind: FrictionAndWind
    road: LocalRoad
    attention: Attention
    first_contact: FirstContact
    end_step: F32
    num_percepts: F32

    @classmethod
    def at_start(cls, params: StepParameters) -> Self:
        """The state at the first frame: all vehicles drive straight in lane at constant speed."""
        vehicles, simulations = params.vehicles, params.simulations
        shape = vehicles.start_s.shape
        state = cls(
            motion=_group(Motion, shape),
            controls=_group(Controls, shape),
            # A path of one second that has ended: the vehicle keeps its lateral position.
            path=LateralPath(
                coefficients=_full((6, *shape), 0.0),
                elapsed=_full(shape, 1.0),
                duration=_full(shape, 1.0),
            ),
            # As long as the longest pause after a lane change, `cooldown`: no driver waits for it.
            lane_choice=_group(LaneChoice, shape, time_since_lane_change=10.0),
            overtake=_group(OvertakeState, shape, stage=Stage.FOLLOW, target_slot=NO_SLOT),
            noise=_group(RandomProcesses, shape),
            # Overwritten at the first decision; a friction above zero keeps divisions finite.
            friction_and_wind=_group(FrictionAndWind, shape, mu_left=0.8, mu_right=0.8),
            road=_group(
                LocalRoad,
                shape,
                station_per_metre=1.0,
                bend_speed=1e9,
                accel_limit=NO_ACCEL_LIMIT,
                sight_distance=1e9,
            ),
            attention=Attention(
                slot_in_view=_full((6, *shape), NEVER_LOOKED),
                time_in_view=_full((6, *shape), 0.0),
                oncoming_slot=_full((2, *shape), NEVER_LOOKED),
                oncoming_time_in_view=_full((2, *shape), 0.0),
                past_s=_full((HISTORY_LENGTH, *shape), 0.0),
                past_speed=_full((HISTORY_LENGTH, *shape), 0.0),
            ),
            first_contact=_group(FirstContact, shape, partner=NO_SLOT),
            end_step=simulations.last_step.copy(),
            num_percepts=np.zeros_like(simulations.last_step),
        )
        state.motion.s, state.motion.d = vehicles.start_s.copy(), vehicles.start_d.copy()
        state.motion.vx = vehicles.start_speed.copy()
        state.lane_choice.lane = vehicles.start_lane.copy()
        state.path.coefficients[0] = vehicles.start_d
        state.overtake.has_attempted = np.zeros_like(simulations.last_step)
        return state

    def position_seen_by_each(self, params: StepParameters, slot: int) -> tuple[F32, F32]:
        """Station and lateral position of a vehicle in the coordinates of each vehicle [m].

        The coordinates of opposite directions differ by half a turn: s becomes length - s, and d
        becomes `edge_sum` - d, where `edge_sum` is the sum of the lateral positions of both road
        edges.

        Args:
            params: Parameters of the batch.
            slot: Slot of the vehicle.

        Returns:
            Two arrays of shape (vehicle, simulation).
        """
        vehicles, road, motion = params.vehicles, params.road, self.motion
        is_opposite = vehicles.travel_sign[slot] != vehicles.travel_sign
        s = np.where(is_opposite, road.length - motion.s[slot], motion.s[slot])
        return s, np.where(is_opposite, road.edge_sum - motion.d[slot], motion.d[slot])

    def road_position(self, params: StepParameters) -> tuple[F32, F32]:
        """Station and lateral position of each vehicle in the coordinates of the road [m].

        These are the coordinates of the vehicles whose `travel_sign` is 1.
        """
        road, motion = params.road, self.motion
        is_opposite = params.vehicles.travel_sign < 0
        s = np.where(is_opposite, road.length - motion.s, motion.s)
        return s, np.where(is_opposite, road.edge_sum - motion.d, motion.d)

    def road_velocity(self) -> tuple[F32, F32]:
        """Velocity along and across the road, in each vehicle's direction of travel [m/s]."""
        motion = self.motion
        sine, cosine = sincos(motion.heading)
        along = motion.vx * cosine - motion.vy * sine
        return along, motion.vx * sine + motion.vy * cosine

    def is_in_stage(self, stage: Stage, slots: SlotSelection) -> Mask:
        """Whether drivers are in a stage of their overtake; false for wrecks."""
        is_sound = self.motion.is_wreck[slots] == 0
        return is_sound & (self.overtake.stage[slots] == np.float32(stage))

    def is_before_return(self, slots: SlotSelection) -> Mask:
        """Whether drivers pull out or pass, before they begin to return or abort."""
        return self.is_in_stage(Stage.PULL_OUT, slots) | self.is_in_stage(Stage.PASS, slots)

    def is_overtaking(self) -> Mask:
        """Whether drivers are between pulling out and being back, (vehicle, simulation)."""
        stage = self.overtake.stage
        is_away = (stage != np.float32(Stage.FOLLOW)) & (stage != np.float32(Stage.DONE))
        return is_away & (self.motion.is_wreck == 0)

    def has_finished_lane_change(self, slots: SlotSelection) -> Mask:
        """Whether the last lane change is over."""
        return self.path.elapsed[slots] >= self.path.duration[slots]


def _full(shape: tuple[int, ...], value: float | np.float32) -> F32:
    return np.full(shape, value, np.float32)


def _group(group_type: type[Group], shape: tuple[int, ...], **values: float | np.float32) -> Group:
    """A group of arrays of one shape with some values; the other arrays are zero."""
    names = group_type.__annotations__
    return group_type(**{name: _full(shape, values.get(name, 0.0)) for name in names})


def value_at_slot(values: F32, slot: F32) -> F32:
    """The value of one vehicle in each simulation; without a vehicle the value of slot 0.

    Args:
        values: Shape (vehicle, simulation).
        slot: Vehicle slots as whole numbers, or `NO_SLOT`, shape (..., simulation).
    """
    index = np.where(slot < 0, np.float32(0.0), slot).astype(np.int64)
    return values[index, np.arange(values.shape[1])]


def is_leader_role(role: int) -> bool:
    """Whether the role is one of the three leaders, which have even numbers."""
    return role % 2 == 0
