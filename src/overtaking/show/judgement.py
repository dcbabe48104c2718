"""The labels of one simulation as plain values: events, classes, and the law with its remedies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from overtaking.labels.law.rule import TextSource
from overtaking.model.overtake_events import NEVER, Outcome, OutcomeDetail
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.model.verdicts import Belief, OvertakeClass

if TYPE_CHECKING:
    from overtaking.labels.explanation import (
        BelievedFinding,
        Breach,
        Explanation,
        UndecidedRule,
    )
    from overtaking.labels.labelling import LabelledTrajectories
    from overtaking.labels.law.remedies import RequiredChange

Values = dict[str, Any]
"""A JSON object: names with units, plain Python values."""


class EventWords(NamedTuple):
    """The words for an event.

    Attributes:
        letter: Its mark on the time line; none is the symbol of a vehicle.
        symbol: The paper's symbol where it has one.
        sentence: What the ego does, with the symbols of `target` and `partner` filled in.
    """

    letter: str
    symbol: str
    sentence: str


EVENTS = {
    "following_begin": EventWords("F", "t_follow", "follows {target}"),
    "attempt": EventWords("A", "t_a", "begins to move out, to overtake {target}"),
    "line_crossed": EventWords("X", "t_x1", "has a corner over the line"),
    "overlap_begin": EventWords("O", "t_o1", "is alongside {target}"),
    "overlap_end": EventWords("P", "t_o2", "is wholly ahead of {target}"),
    "return_begin": EventWords("R", "t_b", "begins to move back"),
    "return_end": EventWords("H", "t_x2", "is wholly back in its lane, ahead of {target}"),
    "abort": EventWords("Q", "abort", "gives up and begins to move back"),
    "abort_end": EventWords("B", "back", "is wholly back in its lane, behind {target}"),
    "collision": EventWords("C", "collision", "{meets} {partner}"),
    "road_departure": EventWords("D", "departure", "leaves the driving lanes with its centre"),
    "spin": EventWords("S", "spin", "spins until it is across the road"),
    "drift": EventWords("W", "drift", "drifts to the left"),
    "began_before_recording": EventWords(
        "U", "under way", "had begun to move out before the recording"
    ),
}
"""The events, by the names of `model.overtake_events.OvertakeEvents`."""

_DECIMALS = 4
_MS_PER_S = 1000.0


def judge(labelled: LabelledTrajectories, explanation: Explanation) -> Values:
    """The labels of one simulation.

    Args:
        labelled: A batch of one simulation.
        explanation: Why it is judged so.

    Returns:
        Values of plain Python types, in SI units.
    """
    events, labels = labelled.events, labelled.labels
    interval = labelled.signals.frame_interval_ms
    return {
        "outcome": Outcome(int(labels.outcome[0])).name.lower(),
        "detail": OutcomeDetail(int(labels.detail[0])).name.lower(),
        "target": _slot(events.target_slot[0]),
        "collision_partner": _slot(events.collision_slot[0]),
        "struck_by_partner": bool(events.was_struck[0]),
        "num_attempts": int(events.num_attempts[0]),
        "was_intended": _was_intended(labelled),
        "num_drifts": int(events.num_drifts[0]),
        "num_passed": int(events.num_passed[0]),
        "events": _events(labelled),
        "rules_version": labelled.findings.version,
        "policies": _policies(labelled, explanation),
        "broken": [_breach(each, interval) for each in explanation.breaches],
        "undecidable": [_doubt(each) for each in explanation.undecided],
        "kept": [rule.code for rule in explanation.kept],
        "not_applicable": [rule.code for rule in explanation.inapplicable],
        "text_not_read": [
            rule.code for rule in explanation.decided if rule.text_source is not TextSource.READ
        ],
    }


def thought(of: BelievedFinding) -> Values:
    """Verdict of the law on one neighbour at a decision."""
    believed = of.believed_margin
    return {
        "rule": of.rule_code,
        "margin_m": round(of.margin, _DECIMALS),
        "believed_margin_m": None if believed is None else round(believed, _DECIMALS),
        "belief": _belief(of.belief),
    }


def _was_intended(labelled: LabelledTrajectories) -> bool | None:
    """Whether the ego's driver meant its attempt; None without one, or if that is not recorded."""
    events = labelled.events
    is_known = events.has_attempt[0] and not labelled.trajectories.is_excerpt
    return bool(events.was_intended[0]) if is_known else None


def _slot(vehicle: int) -> int | None:
    """A slot, None where there is no vehicle to name."""
    return None if vehicle == NO_VEHICLE else int(vehicle)


def _seconds(frame: int, interval_ms: int) -> float:
    return frame * interval_ms / _MS_PER_S


def _events(labelled: LabelledTrajectories) -> list[Values]:
    """The events that happened, in the order of time."""
    frames = {name: int(getattr(labelled.events, name)[0]) for name in EVENTS}
    interval = labelled.signals.frame_interval_ms
    return [
        {
            "event": name,
            "symbol": EVENTS[name].symbol,
            "frame": frame,
            "time_s": _seconds(frame, interval),
        }
        for name, frame in sorted(frames.items(), key=lambda item: item[1])
        if frame != NEVER
    ]


def _policies(labelled: LabelledTrajectories, explanation: Explanation) -> dict[str, Values]:
    """The class under each policy, and the rules that made it so."""
    return {
        name: {
            "class": OvertakeClass(int(labelled.labels.classes[0, place])).title,
            "broken": [b.rule.code for b in explanation.breaches if name in b.policies],
            "undecidable": [d.rule.code for d in explanation.undecided if name in d.policies],
        }
        for place, name in enumerate(labelled.labels.policies)
    }


def _breach(breach: Breach, interval_ms: int) -> Values:
    rule = breach.rule
    return {
        "rule": rule.code,
        "id": rule.id,
        "law": rule.article,
        "title": rule.title,
        "gloss": rule.gloss,
        "text": rule.text_source.value,
        "duty_of_ego": rule.is_duty_of_ego,
        "required_by": list(breach.policies),
        "severity": breach.severity.name.lower(),
        "belief": _belief(breach.belief),
        "margin": round(breach.margin, _DECIMALS),
        "unit": rule.unit,
        "first_frame": breach.first_frame,
        "last_frame": breach.last_frame,
        "from_s": _seconds(breach.first_frame, interval_ms),
        "to_s": _seconds(breach.last_frame, interval_ms),
        "remedies": [
            [_change(change, interval_ms) for change in remedy] for remedy in breach.remedies
        ],
    }


def _change(change: RequiredChange, interval_ms: int) -> Values:
    frame = change.frame
    return {
        "quantity": change.quantity.value,
        "unit": change.unit,
        "actual": round(change.actual, _DECIMALS),
        "needed": round(change.needed, _DECIMALS),
        "by": round(change.by, _DECIMALS),
        "frame": frame,
        "time_s": None if frame is None else _seconds(frame, interval_ms),
        "vehicle": change.slot,
    }


def _doubt(doubt: UndecidedRule) -> Values:
    return {
        "rule": doubt.rule.code,
        "title": doubt.rule.title,
        "law": doubt.rule.article,
        "required_by": list(doubt.policies),
        "not_recorded": list(doubt.missing_inputs),
        "text": doubt.rule.text_source.value,
        "text_not_read": doubt.is_text_unread,
    }


def _belief(belief: Belief) -> str | None:
    """The word for a belief, None where there is nothing to believe."""
    return None if belief is Belief.NONE else belief.name.lower()
