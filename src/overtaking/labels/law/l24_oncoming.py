"""L24: be back before oncoming traffic is near."""

import numpy as np

from overtaking.core.elementary import maximum
from overtaking.labels.law.frames import instant, is_two_way
from overtaking.labels.law.others import others_at
from overtaking.labels.law.rule import Check, Grade, Rule, inapplicable
from overtaking.labels.signals.frames import at
from overtaking.model.events import NEVER
from overtaking.model.labels import Case
from overtaking.world.constants import known

_ENDLESS = np.float32(3.0e38)


def check(case: Case) -> Check:
    """When the ego is back, the first oncoming vehicle is 1 s of both speeds and 2 s away."""
    if not is_two_way(case.trajectories.road):
        return inapplicable(case.signals.num_simulations)
    events = case.events
    back = np.where(events.return_end != NEVER, events.return_end, events.back)
    others = others_at(case, back)
    meets = others.valid & others.oncoming & (others.lead < 0)
    both = known("law.oncoming.time") * (others.speed + at(case.signals.speed, back)[:, None])
    alone = known("law.oncoming.encroachment") * others.speed
    margin = np.where(meets, others.gap - maximum(both, alone), _ENDLESS).min(axis=1)
    was_out = events.line_crossed != NEVER
    return instant(back, margin, was_out & meets.any(axis=1))


RULE = Rule(
    id="pt.ce.38-1.oncoming@2013",
    code="L24",
    law="Article 38(1)",
    title="Oncoming traffic",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic from the "
    "opposite direction.",
    predicate="On two-way roads, at return_end or back: gap to each oncoming vehicle >= 1 s (v + "
    "v_oncoming), and it reaches the place that the ego has left after 2 s or more.",
    unit="m",
    grade=Grade.BY_ROAD,
    check=check,
)
