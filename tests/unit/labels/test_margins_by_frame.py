"""Margins frame by frame agree with the findings."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.support.overtakes import passing
from tests.support.worlds import wide_road

import overtaking as ot
from overtaking.labels.explanation import margins_by_frame
from overtaking.labels.labelling import label
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import judge_pack, policies_of_law
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.verdicts import Verdict


@pytest.mark.parametrize(
    ("pack", "codes"),
    [
        (PORTUGAL, ("L3", "L10", "L12", "L14", "L14s")),
        (GERMANY, ("A1", "O7", "O10", "V1", "V1s", "V2")),
    ],
)
def test_the_smallest_margin_by_frame_is_the_margin_of_the_finding(pack, codes):
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=64, seed=5))
    labelled = label(runs, pack=pack, policies=policies_of_law(pack.name))
    num_checked = dict.fromkeys(codes, 0)
    for number in range(64):
        simulation = labelled.select(np.array([number]))
        series = margins_by_frame(simulation, pack)
        for column, code in enumerate(simulation.findings.rule_codes):
            is_decided = simulation.findings.verdict[0, column] in (Verdict.LEGAL, Verdict.ILLEGAL)
            assert (code in series) == (code in num_checked and is_decided)
            if code in series:
                num_checked[code] += 1
                assert np.nanmin(series[code]) == simulation.findings.margin[0, column]
                breach_frames = np.flatnonzero(series[code] < 0)
                if simulation.findings.verdict[0, column] == Verdict.ILLEGAL:
                    ends = (
                        simulation.findings.first_frame[0, column],
                        simulation.findings.last_frame[0, column],
                    )
                    assert (breach_frames[0], breach_frames[-1]) == ends
    # O10 is about bicycles, and few targets are bicycles.
    assert min(count for code, count in num_checked.items() if code != "O10") > 5


@pytest.mark.parametrize(("kind", "needed"), [("town", 1.5), ("other", 2.0)])
def test_the_margin_beside_a_bicycle_depends_on_the_kind_of_road(kind, needed):
    road = dataclasses.replace(wide_road(), kind=kind)
    passed_bicycle = passing(2.4 / 3.75, target={"kind": "B"}, road=road)
    labelled = label(passed_bicycle.trajectories, pack=GERMANY, policies=policies_of_law("de"))
    # The tracks of the fixture show no events; the fixture states them.
    labelled = labelled.replace(
        events=passed_bicycle.events, findings=judge_pack(GERMANY, passed_bicycle)
    )
    series = margins_by_frame(labelled, GERMANY)["O10"]
    gap = passed_bicycle.target.lateral_gap[0]
    is_judged = np.isfinite(series)
    assert is_judged.any()
    np.testing.assert_allclose(series[is_judged], gap[is_judged] - needed, atol=1e-6)
