"""Facts are what was recorded, as integers that compare with thresholds as the numbers did."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.cases import LEFT, Track, case, ramp
from tests.support.logic import ALL, group_of, program_of, solved
from tests.support.overtakes import meeting, rural

from overtaking.analysis.logic import facts as writing
from overtaking.analysis.logic import integers
from overtaking.analysis.logic.export import PROGRAMS
from overtaking.analysis.logic.facts import Demand, everything, header
from overtaking.analysis.logic.vocabulary import FACTS, LARGEST, THEORY
from overtaking.core.errors import SchemaError

THEORY_TEXT = (PROGRAMS / "theory.lp").read_text(encoding="utf-8")
METRES = st.floats(-1000, 1000, width=32)


def over_and_back():
    """The ego overtakes a slower vehicle and returns; another one drives far ahead."""
    way = ramp((0, 0), (2, 0), (4, 1), (8, 1), (10, 0), frames=260)
    return case(
        Track(s=0.0, speed=30.0, lane=way, lights=np.where(way > 0.5, LEFT, 0)),
        Track(s=40.0, speed=20.0),
        Track(s=300.0, speed=30.0),
        frames=260,
    )


def test_positions_speeds_and_lanes_are_those_that_were_recorded():
    recorded = over_and_back()
    found = solved(program_of(recorded, every=1))
    states = recorded.trajectories.states
    rows = [(0, v, f) for v in range(3) for f in range(260)]
    near = [(0, v, f) for _, v, f in rows if abs(states.s[0, v, f] - states.s[0, 0, f]) <= 200_000]
    assert found["position"] == {(*row, int(states.s[row])) for row in near}
    assert found["speed"] == {(*row, int(states.speed[row])) for row in near}
    of_lane = {(s, v, f): k for s, v, k, a, b in found["lane"] for f in range(a, b + 1)}
    assert of_lane == {row: int(states.lane[row]) for row in rows}
    lit = {(s, v, f) for s, v, _, a, b in found["indicator"] for f in range(a, b + 1)}
    assert lit == {row for row in rows if states.lights[row] & LEFT}


@pytest.mark.ci
@pytest.mark.parametrize("name", ["overtakes", "passes", "pulls_out", "returns", "collides"])
def test_what_happens_is_found_in_the_same_frame_however_few_are_written(name: str):
    recorded = over_and_back()
    rare, often = (solved(program_of(recorded, every=n) + THEORY_TEXT) for n in (1000, 1))
    assert len(rare["frame"]) < 20 < len(often["frame"])
    assert rare.get(name) == often.get(name)
    assert name == "collides" or (0, 0, 1) in {row[:3] for row in rare[name]}


@given(METRES, METRES)
def test_a_limit_compares_with_what_it_limits_as_before(limit: float, value: float):
    limits, values = (np.array([each], np.float32) for each in (limit, value))
    whole, given_ = int(integers.beside(limits, values)[0]), int(integers.down(values)[0])
    assert (whole > given_, whole < given_) == (limits[0] > values[0], limits[0] < values[0])
    assert abs(whole - 1000.0 * limit) <= 2.0


@given(METRES, st.integers(-(10**6), 10**6))
def test_rounding_keeps_the_side_of_every_whole_threshold(metres: float, threshold: int):
    value = np.array([metres], np.float32)
    exact = float(value[0]) * 1000.0
    assert (integers.down(value)[0] >= threshold) == (exact >= threshold)
    assert (integers.up(value)[0] <= threshold) == (exact <= threshold)


def test_a_value_outside_its_declared_range_is_refused():
    too_far = {"position": tuple(np.array([n]) for n in (0, 0, 0, 600_000_000))}
    with pytest.raises(SchemaError, match="argument X of position"):
        writing.text(too_far)


def test_only_what_is_asked_for_is_written():
    recorded = over_and_back()
    demand = Demand(patterns={"spacing": frozenset([(None, "leader", None, None, None, None)])})
    found = writing.facts(group_of(recorded), demand)
    assert set(found) == {"spacing"}
    assert set(found["spacing"][1].tolist()) == {0}
    assert len(found["spacing"][0]) < len(writing.facts(group_of(recorded), ALL)["spacing"][0])


def test_every_predicate_is_declared_above_the_facts_and_no_measurement_of_the_law_is_a_verdict():
    for language in ("asp", "prolog"):
        text = header("Title", everything(with_law=True), language)
        for one in FACTS:
            assert f"%: {one.name}({', '.join(kind.name for _, kind in one.arguments)})" in text
            assert f"{one.name}/{len(one.arguments)}" in text
    assert "verdict" not in text
    assert all(kind.names or kind.high <= LARGEST for one in FACTS for _, kind in one.arguments)


@pytest.mark.skipif(shutil.which("swipl") is None, reason="SWI-Prolog is not installed")
def test_prolog_draws_the_same_conclusions(tmp_path):
    text = program_of(over_and_back(), every=10)
    expected = solved(text + THEORY_TEXT)
    demand = everything(with_law=True)
    facts_file = tmp_path / "facts.pl"
    facts_file.write_text(header("Title", demand, "prolog") + text, encoding="utf-8")
    heads = [(one.name, len(one.arguments)) for one in THEORY]
    goals = [
        f"forall(setof(x, {call}, _), (write_canonical({call}), nl))"
        for name, arity in heads
        for call in [f"{name}({','.join(f'X{n}' for n in range(arity))})"]
    ]
    command = ["swipl", "-q", "-g", ",".join(goals), "-t", "halt"]
    files = [str(facts_file), str(PROGRAMS / "theory.pl")]
    done = subprocess.run([*command, *files], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    found: dict[str, set[tuple[int, ...]]] = {}
    for name, arguments in re.findall(r"^(\w+)\((.*)\)$", done.stdout, re.MULTILINE):
        found.setdefault(name, set()).add(tuple(int(one) for one in arguments.split(",")))
    for name, _ in heads:
        assert found.get(name, set()) == expected.get(name, set()), name
    assert found["overtakes"]


def test_who_comes_against_the_road_is_opposite_to_the_others_and_ahead_of_nobody():
    found = solved(program_of(rural(meeting(60.0)), every=20) + THEORY_TEXT)
    assert found["opposite"] == {(0, 0, 2), (0, 2, 0), (0, 1, 2), (0, 2, 1)}
    comes = {row[1:3] for row in found["oncoming"] if len(row) > 1}  # The road has one, too.
    assert comes == {(2, 0), (2, 1)}
    assert found["ahead"]
    assert not {row for row in found["ahead"] if 2 in row[1:3]}
    assert {row[1:3] for row in found["overtakes"]} == {(0, 1)}
