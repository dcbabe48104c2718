"""From outcome and law to the classes of the paper."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.elementary import Mask
from overtaking.labels.events.outcome import detail, outcome
from overtaking.model.events import Detail, Events, Outcome
from overtaking.model.labels import Labels, OvertakeClass

U8 = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What a policy makes of the rules; every array has shape (simulation,).

    Attributes:
        policy: Its name.
        allows_undecided: Whether an overtake counts as legal although a rule is undecidable.
        censors_open: Whether an overtake that the recording cuts off is left out.
        is_legal: Whether no required rule is broken, as far as can be decided.
        num_broken: Required rules that are broken.
        num_undecidable: Required rules that apply and cannot be decided.
    """

    policy: str
    allows_undecided: bool
    censors_open: bool
    is_legal: Mask
    num_broken: U8
    num_undecidable: U8


def classify(events: Events, judgements: Sequence[Judgement], frame_interval_ms: int) -> Labels:
    """The labels of a batch.

    Args:
        events: What happened.
        judgements: What each policy makes of the law.
        frame_interval_ms: Time between frames [ms].
    """
    how, way = outcome(events), detail(events, frame_interval_ms)
    return Labels(
        policies=tuple(each.policy for each in judgements),
        outcome=how,
        detail=way,
        classes=np.stack([_classes(how, way, each) for each in judgements], axis=1),
        is_legal=np.stack([each.is_legal for each in judgements], axis=1),
        num_broken=np.stack([each.num_broken for each in judgements], axis=1),
        num_undecidable=np.stack([each.num_undecidable for each in judgements], axis=1),
    )


def _classes(how: U8, way: U8, judged: Judgement) -> U8:
    undecided = (judged.num_undecidable > 0) & (not judged.allows_undecided)
    completed = how == Outcome.COMPLETED
    cut_off = (way == Detail.OPEN_AT_HORIZON) & judged.censors_open
    cases: list[tuple[Mask, OvertakeClass]] = [
        (how == Outcome.COLLISION, OvertakeClass.UNSUCCESS_COL),
        (how == Outcome.NO_ATTEMPT, OvertakeClass.NO_ATTEMPT),
        (completed & (judged.num_broken > 0), OvertakeClass.SUCCESS_I),
        (completed & undecided, OvertakeClass.SUCCESS_U),
        (completed, OvertakeClass.SUCCESS_L),
        (cut_off, OvertakeClass.CENSORED),
    ]
    conditions, classes = zip(*cases, strict=True)
    return np.select(conditions, classes, OvertakeClass.UNSUCCESS_NCOL).astype(np.uint8)
