"""Rounding once: from the state to recorded integers, and the hash over them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.float32_math import clamp
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
from overtaking.sim.reference.decision_context import Beliefs, Neighbours, OncomingVehicle
from overtaking.sim.reference.state import ONCOMING_ROLE, State, value_at_slot
from overtaking.world.constants import STEP_MS
from overtaking.world.step_parameters import StepParameters

MAX_PERCEPTS = 4
"""Decisions of the ego that are written down for a simulation."""


_INT16_LIMIT = np.float32(32767.0)


_INT32_LIMIT = np.float32(2.0e9)


_TAU = np.float32(6.283_185_5)


_HALF_TURN = np.float32(3.141_592_7)


_TURNS_PER_RADIAN = np.float32(0.159_154_94)


_INTEGERS_PER_UNIT = np.float32(1000.0)


_INTEGERS_PER_RADIAN = np.float32(10000.0)


_PRIME_1, _PRIME_2, _PRIME_3 = np.uint32(2654435761), np.uint32(2246822519), np.uint32(3266489917)


_HASH_START = tuple(
    word & 0xFFFF_FFFF for word in (2654435761 + 2246822519, 2246822519, 0, -2654435761)
)


def to_recorded_integers(
    value: F32, scale: np.float32, limit: np.float32 = _INT32_LIMIT
) -> NDArray[np.int32]:
    """`value` in steps of 1 / `scale`, half to even, clamped."""
    return np.rint(clamp(value * scale, -limit, limit)).astype(np.int32)


def wrap_angle(angle: F32) -> F32:
    """`angle` in (-pi, pi]."""
    turns = np.rint(angle * _TURNS_PER_RADIAN)
    return angle - turns * _TAU


def _empty_states(shape: tuple[int, int, int]) -> States:
    """Zeros of shape (simulation, vehicle, time)."""
    return States(**{name: np.zeros(shape, kind) for name, kind in STATE_DTYPES.items()})


def _recorded_belief(
    state: State, neighbours: Neighbours, beliefs: Beliefs, role: int
) -> dict[str, NDArray[Any]]:
    """What the ego believes of the neighbour in `role`, and the truth, by field of `Percepts`."""
    slot = neighbours.slot[role, EGO_SLOT]
    is_missing = slot < 0
    speed, _ = state.road_velocity()
    own, other = speed[EGO_SLOT], value_at_slot(speed, slot)
    closing = own - other if role % 2 == 0 else other - own
    true_gap = to_recorded_integers(neighbours.gap[role, EGO_SLOT], _INTEGERS_PER_UNIT)
    zero = np.int32(0)
    return {
        "slot": np.where(is_missing, np.int32(NO_VEHICLE), slot.astype(np.int32)),
        "is_detected": beliefs.is_detected[role, EGO_SLOT],
        "gap": to_recorded_integers(beliefs.gap[role, EGO_SLOT], _INTEGERS_PER_UNIT),
        "closing_speed": to_recorded_integers(
            beliefs.closing_speed[role, EGO_SLOT], _INTEGERS_PER_UNIT
        ),
        "true_gap": np.where(is_missing, zero, true_gap),
        "true_closing_speed": np.where(
            is_missing, zero, to_recorded_integers(closing, _INTEGERS_PER_UNIT)
        ),
    }


def _recorded_oncoming_belief(state: State, oncoming: OncomingVehicle) -> dict[str, NDArray[Any]]:
    """What the ego believes of the oncoming vehicle, and the truth, by field of `Percepts`."""
    ego = EGO_SLOT
    slot = oncoming.slot[ego]
    is_missing = slot < 0
    speed, _ = state.road_velocity()
    zero = np.int32(0)
    closing = to_recorded_integers(speed[ego] + value_at_slot(speed, slot), _INTEGERS_PER_UNIT)
    return {
        "slot": np.where(is_missing, np.int32(NO_VEHICLE), slot.astype(np.int32)),
        "is_detected": oncoming.is_detected[ego],
        "gap": to_recorded_integers(oncoming.believed_gap[ego], _INTEGERS_PER_UNIT),
        "closing_speed": to_recorded_integers(oncoming.closing_speed[ego], _INTEGERS_PER_UNIT),
        "true_gap": np.where(
            is_missing, zero, to_recorded_integers(oncoming.gap[ego], _INTEGERS_PER_UNIT)
        ),
        "true_closing_speed": np.where(is_missing, zero, closing),
    }


def _contacts(state: State) -> Contacts:
    """The first contact of each vehicle, (simulation, vehicle)."""
    is_missing = state.first_contact.partner < 0
    partner = np.where(is_missing, np.float32(NO_VEHICLE), state.first_contact.partner)
    return Contacts(
        partner=partner.T.astype(np.uint8),
        time=to_recorded_integers(state.first_contact.time, _INTEGERS_PER_UNIT).T.copy(),
        impulse=to_recorded_integers(state.first_contact.impulse, np.float32(1.0)).T.copy(),
        closing_speed=to_recorded_integers(
            state.first_contact.closing_speed, _INTEGERS_PER_UNIT
        ).T.copy(),
    )


class Recorder:
    """Collects the recorded integers of a batch and hashes them."""

    def __init__(self, scenario: Scenario, given: StepParameters) -> None:
        """Make room for the longest simulation."""
        n, slots, frames = scenario.num_simulations, scenario.num_slots, given.num_frames
        self.states = _empty_states((n, slots, frames))
        self.stage = np.zeros((n, frames), np.uint8)
        self.collided_with = np.full((n, frames), NO_VEHICLE)
        self.num_frames = np.zeros(n, np.int32)
        self.beliefs = Percepts.empty(n, MAX_PERCEPTS)
        self.scenario, self.given = scenario, given
        self.hash = np.stack([np.full(n, word, np.uint32) for word in _HASH_START])

    def record_frame(
        self, state: State, params: StepParameters, is_running: Mask, number: int
    ) -> None:
        """Write down one frame of the simulations that still run."""
        vehicles = params.vehicles
        filled = vehicles.valid > 0
        values = {
            name: np.where(filled, value, np.int32(0))
            for name, value in self._state_words(state, params).items()
        }
        for name, recorded in values.items():
            rows = getattr(self.states, name)
            rows[is_running, :, number] = recorded.T[is_running].astype(rows.dtype)
        stage = state.overtake.stage[EGO_SLOT].astype(np.int32)
        partner = np.where(
            state.first_contact.partner[EGO_SLOT] < 0,
            np.int32(NO_VEHICLE),
            state.first_contact.partner[EGO_SLOT].astype(np.int32),
        )
        self.stage[is_running, number] = stage[is_running]
        self.collided_with[is_running, number] = partner[is_running]
        self.num_frames[is_running] = number + 1
        # Empty slots are not hashed, so the hash is the same for any number of slots.
        for i in range(len(vehicles.valid)):
            words = [recorded[i] for recorded in values.values()]
            for k in range(0, len(words), 4):
                self._mix(words[k : k + 4], is_running & (vehicles.valid[i] > 0))
        zero = np.zeros_like(stage)
        self._mix([stage, partner, zero + np.int32(number), zero], is_running)

    def _state_words(self, state: State, params: StepParameters) -> dict[str, NDArray[np.int32]]:
        vehicles = params.vehicles
        road, side = self.given.road, self.given.road.overtaking_sign
        s, from_slow = state.road_position(params)
        d = side * from_slow
        lane = np.full(d.shape, np.int32(BEYOND_KERB_EDGE))
        for k in range(road.num_own_lanes + 1):
            lane = np.where(from_slow >= road.boundaries[k], np.int32(k), lane)
        turned = np.where(vehicles.travel_sign < 0, _HALF_TURN, np.float32(0.0))
        return {
            "x": to_recorded_integers(
                road.x0 + s * road.cosine - d * road.sine, _INTEGERS_PER_UNIT
            ),
            "y": to_recorded_integers(
                road.y0 + s * road.sine + d * road.cosine, _INTEGERS_PER_UNIT
            ),
            "s": to_recorded_integers(s, _INTEGERS_PER_UNIT),
            "d": to_recorded_integers(d, _INTEGERS_PER_UNIT),
            "speed": to_recorded_integers(
                np.sqrt(state.motion.vx * state.motion.vx + state.motion.vy * state.motion.vy),
                _INTEGERS_PER_UNIT,
            ),
            "heading": to_recorded_integers(
                wrap_angle(road.heading + side * state.motion.heading + turned),
                _INTEGERS_PER_RADIAN,
                _INT16_LIMIT,
            ),
            "wheel_angle": to_recorded_integers(
                side
                * np.where(vehicles.two_wheeler > 0, np.float32(0.0), state.controls.wheel_angle),
                _INTEGERS_PER_RADIAN,
                _INT16_LIMIT,
            ),
            "accel_lon": to_recorded_integers(
                state.motion.accel_lon, _INTEGERS_PER_UNIT, _INT16_LIMIT
            ),
            "accel_lat": to_recorded_integers(
                side * state.motion.accel_lat, _INTEGERS_PER_UNIT, _INT16_LIMIT
            ),
            "yaw_rate": to_recorded_integers(
                side * state.motion.yaw_rate, _INTEGERS_PER_RADIAN, _INT16_LIMIT
            ),
            "lane": lane,
            "lights": self._lights(state, params),
        }

    def _lights(self, state: State, params: StepParameters) -> NDArray[np.int32]:
        vehicles = params.vehicles
        towards_left = self.given.road.overtaking_sign * state.controls.indicator
        left = np.where(towards_left > 0, np.int32(Lights.INDICATOR_LEFT), np.int32(0))
        right = np.where(towards_left < 0, np.int32(Lights.INDICATOR_RIGHT), np.int32(0))
        braking = (state.controls.requested_accel < -self.given.constants.stop_lamp_decel) | (
            state.motion.is_wreck > 0
        )
        return (
            vehicles.initial_lights.astype(np.int32)
            + left
            + right
            + np.where(braking, np.int32(Lights.BRAKE), np.int32(0))
            + np.where(
                state.controls.flashes_high_beam > 0, np.int32(Lights.HIGH_BEAM), np.int32(0)
            )
        )

    def record_percepts(
        self,
        state: State,
        neighbours: Neighbours,
        beliefs: Beliefs,
        mask: Mask,
        kind: ManoeuvreKind,
        roles: tuple[int, int, int],
        step: int,
        oncoming: OncomingVehicle | None = None,
    ) -> None:
        """Record the ego's beliefs at a decision, as long as there is room.

        `roles` are those of the vehicles in `PerceivedVehicle`.
        """
        mask = mask & (state.num_percepts < MAX_PERCEPTS) & (np.float32(step) <= state.end_step)
        rows = np.flatnonzero(mask)
        if not len(rows):
            return
        at = state.num_percepts[rows].astype(np.int64)
        b = self.beliefs
        b.valid[rows, at], b.kind[rows, at] = True, np.uint8(kind)
        b.time[rows, at] = np.int32(step * STEP_MS)
        for vehicle, role in zip(PerceivedVehicle, roles, strict=True):
            if role == ONCOMING_ROLE and oncoming is not None:
                told = _recorded_oncoming_belief(state, oncoming)
            else:
                told = _recorded_belief(state, neighbours, beliefs, role)
            for name, numbers in told.items():
                array = getattr(b, name)
                array[rows, at, vehicle] = numbers[rows].astype(array.dtype)
        state.num_percepts = np.where(
            mask, state.num_percepts + np.float32(1.0), state.num_percepts
        )

    def _mix(self, words: list[NDArray[np.int32]], mask: Mask) -> None:
        """One round of the hash, that of xxHash32 (Collet 2012): a word into each accumulator."""
        before = self.hash[: len(words)]
        mixed = before + np.stack(words).astype(np.uint32) * _PRIME_2
        mixed = ((mixed << np.uint32(13)) | (mixed >> np.uint32(19))) * _PRIME_1
        self.hash[: len(words)] = np.where(mask, mixed, before)

    def finish(self, state: State) -> Trajectories:
        """The recorded batch, trimmed to its longest simulation, with contacts and hashes."""
        contacts = _contacts(state)
        self._mix_contacts(contacts)
        self._mix_percepts()
        longest = int(self.num_frames.max(initial=1))  # As in `engine._trajectories`.
        trimmed = {name: getattr(self.states, name)[:, :, :longest] for name in States.__slots__}
        running = np.arange(longest) < self.num_frames[:, None, None]
        there = self.scenario.vehicles.valid[:, :, None] & running
        return Trajectories(
            scenario=self.scenario,
            num_frames=self.num_frames,
            states=with_world_coordinates(self.scenario.road, States(**trimmed), there),
            stage=self.stage[:, :longest],
            collided_with=self.collided_with[:, :longest],
            contacts=contacts,
            percepts=self.beliefs,
            trace_hash=self._digest(),
        )

    def _mix_contacts(self, contacts: Contacts) -> None:
        valid = self.scenario.vehicles.valid
        row = (contacts.partner, contacts.time, contacts.impulse, contacts.closing_speed)
        for i in range(contacts.partner.shape[1]):
            self._mix([array[:, i].astype(np.int32) for array in row], valid[:, i])

    def _mix_percepts(self) -> None:
        b = self.beliefs
        triples = (b.slot, b.is_detected, b.gap, b.closing_speed, b.true_gap, b.true_closing_speed)
        for k in range(MAX_PERCEPTS):
            words = [b.kind[:, k], b.time[:, k]]
            words += [array[:, k, column] for column in range(3) for array in triples]
            for at in range(0, len(words), 4):
                self._mix([word.astype(np.int32) for word in words[at : at + 4]], b.valid[:, k])

    def _digest(self) -> NDArray[np.uint32]:
        words = []
        for k in range(4):
            word = self.hash[k] + (
                (self.hash[(k + 1) % 4] << np.uint32(7)) | (self.hash[(k + 1) % 4] >> np.uint32(25))
            )
            word = (word ^ (word >> np.uint32(15))) * _PRIME_2
            word = (word ^ (word >> np.uint32(13))) * _PRIME_3
            words.append(word ^ (word >> np.uint32(16)))
        return np.stack(words, axis=1)
