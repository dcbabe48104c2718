"""From SUMO's numbers to recorded integers."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.model.trajectories import NO_VEHICLE, UNKNOWNS, Lights
from overtaking.simulators.sumo.recording import RAW, UNKNOWN, Recording, Run

BLINKER_RIGHT, BLINKER_LEFT, BRAKE = 1, 2, 8
SEEN = {"front": 102.0, "d": -8.0, "speed": 30.0, "drift": 0.5, "accel": -1.2345, "angle": 89.0}


def recorded(road=None, signals=0, frames=2, contacts=None, **changes):
    world = scenario([Vehicle(body={"length": 4.0})], road=road or wide_road(), num_slots=2)
    raw = np.zeros((len(RAW), 2, frames))
    values = SEEN | {"signals": float(signals)} | changes
    for k, name in enumerate(RAW):
        raw[k, 0] = values[name]
    run = Run(
        raw=raw,
        stage=np.zeros(frames, np.uint8),
        collided_with=np.full(frames, NO_VEHICLE),
        contacts=contacts or {},
    )
    recording = Recording(world, frames)
    recording.put(0, run)
    return recording.finish()


def first(trajectories, name):
    return int(getattr(trajectories.states, name)[0, 0, 0])


def test_positions_are_those_of_the_middle_in_millimetres():
    run = recorded()
    assert (first(run, "s"), first(run, "d"), first(run, "lane")) == (100_000, -8_000, 0)
    assert (first(run, "x"), first(run, "y")) == (100_000, -8_000)


def test_speed_has_its_lateral_part_and_heading_turns_to_the_left():
    run = recorded()
    assert first(run, "speed") == round(1000 * np.hypot(30.0, 0.5))
    assert first(run, "heading") == round(np.radians(1.0) * 1e4)
    assert first(run, "accel_lon") == -1234  # -1.2345, half to even.


def test_lateral_acceleration_is_the_change_of_lateral_speed():
    run = recorded(drift=np.array([0.0, 0.05]))
    assert run.states.accel_lat[0, 0].tolist() == [0, 1000]  # 0.05 m/s in 0.05 s.


def test_left_hand_traffic_is_the_mirror_image():
    right = recorded(signals=BLINKER_LEFT)
    left = recorded(road=wide_road().mirror(), signals=BLINKER_LEFT)
    for name in ("s", "speed", "accel_lon", "lane"):
        assert first(right, name) == first(left, name)
    for name in ("d", "heading"):
        assert first(right, name) == -first(left, name)
    assert first(right, "lights") == Lights.INDICATOR_LEFT
    assert first(left, "lights") == Lights.INDICATOR_RIGHT


@pytest.mark.parametrize(
    ("signals", "lights"),
    [
        (BLINKER_RIGHT, Lights.INDICATOR_RIGHT),
        (BRAKE, Lights.BRAKE),
        (BLINKER_LEFT | BRAKE, Lights.INDICATOR_LEFT | Lights.BRAKE),
        (16, 0),
    ],
)
def test_signals_are_lights(signals, lights):
    assert first(recorded(signals=signals), "lights") == lights


def test_empty_slots_hold_zeros():
    run = recorded()
    assert not any(getattr(run.states, name)[0, 1].any() for name in run.states.__slots__)


def test_what_sumo_cannot_say_is_said_to_be_unknown():
    assert recorded().unknown == UNKNOWN <= set(UNKNOWNS)
    assert not recorded().percepts.valid.any()


def test_contacts_are_written_down_once_for_each():
    run = recorded(contacts={0: (1, 1250, 3.5)})
    assert (run.contacts.partner[0, 0], run.contacts.time[0, 0]) == (1, 1250)
    assert run.contacts.closing_speed[0, 0] == 3500
    assert run.contacts.partner[0, 1] == NO_VEHICLE


@pytest.mark.parametrize("name", ["front", "d", "speed", "accel", "angle"])
def test_every_recorded_number_is_part_of_the_hash(name):
    one, same = recorded(), recorded()
    other = recorded(**{name: SEEN[name] + 0.01})
    assert (one.trace_hash == same.trace_hash).all()
    assert (one.trace_hash != other.trace_hash).any()
