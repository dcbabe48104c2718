"""Labels, findings and features as tables."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.elementary import F32, Mask
from overtaking.data.tables.arrow import Masked
from overtaking.data.tables.build import Texts, build
from overtaking.data.tables.decision_columns import DECISION_COLUMNS
from overtaking.data.tables.encode import Numbers
from overtaking.data.tables.label_schemas import ARTICLES, EVENTS_IN_ORDER, POLICY_NAMES, READINGS
from overtaking.data.tables.measured import masked_columns
from overtaking.data.tables.safety_columns import MANOEUVRE_COLUMNS, SAFETY_COLUMNS
from overtaking.labels.label import Labelled
from overtaking.labels.law import PORTUGAL
from overtaking.model.events import NEVER
from overtaking.model.features import Features
from overtaking.model.labels import Verdict
from overtaking.model.safety import MOMENTS
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role

Weights = NDArray[np.float64]

PERCENT = np.float32(100.0)


def encode_labels(
    labelled: Labelled, numbers: Numbers, class_weight: Weights | None = None
) -> dict[str, pa.Table]:
    """The tables of labels of a batch, by the names of their folders.

    Args:
        labelled: The labelled simulations.
        numbers: Number of each simulation in its data set, growing, shape (simulation,).
        class_weight: Weights that give back the natural rates, shape (simulation,); the sampling
            weights if left out.
    """
    weight = labelled.trajectories.scenario.weight if class_weight is None else class_weight
    return {
        "events": events(labelled, numbers),
        "labels": labels(labelled, numbers, weight),
        "findings": findings(labelled, numbers),
        "features": features(labelled, numbers),
        "decisions": decisions(labelled, numbers),
        "safety": safety(labelled, numbers),
    }


def events(labelled: Labelled, numbers: Numbers) -> pa.Table:
    """One row per simulation and event that happened."""
    found = labelled.events
    frames = np.stack([getattr(found, name) for name in EVENTS_IN_ORDER], axis=1)
    happened = frames != NEVER
    simulation, event = np.nonzero(happened)
    is_contact = event == EVENTS_IN_ORDER.index("collision")
    vehicle = np.where(is_contact, found.partner[simulation], found.target[simulation])
    interval = np.int32(labelled.signals.frame_interval_ms)
    return build(
        "events",
        {
            "simulation": numbers[simulation],
            "event": event,
            "frame": frames[happened],
            "time_ms": frames[happened] * interval,
            "vehicle": Masked(vehicle, vehicle == NO_VEHICLE),
            "speed_change_mps": Masked(_speed_change(labelled)[simulation], ~is_contact),
        },
    )


def _speed_change(labelled: Labelled) -> NDArray[np.floating[Any]]:
    """Impulse of the ego's first contact over its mass, shape (simulation,) [m/s]."""
    run = labelled.trajectories
    impulse = run.contacts.impulse[:, Role.EGO].astype(np.float32)
    return impulse / run.scenario.vehicles.mass[:, Role.EGO]


def labels(labelled: Labelled, numbers: Numbers, weight: Weights) -> pa.Table:
    """One row per simulation and policy."""
    found = labelled.labels
    count, policies = found.classes.shape
    code = [POLICY_NAMES.names.index(name) for name in found.policies]
    return build(
        "labels",
        {
            "simulation": np.repeat(numbers, policies),
            "policy": np.tile(np.array(code), count),
            "class": found.classes.reshape(-1),
            "outcome": np.repeat(found.outcome, policies),
            "detail": np.repeat(found.detail, policies),
            "legal_as_far_as_decidable": found.is_legal.reshape(-1),
            "num_broken": found.num_broken.reshape(-1),
            "num_undecidable": found.num_undecidable.reshape(-1),
            "rule_set": Texts.same(labelled.findings.version, count * policies),
            "class_weight": np.repeat(weight, policies),
        },
    )


def findings(labelled: Labelled, numbers: Numbers) -> pa.Table:
    """One row per simulation and rule."""
    found = labelled.findings
    count, rules = found.verdict.shape
    laws = {rule.code: ARTICLES.names.index(rule.law) for rule in PORTUGAL.rules}
    codes = [PORTUGAL.codes.index(rule) for rule in found.rules]
    verdict = found.verdict.reshape(-1)
    first, last = found.first.reshape(-1), found.last.reshape(-1)
    judged = (verdict == Verdict.LEGAL) | (verdict == Verdict.ILLEGAL)
    return build(
        "findings",
        {
            "simulation": np.repeat(numbers, rules),
            "rule": np.tile(np.array(codes), count),
            "verdict": verdict,
            "margin": Masked(found.margin.reshape(-1), ~judged),
            "first_frame": Masked(first, first == NEVER),
            "last_frame": Masked(last, last == NEVER),
            "article": np.tile(np.array([laws[rule] for rule in found.rules]), count),
            "severity": found.severity.reshape(-1),
            "belief": found.belief.reshape(-1),
        },
    )


def features(labelled: Labelled, numbers: Numbers) -> pa.Table:
    """One row per simulation and way of measuring."""
    unknown = labelled.trajectories.unknown
    readings = [_features(one, numbers, unknown) for one in labelled.features]
    count = len(numbers)
    # Row i of each reading in turn.
    order = np.arange(count * len(readings)).reshape(len(readings), count).T.reshape(-1)
    columns = {name: _interleaved([one[name] for one in readings], order) for name in readings[0]}
    return build("features", columns)


def _interleaved(parts: list[NDArray[Any] | Masked], order: NDArray[np.int64]) -> Any:
    values = np.concatenate([_values(part) for part in parts])[order]
    if not any(isinstance(part, Masked) for part in parts):
        return values
    return Masked(values, np.concatenate([_missing(part) for part in parts])[order])


def _values(part: NDArray[Any] | Masked) -> NDArray[Any]:
    return part.values if isinstance(part, Masked) else part


def _missing(part: NDArray[Any] | Masked) -> Mask:
    return part.missing if isinstance(part, Masked) else np.zeros(len(part), dtype=np.bool_)


def decisions(labelled: Labelled, numbers: Numbers) -> pa.Table:
    """One row per simulation: what there was to know when the overtake began, or might have."""
    found, unknown = labelled.decisions, labelled.trajectories.unknown
    columns = masked_columns(DECISION_COLUMNS, found, unknown)
    return build("decisions", {"simulation": numbers, "frame": found.frame, **columns})


def safety(labelled: Labelled, numbers: Numbers) -> pa.Table:
    """One row per simulation and moment that came."""
    found, unknown = labelled.safety, labelled.trajectories.unknown
    came = np.flatnonzero(found.frame != NEVER)
    simulation, moment = np.divmod(came, len(MOMENTS))
    columns = masked_columns(SAFETY_COLUMNS, found, unknown, came)
    others = moment != MOMENTS.index("manoeuvre")
    once = masked_columns(MANOEUVRE_COLUMNS, found, unknown, simulation)
    columns |= {name: Masked(one.values, one.missing | others) for name, one in once.items()}
    frame = found.frame.reshape(-1).take(came)
    keys = {"simulation": numbers[simulation], "moment": moment, "frame": frame}
    return build("safety", keys | columns)


def _features(
    found: Features, numbers: Numbers, unknown: frozenset[str]
) -> Mapping[str, NDArray[Any] | Masked]:
    nobody = ~found.has_target
    unseen = np.full(len(numbers), "weather" in unknown)
    return {
        "simulation": numbers,
        "policy": np.full(len(numbers), READINGS.names.index(found.policy)),
        "DN": Masked(found.night.astype(np.int32), unseen),
        "HL": Masked(found.horizon_line.astype(np.int32), unseen),
        "TE": found.ego_kind,
        "TP": Masked(found.target_kind, nobody),
        "WT_s": _where_known(found.waiting_time),
        "OT_s": _where_known(found.overtaking_time),
        "NV": found.num_vehicles,
        "SE_mps": found.ego_speed,
        "SP_mps": _where_known(found.target_speed, nobody),
        "DSEP_mps": _where_known(found.speed_difference, nobody),
        "D_m": _where_known(found.distance, nobody),
        "OLR_percent": found.left_occupancy * PERCENT,
        "PREC_percent": Masked(found.rain, unseen),
        "WIND_percent": Masked(found.wind, unseen),
        "FOG_percent": Masked(found.fog, unseen),
        "frame": Masked(found.frame, found.frame == NEVER),
    }


def _where_known(values: F32, missing: Mask | None = None) -> Masked:
    """Values that are null where they are NaN, and where said so."""
    unknown = np.isnan(values)
    return Masked(values, unknown if missing is None else unknown | missing)
