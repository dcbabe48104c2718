"""Explanations agree with the findings, and compare them with the beliefs of the driver."""

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
"""Lawful and unlawful gap behind a leader at the same speed of 30 m/s [m]."""


@pytest.fixture(scope="module")
def labelled() -> LabelledTrajectories:
    """Enough simulations for most rules to be broken in some."""
    return ot.label(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=NUM_SIMULATIONS, seed=1))
    )


def test_an_explanation_sorts_the_rules_by_their_verdicts(labelled):
    codes = np.array(labelled.findings.rule_codes)
    for simulation in range(NUM_SIMULATIONS):
        explanation = explain(labelled, simulation)
        verdict = labelled.findings.verdict[simulation]
        codes_by_verdict = {
            Verdict.ILLEGAL: [item.rule.code for item in explanation.breaches],
            Verdict.UNDECIDABLE: [item.rule.code for item in explanation.undecided],
            Verdict.LEGAL: [rule.code for rule in explanation.kept],
            Verdict.NOT_APPLICABLE: [rule.code for rule in explanation.inapplicable],
        }
        for expected_verdict, rule_codes in codes_by_verdict.items():
            assert rule_codes == codes[verdict == expected_verdict].tolist()


def test_breaches_repeat_margin_frames_severity_and_belief_of_the_findings(labelled):
    broken_codes = set()
    for simulation in range(NUM_SIMULATIONS):
        findings = labelled.findings.select(np.array([simulation]))
        for breach in explain(labelled, simulation).breaches:
            cell = (0, findings.rule_codes.index(breach.rule.code))
            assert breach.margin == findings.margin[cell] < 0
            assert (breach.first_frame, breach.last_frame) == (
                findings.first_frame[cell],
                findings.last_frame[cell],
            )
            assert breach.severity == findings.severity[cell]
            assert breach.belief == findings.belief[cell]
            assert breach.remedies
            broken_codes.add(breach.rule.code)
    assert len(broken_codes) >= 12


def test_a_breach_names_the_policies_that_count_it(labelled):
    for simulation in range(NUM_SIMULATIONS):
        breaches = explain(labelled, simulation).breaches
        for column, policy in enumerate(STORED_POLICIES):
            num_counted = sum(policy.name in breach.policies for breach in breaches)
            assert num_counted == labelled.labels.num_broken[simulation, column]


def test_an_undecided_rule_names_its_missing_inputs(labelled):
    runs = labelled.trajectories.replace(unknown=frozenset(["weather", "lamps"]))
    explanation = explain(label(runs), 0)
    doubts = {doubt.rule.code: doubt for doubt in explanation.undecided}
    assert "weather" in doubts["L14"].missing_inputs
    assert doubts["L14s"].missing_inputs == ("lamps", "weather")
    assert doubts["L14s"].policies == ("strict",)
    assert all(doubt.missing_inputs for doubt in explanation.undecided)
    assert "L14" in stored_policy("default").required


def test_the_belief_at_the_deciding_decision_is_the_belief_of_the_finding(labelled):
    num_compared = 0
    for simulation in range(NUM_SIMULATIONS):
        explanation = explain(labelled, simulation)
        simulated = labelled.select(np.array([simulation]))
        pulls = [
            thought for thought in explanation.believed
            if simulated.trajectories.percepts.kind[0, thought.percept] == ManoeuvreKind.PULL_OUT
        ]  # fmt: skip
        if len({thought.percept for thought in pulls}) != 1 or simulated.events.attempt[0] < 0:
            continue
        for thought in pulls:
            finding = Belief(
                int(
                    simulated.findings.belief[
                        0, simulated.findings.rule_codes.index(thought.rule_code)
                    ]
                )
            )
            if finding is not Belief.NONE:
                assert thought.belief is finding
                num_compared += 1
    assert num_compared >= 10


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
def test_perceived_and_true_gap_decide_the_kind_of_belief(believed, belief):
    (thought,) = believed_findings(crossing(beliefs=(believed,)), PORTUGAL)
    assert (thought.perceived, thought.rule_code, thought.belief) == (
        PerceivedVehicle.LEADER,
        "L3",
        belief,
    )
    # At equal speeds the rule requires the distance of one second: 30 m.
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
def test_each_perceived_neighbour_at_each_decision_has_its_rule(kind, whom, code):
    judged = crossing(Track(s=40.0, lane=1), beliefs=(leader(FAR, NEAR, kind=kind, whom=whom),))
    (thought,) = believed_findings(judged, PORTUGAL)
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
def test_the_margin_uses_the_speed_of_the_rear_vehicle(kind, whom, rear, lead):
    percept = leader(FAR, FAR, kind=kind, whom=whom, closing_speed=10.0, true_closing_speed=10.0)
    judged = crossing(Track(s=40.0, lane=1), beliefs=(percept,))
    (thought,) = believed_findings(judged, PORTUGAL)
    b = min(8.0, 0.9 * float(judged.signals.friction[0, 50]) * 9.81)
    needed = rear + (rear * rear - lead * lead) / (2.0 * b)
    assert thought.margin == pytest.approx(FAR - needed, abs=0.01)


def test_an_abort_and_a_recording_without_percepts_have_no_believed_findings():
    believed = (leader(FAR, NEAR, kind=ManoeuvreKind.CANCEL),)
    assert believed_findings(crossing(beliefs=believed), PORTUGAL) == ()
    assert (
        believed_findings(crossing(beliefs=(leader(FAR, NEAR),), unknown=("percepts",)), PORTUGAL)
        == ()
    )


def test_an_explanation_accepts_another_pack_and_policy(labelled):
    rules = tuple(rule for rule in PORTUGAL.rules if rule.code in ("L3", "L12"))
    pack = Pack(name="short", version="short-1", rules=rules)
    speed_only = Policy(
        name="slow",
        required=("L12",),
        allows_undecided=True,
        censors_open=False,
        names_departures=False,
    )
    relabelled = label(labelled.trajectories, pack=pack, policies=(speed_only,))
    explanations = [
        explain(relabelled, simulation, pack=pack, policies=(speed_only,))
        for simulation in range(NUM_SIMULATIONS)
    ]
    policies_of_rules = {
        breach.rule.code: breach.policies
        for explanation in explanations
        for breach in explanation.breaches
    }
    assert policies_of_rules == {"L12": ("slow",), "L3": ()}
