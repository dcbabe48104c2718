"""Overtaking, § 5(2) sentence 1: oncoming traffic."""

from overtaking.labels.law.oncoming_traffic import BACK_BEFORE_ONCOMING, L24
from overtaking.labels.law.rule import Grade, adopt

O3 = adopt(
    L24,
    id="de.stvo.5-2-1@2013",
    code="O3",
    article="§ 5(2) sentence 1 StVO",
    title="Oncoming traffic",
    predicate=BACK_BEFORE_ONCOMING,
    gloss="Only those may overtake who can see that they will not hinder oncoming traffic at any "
    "time.",
    grade=Grade.SERIOUS,
    source="de-stvo-2013",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)
