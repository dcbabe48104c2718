"""Remedies of the German rules with checks of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.labels.explain.remedies import (
    see_oncoming_traffic,
)
from overtaking.labels.law.germany.opposite import O16

if TYPE_CHECKING:
    from collections.abc import Callable

    from overtaking.labels.explain.remedies import Find
    from overtaking.model.verdicts import Case, Finding


GERMAN: dict[Callable[[Case], Finding], Find] = {
    rule.check: find for rule, find in ((O16, see_oncoming_traffic),)
}
"""Remedies by the check of a rule. German rules that are not listed share the check of a Portuguese
rule, and with it the remedy in `REMEDIES`."""
