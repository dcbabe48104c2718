"""The side of oncoming traffic and places where one does not overtake: §§ 5, 19, 26, and signs."""

from overtaking.labels.law.margins import (
    finding_at_frame,
    finding_not_applicable,
)
from overtaking.labels.law.numbers import amount
from overtaking.labels.law.rule import Grade, Rule, Spread
from overtaking.labels.law.sight import (
    SEES_ONCOMING,
    crossing_frame,
    passing_sight_margin,
    sight_error,
)
from overtaking.model.verdicts import Case, Finding

_STVO = "de-stvo-2013"
_SENTENCE = "§ 5(2) sentence 1 StVO"
_SEE = (
    "Only those may overtake who can see that they will not hinder oncoming traffic at any time of "
    "the overtake."
)
_FINE = "100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)"


def _oversees(case: Case) -> Finding:
    """As the line is crossed, air and road show as much as the overtake takes."""
    if not case.trajectories.road.is_two_way:
        return finding_not_applicable(case.signals.num_simulations)
    return finding_at_frame(
        crossing_frame(case), passing_sight_margin(case), case.events.has_attempt
    )


O16 = Rule(
    id="de.stvo.5-2-1.sight@2013",
    code="O16",
    article=_SENTENCE,
    title="Sight of the road ahead",
    gloss=_SEE,
    predicate=SEES_ONCOMING,
    unit="m",
    grade=Grade.SERIOUS,
    source=_STVO,
    required_inputs=frozenset(["weather"]),
    check=_oversees,
    spread=Spread(
        formula=f"(time on the left + {amount('law.sight.oncoming_margin')}) sv",
        standard_error=sight_error,
    ),
    fine=_FINE,
    only_two_way_roads=True,
)
