"""The law in Python and the law as a logic program say the same."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support import german_fixtures
from tests.support.law_fixtures import FIXTURES
from tests.support.logic import group_of, program_of, solved

from overtaking import sample, simulate
from overtaking.analysis.logic.export import PROGRAMS
from overtaking.analysis.logic.law import CODES, CODES_DE, judged, law, lawyer
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import judge_pack
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.verdicts import Case, Verdict

if TYPE_CHECKING:
    from overtaking.labels.law.rule import Pack

pytestmark = pytest.mark.ci

LAW = (PROGRAMS / "law.lp").read_text(encoding="utf-8")
LAW_DE = (PROGRAMS / "law_de.lp").read_text(encoding="utf-8")
GERMAN = [one for one in german_fixtures.FIXTURES if one[0] in CODES_DE]


@cache
def known(place: int) -> tuple[str, dict[str, str], dict[str, int]]:
    """The facts of a fixture, and what Python says of it."""
    case = FIXTURES[place][3]()
    return program_of(case, every=10**6), *in_python(case)


def in_logic(facts: str, law_text: str = LAW) -> tuple[dict[str, str], dict[str, int]]:
    """Verdicts of one simulation, and first frames of breaches, by the code of the rule."""
    found = solved(facts + law_text, "verdict", "breach")
    verdicts: dict[str, str] = {}
    for _, rule, verdict in found["verdict"]:
        assert rule not in verdicts, f"two verdicts of {rule}"
        verdicts[rule.upper()] = verdict
    breaches = sorted(found.get("breach", set()), key=lambda row: -row[2])
    return verdicts, {rule.upper(): frame for _, rule, frame in breaches}


def in_python(
    case: Case, pack: Pack = PORTUGAL, codes: tuple[str, ...] = CODES
) -> tuple[dict[str, str], dict[str, int]]:
    findings = judge_pack(pack, case)
    verdicts: dict[str, str] = {}
    first: dict[str, int] = {}
    for code in codes:
        place = (0, findings.rule_codes.index(code))
        verdicts[code] = Verdict(int(findings.verdict[place])).name.lower()
        if verdicts[code] == "illegal":
            first[code] = int(findings.first_frame[place])
    return verdicts, first


@pytest.mark.parametrize(
    "place", [pytest.param(n, id=f"{f[0]}: {f[2]}") for n, f in enumerate(FIXTURES)]
)
def test_both_say_the_same_of_every_fixture(place: int):
    facts, expected, expected_first = known(place)
    verdicts, first = in_logic(facts)
    assert verdicts == expected
    assert {code: first[code] for code in expected_first} == expected_first


def without_kinds(case: Case) -> Case:
    """The same case, recorded without knowledge of any vehicle's kind."""
    is_known = np.zeros_like(case.trajectories.known_kinds)
    return case.replace(trajectories=case.trajectories.replace(is_kind_known=is_known))


@pytest.mark.parametrize("law_text", ["", LAW_DE], ids=["Portugal", "Germany"])
@pytest.mark.parametrize("place", range(0, len(FIXTURES), 5))
def test_logic_decides_no_rule_that_unknown_kinds_leave_open(place: int, law_text: str):
    case = without_kinds(FIXTURES[place][3]())
    pack, codes = (GERMANY, CODES_DE) if law_text else (PORTUGAL, CODES)
    verdicts, _ = in_logic(program_of(case, every=10**6), LAW + law_text)
    expected, _ = in_python(case, pack, codes)
    decided = {code: verdicts[code] for code in codes if verdicts[code] != "undecidable"}
    assert decided == {code: expected[code] for code in decided}


def test_logic_leaves_open_what_a_truck_would_break():
    places = [place for place in range(len(FIXTURES)) if known(place)[1].get("L20") == "illegal"]
    assert places
    for place in places:
        case = without_kinds(FIXTURES[place][3]())
        verdicts, _ = in_logic(program_of(case, every=10**6))
        assert verdicts["L20"] == "undecidable"


@cache
def german(place: int) -> tuple[str, dict[str, str], dict[str, int]]:
    """The facts of a German fixture, and what Python says of it."""
    case = GERMAN[place][3]()
    return program_of(case, every=10**6), *in_python(case, GERMANY, CODES_DE)


def in_german_logic(facts: str, law_text: str = LAW_DE) -> tuple[dict[str, str], dict[str, int]]:
    verdicts, first = in_logic(facts, LAW + law_text)
    return {code: verdicts[code] for code in CODES_DE}, first


@pytest.mark.parametrize(
    "place", [pytest.param(n, id=f"{f[0]}: {f[2]}") for n, f in enumerate(GERMAN)]
)
def test_both_say_the_same_of_every_german_fixture(place: int):
    facts, expected, expected_first = german(place)
    verdicts, first = in_german_logic(facts)
    assert verdicts == expected
    assert {code: first[code] for code in expected_first} == expected_first


@pytest.mark.parametrize(
    ("code", "old", "new"),
    [
        ("A1", "G < 3*V/2", "G < V/2"),
        ("A2", "N > 3000/M", "N > 9000/M"),
        ("A3", "G < 50000", "G < 40000"),
        ("A4", "G < 3*V+4500", "G < 3*V-4500"),
        ("O1", "L <= K.", "L < K-5."),
        ("O9", "K != b, K != mc", "K = b"),
        ("O17", "level_crossing,240000", "level_crossing,0"),
        ("O2", "36*(V-W) < 100000", "36*(V-W) < 10000"),
        ("O6", "left_follower,F,B), B > 2000", "left_follower,F,B), B > 900000"),
        ("O12", "S,follower,F,B), B > 2000", "S,follower,F,B), B > 900000"),
        ("V2", "general_de(motorway,heavy,80)", "general_de(motorway,heavy,90)"),
        ("V2", "over_lower(S,F), A <= F", "over_lower(S,F), A > F"),
    ],
)
def test_a_german_condition_that_is_changed_is_noticed(code: str, old: str, new: str):
    assert old in LAW_DE
    spoiled = LAW_DE.replace(old, new)
    places = [n for n, fixture in enumerate(GERMAN) if fixture[0] == code]
    assert any(in_german_logic(german(n)[0], spoiled)[0] != german(n)[1] for n in places)


@pytest.mark.parametrize(("profile", "number"), [("pinto2023-physical", 120), ("motorway", 30)])
def test_both_say_the_same_of_simulations_by_german_law(profile: str, number: int):
    case = case_from_trajectories(simulate(sample(profile, num_simulations=number, seed=23)))
    with lawyer("de") as reasoner:
        said = judged(reasoner, group_of(case), "de")
    findings = judge_pack(GERMANY, case)
    place = [findings.rule_codes.index(code) for code in CODES_DE]
    verdict = findings.verdict[:, place]
    np.testing.assert_array_equal(said.verdict, verdict)
    is_illegal = verdict == Verdict.ILLEGAL
    np.testing.assert_array_equal(
        said.first[is_illegal], findings.first_frame[:, place][is_illegal]
    )


@pytest.mark.parametrize(
    ("profile", "number"), [("pinto2023-physical", 176), ("motorway-risk", 24)]
)
def test_both_say_the_same_of_simulations(profile: str, number: int):
    case = case_from_trajectories(simulate(sample(profile, num_simulations=number, seed=23)))
    with lawyer() as reasoner:
        said = judged(reasoner, group_of(case))
    findings = judge_pack(PORTUGAL, case)
    place = [findings.rule_codes.index(code) for code in CODES]
    verdict = findings.verdict[:, place]
    np.testing.assert_array_equal(said.verdict, verdict)
    is_illegal = verdict == Verdict.ILLEGAL
    np.testing.assert_array_equal(
        said.first[is_illegal], findings.first_frame[:, place][is_illegal]
    )
    assert is_illegal.sum() > number / 4


@pytest.mark.parametrize(
    ("code", "old", "new"),
    [
        ("L1", "L <= K.", "L < K-5."),
        ("L2", "D-R > 50, A <= F", "D-R > 90, A <= F"),
        ("L3", "C <= F, F <= C+N", "C <= F, F <= C"),
        ("L5", "left_follower,F,G,_,R), G < R.", "left_follower,F,G,_,R), G > R."),
        ("L8", "follower,F,G,_,R), G < R.", "follower,F,G,_,R), G < -R."),
        ("L9", "N > 8000/M", "N > 12000/M"),
        ("L12", "(10000*L+18)/36", "(10000*L+18)/30"),
        (
            "L12",
            "lower_limit(P,Q,L), ego_place(S,F,X), P <= X",
            "lower_limit(P,Q,L), ego_place(S,F,X), P < X+9",
        ),
        ("L12", "X < Q, ego_speed", "X < Q-9, ego_speed"),
        ("L12", "over_lower(S,F), A <= F", "over_lower(S,F), A > F"),
        ("L13", "36*V < 500000", "36*V < 300000"),
        ("L16", "W-M < 400", "W-M < 0"),
        ("L2", "beside_solid(S,F), reach", "reach"),
        ("L17", "2*X+L > 2*P-100000", "2*X+L > 2*P"),
        ("L24", "back_frame(S,F), oncomer(S,F,_,_,_)", "back_frame(S,F), oncomer(S,F,0,_,_)"),
        ("L25", "G-(Y-X)-U-W < W*T/100", "G-(Y-X)-U-W < 0"),
        ("L26", "V,B), B > 2000", "V,B), B > 9000"),
        ("L28", "G < 50000", "G < 30000"),
        ("L29", "K != b, K != mc", "K = b"),
        ("L18", "frames_in(2000,P)", "frames_in(1000,P)"),
        ("L20", "N >= 3, conduct", "N >= 6, conduct"),
        ("L21", "at_first(S,F), not taken(S,F)", "at_first(S,F), taken(S,F)"),
    ],
)
def test_a_condition_that_is_changed_is_noticed(code: str, old: str, new: str):
    assert old in LAW
    spoiled = LAW.replace(old, new)
    places = [n for n, fixture in enumerate(FIXTURES) if fixture[0] == code]
    assert any(in_logic(known(n)[0], spoiled)[0] != known(n)[1] for n in places)


def test_the_law_reads_measurements_and_no_label():
    read = set(law().demand.patterns)
    assert read.isdisjoint({"class", "outcome"})
    assert {"spacing", "reach", "ego_speed", "event", "lane"} <= read


@pytest.mark.parametrize(
    ("text", "pack", "codes"), [(LAW, PORTUGAL, CODES), (LAW_DE, GERMANY, CODES_DE)]
)
def test_every_rule_is_headed_by_its_article_and_its_gloss(text, pack, codes):
    rules = {rule.code: rule for rule in pack.rules}
    lines = text.splitlines()
    heads = {
        line.split(": ")[0]: n
        for n, line in enumerate(lines)
        if line.startswith("% --- ") and ": " in line
    }
    assert {head for head in heads if head[6:] in rules} == {f"% --- {code}" for code in codes}
    for code in codes:
        begin = heads[f"% --- {code}"]
        end = lines.index("", begin)
        assert lines[begin].split(": ", 1)[1].rstrip("- ") == rules[code].article
        said = " ".join(line.removeprefix("% ") for line in lines[begin + 1 : end])
        assert said == rules[code].gloss
