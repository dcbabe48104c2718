"""The German rules of overtaking (StVO): an interpretation, not legal advice.

A breach is serious where the catalogue of fines gives a point for it, very serious with two, else
light. A rule whose text was not read is undecidable.
"""

from overtaking.labels.law.germany.distances import A1, A2, A3, A4
from overtaking.labels.law.germany.driving import B1, F1, F2, G1, S1, V1, V2, V3, V1s
from overtaking.labels.law.germany.opposite import O9, O14, O15, O16, O17
from overtaking.labels.law.germany.overtaking import (
    O1,
    O2,
    O3,
    O4,
    O5,
    O6,
    O7,
    O8,
    O10,
    O11,
    O12,
    O13,
)
from overtaking.labels.law.rule import Pack
from overtaking.labels.law.texts import edition, with_texts

# fmt: off
_RULES = (
    G1, F1, F2, V1, V1s, V2, V3, A1, A2, A3, A4, O1, O2, O3, O4, O5, O6, O7, O8, O9, O10, O11,
    O12, O13, O14, O15, O16, O17, B1, S1,
)
# fmt: on

GERMANY = Pack(
    name="de",
    version="de-2@2013",
    rules=with_texts("de", _RULES),
    edition=edition("de"),
    severities="the catalogue of fines and points: light without a point, serious with one, very "
    "serious with two",
    accepts_unread_articles=False,
)
