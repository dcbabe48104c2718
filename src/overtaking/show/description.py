"""One recorded simulation in words and numbers, before anybody draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from overtaking.knowledge import terms
from overtaking.model.trajectory import (
    METRES_PER_SECOND_PER_STEP,
    METRES_PER_STEP,
    NO_VEHICLE,
    DecisionKind,
    Stage,
)
from overtaking.model.vehicles import Colour, VehicleKind
from overtaking.model.weather import NO_PRESET
from overtaking.show.judgement import judge, thought

if TYPE_CHECKING:
    from overtaking.labels.explain import Thought
    from overtaking.labels.label import Labelled
    from overtaking.model.road import Road
    from overtaking.model.trajectory import Trajectories
    from overtaking.show.judgement import Values

KINDS = {kind: terms("vehicles")[kind.name].title for kind in VehicleKind}
NEIGHBOURS = ("leader", "front", "rear")
"""Last axis of `Percepts`: the vehicle ahead, and in the target lane those ahead and behind."""

_MS_PER_S = 1000.0
_DECIMALS = 3  # Of what was recorded in thousandths.


def describe(labelled: Labelled, number: int) -> Values:
    """Everything that `show` tells about one simulation.

    Args:
        labelled: A batch of one simulation, with all that is said of it.
        number: Its number in its data set.

    Returns:
        Values of plain Python types, in SI units; None for what was not recorded.
    """
    from overtaking.labels.explain import explain

    run, explanation = labelled.trajectories, explain(labelled)
    scenario = run.scenario
    return {
        "simulation": number,
        "profile": scenario.profile,
        "seed": scenario.seed,
        "index": int(scenario.index[0]),
        "weight": float(scenario.weight[0]),
        "trace_hash": run.trace_hash[0].astype("<u4").tobytes().hex(),
        "num_frames": int(run.num_frames[0]),
        "frame_interval_ms": scenario.frame_interval_ms,
        "duration_s": (int(run.num_frames[0]) - 1) * scenario.frame_interval_ms / _MS_PER_S,
        "not_recorded": sorted(run.unknown),
        "road": _road(run),
        "weather": _weather(run),
        "vehicles": [_vehicle(run, int(slot)) for slot in present(run)],
        "stages": _stages(run),
        "collisions": _collisions(run),
        "decisions": _decisions(run, explanation.thoughts),
        **judge(labelled, explanation),
    }


def present(run: Trajectories) -> np.ndarray:
    """Slots of the vehicles of the first simulation."""
    return np.flatnonzero(run.scenario.vehicles.valid[0])


def lane_name(road: Road, code: int) -> str:
    """OpenDRIVE's id of a recorded lane, or "off" where a vehicle has left the lanes."""
    return str(road.lanes[code].lane_id) if code < road.num_lanes else "off"


def _road(run: Trajectories) -> Values:
    """The road as the recorded positions see it."""
    road, unknown = run.road, run.unknown
    return {
        "name": road.name,
        "kind": None if "road_kind" in unknown else road.kind,
        "driving_side": road.driving_side.value,
        "lane_ids": [lane.lane_id for lane in road.lanes],
        "length_m": road.length,
        "speed_limit_mps": None if "speed_limit" in unknown else road.speed_limit,
    }


def _weather(run: Trajectories) -> Values | None:
    """Weather and light."""
    from overtaking.knowledge import presets

    if "weather" in run.unknown:
        return None
    weather = run.scenario.weather
    code = weather.preset[0]
    return {
        "preset": None if code == NO_PRESET else list(presets())[code],
        **{
            f"{name}_percent": round(float(getattr(weather, name)[0]), _DECIMALS)
            for name in ("cloudiness", "rain", "puddles", "wind", "fog")
        },
        "night": bool(weather.night[0]),
        "horizon_line": bool(weather.horizon_line[0]),
    }


def _vehicle(run: Trajectories, slot: int) -> Values:
    """A body, who drives it, and where it began."""
    scenario, unknown = run.scenario, run.unknown
    bodies, drivers = scenario.vehicles, scenario.drivers

    def value(array: np.ndarray, needs: str | None = None) -> float | None:
        return None if needs in unknown else round(float(array[0, slot]), _DECIMALS)

    kind = KINDS[VehicleKind(int(bodies.kind[0, slot]))]
    seconds = np.flatnonzero(run.state_valid[0, slot]) * scenario.frame_interval_ms / _MS_PER_S
    colour = Colour(int(bodies.colour[0, slot])).name.lower()
    return {
        "vehicle": slot,
        "kind": None if "kinds" in unknown else kind,
        "colour": None if "bodies" in unknown else colour,
        "length_m": value(bodies.length),
        "width_m": value(bodies.width),
        "height_m": value(bodies.height, "bodies"),
        "mass_kg": value(bodies.mass, "bodies"),
        "desired_speed_mps": value(drivers.desired_speed, "drivers"),
        "reaction_time_s": value(drivers.reaction_time, "drivers"),
        "from_s": float(seconds[0]),
        "to_s": float(seconds[-1]),
        "start_s_m": value(scenario.start_s),
        "start_lane_id": run.road.lanes[int(scenario.start_lane[0, slot])].lane_id,
        "start_speed_mps": value(scenario.start_speed),
    }


def _stages(run: Trajectories) -> list[Values]:
    """What the ego did from when to when; the last stage ends with the last frame."""
    if "stage" in run.unknown:
        return []
    stage = run.stage[0, : run.num_frames[0]]
    starts = np.flatnonzero(np.diff(stage, prepend=-1))
    ends = np.append(starts[1:], len(stage) - 1)
    seconds = run.time_ms / _MS_PER_S
    return [
        {
            "stage": Stage(int(stage[start])).name,
            "from_s": float(seconds[start]),
            "to_s": float(seconds[end]),
        }
        for start, end in zip(starts, ends, strict=True)
    ]


def _collisions(run: Trajectories) -> list[Values]:
    """The first contact of each vehicle, each pair once, in the order of time."""
    contacts, impulse_unknown = run.contacts, "impulse" in run.unknown
    found: dict[tuple[int, int, int], Values] = {}
    for slot in present(run).tolist():
        partner = int(contacts.partner[0, slot])
        if partner == NO_VEHICLE:
            continue
        pair = (int(contacts.time[0, slot]), min(slot, partner), max(slot, partner))
        found[pair] = {
            "vehicles": [pair[1], pair[2]],
            "time_s": pair[0] / _MS_PER_S,
            "impulse_newton_s": None if impulse_unknown else int(contacts.impulse[0, slot]),
            "closing_speed_mps": _steps(contacts.closing_speed[0, slot]),
        }
    return [found[pair] for pair in sorted(found)]


def _decisions(run: Trajectories, thoughts: tuple[Thought, ...]) -> list[Values]:
    """What the ego believed of its neighbours when it decided, and the truth beside."""
    if "percepts" in run.unknown:
        return []
    percepts = run.percepts
    law = {(one.decision, one.whom): thought(one) for one in thoughts}
    return [
        {
            "kind": DecisionKind(int(percepts.kind[0, row])).name,
            "time_s": int(percepts.time[0, row]) / _MS_PER_S,
            "neighbours": {
                who: _percept(run, row, place, law.get((row, place)))
                for place, who in enumerate(NEIGHBOURS)
            },
        }
        for row in np.flatnonzero(percepts.valid[0]).tolist()
    ]


def _percept(run: Trajectories, row: int, place: int, law: Values | None) -> Values | None:
    """What was believed of one neighbour, None if there is none and none was imagined."""
    percepts = run.percepts
    at = (0, row, place)
    vehicle, is_detected = int(percepts.vehicle[at]), bool(percepts.detected[at])
    exists = vehicle != NO_VEHICLE
    if not (exists or is_detected):
        return None
    return {
        "vehicle": vehicle if exists else None,
        "detected": is_detected,
        "gap_m": _steps(percepts.gap[at]) if is_detected else None,
        "closing_speed_mps": _steps(percepts.closing_speed[at]) if is_detected else None,
        "true_gap_m": _steps(percepts.true_gap[at]) if exists else None,
        "true_closing_speed_mps": _steps(percepts.true_closing_speed[at]) if exists else None,
        "law": law,
    }


def _steps(value: np.integer) -> float:
    """A recorded length or speed in SI; both have the same step."""
    assert METRES_PER_STEP == METRES_PER_SECOND_PER_STEP
    return round(int(value) * METRES_PER_STEP, _DECIMALS)
