"""L9: return to the right as soon as that is safe."""

import numpy as np

from overtaking.labels.law.engine import duty_to_return
from overtaking.labels.law.frames import Span, frames_of, manoeuvre
from overtaking.labels.law.rule import Check, Grade, Rule, decided
from overtaking.labels.signals.frames import seconds_of
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.world.constants import known


def check(case: Case) -> Check:
    """With the target behind and room in the slower lane, the ego does not stay for over 8 s."""
    events = case.events
    passed, stop = events.overlap_end != NEVER, manoeuvre(case).stop
    over = Span(start=np.where(passed, events.overlap_end, stop + 1), stop=stop)
    first, length = duty_to_return(case, over)
    allowed = frames_of(case, known("law.return.within"))
    margin = known("law.return.within") - seconds_of(case, length)
    # The frame in which it had been due for so long, up to the last in which it still was.
    return decided(passed & over.exists, margin, first + allowed, first + length - 1)


RULE = Rule(
    id="pt.ce.38-4@2013",
    code="L9",
    law="Articles 38(4) and 13(3)",
    title="Duty to return",
    gloss="Return to the right as soon as the manoeuvre is done and this is safe.",
    predicate="From overlap_end on: the ego never stays out of its original lane for more than 8 "
    "s on end in which the target is max(2 s, safe distance) or more behind it and the lane to "
    "the right is free: room ahead and behind, and no vehicle reached within 10 s. Not in the "
    "lane of oncoming traffic, for which there is L24.",
    unit="s",
    grade=Grade.BY_ROAD,
    needs=frozenset(["weather"]),
    check=check,
)
