"""Facts are recorded integers, or rounded measurements on the same side of every threshold."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.cases import LEFT, Track, case, ramp
from tests.support.logic import ALL_FACTS, facts_text, group_of, solve
from tests.support.overtakes import meeting, rural

from overtaking.analysis.logic.fact_files import (
    FACTS,
    PROGRAM_FOLDER,
    RequestedFacts,
    all_facts,
    fact_lines,
    file_header,
    measure_simulation_facts,
)
from overtaking.analysis.logic.programs import THEORY_PREDICATES, declared_predicates
from overtaking.analysis.logic.vocabulary import (
    MAX_INT,
    round_limits_in_order,
    rounded_down_thousandths,
    rounded_up_thousandths,
)
from overtaking.core.errors import SchemaError

THEORY_TEXT = (PROGRAM_FOLDER / "theory.lp").read_text(encoding="utf-8")
METRES = st.floats(-1000, 1000, width=32)


def over_and_back():
    """The ego overtakes a slower vehicle and returns; a third vehicle drives far ahead."""
    lane = ramp((0, 0), (2, 0), (4, 1), (8, 1), (10, 0), frames=260)
    return case(
        Track(s=0.0, speed=30.0, lane=lane, lights=np.where(lane > 0.5, LEFT, 0)),
        Track(s=40.0, speed=20.0),
        Track(s=300.0, speed=30.0),
        frames=260,
    )


def test_positions_speeds_lanes_and_indicators_equal_the_recording():
    overtake = over_and_back()
    facts = solve(facts_text(overtake, frame_step=1))
    states = overtake.trajectories.states
    instants = [(0, slot, frame) for slot in range(3) for frame in range(260)]
    near = [
        (0, slot, frame)
        for _, slot, frame in instants
        if abs(states.s[0, slot, frame] - states.s[0, 0, frame]) <= 200_000
    ]
    assert facts["position"] == {(*instant, int(states.s[instant])) for instant in near}
    assert facts["speed"] == {(*instant, int(states.speed[instant])) for instant in near}
    lanes = {
        (simulation, slot, frame): lane
        for simulation, slot, lane, first, last in facts["lane"]
        for frame in range(first, last + 1)
    }
    assert lanes == {instant: int(states.lane[instant]) for instant in instants}
    indicating = {
        (simulation, slot, frame)
        for simulation, slot, _, first, last in facts["indicator"]
        for frame in range(first, last + 1)
    }
    assert indicating == {instant for instant in instants if states.lights[instant] & LEFT}


@pytest.mark.ci
@pytest.mark.parametrize("name", ["overtakes", "passes", "pulls_out", "returns", "collides"])
def test_conclusions_have_the_same_frames_with_few_and_with_all_frames_as_facts(name: str):
    overtake = over_and_back()
    few_frames, all_frames = (
        solve(facts_text(overtake, frame_step=step) + THEORY_TEXT) for step in (1000, 1)
    )
    assert len(few_frames["frame"]) < 20 < len(all_frames["frame"])
    assert few_frames.get(name) == all_frames.get(name)
    assert name == "collides" or (0, 0, 1) in {row[:3] for row in few_frames[name]}


@given(METRES, METRES)
def test_a_rounded_limit_is_on_the_same_side_of_its_rounded_value(limit: float, value: float):
    limits, values = np.array([limit], np.float32), np.array([value], np.float32)
    limit_mm, value_mm = (
        int(round_limits_in_order(limits, values)[0]),
        int(rounded_down_thousandths(values)[0]),
    )
    assert (limit_mm > value_mm) == (limits[0] > values[0])
    assert (limit_mm < value_mm) == (limits[0] < values[0])
    assert abs(limit_mm - 1000.0 * limit) <= 2.0


@given(METRES, st.integers(-(10**6), 10**6))
def test_a_rounded_measurement_is_on_the_same_side_of_every_integer_threshold(
    metres: float, threshold: int
):
    value = np.array([metres], np.float32)
    exact = float(value[0]) * 1000.0
    assert (rounded_down_thousandths(value)[0] >= threshold) == (exact >= threshold)
    assert (rounded_up_thousandths(value)[0] <= threshold) == (exact <= threshold)


def test_a_value_outside_its_declared_range_is_refused():
    too_far = {"position": tuple(np.array([n]) for n in (0, 0, 0, 600_000_000))}
    with pytest.raises(SchemaError, match="argument X of position"):
        fact_lines(too_far)


def test_only_requested_facts_are_measured():
    group = group_of(over_and_back())
    pattern = (None, "leader", None, None, None, None)
    requested = RequestedFacts(patterns={"spacing": frozenset([pattern])})
    facts = measure_simulation_facts(group, requested)
    assert set(facts) == {"spacing"}
    assert set(facts["spacing"][1].tolist()) == {0}
    assert len(facts["spacing"][0]) < len(measure_simulation_facts(group, ALL_FACTS)["spacing"][0])


def test_the_header_of_facts_declares_every_predicate_and_no_verdict():
    for language in ("asp", "prolog"):
        text = file_header("Title", all_facts(with_law=True), language)
        for fact in FACTS.values():
            assert f"{fact.name}/{len(fact.arguments)}" in text
        assert [predicate.name for predicate in declared_predicates(text)] == [*FACTS]
        for predicate in declared_predicates(text):
            fact = FACTS[predicate.name]
            assert (predicate.arguments, predicate.meaning) == (fact.arguments, fact.meaning)
        assert "verdict" not in text
    assert all(kind.high <= MAX_INT for fact in FACTS.values() for kind in fact.types)


@pytest.mark.skipif(shutil.which("swipl") is None, reason="SWI-Prolog is not installed")
def test_prolog_draws_the_same_conclusions(tmp_path):
    facts = facts_text(over_and_back(), frame_step=10)
    expected = solve(facts + THEORY_TEXT)
    header = file_header("Title", all_facts(with_law=True), "prolog")
    facts_file = tmp_path / "facts.pl"
    facts_file.write_text(header + facts, encoding="utf-8")
    heads = [predicate.signature for predicate in THEORY_PREDICATES]
    goals = [
        f"forall(setof(x, {call}, _), (write_canonical({call}), nl))"
        for name, arity in heads
        for call in [f"{name}({','.join(f'X{n}' for n in range(arity))})"]
    ]
    command = ["swipl", "-q", "-g", ",".join(goals), "-t", "halt"]
    files = [str(facts_file), str(PROGRAM_FOLDER / "theory.pl")]
    process = subprocess.run([*command, *files], capture_output=True, text=True, check=True)
    assert process.stderr == ""
    conclusions: dict[str, set[tuple[int, ...]]] = {}
    for name, arguments in re.findall(r"^(\w+)\((.*)\)$", process.stdout, re.MULTILINE):
        conclusions.setdefault(name, set()).add(tuple(map(int, arguments.split(","))))
    for name, _ in heads:
        assert conclusions.get(name, set()) == expected.get(name, set()), name
    assert conclusions["overtakes"]


def test_an_oncoming_vehicle_is_opposite_to_the_others_and_ahead_of_no_vehicle():
    atoms = solve(facts_text(rural(meeting(60.0)), frame_step=20) + THEORY_TEXT)
    assert atoms["opposite"] == {(0, 0, 2), (0, 2, 0), (0, 1, 2), (0, 2, 1)}
    assert {row[1:3] for row in atoms["oncoming"]} == {(2, 0), (2, 1)}
    assert atoms["ahead"]
    assert not {row for row in atoms["ahead"] if 2 in row[1:3]}
    assert {row[1:3] for row in atoms["overtakes"]} == {(0, 1)}
