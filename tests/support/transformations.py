"""Changes of scenarios and recordings that must leave labels and verdicts as they are."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.model.trajectories import NO_VEHICLE, Lights, Trajectories

if TYPE_CHECKING:
    from overtaking.model.scenario import Scenario

MIRRORED_STATES = ("y", "d", "heading", "wheel_angle", "accel_lat", "yaw_rate")
"""States that change their sign in a mirror."""


def mirror_scenario(scenario: Scenario) -> Scenario:
    """Swap left and right: the road, the wind and the sun."""
    weather = scenario.weather.replace(
        wind_direction=-scenario.weather.wind_direction, sun_azimuth=-scenario.weather.sun_azimuth
    )
    return scenario.replace(road=scenario.road.mirror(), weather=weather)


def mirror_lights(lights: np.ndarray) -> np.ndarray:
    """Swap the indicators."""
    left, right = lights & Lights.INDICATOR_LEFT, lights & Lights.INDICATOR_RIGHT
    others = lights & np.uint8(0xFF ^ (Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT))
    # The bit of the left indicator lies just below the bit of the right one.
    return (others | (left << 1) | (right >> 1)).astype(np.uint8)


def mirror_recording(trajectories: Trajectories) -> Trajectories:
    """The same traffic in a world where left and right are swapped."""
    states = trajectories.states
    mirrored = {name: -getattr(states, name) for name in MIRRORED_STATES}
    return trajectories.replace(
        scenario=mirror_scenario(trajectories.scenario),
        states=states.replace(lights=mirror_lights(states.lights), **mirrored),
    )


def reorder_slots(batch: Any, order: np.ndarray) -> Any:
    """A batch of arrays (simulation, slot, ...) in which slot k holds the values of `order[k]`."""
    reordered = {
        field.name: getattr(batch, field.name)[:, order] for field in dataclasses.fields(batch)
    }
    return batch.replace(**reordered)


def reorder_scenario(scenario: Scenario, order: np.ndarray) -> Scenario:
    """The same vehicles in other slots; as in `reorder_slots`."""
    return scenario.replace(
        vehicles=reorder_slots(scenario.vehicles, order),
        drivers=reorder_slots(scenario.drivers, order),
        start_s=scenario.start_s[:, order],
        start_lane=scenario.start_lane[:, order],
        start_speed=scenario.start_speed[:, order],
    )


def new_slots(order: np.ndarray) -> np.ndarray:
    """The new slot of each old one after `reorder_slots`; `NO_VEHICLE` keeps its value."""
    slots = np.full(256, NO_VEHICLE, np.uint8)
    slots[order] = np.arange(len(order))
    return slots


def reorder_recording(trajectories: Trajectories, order: np.ndarray) -> Trajectories:
    """The same recording with its vehicles in other slots; as in `reorder_slots`."""
    slots = new_slots(order)
    contacts = reorder_slots(trajectories.contacts, order)
    return trajectories.replace(
        scenario=reorder_scenario(trajectories.scenario, order),
        states=reorder_slots(trajectories.states, order),
        collided_with=slots[trajectories.collided_with],
        contacts=contacts.replace(partner=slots[contacts.partner]),
        percepts=trajectories.percepts.replace(slot=slots[trajectories.percepts.slot]),
    )


def begin_earlier(trajectories: Trajectories, num_frames: int) -> Trajectories:
    """The recording after some frames of 50 ms in which all vehicles keep lane and speed."""

    def prepend(values: np.ndarray, change: np.ndarray | int = 0) -> np.ndarray:
        earlier = np.repeat(values[..., :1], num_frames, axis=-1) - change
        return np.concatenate([earlier.astype(values.dtype), values], axis=-1)

    states = trajectories.states
    frames_before = np.arange(num_frames, 0, -1)
    distance = np.rint(states.speed[..., :1] * frames_before * 0.05).astype(np.int64)
    arrays = {
        field.name: prepend(getattr(states, field.name)) for field in dataclasses.fields(states)
    }
    percepts = trajectories.percepts
    return trajectories.replace(
        num_frames=trajectories.num_frames + np.int32(num_frames),
        states=states.replace(**arrays | {"s": prepend(states.s, distance)}),
        stage=prepend(trajectories.stage),
        collided_with=prepend(trajectories.collided_with),
        percepts=percepts.replace(time=percepts.time + np.int32(num_frames * 50)),
    )
