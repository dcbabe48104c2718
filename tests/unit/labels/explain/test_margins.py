"""Margins frame by frame agree with the findings."""

from __future__ import annotations

import numpy as np

import overtaking as ot
from overtaking.labels.explain.margins import margins
from overtaking.model.labels import Verdict


def test_least_margin_is_that_of_the_finding():
    labelled = ot.label(ot.simulate(ot.sample("pinto2023-physical", 64, seed=5)))
    seen = dict.fromkeys(("L3", "L10", "L12", "L14", "L14s"), 0)
    for number in range(64):
        one = labelled.select(np.array([number]))
        found = margins(one)
        for place, code in enumerate(one.findings.rules):
            is_decided = one.findings.verdict[0, place] in (Verdict.LEGAL, Verdict.ILLEGAL)
            assert (code in found) == (code in seen and is_decided)
            if code in found:
                seen[code] += 1
                assert np.nanmin(found[code]) == one.findings.margin[0, place]
                broken = np.flatnonzero(found[code] < 0)
                if one.findings.verdict[0, place] == Verdict.ILLEGAL:
                    ends = one.findings.first[0, place], one.findings.last[0, place]
                    assert (broken[0], broken[-1]) == ends
    assert min(seen.values()) > 5
