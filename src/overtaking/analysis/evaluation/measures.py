"""A driver's actions in each scene, as columns: numbers of shape (scene,)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from overtaking.analysis.evaluation import lane_changes, origins
from overtaking.analysis.evaluation.endpoints import POLICY
from overtaking.analysis.validation.conflicts import episodes, near_crashes, reactions
from overtaking.analysis.validation.traffic import Batch, limit
from overtaking.labels.law.judging import stored_policy
from overtaking.model.overtake_events import NEVER, OutcomeDetail
from overtaking.model.verdicts import Belief, OvertakeClass, Verdict

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array
    from overtaking.core.arrays import F64
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.model.trajectories import Trajectories

Columns = dict[str, "F64"]

EGO: Final = slice(0, 1)
QUANTILE: Final = 0.95
"""Of jerk and lateral acceleration over the frames of a scene."""

JERK_S: Final = 0.5
"""Jerk is a difference over this time: longer than a step, shorter than a manoeuvre [s]."""


def columns(labelled: LabelledTrajectories, stay: Trajectories) -> Columns:
    """Everything that endpoints are made of.

    Args:
        labelled: The simulations that the driver drove, with labels.
        stay: The same scenes with an ego that stays in its lane.
    """
    batch = Batch.of(labelled.trajectories)
    near = near_crashes(batch, reactions(batch, EGO))
    found = _outcome(labelled) | _law(labelled) | _margins(labelled)
    found |= {
        "scenes": np.ones(len(batch.weight)),
        "km": 1e-3 * batch.metres(batch.sound & (np.arange(batch.sound.shape[1]) == 0)[:, None]),
        "near_crashes": np.bincount(near.simulation, minlength=len(batch.weight)),
        "gained": gained(labelled.trajectories, stay),
        "clipped": _clipped(labelled.trajectories),
    }
    found["near_crash"] = found["near_crashes"] > 0
    for name in ("collision", "near_crash"):
        found[f"{name}_attempted"] = found[name] * found["attempted"]
    found |= _comfort(batch) | lane_changes.columns(batch)
    found |= origins.columns(labelled, batch, near)
    return {name: np.asarray(one, np.float64) for name, one in found.items()}


def _clipped(runs: Trajectories) -> Array:
    """Answers of the policy that were beyond the limits, shape (scene,)."""
    counted = runs.actions and runs.actions.num_clipped
    return np.zeros(runs.scenario.num_simulations) if counted is None else counted


def _outcome(labelled: LabelledTrajectories) -> dict[str, Array]:
    """How the scenes ended."""
    events, labels = labelled.events, labelled.labels
    kind = labels.classes[:, labels.policies.index(POLICY)]
    return {
        "attempted": events.has_attempt,
        "completed": events.is_completed,
        "given_up": kind == OvertakeClass.UNSUCCESS_NCOL,
        "open": kind == OvertakeClass.CENSORED,
        "departed": events.lost_control,
        "collision": events.collision != NEVER,
        "struck": labels.detail == OutcomeDetail.STRUCK_BY_OTHER,
        "lawful": kind == OvertakeClass.SUCCESS_L,
    }


def _law(labelled: LabelledTrajectories) -> dict[str, Array]:
    """Breaches: by policy, and by rule where it applies."""
    labels, findings = labelled.labels, labelled.findings
    place = labels.policies.index(POLICY)
    found: dict[str, Array] = {
        f"legal_{name}": labels.is_legal[:, each] for each, name in enumerate(labels.policies)
    }
    found["undecided"] = labels.num_undecidable[:, place] > 0
    for code in stored_policy(POLICY).required:
        column = findings.rule_codes.index(code)
        verdict, belief = findings.verdict[:, column], findings.belief[:, column]
        broken = verdict == Verdict.ILLEGAL
        found[f"{code}_applies"] = broken | (verdict == Verdict.LEGAL)
        found[f"{code}_broken"] = broken
        found[f"{code}_knowingly"] = broken & (belief == Belief.KNOWINGLY_ILLEGAL)
        found[f"{code}_mistaken"] = broken & (belief == Belief.MISTAKEN)
    return found


def _margins(labelled: LabelledTrajectories) -> dict[str, Array]:
    """Attempts that came too close, at their worst."""
    safety, attempted = labelled.safety, labelled.events.has_attempt
    has_leader = attempted & safety.leader.valid[:, 0]
    return {
        "near_front": has_leader & (safety.leader.ttc[:, 0] < limit("near_crash_ttc")),
    }


def gained(runs: Trajectories, stay: Trajectories) -> F64:
    """How much earlier the ego is where it is than if it had stayed in its lane, (scene,) [s].

    At the last frame that both have: the way that it is ahead over the mean speed of the one that
    stayed.
    """
    last = np.minimum(_last_sound(runs), _last_sound(stay))
    rows = np.arange(len(last))
    ahead, begin = (runs.states.s[rows, 0, last], stay.states.s[rows, 0, 0])
    behind = stay.states.s[rows, 0, last].astype(np.float64)
    seconds = 1e-3 * last * runs.scenario.frame_interval_ms
    return (ahead - behind) * seconds / np.maximum(behind - begin, 1.0)


def _last_sound(runs: Trajectories) -> Array:
    """The last frame in which the ego has not yet touched another, shape (scene,)."""
    sound = Batch.of(runs).sound[:, 0]
    return np.maximum(sound.shape[1] - 1 - np.argmax(sound[:, ::-1], axis=1), 0)


def _comfort(batch: Batch) -> dict[str, Array]:
    """Braking, jerk and lateral acceleration of the ego."""
    states, sound = batch.runs.states, batch.sound[:, 0]
    along, across = (1e-3 * one[:, 0] for one in (states.accel_lon, states.accel_lat))
    step = max(1, round(JERK_S / batch.interval_s))
    jerk = np.abs(along[:, step:] - along[:, :-step]) / (step * batch.interval_s)
    hard = reactions(batch, EGO)
    braked = hard.where(states.accel_lon[hard.place] < -1e3 * limit("hard_braking"))
    braked = episodes(braked, batch.interval_s)
    return {
        "jerk": _quantile(jerk, sound[:, step:]),
        "lateral": _quantile(np.abs(across), sound),
        "braking": np.where(sound, -along, 0.0).max(axis=1, initial=0.0),
        "hard_brakings": np.bincount(braked.simulation, minlength=len(sound)),
    }


def _quantile(values: Array, there: Array) -> Array:
    """The quantile of each scene, 0 without a value, shape (scene,)."""
    padded = np.pad(np.where(there, values, np.inf), ((0, 0), (0, 1)), constant_values=np.inf)
    ordered = np.sort(padded, axis=1)
    number = there.sum(axis=1)
    place = np.ceil(QUANTILE * number).astype(np.int64) - 1
    found = ordered[np.arange(len(values)), np.maximum(place, 0)]
    return np.where(number > 0, found, 0.0)
