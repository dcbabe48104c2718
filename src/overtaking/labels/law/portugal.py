"""The Portuguese rules of overtaking: an interpretation, not legal advice."""

from overtaking.labels.law.alongside import L1, L10, L11, L22
from overtaking.labels.law.following import L3, L28
from overtaking.labels.law.lamps_and_indicators import L18, L19
from overtaking.labels.law.lines_and_lanes import L2, L16, L20
from overtaking.labels.law.oncoming_traffic import L24, L25, L26, L27
from overtaking.labels.law.returning import L8, L9, L21, L23
from overtaking.labels.law.rule import Pack
from overtaking.labels.law.sight import L14, L15, L14s, L15s
from overtaking.labels.law.speed import L12, L13
from overtaking.labels.law.starting import L4, L5, L6, L7
from overtaking.labels.law.texts import edition, with_texts
from overtaking.labels.law.zones import L17, L29

# fmt: off
_RULES = (
    L1, L2, L3, L4, L5, L6, L7, L8, L9, L10, L11, L12, L13, L14, L14s, L15, L15s, L16, L17, L18,
    L19, L20, L21, L22, L23, L24, L25, L26, L27, L28, L29,
)
# fmt: on

PORTUGAL = Pack(
    name="pt",
    version="pt-2@2013",
    rules=with_texts("pt", _RULES),
    edition=edition("pt"),
    severities="Articles 145 and 146 of the Highway Code",
    two_way_version="+opposite-1",
)
