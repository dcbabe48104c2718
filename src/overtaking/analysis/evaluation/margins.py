"""How near attempts came to a collision, and to the border of the law."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from overtaking.analysis.evaluation.endpoints import POLICY
from overtaking.labels.law.judging import stored_policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.verdicts import Verdict

if TYPE_CHECKING:
    from overtaking.analysis.validation.tally import Array
    from overtaking.labels.labelling import LabelledTrajectories

_SAFETY: Final = {
    "ttc": ("least time to collision ahead", "s"),
    "time_gap": ("least time gap ahead", "s"),
    "drac": ("largest deceleration needed ahead", "m/s²"),
    "rss": ("gap minus that of RSS", "m"),
    "entry": ("encroachment at the entry", "s"),
    "return": ("encroachment at the return", "s"),
}
_LAW: Final = {
    one.code: (f"{one.code}: {one.title}", one.unit)
    for one in PORTUGAL.rules
    if one.code in stored_policy(POLICY).required
}

MARGINS: Final = _SAFETY | _LAW
"""Description and unit of each margin; those of rules are negative in a breach."""


def of_batch(labelled: LabelledTrajectories) -> dict[str, tuple[Array, Array]]:
    """Each margin, and the scenes that have it, both of shape (scene,)."""
    safety, findings = labelled.safety, labelled.findings
    has_leader = labelled.events.has_attempt & safety.leader.valid[:, 0]
    found: dict[str, tuple[Array, Array]] = {
        "ttc": (safety.leader.ttc[:, 0], has_leader),
        "time_gap": (safety.leader.time_gap[:, 0], has_leader),
        "drac": (safety.leader.drac[:, 0], has_leader),
        "rss": (safety.rss_margin[:, 0], has_leader),
        "entry": (safety.entry_pet, labelled.events.has_attempt),
        "return": (safety.return_pet, labelled.events.has_attempt),
    }
    for code in _LAW:
        place = findings.rule_codes.index(code)
        known = np.isin(findings.verdict[:, place], (Verdict.LEGAL, Verdict.ILLEGAL))
        found[code] = (findings.margin[:, place], known)
    return {name: (values, there & np.isfinite(values)) for name, (values, there) in found.items()}
