"""Driving in general: §§ 1 to 3, 7, 17 and 18, and signs 295 and 296."""

from overtaking.labels.law.rule import Grade, adopt
from overtaking.labels.law.sight import L14, STOPS_FOR_LIT, STOPS_FOR_UNLIT, L14s

_STVO = "de-stvo-2013"

_LEADER = (
    "A leader does not shorten the visible space: its brake lamps announce what it meets, and A1 "
    "is the rule for it."
)

V1 = adopt(
    L14,
    id="de.stvo.3-1-4@2013",
    code="V1",
    article="§ 3(1) sentence 4 StVO",
    title="Stop in the visible space",
    predicate=f"{STOPS_FOR_LIT} {_LEADER}",
    grade=Grade.SERIOUS,
    gloss="Drive only so fast that one can stop within the way that one overlooks.",
    source=_STVO,
)

V1s = adopt(
    L14s,
    id="de.stvo.3-1-4.unlit@2013",
    code="V1s",
    article="§ 3(1) sentence 4 StVO, strictly",
    title="Stop in the visible space, for the unlit",
    predicate=f"{STOPS_FOR_UNLIT} {_LEADER}",
    grade=Grade.SERIOUS,
    gloss=V1.gloss,
    source=_STVO,
)
