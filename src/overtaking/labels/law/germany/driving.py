"""Driving in general: §§ 1 to 3, 7, 17 and 18, and signs 295 and 296."""

import numpy as np

from overtaking.core.arrays import F32
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.case import (
    general_limits,
    judged_span,
    meteorological_range,
    speed_limit_bounds,
)
from overtaking.labels.law.margins import (
    UNCONSTRAINED,
    finding_over_span,
)
from overtaking.labels.law.numbers import amount, bare
from overtaking.labels.law.rule import Grade, Rule, adopt
from overtaking.labels.law.sight import L14, STOPS_FOR_LIT, STOPS_FOR_UNLIT, L14s
from overtaking.labels.law.speed import (
    L12,
    OF_SPEED,
    WITHIN_LIMIT,
    keeps_limit,
    limit_at_worst_frame,
    limit_error,
    with_breaches_undecidable,
)
from overtaking.model.verdicts import Case, Finding, Severity, Verdict

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


def limits(case: Case, ahead: float = 0.0) -> tuple[F32, F32]:
    """`speed_limit_bounds` by the Road Traffic Order."""
    return speed_limit_bounds(case, general_limits("law_de"), ahead)


def _within_limit(case: Case) -> Finding:
    """Speed never exceeds the posted limit, nor the limit of the class of vehicle on this road."""
    finding = keeps_limit(case, limits(case))
    severity = np.full(len(finding.verdict), Severity.LIGHT, np.uint8)
    for grade in ("serious", "very_serious"):
        severity += (-finding.margin > constant(f"law_de.excess.{grade}")).astype(np.uint8)
    broken = finding.verdict == Verdict.ILLEGAL
    return finding.replace(severity=np.where(broken, severity, np.uint8(Severity.NONE)))


V2 = adopt(
    L12,
    id="de.stvo.3-3@2013",
    code="V2",
    article="§ 3(3) and § 18(5) StVO; sign 274",
    title="Speed limit",
    grade=Grade.BY_BREACH,
    gloss="Keep to the limit that is posted and to the general one: in towns "
    f"{amount('law_de.limits.town.light')}, elsewhere {bare('law_de.limits.other.light')}, for "
    f"trucks {bare('law_de.limits.other.heavy')}; on motorways none, for trucks "
    f"{bare('law_de.limits.motorway.heavy')}.",
    predicate=(
        f"{WITHIN_LIMIT} Over {amount('law_de.excess.serious')} serious, over "
        f"{bare('law_de.excess.very_serious')} very serious."
    ),
    source=_STVO,
    check=_within_limit,
    spread=limit_error(limits),
    limit=lambda case: limit_at_worst_frame(case, limits(case)),
)


def _slow_in_fog(case: Case) -> Finding:
    """Where one sees less than 50 m for fog or rain, speed is 50 km/h at most."""
    thick, may_be = (
        meteorological_range(case) < constant("law_de.fog.sight"),
        case.trajectories.unknown,
    )
    thick |= "weather" in may_be
    margin = constant("law_de.fog.speed") - case.signals.speed
    minimum = finding_over_span(np.where(thick[:, None], margin, UNCONSTRAINED), judged_span(case))
    return with_breaches_undecidable(minimum) if "weather" in may_be else minimum


V3 = Rule(
    id="de.stvo.3-1-3@2013",
    code="V3",
    article="§ 3(1) sentence 3 StVO",
    title="Slowly in fog",
    gloss=f"Drive no faster than {amount('law_de.fog.speed')} if one sees less than "
    f"{amount('law_de.fog.sight')} for fog, snow or rain.",
    predicate=(
        "At every frame, the meteorological optical range being under "
        f"{amount('law_de.fog.sight')}: speed <= {amount('law_de.fog.speed')}."
    ),
    unit="m/s",
    grade=Grade.SERIOUS,
    source=_STVO,
    conditional_inputs=frozenset(["weather"]),
    applies_without_attempt=True,
    check=_slow_in_fog,
    spread=OF_SPEED,
)
