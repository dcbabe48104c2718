"""Describes one recorded simulation as plain values, for JSON and for drawing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from overtaking.core.representation import json_values
from overtaking.core.units import INTEGER_UNITS
from overtaking.data.tables.columns import NAME_SUFFIXES, si_name, unit_of
from overtaking.data.tables.encode import encode
from overtaking.data.tables.names import NEIGHBOURS
from overtaking.knowledge.glossary import terms
from overtaking.labels.law.judging import STORED_POLICIES, default_policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.batch import batch_fields
from overtaking.model.safety_measures import PassingSafety
from overtaking.model.trajectories import (
    PerceivedVehicle,
    Stage,
)
from overtaking.show.judgement import judge, thought

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pyarrow as pa

    from overtaking.labels.explanation import BelievedFinding
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.labels.law.judging import Policy
    from overtaking.labels.law.rule import Pack
    from overtaking.model.road import Road
    from overtaking.model.road_course import SpeedLimitSpan
    from overtaking.model.trajectories import Trajectories
    from overtaking.show.judgement import Values

_MS_PER_S = 1000.0
_DECIMALS = 3  # Of numbers that were recorded in thousandths.

_WEATHER = (
    *("preset", "cloudiness_percent", "rain_percent", "puddles_percent", "wind_percent"),
    *("fog_percent", "night", "low_sun"),
)
_VEHICLE = (
    *("vehicle", "kind", "colour", "length_m", "width_m", "height_m", "mass_kg"),
    *("desired_speed_mps", "reaction_time_s", "start_s_m", "start_lane_id", "start_speed_mps"),
)
_PERCEPT = (
    *("vehicle", "is_detected", "gap_m", "closing_speed_mps"),
    *("true_gap_m", "true_closing_speed_mps"),
)
"""Columns of the tables that are told, under the names that they have in SI."""


def describe(
    labelled: LabelledTrajectories,
    number: int,
    *,
    pack: Pack = PORTUGAL,
    policies: Sequence[Policy] = STORED_POLICIES,
) -> Values:
    """Everything that `show` prints about one simulation.

    Args:
        labelled: A batch of one simulation, with its labels.
        number: Its number in its data set.
        pack: The rules of its labels.
        policies: The policies of its labels.

    Returns:
        Values of plain Python types, in SI units; None for unrecorded values.
    """
    from overtaking.labels.explanation import explain

    run, explanation = labelled.trajectories, explain(labelled, pack=pack, policies=policies)
    scenario, vehicles = run.scenario, _rows(run, "vehicles")
    (weather,) = _rows(run, "weather")
    return {
        "simulation": number,
        "profile": scenario.profile,
        "policy": _policy_name(scenario.profile, policies),
        "seed": scenario.seed,
        "scenario_index": int(scenario.scenario_index[0]),
        "weight": float(scenario.weight[0]),
        "trace_hash": run.trace_hash[0].astype("<u4").tobytes().hex(),
        "num_frames": int(run.num_frames[0]),
        "frame_interval_ms": scenario.frame_interval_ms,
        "duration_s": (int(run.num_frames[0]) - 1) * scenario.frame_interval_ms / _MS_PER_S,
        "not_recorded": sorted(run.unknown),
        "road": _road(run),
        "weather": None if weather["night"] is None else _part(weather, _WEATHER),
        "vehicles": [_vehicle(run, one) for one in vehicles],
        "stages": _stages(run),
        "collisions": _collisions(vehicles),
        "decisions": _decisions(run, explanation.believed),
        **_oncoming(labelled),
        **judge(labelled, explanation),
    }


def _policy_name(profile: str, policies: Sequence[Policy]) -> str:
    """The default policy of the profile; if the pack lacks it, the first policy of the pack."""
    names = [policy.name for policy in policies]
    default = default_policy(profile)
    return default if default in names else names[0]


def _oncoming(labelled: LabelledTrajectories) -> Values:
    """The measures against oncoming traffic, on roads that have some."""
    if not labelled.trajectories.road.is_two_way:
        return {}
    measures = labelled.safety.oncoming
    values = {
        name + NAME_SUFFIXES[field.spec.unit]: json_values(getattr(measures, name)[0])
        for name, field in batch_fields(PassingSafety).items()
        if field.column
    }
    there = bool(measures.was_in_opposing_lane[0])
    return {"oncoming": {name: _rounded(one) if there else None for name, one in values.items()}}


def lane_name(road: Road, code: int) -> str:
    """OpenDRIVE's id of a recorded lane, or "off" where a vehicle has left the lanes."""
    beyond = [road.overtaking_side_neighbour] if road.is_two_way else []
    lanes = [*road.lanes, *beyond]
    lane = lanes[code] if code < len(lanes) else None
    return "off" if lane is None else str(lane.lane_id)


def _road(run: Trajectories) -> Values:
    """The road as the recorded positions see it."""
    road, unknown = run.road, run.unknown
    limits = (
        () if "speed_limit" in unknown or road.course is None else road.course.speed_limit_spans
    )
    return {
        "name": road.name,
        "kind": None if "road_kind" in unknown else road.kind,
        "driving_side": road.driving_side.value,
        "lane_ids": [lane.lane_id for lane in road.lanes],
        "length_m": road.length,
        "speed_limit_mps": None if "speed_limit" in unknown else road.speed_limit,
        **({"lower_limits": [_limit(one) for one in limits]} if limits else {}),
        **({"is_two_way": True} if road.is_two_way else {}),
    }


def _limit(one: SpeedLimitSpan) -> Values:
    """A stretch with a lower limit, as the road's own is told."""
    return {
        "from_m": one.start,
        "to_m": one.stop,
        "speed_limit_mps": one.speed,
        "direction": one.direction,
    }


def _rows(run: Trajectories, table: str) -> list[Values]:
    """The rows of a table of one simulation, in SI; None for unrecorded values."""
    made = encode(run, np.zeros(1, np.int64), [table])[table]
    return [
        {si_name(field): _plain(row[field.name], field) for field in made.schema}
        for row in made.to_pylist()
    ]


def _plain(value: Any, field: pa.Field) -> Any:
    """A value of a column as people read it."""
    if value is not None and unit_of(field) in INTEGER_UNITS:
        value /= INTEGER_UNITS[unit_of(field)][1]
    return _rounded(value)


def _rounded(value: Any) -> Any:
    return round(value, _DECIMALS) if isinstance(value, float) else value


def _part(row: Values, columns: tuple[str, ...], prefix: str = "") -> Values:
    """Some columns of a row, named without a prefix that they share."""
    return {name: row[prefix + name] for name in columns}


def _vehicle(run: Trajectories, row: Values) -> Values:
    """Body, driver, start and recorded frames of a vehicle."""
    frames = np.flatnonzero(run.state_mask[0, row["vehicle"]])
    seconds = frames * run.scenario.frame_interval_ms / _MS_PER_S
    return {
        **_part(row, _VEHICLE),
        "kind": row["kind"] and terms("vehicles")[row["kind"]].title,
        "from_s": float(seconds[0]),
        "to_s": float(seconds[-1]),
    }


def _stages(run: Trajectories) -> list[Values]:
    """The stages of the ego with begin and end; the last stage ends with the last frame."""
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


def _collisions(vehicles: list[Values]) -> list[Values]:
    """The first contact of each vehicle, each pair once, in the order of time."""
    found: dict[tuple[float, int, int], Values] = {}
    for one in vehicles:
        slot, partner, time_s = one["vehicle"], one["contact_vehicle"], one["contact_time_s"]
        if partner is None:
            continue
        pair = (time_s, min(slot, partner), max(slot, partner))
        found[pair] = {
            "vehicles": list(pair[1:]),
            **_part(one, ("time_s", "impulse_newton_s", "closing_speed_mps"), "contact_"),
        }
    return [found[pair] for pair in sorted(found)]


def _decisions(run: Trajectories, thoughts: tuple[BelievedFinding, ...]) -> list[Values]:
    """Beliefs of the ego about its neighbours at each decision, with the true values."""
    if "percepts" in run.unknown:
        return []
    law = {(one.percept, one.perceived): thought(one) for one in thoughts}
    return [
        {
            "kind": row["kind"],
            "time_s": row["time_s"],
            "neighbours": {
                who: _percept(row, who, law.get((row["percept"], place)))
                for place, who in zip(PerceivedVehicle, NEIGHBOURS, strict=True)
            },
        }
        for row in _rows(run, "percepts")
    ]


def _percept(row: Values, who: str, law: Values | None) -> Values | None:
    """Belief about one neighbour; None if there is none and none was imagined."""
    believed = _part(row, _PERCEPT, f"{who}_")
    if believed["vehicle"] is None and not believed["is_detected"]:
        return None
    return {**believed, "law": law}
