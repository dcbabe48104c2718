"""What drivers are compared by: every endpoint is a ratio of two weighted sums over scenes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from overtaking.labels.law.judging import stored_policy
from overtaking.labels.law.portugal import PORTUGAL

POLICY: Final = "default"
"""The policy of the law that counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint:
    """A ratio of two sums over scenes.

    Attributes:
        name: Short name.
        title: Its description.
        part: Column that is summed; see `measures`.
        whole: Column that it is divided by.
        unit: Unit of the ratio; empty for a share.
        scale: Factor from the ratio to the unit.
        is_good: Whether more of it is better; None where neither is.
        is_event: Whether `part` counts events, which may be rare.
    """

    name: str
    title: str
    part: str
    whole: str = "scenes"
    unit: str = ""
    scale: float = 1.0
    is_good: bool | None = False
    is_event: bool = True


PRIMARY: Final = (
    Endpoint(name="collision", title="collision of the ego, per scene", part="collision"),
    Endpoint(name="near_crash", title="near-crash of the ego, per scene", part="near_crash"),
    Endpoint(
        name="legal", title="no breach of the law, per scene", part="legal_default", is_good=True
    ),
    Endpoint(
        name="gained",
        title="time gained over staying in lane, per scene",
        part="gained",
        unit="s",
        is_good=True,
        is_event=False,
    ),
)
"""The endpoints of every evaluation, fixed beforehand and not corrected for their number."""


def _event(name: str, title: str, whole: str = "scenes", **settings: Any) -> Endpoint:
    return Endpoint(name=f"{name}_per_{whole}", title=title, part=name, whole=whole, **settings)


_PER_KM: Final[dict[str, Any]] = {"unit": "per 1000 km", "scale": 1000.0}

OUTCOME: Final = (
    _event("attempted", "attempts to overtake, per scene", is_good=None),
    _event("completed", "completed overtakes, per scene", is_good=True),
    _event("completed", "completed overtakes, per attempt", "attempted", is_good=True),
    _event("given_up", "given up or not completed, per attempt", "attempted"),
    _event("open", "open at the end of the simulation, per scene", is_good=None),
    _event("departed", "left the road or spun, per scene"),
    _event("struck", "struck by another vehicle, per scene"),
    _event("lawful", "lawful overtakes, per scene", is_good=True),
    _event("lawful", "lawful overtakes, per attempt", "attempted", is_good=True),
)

SAFETY: Final = (
    _event("collision", "collisions", "km", **_PER_KM),
    _event("collision_attempted", "collision, per attempt", "attempted"),
    _event("near_crashes", "near-crashes", "km", **_PER_KM),
    _event("near_crash_attempted", "near-crash, per attempt", "attempted"),
    _event("near_front", "less than 1.5 s to collision, per attempt", "attempted"),
)

COMFORT: Final = (
    _event("hard_brakings", "braking above 4 m/s²", "km", **_PER_KM),
    Endpoint(name="jerk", title="jerk, 95 % quantile", part="jerk", unit="m/s³", is_event=False),
    Endpoint(
        name="lateral",
        title="lateral acceleration, 95 % quantile",
        part="lateral",
        unit="m/s²",
        is_event=False,
    ),
    Endpoint(name="braking", title="hardest braking", part="braking", unit="m/s²", is_event=False),
)

LANE_CHANGES: Final = (
    _event("forced_3", "follower needs more than 3 m/s² (R79), per lane change", "changes"),
    _event("forced_37", "follower needs more than 3.7 m/s² (R157), per lane change", "changes"),
    _event("early", "moves less than 1 s after the indicator (R79), per lane change", "changes"),
    _event(
        "untimely", "crosses the line not 3 to 5 s after the indicator (R79), per change", "changes"
    ),
    _event("long", "5 s or more over the line (R79), per lane change", "changes"),
)

CONFLICTS: Final = (
    _event(
        "others_began", "conflicts that others began in the ego's lane, per scene", is_good=None
    ),
    _event("preventable", "of these, preventable contacts, per scene"),
    _event("own_began", "conflicts of the ego's own making, per scene"),
    _event("from_behind", "struck from behind, per scene", is_good=None),
)

LAW: Final = (
    _event("legal_paper", "no breach under paper, per scene", is_good=True),
    _event("legal_strict", "no breach under strict, per scene", is_good=True),
    _event("undecided", "a rule that applies is undecidable, per scene", is_good=None),
    *(
        _event(f"{one.code}_broken", f"{one.article}: {one.title}, broken", f"{one.code}_applies")
        for one in PORTUGAL.rules
        if one.code in stored_policy(POLICY).required
    ),
)

SECONDARY: Final = {
    "outcome": OUTCOME,
    "safety": SAFETY,
    "law": LAW,
    "comfort": COMFORT,
    "lane changes": LANE_CHANGES,
    "conflicts": CONFLICTS,
}
"""All others, by what they are about; their tests are corrected for their number."""

EVERY: Final = (*PRIMARY, *(one for group in SECONDARY.values() for one in group))
