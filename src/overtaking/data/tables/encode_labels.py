"""Labels, findings, features and measures of safety as tables."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from overtaking.core.arrays import Mask
from overtaking.data.tables import names
from overtaking.data.tables.arrow import Array, Masked
from overtaking.data.tables.build import Given, Rows, Texts, build, read_columns
from overtaking.data.tables.encode import Numbers, encode
from overtaking.data.tables.schemas import COLUMNS, LABEL_TABLES
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.snapshots import slot_or_ego
from overtaking.model.batch import concatenate
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.overtake_events import NEVER
from overtaking.model.safety_measures import MEASURED_MOMENTS, WHOLE_MANOEUVRE_MEASURES
from overtaking.model.trajectories import NO_VEHICLE, Trajectories
from overtaking.model.vehicles import EGO_SLOT
from overtaking.model.verdicts import Finding, Verdict

Weights = NDArray[np.float64]

PERCENT = np.float32(100.0)


def contents(
    trajectories: Trajectories,
    numbers: Numbers,
    tables: Collection[str],
    sources: Sequence[str] | None = None,
    balance_weight: Weights | None = None,
) -> dict[str, pa.Table]:
    """The tables of a batch, recordings and labels, by the names of their folders.

    Args:
        trajectories: The recorded simulations.
        numbers: Number of each simulation in its data set, growing, shape (simulation,).
        tables: Which tables.
        sources: Where in a recording each simulation comes from; None for simulations.
        balance_weight: As in `encode_labels`.
    """
    recorded = [name for name in tables if name not in LABEL_TABLES]
    made = encode(trajectories, numbers, recorded, sources)
    if len(recorded) < len(tables):
        said = encode_labels(label(trajectories), numbers, balance_weight)
        made |= {name: said[name] for name in tables if name in LABEL_TABLES}
    return made


def encode_labels(
    labelled: LabelledTrajectories, numbers: Numbers, balance_weight: Weights | None = None
) -> dict[str, pa.Table]:
    """The tables of labels of a batch, by the names of their folders.

    Args:
        labelled: The labelled simulations.
        numbers: Number of each simulation in its data set, growing, shape (simulation,).
        balance_weight: Weights that give back the natural rates, shape (simulation,); the sampling
            weights if left out.
    """
    weight = labelled.trajectories.scenario.weight if balance_weight is None else balance_weight
    return {
        "events": events(labelled, numbers),
        "labels": labels(labelled, numbers, weight),
        "findings": findings(labelled, numbers),
        "features": features(labelled, numbers),
        "attempts": attempts(labelled, numbers),
        "safety": safety(labelled, numbers),
    }


def events(labelled: LabelledTrajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and event that happened."""
    found = labelled.events
    frames = np.stack([getattr(found, name) for name in names.EVENTS], axis=1)
    happened = frames != NEVER
    simulation, event = np.nonzero(happened)
    is_contact = event == names.EVENTS.index("collision")
    vehicle = np.where(is_contact, found.collision_slot[simulation], found.target_slot[simulation])
    interval = np.int32(labelled.signals.frame_interval_ms)
    computed = {
        "simulation": numbers[simulation],
        "event": event,
        "frame": frames[happened],
        "time_ms": frames[happened] * interval,
        "vehicle": Masked(vehicle, vehicle == NO_VEHICLE),
        "speed_change_mps": Masked(_speed_change(labelled)[simulation], ~is_contact),
        "was_intended": Masked(
            found.was_intended[simulation],
            (event != names.EVENTS.index("attempt")) | labelled.trajectories.is_excerpt,
        ),
    }
    return build("events", labelled, _per_simulation(1), computed)


def _speed_change(labelled: LabelledTrajectories) -> NDArray[np.floating[Any]]:
    """Impulse of the ego's first contact over its mass, shape (simulation,) [m/s]."""
    run = labelled.trajectories
    impulse = run.contacts.impulse[:, EGO_SLOT].astype(np.float32)
    return impulse / run.scenario.vehicles.mass[:, EGO_SLOT]


def labels(labelled: LabelledTrajectories, numbers: Numbers, weight: Weights) -> pa.Table:
    """One row per simulation and policy."""
    count, policies = labelled.labels.classes.shape
    code = [names.POLICY_NAMES.index(name) for name in labelled.labels.policies]
    computed = {
        "simulation": np.repeat(numbers, policies),
        "policy": np.tile(np.array(code), count),
        "rule_set": Texts.same(labelled.findings.version, count * policies),
        "balance_weight": np.repeat(weight, policies),
    }
    return build("labels", labelled, _per_simulation(policies), computed)


def findings(labelled: LabelledTrajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and rule; on one-way roads without those about oncoming traffic."""
    labelled = _kept_findings(labelled)
    found = labelled.findings
    count, rules = found.verdict.shape
    laws = {rule.code: names.ARTICLES.index(rule.article) for rule in PORTUGAL.rules}
    codes = [names.RULES.index(rule) for rule in found.rule_codes]
    verdict = found.verdict.reshape(-1)
    judged = (verdict == Verdict.LEGAL) | (verdict == Verdict.ILLEGAL)
    computed = {
        "simulation": np.repeat(numbers, rules),
        "rule": np.tile(np.array(codes), count),
        "margin": Masked(found.margin.reshape(-1), ~judged),
        "article": np.tile(np.array([laws[rule] for rule in found.rule_codes]), count),
    }
    return build("findings", labelled, _per_simulation(rules), computed)


def _kept_findings(labelled: LabelledTrajectories) -> LabelledTrajectories:
    """The batch with the findings that its table keeps."""
    if labelled.trajectories.road.is_two_way:
        return labelled
    found, two_way = (
        labelled.findings,
        {one.code for one in PORTUGAL.rules if one.only_two_way_roads},
    )
    kept = [column for column, code in enumerate(found.rule_codes) if code not in two_way]
    columns = {one.name: getattr(found, one.name)[:, kept] for one in fields(Finding)}
    rules = tuple(found.rule_codes[column] for column in kept)
    return labelled.replace(findings=found.replace(rule_codes=rules, **columns))


def _per_simulation(count: int) -> Rows:
    """Takes `count` rows for each simulation: from its values, or each time the only one."""
    return lambda values: values.reshape(-1) if values.ndim > 1 else np.repeat(values, count)


def features(labelled: LabelledTrajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and way of measuring."""
    paper, matched = labelled.paper_features, labelled.matched_features
    both = concatenate([paper, matched.replace(reading=paper.reading)])
    order = np.arange(2 * len(numbers)).reshape(2, -1).T.reshape(-1)
    codes = [names.READINGS.index(one.reading) for one in (paper, matched)]

    def rows(values: Array) -> Array:
        """Row i of each reading in turn."""
        return values.take(order)

    computed = {
        "simulation": np.repeat(numbers, 2),
        "reading": np.tile(np.array(codes), len(numbers)),
        "OLR_percent": rows(both.left_occupancy) * PERCENT,
    }
    return build("features", both, rows, computed, labelled.trajectories.unknown)


def attempts(labelled: LabelledTrajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation: the state when the overtake began, or might have begun."""
    found, unknown = labelled.attempt_features, labelled.trajectories.unknown
    computed: dict[str, Given] = {"simulation": numbers, **_of_known_kinds(labelled)}
    return build("attempts", found, lambda values: values, computed, unknown)


def _of_known_kinds(labelled: LabelledTrajectories) -> dict[str, Given]:
    """Columns of `attempts` that depend on kinds, null where a kind is not known."""
    run, found = labelled.trajectories, labelled.attempt_features
    if run.is_kind_known is None:
        return {}
    rows = np.arange(len(found.frame))
    leader = labelled.signals.neighbour_slot[rows, NeighbourRole.LEADER, np.maximum(found.frame, 0)]
    is_known = {
        "ego": run.known_kinds[:, EGO_SLOT],
        "law": run.known_kinds[:, EGO_SLOT],
        "leader": run.known_kinds[rows, slot_or_ego(leader)],
        "oncoming": np.asarray(run.known_kinds.all(axis=1)),
    }
    columns = [one for one in COLUMNS["attempts"] if "kinds" in one.spec.needs]
    columns = [one for one in columns if not one.is_silent(run.unknown)]
    made: dict[str, Given] = {}
    for name, one in read_columns(columns, found, lambda values: values).items():
        is_null = ~is_known[name.partition("_")[0]]
        if isinstance(one, Masked):
            made[name] = Masked(one.values, one.missing | is_null)
        elif not isinstance(one, Texts):
            made[name] = Masked(one, is_null)
    return made


def safety(labelled: LabelledTrajectories, numbers: Numbers) -> pa.Table:
    """One row per simulation and moment that came."""
    found, unknown = labelled.safety, labelled.trajectories.unknown
    came = np.flatnonzero(found.frame != NEVER)
    simulation, moment = np.divmod(came, len(MEASURED_MOMENTS))

    def rows(values: Array) -> Array:
        return values.reshape(-1).take(came) if values.ndim > 1 else values.take(simulation)

    once = [
        one for one in COLUMNS["safety"] if one.path.partition(".")[0] in WHOLE_MANOEUVRE_MEASURES
    ]
    others = moment != MEASURED_MOMENTS.index("manoeuvre")
    computed = {
        "simulation": numbers[simulation],
        "moment": moment,
        **_null_where(others, read_columns(once, found, rows)),
    }
    return build("safety", found, rows, computed, unknown)


def _null_where(missing: Mask, columns: Mapping[str, Any]) -> dict[str, Masked]:
    """Columns with further nulls."""
    return {name: Masked(one.values, one.missing | missing) for name, one in columns.items()}
