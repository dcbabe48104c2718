"""Recorded simulations with any values that the arrays can hold, made without a simulator."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from overtaking.model.known_roads import known_road
from overtaking.model.scenario import SLOT_CAPACITIES, Scenario
from overtaking.model.trajectories import (
    NO_VEHICLE,
    STATE_DTYPES,
    Contacts,
    ManoeuvreKind,
    Percepts,
    Stage,
    States,
    Trajectories,
)
from overtaking.model.vehicles import Colour, DriverTraits, VehicleKind, VehicleSpecs
from overtaking.model.weather import NO_PRESET, Weather

if TYPE_CHECKING:
    from overtaking.model.road import Road

Recorder = Callable[..., Trajectories]


class Source:
    """Random arrays of any shape and type."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def integers(self, dtype, shape, *, low=None, high=None):
        info = np.iinfo(dtype)
        low, high = info.min if low is None else low, info.max if high is None else high
        return self.random.integers(low, high, shape, dtype=dtype, endpoint=True)

    def floats(self, shape, *, low=0.5, high=2.0):
        """Numbers that a body, a person or a duration can have."""
        return self.random.uniform(low, high, shape).astype(np.float32)

    def yes_or_no(self, shape):
        return self.random.random(shape) < 0.5

    def batch(self, cls, shape, **known):
        """A batch of `cls` with the fields given, and any floats or yes and no in the others."""
        kinds = {field.name: str(field.type) for field in dataclasses.fields(cls)}
        for name, kind in kinds.items():
            if name not in known:
                known[name] = self.yes_or_no(shape) if "bool" in kind else self.floats(shape)
        return cls(**known)


def states(source: Source, shape: tuple[int, int, int], road: Road) -> States:
    lane = source.integers(np.uint8, shape, low=0, high=road.num_lanes + 1)
    lane[lane == road.num_lanes + 1] = 255
    # Outside the lanes, which side it is follows from the position.
    borders_mm = np.rint(np.array([*road.lane_boundaries, road.lane_boundaries[-1] + 2]) * 1000)
    d = np.where(lane == 255, road.lane_boundaries[0] * 1000 - road.overtaking_sign * 500, 0.0)
    d = np.where(
        lane != 255, borders_mm[np.minimum(lane, road.num_lanes)] + road.overtaking_sign * 500, d
    )
    drawn = {name: source.integers(kind, shape) for name, kind in STATE_DTYPES.items()}
    drawn |= {"d": d.astype(np.int32), "lane": lane}
    drawn["speed"] = source.integers(np.int32, shape, low=0)
    drawn["heading"][:, 0] //= 8  # An ego across the road has spun and attempts nothing.
    drawn["lights"] = source.integers(np.uint8, shape, low=0, high=63)
    return States(**drawn)


def contacts(source: Source, valid: np.ndarray) -> Contacts:
    partner = source.integers(np.uint8, valid.shape, low=0, high=valid.shape[1])
    partner[(partner == valid.shape[1]) | ~valid] = NO_VEHICLE
    hit = partner != NO_VEHICLE
    return Contacts(
        partner=partner,
        time=source.integers(np.int32, valid.shape) * hit,
        impulse=source.integers(np.int32, valid.shape, low=0) * hit,
        closing_speed=source.integers(np.int32, valid.shape) * hit,
    )


def percepts(source: Source, valid: np.ndarray) -> Percepts:
    shape = (*valid.shape, 3)
    there = valid[:, :, None] & source.yes_or_no(shape)
    seen = there & source.yes_or_no(shape)
    vehicle = np.where(there, source.integers(np.uint8, shape, low=1, high=7), NO_VEHICLE)
    return Percepts(
        valid=valid,
        kind=source.integers(np.uint8, valid.shape, low=0, high=len(ManoeuvreKind) - 1) * valid,
        time=source.integers(np.int32, valid.shape, low=0) * valid,
        slot=vehicle.astype(np.uint8),
        is_detected=seen,
        gap=np.where(seen, source.integers(np.int32, shape), 1_000_000),  # As the simulator has it.
        closing_speed=source.integers(np.int32, shape) * seen,
        true_gap=source.integers(np.int32, shape) * there,
        true_closing_speed=source.integers(np.int32, shape) * there,
    )


def bodies(source: Source, valid: np.ndarray) -> VehicleSpecs:
    shape = valid.shape
    kind = source.integers(np.uint8, shape, low=0, high=len(VehicleKind) - 1)
    colour = source.integers(np.uint8, shape, low=0, high=len(Colour) - 1)
    return source.batch(VehicleSpecs, shape, valid=valid, kind=kind, colour=colour)


def weather(source: Source, count: int) -> Weather:
    preset = source.integers(np.uint8, count, low=0, high=8)
    preset[preset == 8] = NO_PRESET
    percents = ("cloudiness", "rain", "puddles", "wind", "fog")
    angles = ("wind_direction", "sun_altitude", "sun_azimuth")
    return Weather(
        preset=preset,
        **{name: source.floats(count, low=0, high=100) for name in percents},
        **{name: source.floats(count, low=-1.5, high=1.5) for name in angles},
        night=source.yes_or_no(count),
        low_sun=source.yes_or_no(count),
    )


def scenario(source: Source, valid: np.ndarray, road: Road) -> Scenario:
    count, shape = len(valid), valid.shape
    return Scenario(
        profile="by hand",
        road=road,
        seed=2**64 - 1,
        frame_interval_ms=50,
        scenario_index=source.integers(np.uint64, count),
        horizon=source.floats(count),
        attempt_deadline=source.floats(count),
        weight=source.random.random(count),
        vehicles=bodies(source, valid),
        drivers=source.batch(DriverTraits, shape),
        weather=weather(source, count),
        start_s=source.floats(shape),
        start_lane=source.integers(np.uint8, shape, low=0, high=road.num_lanes - 1),
        start_speed=source.floats(shape),
    )


def record(
    seed: int = 0,
    *,
    num_simulations: int = 5,
    num_slots: int = SLOT_CAPACITIES[0],
    num_frames: int = 12,
    road: Road | None = None,
    full: bool = False,
) -> Trajectories:
    """Recorded simulations with 1 to `num_slots` vehicles and 1 to `num_frames` frames.

    Args:
        seed: Equal seeds give equal arrays.
        num_simulations: Length of the simulation axis.
        num_slots: Length of the vehicle axis.
        num_frames: Length of the time axis; at least one simulation is as long.
        road: The road; `town06` if left out.
        full: Whether every slot holds a vehicle and every frame is recorded.
    """
    source, road = Source(seed), road or known_road("town06")
    count = source.integers(np.int64, num_simulations, low=1, high=num_slots)
    length = source.integers(np.int32, num_simulations, low=1, high=num_frames)
    count[:1], length[:1] = num_slots, num_frames
    if full:
        count[:], length[:] = num_slots, num_frames
    valid = np.arange(num_slots)[None, :] < count[:, None]
    shape = (num_simulations, num_frames)
    recorded = np.arange(num_frames)[None, :] < length[:, None]
    partner = source.integers(np.uint8, shape, low=1, high=num_slots)
    decisions = (
        np.arange(3)[None, :] < source.integers(np.int64, num_simulations, low=0, high=3)[:, None]
    )
    return Trajectories(
        scenario=scenario(source, valid, road),
        num_frames=length,
        states=states(source, (num_simulations, num_slots, num_frames), road),
        stage=source.integers(np.uint8, shape, low=0, high=len(Stage) - 1) * recorded,
        collided_with=np.where(partner == num_slots, NO_VEHICLE, partner).astype(np.uint8),
        contacts=contacts(source, valid),
        percepts=percepts(source, decisions),
        trace_hash=source.integers(np.uint32, (num_simulations, 4)),
    )


@pytest.fixture(scope="session")
def recorder() -> Recorder:
    """Makes recorded simulations; see `record`."""
    return record
