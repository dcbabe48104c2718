"""What is said of one simulation, for people."""

from dataclasses import dataclass

import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What is said of one simulation.

    Attributes:
        simulation: Its number.
        outcome: How it ended, legality aside: `completed`, `not_completed`, `collision`,
            `no_attempt`.
        detail: How it came to that.
        classes: Class under each policy, by its name.
        phases: Time of each event that happened [s], in order.
        rules: One row per rule: verdict, margin, first and last frame of a breach, article,
            severity, and whether the driver could know.
    """

    simulation: int
    outcome: str
    detail: str
    classes: dict[str, str]
    phases: dict[str, float]
    rules: pd.DataFrame

    @property
    def broken(self) -> pd.DataFrame:
        """The rules that are broken."""
        return self.rules[self.rules["verdict"] == "illegal"]


def verdict_of(
    simulation: int, labels: pd.DataFrame, events: pd.DataFrame, findings: pd.DataFrame
) -> Verdict:
    """What the tables of labels say of one simulation.

    Args:
        simulation: Its number.
        labels: Its rows in the table of that name.
        events: Its rows in the table of that name.
        findings: Its rows in the table of that name.
    """
    ordered = events.sort_values("time_s")
    return Verdict(
        simulation=simulation,
        outcome=str(labels["outcome"].iloc[0]),
        detail=str(labels["detail"].iloc[0]),
        classes=dict(zip(labels["policy"].astype(str), labels["class"].astype(str), strict=True)),
        phases=dict(zip(ordered["event"].astype(str), ordered["time_s"], strict=True)),
        rules=findings.drop(columns="simulation").set_index("rule"),
    )
