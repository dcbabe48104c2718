"""Explanations agree with the findings that they explain, and know what the driver believed."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.cases import Belief as Believed
from tests.support.cases import Track
from tests.support.overtakes import crossing

import overtaking as ot
from overtaking.labels.explanation import believed_findings, explain
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.law.judging import STORED_POLICIES, Policy, stored_policy
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Pack
from overtaking.model.trajectories import (
    ManoeuvreKind,
    PerceivedVehicle,
)
from overtaking.model.verdicts import Belief, Verdict

NUM_SIMULATIONS = 48
FAR, NEAR = 60.0, 10.0
"""Gaps behind a leader of one's own speed, 30 m/s: lawful and not [m]."""


@pytest.fixture(scope="module")
def labelled() -> LabelledTrajectories:
    """Enough simulations for most rules to be broken in some."""
    return ot.label(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=NUM_SIMULATIONS, seed=1))
    )


def test_each_rule_is_broken_or_doubtful_or_kept_or_inapplicable_as_found(labelled):
    codes = np.array(labelled.findings.rule_codes)
    for simulation in range(NUM_SIMULATIONS):
        told = explain(labelled, simulation)
        verdict = labelled.findings.verdict[simulation]
        parts = {
            Verdict.ILLEGAL: [each.rule.code for each in told.breaches],
            Verdict.UNDECIDABLE: [each.rule.code for each in told.undecided],
            Verdict.LEGAL: [rule.code for rule in told.kept],
            Verdict.NOT_APPLICABLE: [rule.code for rule in told.inapplicable],
        }
        for kind, of_kind in parts.items():
            assert of_kind == codes[verdict == kind].tolist()


def test_breaches_repeat_margin_frames_severity_and_belief_of_the_findings(labelled):
    seen = set()
    for simulation in range(NUM_SIMULATIONS):
        findings = labelled.findings.select(np.array([simulation]))
        for each in explain(labelled, simulation).breaches:
            place = (0, findings.rule_codes.index(each.rule.code))
            assert each.margin == findings.margin[place] < 0
            assert (each.first_frame, each.last_frame) == (
                findings.first_frame[place],
                findings.last_frame[place],
            )
            assert each.severity == findings.severity[place]
            assert each.belief == findings.belief[place]
            assert each.remedies
            seen.add(each.rule.code)
    assert len(seen) >= 12


def test_the_policies_of_a_breach_are_those_that_count_it(labelled):
    for simulation in range(NUM_SIMULATIONS):
        told = explain(labelled, simulation).breaches
        for place, one in enumerate(STORED_POLICIES):
            counted = sum(one.name in each.policies for each in told)
            assert counted == labelled.labels.num_broken[simulation, place]


def test_without_weather_the_rules_that_need_it_are_named_with_what_is_missing(labelled):
    runs = labelled.trajectories.replace(unknown=frozenset(["weather", "lamps"]))
    told = explain(label(runs), 0)
    doubts = {each.rule.code: each for each in told.undecided}
    assert "weather" in doubts["L14"].missing_inputs
    assert doubts["L14s"].missing_inputs == ("lamps", "weather")
    assert doubts["L14s"].policies == ("strict",)
    assert all(each.missing_inputs for each in told.undecided)
    assert "L14" in stored_policy("default").required


def test_the_thought_of_the_deciding_decision_is_the_belief_of_the_finding(labelled):
    compared = 0
    for simulation in range(NUM_SIMULATIONS):
        told = explain(labelled, simulation)
        one = labelled.select(np.array([simulation]))
        pulls = [
            each for each in told.believed
            if one.trajectories.percepts.kind[0, each.percept] == ManoeuvreKind.PULL_OUT
        ]  # fmt: skip
        if len({each.percept for each in pulls}) != 1 or one.events.attempt[0] < 0:
            continue
        for each in pulls:
            finding = Belief(
                int(one.findings.belief[0, one.findings.rule_codes.index(each.rule_code)])
            )
            if finding is not Belief.NONE:
                assert each.belief is finding
                compared += 1
    assert compared >= 10


def leader(gap: float, true_gap: float, **changes) -> Believed:
    return Believed(frame=50, gap=gap, true_gap=true_gap, **changes)


@pytest.mark.parametrize(
    ("believed", "belief"),
    [
        (leader(FAR, FAR), Belief.LEGAL),
        (leader(FAR, NEAR), Belief.MISTAKEN),
        (leader(NEAR, NEAR), Belief.KNOWINGLY_ILLEGAL),
        (leader(NEAR, FAR), Belief.LUCKY),
        (leader(0.0, NEAR, detected=False), Belief.MISTAKEN),
    ],
)
def test_a_driver_is_right_or_mistaken_or_knows_or_is_lucky(believed, belief):
    (thought,) = believed_findings(crossing(beliefs=(believed,)), PORTUGAL)
    assert (thought.perceived, thought.rule_code, thought.belief) == (
        PerceivedVehicle.LEADER,
        "L3",
        belief,
    )
    # At equal speeds a second of way is asked for: 30 m.
    assert thought.margin == pytest.approx(believed.true_gap - 30.0, abs=1e-3)
    if believed.detected:
        assert thought.believed_margin == pytest.approx(believed.gap - 30.0, abs=1e-3)
    else:
        assert thought.believed_margin is None


@pytest.mark.parametrize(
    ("kind", "whom", "code"),
    [
        (ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_LEADER, "L4"),
        (ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_FOLLOWER, "L5"),
        (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_LEADER, "L8"),
        (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_FOLLOWER, "L8"),
    ],
)
def test_each_neighbour_at_each_decision_has_its_rule(kind, whom, code):
    one = crossing(Track(s=40.0, lane=1), beliefs=(leader(FAR, NEAR, kind=kind, whom=whom),))
    (thought,) = believed_findings(one, PORTUGAL)
    assert (thought.perceived, thought.rule_code, thought.belief) == (whom, code, Belief.MISTAKEN)


@pytest.mark.parametrize(
    ("kind", "whom", "rear", "lead"),
    [
        (ManoeuvreKind.PULL_OUT, PerceivedVehicle.LEADER, 30.0, 20.0),
        (ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_LEADER, 30.0, 20.0),
        (ManoeuvreKind.PULL_OUT, PerceivedVehicle.NEW_FOLLOWER, 40.0, 30.0),
        (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_LEADER, 30.0, 20.0),
        (ManoeuvreKind.RETURN, PerceivedVehicle.NEW_FOLLOWER, 40.0, 30.0),
    ],
)
def test_the_margin_is_that_of_who_drives_behind(kind, whom, rear, lead):
    seen = leader(FAR, FAR, kind=kind, whom=whom, closing_speed=10.0, true_closing_speed=10.0)
    one = crossing(Track(s=40.0, lane=1), beliefs=(seen,))
    (thought,) = believed_findings(one, PORTUGAL)
    b = min(8.0, 0.9 * float(one.signals.friction[0, 50]) * 9.81)
    needed = rear + (rear * rear - lead * lead) / (2.0 * b)
    assert thought.margin == pytest.approx(FAR - needed, abs=0.01)


def test_of_an_abort_and_without_percepts_the_law_says_nothing():
    believed = (leader(FAR, NEAR, kind=ManoeuvreKind.CANCEL),)
    assert believed_findings(crossing(beliefs=believed), PORTUGAL) == ()
    assert (
        believed_findings(crossing(beliefs=(leader(FAR, NEAR),), unknown=("percepts",)), PORTUGAL)
        == ()
    )


def test_another_pack_and_policy_are_explained_too(labelled):
    rules = tuple(one for one in PORTUGAL.rules if one.code in ("L3", "L12"))
    pack = Pack(name="short", version="short-1", rules=rules)
    only = Policy(
        name="slow",
        required=("L12",),
        allows_undecided=True,
        censors_open=False,
        names_departures=False,
    )
    one = label(labelled.trajectories, pack=pack, policies=(only,))
    told = [explain(one, n, pack=pack, policies=(only,)) for n in range(NUM_SIMULATIONS)]
    asked = {each.rule.code: each.policies for of_one in told for each in of_one.breaches}
    assert asked == {"L12": ("slow",), "L3": ()}
