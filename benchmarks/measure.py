"""What a benchmark reports: a number, its unit, and whether it meets its target."""

import argparse
import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """One measured number.

    Attributes:
        name: What was measured.
        value: The number.
        unit: Its unit.
        at_least: Target from below, or None.
        at_most: Target from above, or None.
        note: How it was measured, or what it is made of.
    """

    name: str
    value: float
    unit: str
    at_least: float | None = None
    at_most: float | None = None
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without one."""
        if self.at_least is None and self.at_most is None:
            return None
        low = self.at_least is None or self.value >= self.at_least
        return low and (self.at_most is None or self.value <= self.at_most)

    def line(self) -> str:
        """The number, its target and the verdict, on one line."""
        target = "" if self.at_least is None else f">= {number(self.at_least)}"
        target = target if self.at_most is None else f"<= {number(self.at_most)}"
        verdict = {True: "met", False: "MISSED", None: ""}[self.met]
        text = f"{self.name:<46} {number(self.value):>12} {self.unit:<16} {target:>12} {verdict:<7}"
        return f"{text} {self.note}".rstrip()

    def values(self) -> dict[str, Any]:
        """The same for machines."""
        return {**asdict(self), "met": self.met}


def number(value: float) -> str:
    """A number with three digits that matter, or all of a large one."""
    if value == round(value) or abs(value) >= 1000.0:
        return f"{value:,.0f}"
    return f"{value:.3g}"


def load_note() -> str:
    """How busy the machine is: others on it make every number worse."""
    one, five, _ = os.getloadavg()
    return f"load {one:.1f} now, {five:.1f} over five minutes, on {os.cpu_count()} cores"


def parser(description: str | None) -> argparse.ArgumentParser:
    """A command line that every benchmark understands."""
    made = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    made.add_argument("--json", action="store_true", help="print the numbers for machines")
    return made


def report(measures: list[Measure], *, as_json: bool) -> int:
    """Print numbers; 1 if a target is missed."""
    if as_json:
        print(json.dumps([measure.values() for measure in measures], indent=1))
    else:
        for measure in measures:
            print(measure.line())
        print(load_note())
    return 1 if any(measure.met is False for measure in measures) else 0
