"""The rules in Python and the rules as logic programs give the same verdicts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from tests.support import german_fixtures, law_fixtures
from tests.support.logic import facts_text, group_of, solve
from tests.support.logic_law import (
    CODES,
    GERMAN_CODES,
    GERMAN_PROGRAM,
    law_reasoner,
    program_of_law,
    program_verdicts,
)

from overtaking import sample, simulate
from overtaking.analysis.logic.fact_files import PROGRAM_FOLDER
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.judging import LAWS, judge_pack
from overtaking.model.verdicts import Case, Verdict

pytestmark = pytest.mark.ci

PORTUGUESE_TEXT = (PROGRAM_FOLDER / "law.lp").read_text(encoding="utf-8")
GERMAN_TEXT = GERMAN_PROGRAM.read_text(encoding="utf-8")
TEXTS = {"pt": PORTUGUESE_TEXT, "de": GERMAN_TEXT}
"""The text of each law, without the program that it continues."""

FIXTURES = {
    "pt": law_fixtures.FIXTURES,
    "de": [fixture for fixture in german_fixtures.FIXTURES if fixture[0] in GERMAN_CODES],
}
ALL_FIXTURES = [
    pytest.param(law, index, id=f"{fixture[0]}: {fixture[2]}")
    for law, fixtures in FIXTURES.items()
    for index, fixture in enumerate(fixtures)
]
NO_POSITIONS = 10**6
"""Interval between frames with positions [frames]; the law reads none."""


@dataclass(frozen=True)
class Judgement:
    """Verdicts by the code of the rule, and the first frames of breaches."""

    verdicts: dict[str, str]
    first_frames: dict[str, int]


def judgement_of_program(facts: str, law: str, text: str | None = None) -> Judgement:
    """Judge one simulation by a program.

    Args:
        facts: Facts of the simulation.
        law: A key of `TEXTS`.
        text: A changed text of the law; None for the present one.
    """
    text = TEXTS[law] if text is None else text
    program = text if law == "pt" else PORTUGUESE_TEXT + text
    atoms = solve(facts + program, "verdict", "breach")
    verdicts: dict[str, str] = {}
    for _, rule, verdict in atoms["verdict"]:
        assert rule not in verdicts, f"two verdicts of {rule}"
        verdicts[rule.upper()] = verdict
    breaches = sorted(atoms.get("breach", set()), key=lambda row: -row[2])
    first_frames = {rule.upper(): frame for _, rule, frame in breaches}
    return Judgement({code: verdicts[code] for code in CODES[law]}, first_frames)


def judgement_of_python(case: Case, law: str) -> Judgement:
    findings = judge_pack(LAWS[law], case)
    verdicts: dict[str, str] = {}
    first_frames: dict[str, int] = {}
    for code in CODES[law]:
        index = (0, findings.rule_codes.index(code))
        verdicts[code] = Verdict(int(findings.verdict[index])).name.lower()
        if verdicts[code] == "illegal":
            first_frames[code] = int(findings.first_frame[index])
    return Judgement(verdicts, first_frames)


@cache
def facts_and_judgement(law: str, fixture: int) -> tuple[str, Judgement]:
    """The facts of a fixture, and its judgement by the rules in Python."""
    case = FIXTURES[law][fixture][3]()
    return facts_text(case, frame_step=NO_POSITIONS), judgement_of_python(case, law)


@pytest.mark.parametrize(("law", "fixture"), ALL_FIXTURES)
def test_program_and_python_give_equal_verdicts_for_every_fixture(law: str, fixture: int):
    facts, expected = facts_and_judgement(law, fixture)
    judgement = judgement_of_program(facts, law)
    assert judgement.verdicts == expected.verdicts
    first_frames = {code: judgement.first_frames[code] for code in expected.first_frames}
    assert first_frames == expected.first_frames


def without_kinds(case: Case) -> Case:
    """The same case, recorded without knowledge of any vehicle's kind."""
    is_known = np.zeros_like(case.trajectories.known_kinds)
    return case.replace(trajectories=case.trajectories.replace(is_kind_known=is_known))


@pytest.mark.parametrize("law", TEXTS)
@pytest.mark.parametrize("fixture", range(0, len(FIXTURES["pt"]), 5))
def test_the_program_decides_no_rule_that_unknown_kinds_leave_open(fixture: int, law: str):
    case = without_kinds(FIXTURES["pt"][fixture][3]())
    verdicts = judgement_of_program(facts_text(case, frame_step=NO_POSITIONS), law).verdicts
    expected = judgement_of_python(case, law).verdicts
    decided = {code: verdict for code, verdict in verdicts.items() if verdict != "undecidable"}
    assert decided == {code: expected[code] for code in decided}


def test_the_program_leaves_breaches_of_trucks_open_where_kinds_are_unknown():
    breaches = [
        fixture
        for fixture in range(len(FIXTURES["pt"]))
        if facts_and_judgement("pt", fixture)[1].verdicts["L20"] == "illegal"
    ]
    assert breaches
    for fixture in breaches:
        case = without_kinds(FIXTURES["pt"][fixture][3]())
        facts = facts_text(case, frame_step=NO_POSITIONS)
        assert judgement_of_program(facts, "pt").verdicts["L20"] == "undecidable"


@pytest.mark.parametrize(
    ("law", "code", "old", "new"),
    [
        ("pt", "L1", "L <= K.", "L < K-5."),
        ("pt", "L2", "line_tolerance_mm = 50", "line_tolerance_mm = 90"),
        ("pt", "L3", "C <= F, F <= C+N", "C <= F, F <= C"),
        ("pt", "L5", "left_follower,F,G,_,R), G < R.", "left_follower,F,G,_,R), G > R."),
        ("pt", "L8", "S,follower,F,G,_,R), G < R.", "S,follower,F,G,_,R), G < -R."),
        ("pt", "L9", "max_return_delay_ms = 8000", "max_return_delay_ms = 12000"),
        ("pt", "L12", "(10000*L+18)/36", "(10000*L+18)/30"),
        (
            "pt",
            "L12",
            "lower_limit(P,Q,L), ego_position(S,F,X), P <= X",
            "lower_limit(P,Q,L), ego_position(S,F,X), P < X+9",
        ),
        ("pt", "L12", "X < Q,\n    ego_speed", "X < Q-9, ego_speed"),
        ("pt", "L12", "exceeds_lower_limit(S,F), A <= F", "exceeds_lower_limit(S,F), A > F"),
        ("pt", "L13", "min_speed_km_per_h = 50", "min_speed_km_per_h = 30"),
        ("pt", "L16", "min_border_distance_mm = 200", "min_border_distance_mm = 0"),
        ("pt", "L2", "beside_solid_edge_line(S,F),\n    ego_edges", "ego_edges"),
        ("pt", "L17", "approach_length_mm = 50000", "approach_length_mm = 0"),
        (
            "pt",
            "L24",
            "back_in_lane(S,F), approaching(S,F,_,_,_)",
            "back_in_lane(S,F), approaching(S,F,0,_,_)",
        ),
        ("pt", "L25", "-oncoming_time_s*(U+W) < W*T/100", "-oncoming_time_s*(U+W) < 0"),
        ("pt", "L26", "V,B), B > abrupt_braking_mm_per_s2", "V,B), B > 9000"),
        ("pt", "L28", "slow_vehicle_gap_mm = 50000", "slow_vehicle_gap_mm = 30000"),
        ("pt", "L29", "K != b, K != mc", "K = b"),
        ("pt", "L18", "indication_before_ms = 2000", "indication_before_ms = 1000"),
        ("pt", "L20", "truck_min_lanes = 3", "truck_min_lanes = 6"),
        (
            "pt",
            "L21",
            "begins_left_of_rightmost_lane(S,F), not right_lane_occupied",
            "begins_left_of_rightmost_lane(S,F), right_lane_occupied",
        ),
        ("de", "A1", "min_time_gap_ms = 1500", "min_time_gap_ms = 500"),
        ("de", "A2", "N > fined_duration_ms/M", "N > 3*fined_duration_ms/M"),
        ("de", "A3", "truck_gap_mm = 50000", "truck_gap_mm = 40000"),
        ("de", "A4", "+car_length_mm", "-car_length_mm"),
        ("de", "O1", "L <= K.", "L < K-5."),
        ("de", "O9", "K != b, K != mc", "K = b"),
        ("de", "O17", "level_crossing_approach_mm = 240000", "level_crossing_approach_mm = 0"),
        ("de", "O2", "min_speed_gain_km_per_h = 10", "min_speed_gain_km_per_h = 1"),
        (
            "de",
            "O6",
            "left_follower,F,B),\n    B > abrupt_braking_mm_per_s2",
            "left_follower,F,B),\n    B > 900000",
        ),
        (
            "de",
            "O12",
            "S,follower,F,B),\n    B > abrupt_braking_mm_per_s2",
            "S,follower,F,B),\n    B > 900000",
        ),
        ("de", "V2", "general_limit(motorway,heavy,80)", "general_limit(motorway,heavy,90)"),
        ("de", "V2", "exceeds_lower_limit(S,F), A <= F", "exceeds_lower_limit(S,F), A > F"),
    ],
)
def test_a_changed_condition_changes_a_verdict(law: str, code: str, old: str, new: str):
    assert old in TEXTS[law]
    changed_text = TEXTS[law].replace(old, new)
    fixtures = [n for n, fixture in enumerate(FIXTURES[law]) if fixture[0] == code]
    judgements = [facts_and_judgement(law, fixture) for fixture in fixtures]
    assert any(
        judgement_of_program(facts, law, changed_text).verdicts != expected.verdicts
        for facts, expected in judgements
    )


@pytest.mark.parametrize(
    ("law", "profile", "num_simulations"),
    [
        ("pt", "pinto2023-physical", 176),
        ("pt", "motorway-risk", 24),
        ("de", "pinto2023-physical", 120),
        ("de", "motorway", 30),
    ],
)
def test_program_and_python_give_equal_verdicts_for_simulations(
    law: str, profile: str, num_simulations: int
):
    scenarios = sample(profile, num_simulations=num_simulations, seed=23)
    case = case_from_trajectories(simulate(scenarios))
    with law_reasoner(law) as reasoner:
        judgement = program_verdicts(reasoner, group_of(case), law)
    findings = judge_pack(LAWS[law], case)
    columns = [findings.rule_codes.index(code) for code in CODES[law]]
    verdict, first_frame = findings.verdict[:, columns], findings.first_frame[:, columns]
    np.testing.assert_array_equal(judgement.verdict, verdict)
    is_illegal = verdict == Verdict.ILLEGAL
    np.testing.assert_array_equal(judgement.first_frame[is_illegal], first_frame[is_illegal])


def test_the_law_reads_measurements_and_no_label():
    facts = set(program_of_law().requested_facts.patterns)
    assert facts.isdisjoint({"class", "outcome"})
    assert {"spacing", "ego_edges", "ego_speed", "event", "lane"} <= facts


@pytest.mark.parametrize("law", TEXTS)
def test_every_rule_of_a_program_has_a_heading_with_its_article_and_gloss(law: str):
    pack, lines = LAWS[law], TEXTS[law].splitlines()
    rules = {rule.code: rule for rule in pack.rules}
    line_of_heading = {
        line.split(": ")[0].removeprefix("% --- "): number
        for number, line in enumerate(lines)
        if line.startswith("% --- ") and ": " in line
    }
    assert {code for code in line_of_heading if code in rules} == {*CODES[law]}
    for code in CODES[law]:
        begin = line_of_heading[code]
        end = lines.index("", begin)
        assert lines[begin].split(": ", 1)[1].rstrip("- ") == rules[code].article
        gloss = " ".join(line.removeprefix("% ") for line in lines[begin + 1 : end])
        assert gloss == rules[code].gloss
