"""The futures of a simulation as plain values, and texts for what they have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from overtaking.model.verdicts import OvertakeClass

if TYPE_CHECKING:
    from overtaking.analysis.whatif.fan import Fan

CONDITION_TEXTS = {
    "truth": "the others as they are: hindsight",
    "belief": "by what the ego notices at its start: its decision",
}
"""What the futures share: names in `analysis.whatif.fan.CONDITIONS`."""


def fan_title(condition_on: str) -> str:
    """The heading of a figure of shares over the instants."""
    return f"P(class | start at t), {CONDITION_TEXTS[condition_on]}"


def values_of_fan(one: Fan) -> dict[str, Any]:
    """A fan as plain values."""
    instants = []
    limits = {code: one.interval(code) for code in OvertakeClass if one.counts[:, code].any()}
    for place, time in enumerate(one.time.tolist()):
        enough = bool(one.is_enough[place])
        instants.append(
            {
                "told_s": round(time, 3),
                "pulls_out_s": _number(one.begun[place]),
                "futures": int(one.futures[place]),
                "tried": int(one.tried[place]),
                "shares": {
                    code.title: {
                        "share": _number(one.shares[place, code]),
                        "low": _number(rows[place, 0]) if enough else None,
                        "high": _number(rows[place, 1]) if enough else None,
                    }
                    for code, rows in limits.items()
                },
            }
        )
    return {
        "simulation": one.number,
        "condition_on": one.condition_on,
        "policy": one.policy,
        "pulled_out_s": one.actual,
        "instants": instants,
    }


def _number(value: float) -> float | None:
    return None if value != value else round(float(value), 4)
