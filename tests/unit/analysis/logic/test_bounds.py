"""No sum and no product of a program can leave 32 bits, where clingo wraps without a word."""

from __future__ import annotations

import pytest
from tests.support.logic import solved

from overtaking.analysis.logic.bounds import overflows, range_of, ranges_of, within
from overtaking.analysis.logic.clauses import FILES, clauses, declared, program, reasoner
from overtaking.analysis.logic.question import question
from overtaking.analysis.logic.vocabulary import FACTS, LARGEST
from overtaking.core.errors import ConfigError


def overflows_of(text: str) -> list[str]:
    (clause,) = clauses(text)
    return [one.text for one in overflows([clause.tree.head, *clause.tree.body])]


@pytest.mark.ci
@pytest.mark.parametrize("file", FILES)
def test_no_term_of_a_program_leaves_32_bits_whatever_the_facts_within_their_ranges(file: str):
    for clause in program(file):
        assert overflows([clause.tree.head, *clause.tree.body]) == [], clause.text


@pytest.mark.parametrize("file", FILES)
def test_every_word_of_a_program_is_declared(file: str):
    used = {one.signature for clause in program(file) for one in (*clause.heads, *clause.body)}
    assert used <= set(declared())


@pytest.mark.ci
def test_the_largest_product_of_the_theory_is_near_the_border_and_below_it():
    highest = 0
    for file in FILES:
        for clause in program(file):
            trees = [clause.tree.head, *clause.tree.body]
            ranges = ranges_of(trees)
            highest = max(highest, *(range_of(tree, ranges)[1] for tree in within(trees)))
    assert LARGEST // 2 < highest <= LARGEST


def test_the_largest_legal_values_are_compared_as_they_are():
    far, near = 500_000_000, -500_000_000
    facts = f"""
        frame(0,0). vehicle(0,0,t,100000,2500). vehicle(0,1,t,100000,2500).
        position(0,0,0,{far}). position(0,1,0,{near}). lane(0,0,0,0,0). lane(0,1,0,0,0).
        speed(0,0,0,200000). speed(0,1,0,200000).
    """
    theory = "".join(clause.text + "\n" for clause in program("theory.lp"))
    found = solved(facts + theory)
    assert found["clear_ahead"] == {(0, 0, 1, 0)}
    assert "beside" not in found
    assert "follows" not in found


def test_beyond_them_clingo_wraps_without_a_word():
    assert solved("p(1000000000). q(3*X) :- p(X).")["q"] == {(3_000_000_000 - 2**32,)}


def test_a_term_that_could_wrap_is_found():
    assert overflows_of("p(X*Y) :- speed(S,A,F,X), speed(S,B,F,Y).") == ["(X*Y)"]
    assert overflows_of("p(X) :- position(S,A,F,X), X+X+X+X+X < 3.") != []
    assert overflows_of("p(Z) :- position(S,A,F,X), Z = 3*X, Z+Z > 0.") != []
    assert overflows_of("p(Y) :- position(S,A,F,X), Y = X**2.") != []
    assert overflows_of("p(X) :- unheard_of(X), X+1 > 0.") == ["(X+1)"]
    assert overflows_of("p(X+Y) :- speed(S,A,F,X), speed(S,B,F,Y).") == []


def test_a_question_that_could_wrap_is_refused():
    with pytest.raises(ConfigError, match=r"clingo's integers hold, got \(X\*X\)"):
        question("position(S,A,F,X), X*X > 4")
    with pytest.raises(ConfigError, match="got 4294967297"):
        question("simulation(S), S < 4294967297")
    with pytest.raises(ConfigError, match="sums of numbers up to 2000"):
        question("simulation(S), #sum{ X,F : speed(S,0,F,X) } > 4")


def test_every_type_leaves_room_for_a_sum():
    for predicate in FACTS:
        for _, kind in predicate.arguments:
            assert kind.names or (2 * kind.low >= -LARGEST and 2 * kind.high <= LARGEST), kind.name


def test_the_reasoner_is_the_one_that_is_bounded_here():
    assert reasoner().__name__ == "clingo"
