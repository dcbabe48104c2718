"""Drivers in vehicles that another simulator moves: engine and reference compute the same bits."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.bends import on
from tests.support.two_way import pair, road
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking import _core
from overtaking.model.trajectories import NO_VEHICLE, Stage
from overtaking.sim.external_motion import (
    DriverOutput,
    ExternallyMovedSimulation,
    VehicleContact,
    VehicleMotion,
)
from overtaking.sim.reference import collisions, steering
from overtaking.sim.reference.recorder import Recorder
from overtaking.sim.reference.simulation import decide
from overtaking.sim.reference.state import State
from overtaking.world.constants import SUBSTEPS
from overtaking.world.step_parameters import StepParameters, step_parameters

if TYPE_CHECKING:
    from overtaking.model.scenario import Scenario
    from overtaking.model.trajectories import Trajectories

TICK = 0.05
LEVELS = [name for name, is_available in _core.simd_levels() if is_available]
FAST = {"desired_speed": 33.3, "min_speed_gain": 1.0, "accel": 1.8, "lane_change_duration": 4.0}
OVERTAKE = [
    Vehicle(kind="M", s=320.0, lane=1, speed=33.3, driver=FAST),
    Vehicle(kind="S", s=365.0, lane=1, speed=20.0),
    Vehicle(kind="T", s=300.0, lane=0, speed=25.0),
]
BENDS = ((900.0, 0.0, 0.0), (300.0, 0.0, 1 / 300), (500.0, 1 / 300, 1 / 300))
HILLS = ((800.0, 0.0), (1100.0, 0.04), (1500.0, -0.03))
SCENES = {
    "one way": lambda: scenario(OVERTAKE, weather={"rain": 20.0}, horizon=9.0),
    "left-hand traffic": lambda: scenario(OVERTAKE, road=wide_road().mirror(), horizon=4.0),
    "frames of 100 ms": lambda: scenario(OVERTAKE, frame_interval_ms=100, horizon=4.0),
    "two-way, bends and hills": lambda: scenario(
        pair(250.0), road=on(road(), *BENDS, grade=HILLS), horizon=5.0
    ),
}


class ReferenceSimulation:
    """The reference with the interface of `ExternallyMovedSimulation`."""

    def __init__(self, batch: Scenario, params: StepParameters) -> None:
        self.params, self.state = params, State.at_start(params)
        self.recorder = Recorder(batch, params)
        self.lights = np.zeros(batch.num_slots, np.uint8)

    def record_contacts(
        self, contacts: list[VehicleContact], step: int, time_scale: float = 1.0
    ) -> None:
        state, vehicles, constants = self.state, self.params.vehicles, self.params.constants
        was_sound = state.motion.is_wreck[0].copy() == 0
        first = state.first_contact
        for slot, other_slot, _, impulse in contacts:
            if other_slot < 0 or first.partner[slot, 0] >= 0:
                continue
            size = time_scale * math.hypot(*impulse)
            first.partner[slot, 0] = other_slot
            first.time[slot, 0] = np.float32(step) * constants.step
            first.impulse[slot, 0] = size
            softness = vehicles.inverse_mass[slot, 0] + vehicles.inverse_mass[other_slot, 0]
            first.closing_speed[slot, 0] = (
                size * float(softness) / (1.0 + float(constants.restitution))
            )
            state.motion.is_wreck[slot, 0] = 1.0
        has_crashed = was_sound & (state.motion.is_wreck[0] > 0)
        collisions.end_after_ego_accident(state, self.params, has_crashed, step)

    def set_motion(self, motion: VehicleMotion) -> None:
        is_vehicle = self.params.vehicles.valid[:, 0] > 0
        for name, row in zip(VehicleMotion._fields, motion, strict=True):
            getattr(self.state.motion, name)[is_vehicle, 0] = row[is_vehicle]

    def record_due_frame(self, step: int) -> None:
        number, offset = divmod(step, self.params.steps_per_frame)
        if offset == 0:
            is_running = np.float32(step) <= self.state.end_step
            self.recorder.record_frame(self.state, self.params, is_running, number)
            self.lights = self.recorder.states.lights[0, :, number]

    def decide(self, motion: VehicleMotion, step: int) -> DriverOutput:
        self.set_motion(motion)
        state = self.state
        decide(state, self.params, step=step, recorder=self.recorder)
        self.record_due_frame(step)
        return DriverOutput(
            requested_accel=state.controls.requested_accel[:, 0],
            wheel_angle=state.controls.wheel_angle[:, 0],
            curvature=state.road.curvature[:, 0],
            lateral_speed=state.road_velocity()[1][:, 0],
            is_wreck=state.motion.is_wreck[:, 0] > 0,
            lights=self.lights,
            end_step=int(state.end_step[0]),
        )

    def steer(self, wind_trim: np.ndarray) -> np.ndarray:
        constants = self.params.constants.replace(step=TICK, two_wheeler_lag=0.5 * TICK)
        self.state.controls.wind_trim = wind_trim[:, None]
        steering.steer(
            self.state,
            dataclasses.replace(self.params, constants=constants),
            self.params.simulations.max_lateral_accel,
            constants.step,
        )
        return self.state.controls.wheel_angle[:, 0]

    def record(self, motion: VehicleMotion, stage: Stage, indicator: float, step: int) -> None:
        self.set_motion(motion)
        self.state.overtake.stage[0], self.state.controls.indicator[0] = float(stage), indicator
        self.record_due_frame(step)

    def finish(self) -> Trajectories:
        return self.recorder.finish(self.state)


class Wanderers:
    """Vehicles that follow the requests of their drivers roughly, with random disturbances."""

    def __init__(self, params: StepParameters, seed: int) -> None:
        vehicles = params.vehicles
        self.chance = np.random.default_rng(seed)
        self.s, self.d = vehicles.start_s[:, 0].copy(), vehicles.start_d[:, 0].copy()
        self.vx = vehicles.start_speed[:, 0].copy()

    def drawn(self, size: float) -> np.ndarray:
        return self.chance.normal(0.0, size, len(self.s)).astype(np.float32)

    def move(self, accel: np.ndarray) -> VehicleMotion:
        self.vx = np.maximum(self.vx + np.float32(TICK) * accel, 0.0).astype(np.float32)
        self.s = (self.s + np.float32(TICK) * self.vx).astype(np.float32)
        self.d = self.d + self.drawn(0.02)
        return VehicleMotion(
            s=self.s,
            d=self.d,
            heading=self.drawn(0.01),
            vx=self.vx,
            vy=self.drawn(0.1),
            yaw_rate=self.drawn(0.02),
            accel_lon=accel + self.drawn(0.1),
            accel_lat=self.drawn(0.3),
        )


def assert_same_recording(recording: Trajectories, expected: Trajectories) -> None:
    assert (recording.trace_hash == expected.trace_hash).all()
    for group in ("states", "contacts", "percepts"):
        recorded, reference = getattr(recording, group), getattr(expected, group)
        for field in dataclasses.fields(reference):
            name = field.name
            assert (getattr(recorded, name) == getattr(reference, name)).all(), name


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("scene", SCENES)
def test_engine_and_reference_decide_alike(scene: str, level: str):
    batch = SCENES[scene]()
    params = step_parameters(batch)
    is_vehicle = batch.vehicles.valid[0]
    engine = ExternallyMovedSimulation(batch, params, TICK, level)
    reference = ReferenceSimulation(batch, params)
    wanderers = Wanderers(params, seed=1)
    accel = np.zeros(batch.num_slots, np.float32)
    step, largest_wheel_angle = 0, 0.0
    while step <= engine.end_step:
        motion = wanderers.move(accel)
        output, expected = engine.decide(motion, step), reference.decide(motion, step)
        for name, row, expected_row in zip(DriverOutput._fields, output, expected, strict=True):
            values, expected_values = np.asarray(row), np.ascontiguousarray(expected_row)
            if values.ndim:
                values, expected_values = values[is_vehicle], expected_values[is_vehicle]
            assert values.dtype == expected_values.dtype, name
            assert values.tobytes() == expected_values.tobytes(), (step, name)
        trim = wanderers.drawn(0.002)
        wheel_angle, expected_angle = engine.steer(trim), reference.steer(trim)
        assert wheel_angle[is_vehicle].tobytes() == expected_angle[is_vehicle].tobytes(), step
        largest_wheel_angle = max(largest_wheel_angle, float(np.abs(wheel_angle[is_vehicle]).max()))
        accel = np.where(is_vehicle, output.requested_accel, 0.0).astype(np.float32)
        step += SUBSTEPS
    recording = engine.finish()
    assert_same_recording(recording, reference.finish())
    assert largest_wheel_angle > 0.0
    if scene == "one way":  # The comparison covers a lane change and perceptions.
        assert Stage.PULL_OUT in recording.stage[0]
        assert recording.percepts.valid.any()


@pytest.mark.parametrize("time_scale", [1.0, 3.0])
def test_contacts_of_engine_and_reference_are_alike_and_end_the_simulation(time_scale: float):
    batch = scenario(OVERTAKE, horizon=9.0)
    params = step_parameters(batch)
    engine = ExternallyMovedSimulation(batch, params, TICK)
    reference = ReferenceSimulation(batch, params)
    wanderers = Wanderers(params, seed=2)
    contacts = {
        -5: [VehicleContact(0, -1, 0, (9e3, 0.0))],
        10: [VehicleContact(2, 1, 3, (100.0, 2_000.0))],
        20: [VehicleContact(0, 1, 5, (-3_000.0, 40.0)), VehicleContact(1, 0, 5, (3_000.0, -40.0))],
        30: [VehicleContact(0, 2, 7, (50_000.0, 0.0))],
    }
    step = 0
    while step <= engine.end_step:
        for simulation in (engine, reference):
            simulation.record_contacts(
                contacts.get(step - SUBSTEPS, []), step - SUBSTEPS, time_scale
            )
        motion = wanderers.move(np.zeros(batch.num_slots, np.float32))
        output, expected = engine.decide(motion, step), reference.decide(motion, step)
        assert (output.is_wreck[:3] == expected.is_wreck[:3]).all()
        assert engine.is_ego_wrecked == (step > 20)
        step += SUBSTEPS
    recording = engine.finish()
    assert_same_recording(recording, reference.finish())
    after = float(params.constants.after_collision / params.constants.step)
    assert engine.end_step == 20 + round(after)
    assert recording.contacts.partner[0, :3].tolist() == [1, 0, 1]
    # The first contact counts: J (1 / m1 + 1 / m2) / (1 + e) of Newton's law of restitution.
    masses = params.vehicles.mass[:2, 0].astype(float)
    impulse = time_scale * math.hypot(3_000.0, 40.0)
    expected_speed = impulse * (1.0 / masses).sum() / (1.0 + float(params.constants.restitution))
    assert recording.contacts.closing_speed[0, 0] * 1e-3 == pytest.approx(expected_speed, rel=1e-3)
    assert recording.stage[0, -1] == Stage.CRASHED


def test_frames_of_other_drivers_are_recorded_alike():
    batch = scenario(OVERTAKE, frame_interval_ms=100, horizon=4.0)
    params = step_parameters(batch)
    engine = ExternallyMovedSimulation(batch, params, TICK)
    reference = ReferenceSimulation(batch, params)
    wanderers = Wanderers(params, seed=3)
    stages = [Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE]
    for frame, step in enumerate(range(0, 260, params.steps_per_frame)):
        motion = wanderers.move(np.zeros(batch.num_slots, np.float32))
        stage, indicator = stages[frame // 6], float(frame % 3 - 1)
        engine.record(motion, stage, indicator, step)
        reference.record(motion, stage, indicator, step)
    recording = engine.finish()
    assert_same_recording(recording, reference.finish())
    assert recording.num_frames.tolist() == [26]
    assert set(recording.stage[0].tolist()) == {float(stage) for stage in stages}
    assert (recording.contacts.partner == NO_VEHICLE).all()
    assert not recording.percepts.valid.any()


def test_a_simulation_records_nothing_after_its_last_step():
    batch = scenario(OVERTAKE, horizon=4.0)
    engine = ExternallyMovedSimulation(batch, step_parameters(batch), TICK)
    wanderers = Wanderers(step_parameters(batch), seed=4)
    for step in range(0, 100, SUBSTEPS):
        engine.decide(wanderers.move(np.zeros(batch.num_slots, np.float32)), step)
        if step == 50:
            engine.end_at(step)
    assert engine.end_step == 50
    assert engine.finish().num_frames.tolist() == [11]


def test_the_engine_refuses_motion_and_contacts_of_slots_that_do_not_exist():
    batch = scenario(OVERTAKE, horizon=4.0)
    engine = ExternallyMovedSimulation(batch, step_parameters(batch), TICK)
    short = VehicleMotion(*np.zeros((8, 2), np.float32))
    with pytest.raises(ValueError, match="motion"):
        engine.decide(short, 0)
    with pytest.raises(ValueError, match="motion"):
        engine.record(short, Stage.FOLLOW, 0.0, 0)
    with pytest.raises(ValueError, match="wind_trim"):
        engine.steer(np.zeros(2, np.float32))
    with pytest.raises(ValueError, match="slot"):
        engine._simulation.record_contacts([(99, 0, 0.0, 1.0, 1.0)], 0)
