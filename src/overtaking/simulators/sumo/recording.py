"""From SUMO's states of vehicles to the recorded integers, rounded once."""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.model.road import Road
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import (
    BEYOND_KERB_EDGE,
    NO_VEHICLE,
    STATE_DTYPES,
    STATE_RESOLUTION,
    Contacts,
    Lights,
    Percepts,
    States,
    Trajectories,
    to_integers,
)
from overtaking.simulators.sumo.traffic import oncoming

UNKNOWN = frozenset({"lamps", "wheel_angle", "yaw_rate", "impulse", "percepts"})
"""Quantities that SUMO lacks: it has no wheels, headlamps, colliding masses or beliefs."""

RAW = ("front", "d", "speed", "drift", "accel", "angle", "signals")
"""Read of a vehicle in each frame; lateral axis towards the fast side, angle in degrees."""


_RIGHT, _LEFT, _BRAKE = 1, 2, 8  # SUMO's VEH_SIGNAL_BLINKER_RIGHT, _BLINKER_LEFT, _BRAKELIGHT.
_NORTH = 90.0  # SUMO counts angles clockwise from y; its x is our `s`.


@dataclass(slots=True, kw_only=True)
class Run:
    """One simulation as it was read.

    Attributes:
        raw: What `RAW` names, shape (field, vehicle, frame); empty slots hold zeros.
        stage: Stage of the ego, shape (frame,).
        collided_with: Partner of the ego so far, shape (frame,).
        contacts: Partner, time [ms] and speed of approach [m/s] by slot.
    """

    raw: F64
    stage: NDArray[np.uint8]
    collided_with: NDArray[np.uint8]
    contacts: dict[int, tuple[int, int, float]]


class Recording:
    """The recorded integers of a batch.

    Args:
        scenario: The batch.
        frames: Frames of the longest simulation that it allows.
    """

    def __init__(self, scenario: Scenario, frames: int) -> None:
        """Make room."""
        n, slots = scenario.num_simulations, scenario.num_slots
        self._scenario = scenario
        self._states = {k: np.zeros((n, slots, frames), kind) for k, kind in STATE_DTYPES.items()}
        self._stage = np.zeros((n, frames), np.uint8)
        self._collided_with = np.full((n, frames), NO_VEHICLE)
        self._num_frames = np.zeros(n, np.int32)
        self._partner = np.full((n, slots), NO_VEHICLE)
        self._contact = {k: np.zeros((n, slots), np.int32) for k in ("time", "closing_speed")}
        self._hash = np.zeros((n, 4), np.uint32)

    def put(self, row: int, run: Run) -> None:
        """Write down one simulation."""
        count = run.raw.shape[2]
        frame_time = 1e-3 * self._scenario.frame_interval_ms
        values = _values(self._scenario, row, run.raw, frame_time)
        for name, array in values.items():
            self._states[name][row, :, :count] = array
        self._stage[row, :count], self._collided_with[row, :count] = run.stage, run.collided_with
        self._num_frames[row] = count
        for slot, (partner, time_ms, closing) in run.contacts.items():
            self._partner[row, slot] = partner
            self._contact["time"][row, slot] = time_ms
            self._contact["closing_speed"][row, slot] = to_integers(
                "speed", np.asarray(closing) * (1.0 / STATE_RESOLUTION["speed"]), "SUMO"
            )
        self._hash[row] = self._digest(row, count)

    def finish(self) -> Trajectories:
        """The whole batch, trimmed to its longest simulation."""
        longest = int(self._num_frames.max()) if len(self._num_frames) else 0
        states: dict[str, Any] = {k: v[:, :, :longest] for k, v in self._states.items()}
        return Trajectories(
            scenario=self._scenario,
            num_frames=self._num_frames,
            states=States(**states),
            stage=self._stage[:, :longest],
            collided_with=self._collided_with[:, :longest],
            contacts=Contacts(
                partner=self._partner,
                time=self._contact["time"],
                impulse=np.zeros_like(self._contact["time"]),
                closing_speed=self._contact["closing_speed"],
            ),
            percepts=Percepts.empty(self._scenario.num_simulations, 0),
            trace_hash=self._hash,
            unknown=UNKNOWN,
        )

    def _digest(self, row: int, count: int) -> NDArray[np.uint32]:
        """128 bits over the recorded integers of one simulation (BLAKE2b, RFC 7693)."""
        total = hashlib.blake2b(digest_size=16)
        valid = self._scenario.vehicles.valid[row]
        parts = [self._states[name][row, valid, :count] for name in STATE_DTYPES]
        parts += [self._stage[row, :count], self._collided_with[row, :count]]
        parts += [self._partner[row, valid], *(a[row, valid] for a in self._contact.values())]
        for part in parts:
            total.update(np.ascontiguousarray(part.astype("<i4")).tobytes())
        return np.frombuffer(total.digest(), "<u4")


def _values(scenario: Scenario, row: int, raw: F64, frame_time: float) -> dict[str, Any]:
    """The columns of `States` for one simulation, each (vehicle, frame)."""
    road, half = scenario.road, 0.5 * scenario.vehicles.length[row].astype(np.float64)[:, None]
    front, d, speed, drift, accel, angle, signals = raw
    back = np.where(oncoming(scenario, row), -1.0, 1.0)[:, None]  # From the front to the middle.
    s, left = front - back * half, road.overtaking_sign * d
    x, y = road.to_world(s, left)
    heading = road.heading_at(s) + road.overtaking_sign * np.radians(_NORTH - angle)
    # Lateral acceleration is what the lateral speed changed by since the frame before.
    sideways = np.diff(drift, axis=1, prepend=drift[:, :1]) / frame_time
    filled = scenario.vehicles.valid[row][:, None]
    numbers = {
        "x": x,
        "y": y,
        "s": s,
        "d": left,
        "speed": np.sqrt(speed * speed + drift * drift),
        "heading": heading - np.rint(heading / (2.0 * np.pi)) * (2.0 * np.pi),  # In (-pi, pi].
        "accel_lon": accel,
        "accel_lat": road.overtaking_sign * sideways,
    }
    values = {
        name: to_integers(name, np.asarray(value) * (1.0 / STATE_RESOLUTION[name]), "SUMO")
        for name, value in numbers.items()
    }
    values |= {"lane": _lane(road, left), "lights": _lights(road, signals)}
    return {name: np.where(filled, array, 0) for name, array in values.items()}


def _lane(road: Road, d: F64) -> NDArray[np.int64]:
    index = road.lane_index(d)
    return np.where(index < 0, BEYOND_KERB_EDGE, index)


def _lights(road: Road, signals: F64) -> NDArray[np.int64]:
    """Indicators and stop lamps; SUMO's right is our slow side."""
    bits = signals.astype(np.int64)
    fast, slow = Lights.INDICATOR_LEFT.value, Lights.INDICATOR_RIGHT.value
    if road.overtaking_sign < 0:
        fast, slow = slow, fast
    lit = np.where(bits & _LEFT, fast, 0) + np.where(bits & _RIGHT, slow, 0)
    return lit + np.where(bits & _BRAKE, Lights.BRAKE.value, 0)
