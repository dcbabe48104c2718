"""Recorded integers of a batch, rounded from its states, and the hash over them.

The ego is the vehicle under study. A *percept* records its beliefs about three vehicles at a
manoeuvre, beside the true values: the leader, and the leader and the follower in the lane that the
ego enters. A *frame* is a recorded instant, a *word* a recorded integer that is hashed. A vehicle's
*slot* is its number in the simulation; some slots of a simulation may be empty. In the state, left
is the overtaking side.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import ONE, PI, TAU, ZERO, clamp
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import (
    BEYOND_KERB_EDGE,
    NO_VEHICLE,
    STATE_DTYPES,
    Contacts,
    Lights,
    ManoeuvreKind,
    PerceivedVehicle,
    Percepts,
    States,
    Trajectories,
    with_world_coordinates,
)
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.decision_context import (
    Beliefs,
    DecisionContext,
    Neighbours,
    OncomingVehicle,
)
from overtaking.sim.reference.gap_acceptance import Intent
from overtaking.sim.reference.state import (
    LEADER,
    LEFT_FOLLOWER,
    LEFT_LEADER,
    ONCOMING_ROLE,
    RIGHT_FOLLOWER,
    RIGHT_LEADER,
    State,
    is_leader_role,
    value_at_slot,
)
from overtaking.world.constants import STEP_MS
from overtaking.world.step_parameters import StepParameters

MAX_PERCEPTS = 4
"""Largest number of percepts that are recorded in a simulation, chosen; later ones are dropped."""

_INT16_LIMIT = np.float32(32767.0)
_INT32_LIMIT = np.float32(2.0e9)  # Below 2^31, so no float32 number rounds up to it.

_TURNS_PER_RADIAN = np.float32(0.159_154_94)  # 1 / (2 pi).

_INTEGERS_PER_UNIT = np.float32(1000.0)  # Per m, s, m/s or m/s^2.
_INTEGERS_PER_RADIAN = np.float32(10000.0)  # Per rad or rad/s.

# Primes and start values of xxHash32 with seed 0.
_PRIME_1, _PRIME_2, _PRIME_3 = np.uint32(2654435761), np.uint32(2246822519), np.uint32(3266489917)
_HASH_START = tuple(
    word & 0xFFFF_FFFF for word in (2654435761 + 2246822519, 2246822519, 0, -2654435761)
)


def to_recorded_integers(
    value: F32, scale: np.float32, limit: np.float32 = _INT32_LIMIT
) -> NDArray[np.int32]:
    """`value` as a multiple of 1 / `scale`, rounded half to even and clamped to +- `limit`."""
    return np.rint(clamp(value * scale, -limit, limit)).astype(np.int32)


def wrap_angle(angle: F32) -> F32:
    """The same angle between -pi and pi [rad]."""
    turns = np.rint(angle * _TURNS_PER_RADIAN)
    return angle - turns * TAU


def _empty_states(shape: tuple[int, int, int]) -> States:
    """Zeros of shape (simulation, vehicle, time)."""
    return States(**{name: np.zeros(shape, dtype) for name, dtype in STATE_DTYPES.items()})


def _slot_or_no_vehicle(slot: F32) -> NDArray[np.int32]:
    """Recorded integer of a slot; `NO_VEHICLE` without a vehicle."""
    return np.where(slot < 0, np.int32(NO_VEHICLE), slot.astype(np.int32))


def _neighbour_percept_fields(
    state: State, neighbours: Neighbours, beliefs: Beliefs, role: int
) -> dict[str, NDArray[Any]]:
    """Fields of a percept about the neighbour in `role`, each (simulation,)."""
    slot = neighbours.slot[role, EGO_SLOT]
    speeds, _ = state.road_velocity()
    ego_speed, speed = speeds[EGO_SLOT], value_at_slot(speeds, slot)
    true_closing_speed = ego_speed - speed if is_leader_role(role) else speed - ego_speed
    return _percept_fields(
        slot,
        beliefs.is_detected[role, EGO_SLOT],
        believed=_Approach(beliefs.gap[role, EGO_SLOT], beliefs.closing_speed[role, EGO_SLOT]),
        true=_Approach(neighbours.gap[role, EGO_SLOT], true_closing_speed),
    )


def _oncoming_percept_fields(state: State, oncoming: OncomingVehicle) -> dict[str, NDArray[Any]]:
    """Fields of a percept about the oncoming vehicle, each (simulation,)."""
    slot = oncoming.slot[EGO_SLOT]
    speeds, _ = state.road_velocity()
    return _percept_fields(
        slot,
        oncoming.is_detected[EGO_SLOT],
        believed=_Approach(oncoming.believed_gap[EGO_SLOT], oncoming.closing_speed[EGO_SLOT]),
        # Each speed counts along the vehicle's own direction of travel.
        true=_Approach(oncoming.gap[EGO_SLOT], speeds[EGO_SLOT] + value_at_slot(speeds, slot)),
    )


class _Approach(NamedTuple):
    """Gap to a vehicle [m] and closing speed [m/s], believed or true, (simulation,)."""

    gap: F32
    closing_speed: F32


def _percept_fields(
    slot: F32, is_detected: Mask, *, believed: _Approach, true: _Approach
) -> dict[str, NDArray[Any]]:
    """Fields of a percept about one vehicle, as recorded integers by field of `Percepts`.

    Without a vehicle the true values are 0.
    """
    gap, closing_speed, true_gap, true_closing_speed = (
        to_recorded_integers(value, _INTEGERS_PER_UNIT) for value in (*believed, *true)
    )
    exists = slot >= 0
    return {
        "slot": _slot_or_no_vehicle(slot),
        "is_detected": is_detected,
        "gap": gap,
        "closing_speed": closing_speed,
        "true_gap": np.where(exists, true_gap, np.int32(0)),
        "true_closing_speed": np.where(exists, true_closing_speed, np.int32(0)),
    }


def _contacts(state: State) -> Contacts:
    """The first contact of each vehicle, (simulation, vehicle)."""
    contact = state.first_contact
    return Contacts(
        partner=_slot_or_no_vehicle(contact.partner).T.astype(np.uint8),
        time=to_recorded_integers(contact.time, _INTEGERS_PER_UNIT).T.copy(),
        impulse=to_recorded_integers(contact.impulse, ONE).T.copy(),
        closing_speed=to_recorded_integers(contact.closing_speed, _INTEGERS_PER_UNIT).T.copy(),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedManoeuvre:
    """A manoeuvre of the ego at which a percept is recorded.

    Attributes:
        is_made: Whether the ego makes the manoeuvre at this decision, (simulation,).
        kind: Kind of the manoeuvre.
        roles: Roles of the three vehicles, in the order of `PerceivedVehicle`: leader, new leader,
            new follower.
        step: Time of the manoeuvre in steps of 10 ms, in which the simulation counts time.
    """

    is_made: Mask
    kind: ManoeuvreKind
    roles: tuple[int, int, int]
    step: int


def _integers(
    values: dict[str, F32], scale: np.float32, limit: np.float32
) -> dict[str, NDArray[np.int32]]:
    """Recorded integers of several fields with the same scale and limit."""
    return {name: to_recorded_integers(value, scale, limit) for name, value in values.items()}


class Recorder:
    """Collects the recorded integers of a batch and hashes them."""

    def __init__(self, scenario: Scenario, params: StepParameters) -> None:
        """Allocate memory for the longest simulation."""
        n, slots, frames = scenario.num_simulations, scenario.num_slots, params.num_frames
        self.states = _empty_states((n, slots, frames))
        self.stage = np.zeros((n, frames), np.uint8)
        self.collided_with = np.full((n, frames), NO_VEHICLE)
        self.num_frames = np.zeros(n, np.int32)
        self.percepts = Percepts.empty(n, MAX_PERCEPTS)
        self.scenario, self.params = scenario, params
        self.hash = np.stack([np.full(n, word, np.uint32) for word in _HASH_START])

    def record_frame(
        self, state: State, params: StepParameters, is_running: Mask, frame: int
    ) -> None:
        """Record and hash one frame of the simulations that still run.

        `params` are the present parameters: drivers and vehicles may differ from those at the
        start, which `self.params` holds; the road is the same.
        """
        has_vehicle = params.vehicles.valid > 0
        words_by_field = {
            name: np.where(has_vehicle, words, np.int32(0))
            for name, words in self._state_words(state, params).items()
        }
        for name, words in words_by_field.items():
            array = getattr(self.states, name)
            array[is_running, :, frame] = words.T[is_running].astype(array.dtype)
        stage = state.overtake.stage[EGO_SLOT].astype(np.int32)
        partner = _slot_or_no_vehicle(state.first_contact.partner[EGO_SLOT])
        self.stage[is_running, frame] = stage[is_running]
        self.collided_with[is_running, frame] = partner[is_running]
        self.num_frames[is_running] = frame + 1
        # Empty slots are not hashed, so the hash is the same for any number of slots.
        # Each word goes to the next of four accumulators.
        for slot in range(len(has_vehicle)):
            words = [field_words[slot] for field_words in words_by_field.values()]
            for start in range(0, len(words), 4):
                self._mix(words[start : start + 4], is_running & has_vehicle[slot])
        zero = np.zeros_like(stage)
        self._mix([stage, partner, zero + np.int32(frame), zero], is_running)

    def _state_words(self, state: State, params: StepParameters) -> dict[str, NDArray[np.int32]]:
        """Recorded integers of each vehicle by field of `States`, (vehicle, simulation).

        `overtaking_sign` converts lateral values from the overtaking side to the real left, which
        differs in left-hand traffic. On a curved road `finish` replaces `x`, `y` and `heading`.
        """
        vehicles, motion = params.vehicles, state.motion
        road, overtaking_sign = self.params.road, self.params.road.overtaking_sign
        s, mirrored_d = state.road_position(params)
        d = overtaking_sign * mirrored_d
        # Lanes are counted from the kerb side. On the left of all lanes of the road's direction, in
        # the opposing lane or beside the road, the index is the number of these lanes.
        lane = np.full(d.shape, np.int32(BEYOND_KERB_EDGE))
        for k in range(road.num_own_lanes + 1):
            lane = np.where(mirrored_d >= road.boundaries[k], np.int32(k), lane)
        speed = np.sqrt(motion.vx * motion.vx + motion.vy * motion.vy)
        # Vehicles against the road head the other way. Their angles and lateral accelerations are
        # positive to their own left, `d` to the left of the road.
        turn = np.where(vehicles.travel_sign < 0, PI, ZERO)
        heading = wrap_angle(road.heading + overtaking_sign * motion.heading + turn)
        # A two-wheeler leans; its state holds a lateral acceleration instead of an angle.
        wheel_angle = np.where(vehicles.two_wheeler > 0, ZERO, state.controls.wheel_angle)
        positions_and_speed = {
            "x": road.x0 + s * road.cosine - d * road.sine,
            "y": road.y0 + s * road.sine + d * road.cosine,
            "s": s,
            "d": d,
            "speed": speed,
        }
        angles = {
            "heading": heading,
            "wheel_angle": overtaking_sign * wheel_angle,
        }
        accels = {
            "accel_lon": motion.accel_lon,
            "accel_lat": overtaking_sign * motion.accel_lat,
        }
        # The order of the fields is the order of the hash.
        return {
            **_integers(positions_and_speed, _INTEGERS_PER_UNIT, _INT32_LIMIT),
            **_integers(angles, _INTEGERS_PER_RADIAN, _INT16_LIMIT),
            **_integers(accels, _INTEGERS_PER_UNIT, _INT16_LIMIT),
            **_integers(
                {"yaw_rate": overtaking_sign * motion.yaw_rate}, _INTEGERS_PER_RADIAN, _INT16_LIMIT
            ),
            "lane": lane,
            "lights": self._lights(state, params),
        }

    def _lights(self, state: State, params: StepParameters) -> NDArray[np.int32]:
        """Sum of the bits of `Lights` that are on, (vehicle, simulation)."""
        left = self.params.road.overtaking_sign * state.controls.indicator
        is_braking = state.controls.requested_accel < -self.params.constants.stop_lamp_decel
        # Low beam and fog lamps, which stay as they are.
        lights = params.vehicles.initial_lights.astype(np.int32)
        for is_on, light in (
            (left > 0, Lights.INDICATOR_LEFT),
            (left < 0, Lights.INDICATOR_RIGHT),
            # A wreck requests no braking, but slides with locked wheels; that it shows stop lamps
            # is a choice.
            (is_braking | (state.motion.is_wreck > 0), Lights.BRAKE),
            (state.controls.flashes_high_beam > 0, Lights.HIGH_BEAM),
        ):
            lights = lights + np.where(is_on, np.int32(light), np.int32(0))
        return lights

    def record_manoeuvres(
        self, state: State, context: DecisionContext, intent: Intent, step: int
    ) -> None:
        """Record a percept at each manoeuvre that the ego starts or cancels."""
        left = (LEADER, LEFT_LEADER, LEFT_FOLLOWER)
        right = (LEADER, RIGHT_LEADER, RIGHT_FOLLOWER)
        # On two-way roads the ego enters the opposing lane: its new leader is the oncoming vehicle,
        # its new follower a vehicle that overtakes behind it.
        pull_out_roles = (
            left if context.oncoming is None else (LEADER, ONCOMING_ROLE, LEFT_FOLLOWER)
        )
        for is_made, kind, roles in (
            (intent.starts_pull_out, ManoeuvreKind.PULL_OUT, pull_out_roles),
            # A cancelled lane change leads back to the lane that the ego has left. On two-way roads
            # no driver cancels a return.
            (intent.cancels_pull_out, ManoeuvreKind.CANCEL, right),
            (intent.cancels_return, ManoeuvreKind.CANCEL, left),
            (intent.starts_return, ManoeuvreKind.RETURN, right),
        ):
            manoeuvre = RecordedManoeuvre(is_made=is_made, kind=kind, roles=roles, step=step)
            self._record_percept(state, context, manoeuvre)

    def _record_percept(
        self, state: State, context: DecisionContext, manoeuvre: RecordedManoeuvre
    ) -> None:
        """Record the percept of a manoeuvre, up to `MAX_PERCEPTS` in a simulation."""
        is_running = np.float32(manoeuvre.step) <= state.end_step
        is_recorded = manoeuvre.is_made & (state.num_percepts < MAX_PERCEPTS) & is_running
        rows = np.flatnonzero(is_recorded)
        if not len(rows):
            return
        columns = state.num_percepts[rows].astype(np.int64)
        recorded = self.percepts
        recorded.valid[rows, columns] = True
        recorded.kind[rows, columns] = np.uint8(manoeuvre.kind)
        recorded.time[rows, columns] = np.int32(manoeuvre.step * STEP_MS)
        for vehicle, role in zip(PerceivedVehicle, manoeuvre.roles, strict=True):
            if role == ONCOMING_ROLE and context.oncoming is not None:
                fields = _oncoming_percept_fields(state, context.oncoming.nearest)
            else:
                fields = _neighbour_percept_fields(state, context.neighbours, context.beliefs, role)
            for name, integers in fields.items():
                array = getattr(recorded, name)
                array[rows, columns, vehicle] = integers[rows].astype(array.dtype)
        state.num_percepts = np.where(is_recorded, state.num_percepts + ONE, state.num_percepts)

    def _mix(self, words: list[NDArray[np.int32]], mask: Mask) -> None:
        """Mix one word into each accumulator where `mask` holds, by a round of xxHash32.

        Fewer than four words leave the last accumulators as they are.

        Source:
            Collet 2012.
        """
        accumulators = self.hash[: len(words)]
        mixed = accumulators + np.stack(words).astype(np.uint32) * _PRIME_2
        mixed = ((mixed << np.uint32(13)) | (mixed >> np.uint32(19))) * _PRIME_1
        self.hash[: len(words)] = np.where(mask, mixed, accumulators)

    def finish(self, state: State) -> Trajectories:
        """The recorded batch, trimmed to its longest simulation, with contacts and hashes."""
        contacts = _contacts(state)
        self._mix_contacts(contacts)
        self._mix_percepts()
        length = int(self.num_frames.max(initial=1))  # A batch without simulations has one frame.
        states = States(
            **{name: getattr(self.states, name)[:, :, :length] for name in States.__slots__}
        )
        is_running = np.arange(length) < self.num_frames[:, None, None]
        is_recorded = self.scenario.vehicles.valid[:, :, None] & is_running
        return Trajectories(
            scenario=self.scenario,
            num_frames=self.num_frames,
            # On a curved road this computes `x`, `y` and `heading` from the other integers.
            states=with_world_coordinates(self.scenario.road, states, is_recorded),
            stage=self.stage[:, :length],
            collided_with=self.collided_with[:, :length],
            contacts=contacts,
            percepts=self.percepts,
            trace_hash=self._digest(),
        )

    def _mix_contacts(self, contacts: Contacts) -> None:
        """Hash the first contact of each vehicle."""
        valid = self.scenario.vehicles.valid
        fields = (contacts.partner, contacts.time, contacts.impulse, contacts.closing_speed)
        for slot in range(contacts.partner.shape[1]):
            self._mix([field[:, slot].astype(np.int32) for field in fields], valid[:, slot])

    def _mix_percepts(self) -> None:
        """Hash the percepts, manoeuvre by manoeuvre."""
        p = self.percepts
        fields = (p.slot, p.is_detected, p.gap, p.closing_speed, p.true_gap, p.true_closing_speed)
        for k in range(MAX_PERCEPTS):
            words = [p.kind[:, k], p.time[:, k]]
            words += [field[:, k, vehicle] for vehicle in PerceivedVehicle for field in fields]
            # Each word goes to the next of four accumulators.
            for start in range(0, len(words), 4):
                four = [word.astype(np.int32) for word in words[start : start + 4]]
                self._mix(four, p.valid[:, k])

    def _digest(self) -> NDArray[np.uint32]:
        """The hash of each simulation, (simulation, 4).

        Each word combines two accumulators and ends with the final mix of xxHash32, by which each
        bit of the input changes about half of the bits of the word.
        """
        words = []
        for k in range(4):
            next_word = self.hash[(k + 1) % 4]
            word = self.hash[k] + ((next_word << np.uint32(7)) | (next_word >> np.uint32(25)))
            word = (word ^ (word >> np.uint32(15))) * _PRIME_2
            word = (word ^ (word >> np.uint32(13))) * _PRIME_3
            words.append(word ^ (word >> np.uint32(16)))
        return np.stack(words, axis=1)
