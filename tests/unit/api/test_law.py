"""The documentation of the functions of law."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import overtaking as ot
from overtaking.api import law


def test_the_example_of_a_pack_judges_simulations():
    example = max(re.findall(r"(?:^ {4}.*\n|^\n)+", law.__doc__ or "", re.MULTILINE), key=len)
    names: dict[str, Any] = {}
    exec(textwrap.dedent(example), names)
    scenarios = ot.sample("pinto2023-physical", num_simulations=4, seed=1)
    labelled = ot.label(ot.simulate(scenarios), law=names["PACK"])
    assert labelled.findings.rule_codes == ("S1",)
    assert set(labelled.findings.verdict.ravel()) <= set(ot.Verdict)
